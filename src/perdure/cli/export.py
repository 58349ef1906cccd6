"""`perdure export`: a run in, another program's format out."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import IO, Annotated

import typer

from perdure import params
from perdure.cli import options
from perdure.errors import ParameterError
from perdure.files.mot import write_rows
from perdure.files.runs import Reporting, RunFolder
from perdure.files.whole import refuse_existing, whole_file
from perdure.types import Status, Tracks

CSV_COLUMNS = (
    "frame",
    "time",
    "id",
    "x1",
    "y1",
    "x2",
    "y2",
    "status",
    "confidence",
    "class",
    "group",
    "inferred",
    "hidden_side",
)
FORMATS = ("csv", "mot")


@options.with_parameters(("", {"What counts": Reporting}))
def export(
    run: Annotated[
        Path, typer.Argument(metavar="RUN", help="A run folder of `perdure track`.", show_default=False)
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="OUT", help="The file to write.", show_default=False)
    ],
    chosen: dict[str, object],
    format_: Annotated[
        str,
        typer.Option(
            "--format",
            help="mot: MOTChallenge text, frames and pixels from 1; csv: all plain columns, frames and pixels from 0.",
        ),
    ] = "mot",
    overwrite: options.OverwriteOption = False,
    json_: options.JsonOption = False,
) -> None:
    """Write the rows of RUN that count in another format."""
    if format_ not in FORMATS:
        raise ParameterError(params.unknown_name("format", format_, FORMATS))
    refuse_existing(output, overwrite=overwrite)
    folder = RunFolder.open(run)
    said = {**folder.read_about().get("reporting", {}), **chosen}
    reporting = params.build(Reporting, said)
    rows = 0
    with whole_file(output) as file:
        if format_ == "csv":
            csv.writer(file, lineterminator="\n").writerow(CSV_COLUMNS)
        for _, settled in folder.settled_by_frame():
            counted = settled.counted(reporting.report_confidence)
            rows += len(counted)
            write_rows(file, counted) if format_ == "mot" else _write_csv(file, counted)
    print(json.dumps({"output": str(output), "rows": rows}) if json_ else f"{rows} rows: {output}")


def _write_csv(file: IO[str], rows: Tracks) -> None:
    table = csv.writer(file, lineterminator="\n")
    for i in range(len(rows)):
        table.writerow(
            [
                rows.frames[i],
                f"{rows.times[i]:.3f}",
                rows.ids[i],
                *(f"{side:.2f}" for side in rows.boxes[i]),
                Status(rows.status[i]).word,
                f"{rows.confidence[i]:.4g}",
                rows.classes[i],
                rows.groups[i],
                int(rows.inferred[i]),
                rows.hidden_side[i],
            ]
        )

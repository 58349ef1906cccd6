"""`perdure export`: a run in, another program's format out."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import IO, Annotated, NamedTuple, cast

import typer

from perdure import params
from perdure.cli import options
from perdure.errors import FormatError, OutputError, ParameterError
from perdure.files import mask_pngs
from perdure.files.folders import refuse_existing_folder
from perdure.files.log import read_log
from perdure.files.mot import write_rows
from perdure.files.mots import write_masks
from perdure.files.runs import Reporting, RunFolder
from perdure.files.whole import refuse_existing, whole_file
from perdure.fold import Corrections, settle_with
from perdure.types import Report, Status, Tracks

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
FORMATS = ("csv", "mot", "mots", "mask-png")


@options.with_parameters(("", {"What counts": Reporting}))
def export(
    run: Annotated[
        Path, typer.Argument(metavar="RUN", help="A run folder of `perdure track`.", show_default=False)
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="OUT", help="The file to write; a folder for mask-png.", show_default=False
        ),
    ],
    chosen: dict[str, object],
    format_: Annotated[
        str,
        typer.Option(
            "--format",
            help="mot: MOTChallenge text, frames and pixels from 1; csv: all plain columns, frames and pixels from 0; "
            "mots: MOTS text, silhouettes, frames from 1; mask-png: a folder with a picture a frame, pixel = id.",
        ),
    ] = "mot",
    overwrite: options.OverwriteOption = False,
    json_: options.JsonOption = False,
) -> None:
    """Write the rows of RUN that count in another format."""
    if format_ not in FORMATS:
        raise ParameterError(params.unknown_name("format", format_, FORMATS))
    _refuse(output, run, format_, overwrite=overwrite)
    folder = RunFolder.open(run)
    reporting = params.build(Reporting, {**folder.read_about().get("reporting", {}), **chosen})
    if format_ == "mask-png":
        written = _write_pictures(output, folder, reporting, overwrite=overwrite)
    else:
        written = _write_text(output, folder, reporting, format_)
    if written.left_out:
        print(f"perdure: note: rows left out, without a silhouette: {written.left_out}", file=sys.stderr)
    if json_:
        pictures = {} if written.frames is None else {"frames": written.frames}
        print(json.dumps({"output": str(output), "rows": written.rows, **pictures}))
    else:
        pictures_too = "" if written.frames is None else f" in {written.frames} pictures"
        print(f"{written.rows} rows{pictures_too}: {output}")


class _Written(NamedTuple):
    """What was written."""

    rows: int
    left_out: int = 0  # rows that count, without a silhouette
    frames: int | None = None  # pictures


def _refuse(output: Path, run: Path, format_: str, *, overwrite: bool) -> None:
    """Refuse to write over what is there, unless that is asked; over what the run rests on, never."""
    if output.resolve() in {(run / name).resolve() for name in ("run.json", "tracks.jsonl")}:
        raise OutputError(f"{output} is a part of the run itself; name another place with -o")
    if format_ == "mask-png":
        refuse_existing_folder(output, mask_pngs.SUFFIX, overwrite=overwrite)
    else:
        refuse_existing(output, overwrite=overwrite)


def _counted(folder: RunFolder, reporting: Reporting) -> Iterator[tuple[int, Tracks]]:
    """The rows that count, by frame."""
    for frame, settled in folder.settled_by_frame():
        yield frame, settled.counted(reporting.report_confidence)


def _write_text(output: Path, folder: RunFolder, reporting: Reporting, format_: str) -> _Written:
    """Write a file of one line a row."""
    writers: dict[str, Callable[[IO[str], Tracks], int]] = {"csv": _write_csv, "mot": _write_mot}
    if format_ == "mots":
        height, width = _size(folder)
        writers["mots"] = partial(write_masks, height=height, width=width)
    counted = written = 0
    with whole_file(output) as file:
        if format_ == "csv":
            csv.writer(file, lineterminator="\n").writerow(CSV_COLUMNS)
        for _, rows in _counted(folder, reporting):
            counted += len(rows)
            written += writers[format_](file, rows)
    return _Written(written, counted - written)


def _write_pictures(output: Path, folder: RunFolder, reporting: Reporting, *, overwrite: bool) -> _Written:
    """Write a folder with a picture for each frame of the run."""
    frames: list[int] = []

    def reports() -> Iterator[Report]:
        for entry in read_log(folder.log, with_masks=False):
            if entry.frame >= 0:  # the finishing entry has no frame
                frames.append(entry.frame)
            yield entry.report

    height, width = _size(folder)
    corrections = Corrections.of(reports())
    counted = largest = 0
    for _, settled in settle_with(corrections, (one.report for one in read_log(folder.log, with_masks=False))):
        rows = settled.counted(reporting.report_confidence)
        counted += len(rows)
        largest = max(largest, *rows.ids.tolist(), 0)
    written = mask_pngs.write_masks(
        output, _counted(folder, reporting), frames, height, width, largest_id=largest, overwrite=overwrite
    )
    return _Written(written, counted - written, len(frames))


def _size(folder: RunFolder) -> tuple[int, int]:
    """Height and width of the run's pictures."""
    about = folder.read_about()
    size = about.get("height"), about.get("width")
    if not all(type(side) is int and 0 < side <= _LONGEST_SIDE for side in size):
        raise FormatError(
            f"{folder.path / 'run.json'} does not tell the size of the pictures; `perdure track --overwrite` makes it anew"
        )
    return cast("tuple[int, int]", size)


def _write_mot(file: IO[str], rows: Tracks) -> int:
    write_rows(file, rows)
    return len(rows)


def _write_csv(file: IO[str], rows: Tracks) -> int:
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
    return len(rows)


_LONGEST_SIDE = 1 << 16  # px

"""`perdure scenarios`: a finished run in, what its targets are believed to be and what they did out."""

from __future__ import annotations

import csv
import dataclasses
import json
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Optional

import typer

from perdure.cli import options
from perdure.cli.tables import aligned
from perdure.errors import FormatError
from perdure.files.runs import EVENT_COLUMNS, RunFolder
from perdure.files.scenarios import SHIPPED, read_rules
from perdure.files.whole import refuse_existing, whole_file
from perdure.files.zones import read_zones, zones_of_json
from perdure.interpret import Interpreter, Told, over_run
from perdure.scene.beliefs import Belief
from perdure.scene.zones import Zones
from perdure.types import Event, Scene

_SHOWN = 40  # events that are printed


def scenarios(
    run: options.RunArgument,
    scenarios: Annotated[
        str,
        typer.Option(
            "--scenarios", metavar="FILE|usual", help="A TOML file of scenarios, or those that come with Perdure."
        ),
    ] = SHIPPED,
    zones: Annotated[
        Optional[Path],  # noqa: UP045 - typer reads this at run time
        typer.Option(
            "--zones", metavar="FILE", help="GeoJSON of zones, instead of the run's own.", show_default=False
        ),
    ] = None,
    output: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("-o", "--output", metavar="FILE", help="A CSV file for the events.", show_default=False),
    ] = None,
    overwrite: options.OverwriteOption = False,
    json_: options.JsonOption = False,
) -> None:
    """Tell what targets of a finished run are believed to be, and which scenarios they took part in."""
    if output is not None:
        refuse_existing(output, overwrite=overwrite)
    folder = RunFolder.open(run)
    about = folder.read_about()
    width, height = _size(about, folder)
    known, wanted = _zones(about, zones, width, height), read_rules(scenarios)
    for note in wanted.outside(width, height):
        print(f"perdure: note: {note}", file=sys.stderr)
    interpreter = Interpreter.of(Scene(width, height, zones=known.zones, rules=known.rules), wanted)
    rows, _, _ = folder.read(with_masks=False)
    frames = {entry.frame: entry.time for entry in folder.entries(with_masks=False) if entry.frame >= 0}
    told = over_run(interpreter, rows, list(frames), list(frames.values()))
    if output is not None:
        _write(output, told.events, frames)
    if json_:
        print(json.dumps(_value(run, told)))
        return
    print("\n".join(_words(told, output)))


def _size(about: dict[str, Any], folder: RunFolder) -> tuple[int, int]:
    width, height = about.get("width"), about.get("height")
    if not (isinstance(width, int) and isinstance(height, int) and width > 0 and height > 0):
        raise FormatError(f"{folder.path / 'run.json'} does not tell the size of the picture; track again")
    return width, height


def _zones(about: dict[str, Any], file: Path | None, width: int, height: int) -> Zones:
    if file is not None:
        return read_zones(file, width, height)
    own = about.get("zones")
    return Zones(size=(height, width)) if own is None else zones_of_json(own, width, height)


def _write(output: Path, events: Sequence[Event], times: dict[int, float]) -> None:
    """Write events as a run's `events.csv` has them."""
    with whole_file(output) as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(EVENT_COLUMNS)
        for one in events:
            begin, end = (f"{times.get(frame, 0.0):.3f}" for frame in (one.begin, one.end))
            ids = " ".join(map(str, one.ids))
            table.writerow(
                [one.kind, one.begin, one.end, begin, end, ids, one.zone, f"{one.confidence:g}", one.why]
            )


def _value(run: Path, told: Told) -> dict[str, Any]:
    return {
        "run": str(run),
        "targets": [
            {"id": one, "best": belief.best, "belief": round(belief.coefficient, 3), "of": _rounded(belief)}
            for one, belief in sorted(told.beliefs.items())
        ],
        "counts": dict(Counter(one.kind for one in told.events)),
        "events": [dataclasses.asdict(one) for one in told.events],
    }


def _rounded(belief: Belief) -> dict[str, float]:
    return {name: round(float(one), 3) for name, one in belief.of.items()}


def _words(told: Told, output: Path | None) -> list[str]:
    classes = list(next(iter(told.beliefs.values())).of) if told.beliefs else []
    table = [["id", "best", *classes]]
    for one, belief in sorted(told.beliefs.items()):
        table.append([str(one), belief.best or "-", *(f"{belief.of[name]:.2f}" for name in classes)])
    lines = [aligned(table)] if told.beliefs else ["the run has no targets"]
    if told.events:
        rows = [["event", "frames", "ids", "zone", "belief"]]
        for event in told.events[:_SHOWN]:
            span = str(event.begin) if event.begin == event.end else f"{event.begin} to {event.end}"
            ids = " ".join(map(str, event.ids))
            rows.append([event.kind, span, ids, event.zone or "-", f"{event.confidence:.2f}"])
        lines += ["", aligned(rows)]
        more = len(told.events) - _SHOWN
        if more > 0:
            lines.append(f"and {more} more; -o FILE writes all of them")
    else:
        lines += ["", "no scenario was recognised"]
    return [*lines, *([] if output is None else [f"events   {output}"])]

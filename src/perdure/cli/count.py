"""`perdure count`: a run in, who crossed which line and who was in which zone out."""

from __future__ import annotations

import json
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Optional

import numpy as np
import typer

from perdure import params
from perdure.cli import options
from perdure.cli.tables import aligned
from perdure.errors import FormatError, ParameterError
from perdure.files.counting import lines_of, run_rows, zones_of
from perdure.files.counts import NAMES, write_counts
from perdure.files.folders import refuse_existing_files, whole_files
from perdure.files.runs import Reporting, RunFolder
from perdure.scene.counting import IN, OUT, POINTS, Counts, Crossing, Visit, usual_away
from perdure.scene.counting import count as count_rows
from perdure.types import Tracks


@options.with_parameters(("", {"What counts": Reporting}))
def count(
    run: options.RunArgument,
    chosen: dict[str, object],
    line: Annotated[
        Optional[list[str]],  # noqa: UP045 - typer reads this at run time
        typer.Option(
            "--line",
            metavar="NAME=x1,y1,x2,y2",
            help="A line to be crossed, in pixels; more points make a bent one: 'NAME=x,y x,y x,y'. 'in' is from its "
            "left to its right, seen by who goes from its first point to its last. May be repeated.",
            show_default=False,
        ),
    ] = None,
    zone: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--zone",
            metavar="NAME|NAME=POLYGON",
            help="A zone of --zones or of the run itself, or a polygon 'NAME=x,y x,y x,y …'; may be repeated.",
            show_default=False,
        ),
    ] = None,
    zones: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--zones",
            metavar="FILE",
            help="GeoJSON of zones, instead of the run's own; all of them are counted if --zone names none.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "-o",
            "--output",
            metavar="DIR",
            help="A folder for crossings.csv, occupancy.csv, dwell.csv, counts.json and counts.png.",
            show_default=False,
        ),
    ] = None,
    point: Annotated[
        str, typer.Option("--point", help="Where a target is: 'foot', the middle of its lower edge, or 'centre'.")
    ] = "foot",
    away: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(
            "--away",
            metavar="PX",
            help="How far one must get from a line or edge before it counts, so that jitter does not "
            "(default 2 % of the picture's height).",
            show_default=False,
        ),
    ] = None,
    class_: options.TargetClassOption = None,
    overwrite: options.OverwriteOption = False,
    json_: options.JsonOption = False,
) -> None:
    """Count who crosses lines, which way and how fast, and who is in zones and for how long."""
    if point not in POINTS:
        raise ParameterError(params.unknown_name("point of a box", point, POINTS))
    if output is not None:
        refuse_existing_files(output, NAMES, overwrite=overwrite)
    folder = RunFolder.open(run)
    about = folder.read_about()
    size = _size(about, folder)
    lines, places = lines_of(line or (), size), zones_of(zone or (), zones, about.get("zones"), size)
    if not lines and not places:
        raise ParameterError(
            "nothing to count; name a line with --line NAME=x1,y1,x2,y2 or a zone with --zone NAME"
        )
    reporting = params.build(Reporting, {**about.get("reporting", {}), **chosen})
    rows, frames, times = run_rows(folder, reporting.report_confidence)
    if not len(rows):
        raise FormatError(f"{run} has no rows that count; look at its film, and track again with other parameters")
    _check_classes(rows, class_ or ())
    counts = count_rows(
        rows,
        lines=lines,
        zones=places,
        size=size,
        point=point,
        away=away,
        frames=frames,
        times=times,
    )
    counts = counts.of_classes(class_) if class_ else counts
    on_ground = bool(about.get("ground"))
    told = {
        "run": str(run),
        "point": point,
        "away": usual_away(size) if away is None else away,
        "in": "from the left of a line to its right, seen from its first point to its last",
        **summary(counts, on_ground=on_ground),
    }
    if output is not None:
        _write(output, counts, told, on_ground=on_ground, overwrite=overwrite)
        told["output"] = str(output)
    print(_words(told, output))
    if json_:
        print(json.dumps(told))


def _write(output: Path, counts: Counts, told: dict[str, Any], *, on_ground: bool, overwrite: bool) -> None:
    """Write the tables and the picture into a folder, all or nothing."""
    from perdure.draw.counts import plot

    with whole_files(output, NAMES, overwrite=overwrite) as part:
        write_counts(part, counts, told, plot(counts), on_ground=on_ground)


def summary(counts: Counts, *, on_ground: bool) -> dict[str, Any]:
    """Return what is told of every line and zone, ready for JSON; speeds in m/s or px/s."""
    return {
        "speed_unit": "m/s" if on_ground else "px/s",
        "lines": {
            name: {way: _of_line(counts.of_line(name, way), on_ground) for way in (IN, OUT)}
            for name in counts.lines
        },
        "zones": {name: _of_zone(counts, name, on_ground) for name in counts.zones},
    }


def _of_line(crossings: Sequence[Crossing], on_ground: bool) -> dict[str, Any]:
    return {"count": len(crossings), "speed": _speed(crossings, on_ground)}


def _of_zone(counts: Counts, name: str, on_ground: bool) -> dict[str, Any]:
    visits, occupancy = counts.of_zone(name), counts.occupancy[name]
    seconds = [one.seconds for one in visits] or [0.0]
    return {
        "visits": len(visits),
        "entered": sum(one.entered for one in visits),
        "left": sum(one.left for one in visits),
        "occupancy": {
            "mean": round(float(occupancy.mean()), 4) if len(occupancy) else 0.0,
            "max": int(occupancy.max(initial=0)),
        },
        "dwell": {
            "median": round(statistics.median(seconds), 3),
            "mean": round(statistics.fmean(seconds), 3),
            "max": round(max(seconds), 3),
        },
        "speed": _speed(visits, on_ground),
    }


def _speed(moves: Sequence[Crossing | Visit], on_ground: bool) -> float | None:
    """The median speed; None where none is known."""
    known = [speed for one in moves if (speed := one.ground_speed if on_ground else one.speed) is not None]
    return round(statistics.median(known), 2) if known else None


def _words(told: dict[str, Any], output: Path | None) -> str:
    unit = told["speed_unit"]
    parts = []
    if told["lines"]:
        rows = [["line", "direction", "count", f"speed {unit}"]]
        for name, ways in told["lines"].items():
            rows += [[name, way, str(one["count"]), _shown(one["speed"])] for way, one in ways.items()]
        parts.append(aligned(rows))
        parts.append(f"in: {told['in']}")
    if told["zones"]:
        rows = [["zone", "entered", "left", "mean in it", "max", "dwell s median", "mean", "max", f"speed {unit}"]]
        for name, one in told["zones"].items():
            occupancy, dwell = one["occupancy"], one["dwell"]
            rows.append(
                [
                    name,
                    str(one["entered"]),
                    str(one["left"]),
                    f"{occupancy['mean']:.2f}",
                    str(occupancy["max"]),
                    *(f"{dwell[word]:.2f}" if dwell["max"] else "-" for word in ("median", "mean", "max")),
                    _shown(one["speed"]),
                ]
            )
        parts.append(aligned(rows))
    if output is not None:
        parts.append(f"written: {output}")
    return "\n".join(parts)


def _shown(speed: float | None) -> str:
    return "-" if speed is None else f"{speed:.1f}"


def _check_classes(rows: Tracks, classes: Sequence[str]) -> None:
    known = sorted({str(one) for one in np.unique(rows.classes)} - {""})
    for name in classes:
        if name not in known:
            raise ParameterError(f"--class: {params.unknown_name('class of this run', name, known)}")


def _size(about: dict[str, Any], folder: RunFolder) -> tuple[int, int]:
    size = about.get("height"), about.get("width")
    if not (isinstance(size[0], int) and isinstance(size[1], int)):
        raise FormatError(
            f"{folder.path / 'run.json'} does not tell the size of the pictures; `perdure track --overwrite` makes it anew"
        )
    return size[0], size[1]

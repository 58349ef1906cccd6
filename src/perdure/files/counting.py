"""What is to be counted: lines and zones as they are typed, and the rows of a run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError, ParameterError
from perdure.files.runs import RunFolder
from perdure.files.zones import read_zones, zones_of_json
from perdure.fold import Corrections, settle_with
from perdure.params import unknown_name
from perdure.scene.counting import Line
from perdure.scene.zones import Zone
from perdure.types import Tracks

Points = tuple[tuple[float, float], ...]


def lines_of(typed: Sequence[str], size: tuple[int, int]) -> tuple[Line, ...]:
    """Return lines as they are typed, 'NAME=x1,y1,x2,y2' or 'x,y x,y x,y', in a picture (height, width).

    Raises
    ------
    ParameterError
        For what is none, a line of no length, one outside the picture, or two of one name.
    """
    lines: list[Line] = []
    for number, text in enumerate(typed, 1):
        name, written = _named(text, f"line {number}")
        points = _points(written)
        if points is None or len(points) < 2:
            raise ParameterError(f"--line {text!r} is no line; write NAME=x1,y1,x2,y2 in pixels")
        for x, y in points:
            if not (0 <= x <= size[1] and 0 <= y <= size[0]):
                raise ParameterError(
                    f"--line {name!r}: its point {x:g},{y:g} lies outside the picture of {size[1]}x{size[0]}; "
                    f"x must be 0 to {size[1]}, y 0 to {size[0]}"
                )
        if any(one.name == name for one in lines):
            raise ParameterError(f"--line: two lines have one name, {name!r}; give each its own")
        lines.append(Line(name, points))
    return tuple(lines)


def zones_of(typed: Sequence[str], file: Path | None, own: Any, size: tuple[int, int]) -> tuple[Zone, ...]:
    """Return the zones that are named, or typed as polygons 'NAME=x,y x,y x,y', in a picture (height, width).

    Names are those of a file, else of the run's own zones. A file without a name typed is meant whole.

    Raises
    ------
    ParameterError, FormatError
        For an unknown name (with the nearest known one), for what is no polygon, or two zones of one name.
    """
    height, width = size
    if file is not None:
        known = read_zones(file, width, height).zones
        if not typed:
            return known
    else:
        known = zones_of_json(own, width, height).zones if isinstance(own, Mapping) else ()
    by_name = {zone.name: zone for zone in known}
    found: list[Zone] = []
    for number, text in enumerate(typed, 1):
        zone = by_name.get(text) or _drawn(text, number, size)
        if zone is None:
            where = f"in {file}" if file is not None else "of this run"
            hint = "" if known else "; name a file with --zones, or draw one: --zone 'NAME=x,y x,y x,y'"
            raise ParameterError(f"--zone: {unknown_name(f'zone {where}', text, by_name)}{hint}")
        if any(one.name == zone.name for one in found):
            raise ParameterError(f"--zone: two zones have one name, {zone.name!r}; give each its own")
        found.append(zone)
    return tuple(found)


def run_rows(folder: RunFolder, report_confidence: float) -> tuple[Tracks, NDArray[np.int64], NDArray[np.float64]]:
    """Return the rows of a run that count, without silhouettes, and the frames of its film with their times."""
    entries = [(one.frame, one.time) for one in folder.entries(with_masks=False) if one.frame >= 0]
    corrections = Corrections.of(one.report for one in folder.entries(with_masks=False))
    settled = settle_with(corrections, (one.report for one in folder.entries(with_masks=False)))
    rows = Tracks.join(rows.counted(report_confidence) for _, rows in settled)
    frames, times = zip(*entries, strict=True) if entries else ((), ())
    return rows, np.array(frames, np.int64), np.array(times, np.float64)


def _named(text: str, otherwise: str) -> tuple[str, str]:
    """A name and what is written behind '='."""
    name, sign, written = text.rpartition("=")
    return (name.strip() or otherwise, written) if sign else (otherwise, text)


def _points(text: str) -> Points | None:
    """Points of numbers between commas and spaces; None where there are none."""
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        return None
    if len(numbers) % 2 or not numbers or not all(map(math.isfinite, numbers)):
        return None
    return tuple(zip(numbers[::2], numbers[1::2], strict=True))


def _drawn(text: str, number: int, size: tuple[int, int]) -> Zone | None:
    """A polygon that is typed, checked as those of a file are; None where it is none."""
    name, written = _named(text, f"zone {number}")
    points = _points(written)
    if points is None:
        if "=" in text:
            raise ParameterError(f"--zone {text!r} is no polygon; write 'NAME=x,y x,y x,y' in pixels")
        return None
    ring = [list(one) for one in (*points, points[0])]
    feature = {
        "type": "Feature",
        "properties": {"kind": "ground", "name": name},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }
    try:
        return zones_of_json({"type": "FeatureCollection", "features": [feature]}, size[1], size[0]).zones[0]
    except FormatError as error:
        raise ParameterError(f"--zone: {str(error).removeprefix('zone 1 ')}") from None

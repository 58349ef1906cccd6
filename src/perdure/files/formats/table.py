"""CSV with a line of names: all plain columns of rows, frames and pixels from 0; and contours as well-known text."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import IO

import numpy as np

from perdure.errors import FormatError
from perdure.files.contours import wkt_of
from perdure.files.formats.content import Content, Format, Gathering, Reading, counted_from_one
from perdure.files.formats.traits import ALL, Trait
from perdure.files.lines import four_digits, number_of
from perdure.files.span import shown
from perdure.files.whole import refuse_existing, whole_file
from perdure.types import Ground, Outline, Status, Tracks

COLUMNS = (
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
    "visibility",
    "contour",
)
GROUND_COLUMNS = ("ground_x", "ground_y", "ground_speed")  # m, m/s; of a film whose ground plane is known
NEEDED = ("frame", "id", "x1", "y1", "x2", "y2")


def is_table(path: Path) -> bool:
    """Return whether the first line names the columns that are needed."""
    try:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            return set(NEEDED) <= set(file.readline(_LONGEST_LINE).strip().split(","))
    except OSError:
        return False


def read(path: Path, reading: Reading) -> Content:
    """Return the rows of a table; columns that have other names than ours, or `Tracks.to_pandas`'s, are passed over.

    Raises
    ------
    FormatError
        Naming file and line.
    """
    rows = Gathering(path)
    table = csv.DictReader(io.StringIO(_text(path), newline=""), strict=True)
    try:
        names = table.fieldnames or ()
        missing = [name for name in NEEDED if name not in names]
        if missing:
            raise FormatError(f"{path}, line 1: no column {missing[0]!r}; wanted are {', '.join(NEEDED)} at least")
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise FormatError(f"{path}, line 1: column {twice!r} stands twice")
        for row in table:
            place = f"line {table.line_num}"
            if None in row or None in row.values():
                raise rows.refuse(place, f"not as many cells as the first line has names, {len(names)}")
            _add(rows, place, row)
    except csv.Error as error:
        raise rows.refuse(f"line {table.line_num}", f"not a line of CSV ({error})") from None
    tracks, notes = counted_from_one(rows.tracks())
    return Content(tracks, timed="time" in names, notes=notes)


def write(path: Path, content: Content, *, overwrite: bool) -> int:
    """Write a table; with columns of the ground where any row has a place there."""
    refuse_existing(path, overwrite=overwrite)
    on_ground = any(one is not None for one in content.tracks.ground)
    with whole_file(path) as file:
        write_names(file, on_ground=on_ground)
        write_lines(file, content.tracks, on_ground=on_ground)
    return len(content.tracks)


def write_names(file: IO[str], *, on_ground: bool) -> None:
    """Write the line of names."""
    csv.writer(file, lineterminator="\n").writerow((*COLUMNS, *(GROUND_COLUMNS if on_ground else ())))


def write_lines(file: IO[str], rows: Tracks, *, on_ground: bool) -> None:
    """Write a line a row."""
    csv.writer(file, lineterminator="\n").writerows(_lines(rows, on_ground))


def _lines(rows: Tracks, on_ground: bool) -> Iterator[list[object]]:
    visibility = rows.visibility
    for i in range(len(rows)):
        yield [
            rows.frames[i],
            f"{rows.times[i]:.3f}",
            rows.ids[i],
            *(f"{side:.2f}" for side in rows.boxes[i]),
            Status(rows.status[i]).word,
            four_digits(rows.confidence[i]),
            rows.classes[i],
            rows.groups[i],
            int(rows.inferred[i]),
            rows.hidden_side[i],
            f"{visibility[i]:.4g}",
            wkt_of(rows.outlines[i]),
            *(_ground_cells(rows.ground[i]) if on_ground else ()),
        ]


def _ground_cells(place: Ground | None) -> tuple[object, ...]:
    """X, Y and speed; empty where not known."""
    x, y, speed = (None, None, None) if place is None else place
    return tuple("" if one is None else f"{one:.3f}" for one in (x, y, speed))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"cannot read {path}: {getattr(error, 'strerror', None) or 'it is not text'}") from error


def _add(rows: Gathering, place: str, row: Mapping[str, str]) -> None:
    def number(name: str, default: float = 0.0) -> float:
        cell = row.get(name, "").strip()
        try:
            return number_of(_YES_AND_NO.get(cell, cell)) if cell else default
        except ValueError:
            raise rows.refuse(place, f"{shown(cell)} in column {name!r} is no number") from None

    def wanted(name: str) -> float:
        return number(name, np.nan)

    try:
        outline = outline_of_wkt(row.get("contour", ""))
    except ValueError as error:
        raise rows.refuse(place, f"contour: {error}") from None
    rows.add(
        place,
        frame=wanted("frame"),
        identity=wanted("id"),
        box=[wanted(name) for name in NEEDED[2:]],
        time=number("time"),
        status=_status(rows, place, row.get("status", "")),
        confidence=number("confidence", 1.0),
        kind=row.get("class", row.get("classes", "")),
        group=number("group" if "group" in row else "groups"),
        inferred=bool(number("inferred")),
        outline=outline,
        hidden_side=row.get("hidden_side", ""),
        ground=_ground(number) if row.get("ground_x", "").strip() else None,
    )


def _status(rows: Gathering, place: str, word: str) -> Status:
    known = {one.word: one for one in Status}
    if word and word not in known:
        raise rows.refuse(place, f"status {shown(word)} is none of {', '.join(known)}")
    return known[word] if word else Status.VISIBLE


def _ground(number: Callable[[str, float], float]) -> Ground:
    speed = number("ground_speed", np.nan)
    return Ground(number("ground_x", np.nan), number("ground_y", np.nan), None if np.isnan(speed) else speed)


def outline_of_wkt(text: str) -> Outline | None:
    """Return the contour that `wkt_of` wrote; None for an empty text.

    Raises
    ------
    ValueError
        For what is no POLYGON or MULTIPOLYGON.

    >>> outline_of_wkt("POLYGON ((0 0, 4 0, 4 2.5, 0 0))").area
    5.0
    """
    if not text.strip():
        return None
    import shapely

    try:
        with np.errstate(all="ignore"):  # a number too large becomes infinite, which `Outline` refuses
            shape = shapely.from_wkt(text)
    except shapely.errors.ShapelyError as error:
        raise ValueError(f"{shown(text)} is not well-known text") from error
    if shape.geom_type not in ("Polygon", "MultiPolygon"):
        raise ValueError(f"wanted is a POLYGON or MULTIPOLYGON, not a {shape.geom_type}")
    parts = shape.geoms if shape.geom_type == "MultiPolygon" else [shape]
    rings = [np.array(ring.coords)[:-1, :2] for part in parts for ring in (part.exterior, *part.interiors)]
    return Outline(tuple(rings))


FORMAT = Format(
    "csv",
    "CSV with a line of names, all plain columns; frames and pixels from 0",
    read,
    write,
    suffixes=(".csv",),
    holds=ALL - {Trait.MASK, Trait.BELIEVED, Trait.LINKS},
    rounds={"boxes": 0.01, "times": 0.001, "confidence": 1e-4},
)
_LONGEST_LINE = 4096
_YES_AND_NO = {"True": "1", "False": "0"}  # as pandas writes them

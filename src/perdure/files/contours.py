"""Contours as GeoJSON, as lists of points and as WKT: x to the right and y down in pixels, pixel (0, 0) from 0 to 1.

A row has the contour that its tracker said, between pixels; else the outline of its silhouette along the edges of
pixels; else its box.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from typing import IO, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from perdure.features.outlines import outline_of, outline_of_box, polygons
from perdure.files.lines import short_row
from perdure.types import Outline, Status, Tracks

POINT_COLUMNS = ("frame", "id", "part", "ring", "point", "x", "y")


class Said(NamedTuple):
    """The contour of a row, and what it is of: 'contour', 'believed', 'seen' or 'box'."""

    row: int
    outline: Outline
    of: str


def contours_of(rows: Tracks, *, believed: bool) -> Iterator[Said]:
    """Yield the contours of rows; those of no area are left out.

    Of a row without a contour, `believed` chooses the whole silhouette, where one is believed, before the pixels seen.
    """
    for row in range(len(rows)):
        for outline, of in _choices(rows, row, believed):
            if outline.rings:
                yield Said(row, outline, of)
                break


def _choices(rows: Tracks, row: int, believed: bool) -> Iterator[tuple[Outline, str]]:
    outline, whole = rows.outlines[row], rows.believed[row]
    if outline is not None:
        yield outline, "contour"
    if believed and whole is not None:
        yield outline_of(whole), "believed"
    yield outline_of(rows.masks[row]), "seen"
    yield outline_of_box(rows.boxes[row]), "box"


# GeoJSON --------------------------------------------------------------------------------------------------------


def write_geojson_begin(file: IO[str], size: tuple[int, int] | None) -> None:
    """Write what stands before the features, of pictures of this height and width, where they are known."""
    sides = {} if size is None else {"height": size[0], "width": size[1]}
    about = {"unit": "pixel", "x": "right", "y": "down", **sides}
    file.write(f'{{"type":"FeatureCollection","picture":{_dumped(about)},"features":[')


def write_geojson_end(file: IO[str]) -> None:
    """Write what stands behind the features."""
    file.write("\n]}\n")


def write_features(file: IO[str], rows: Tracks, *, believed: bool, first: bool) -> int:
    """Write a feature a row, each in a line of its own, and return their number; `first` if none was written before."""
    count = 0
    visibility = rows.visibility
    for row, outline, of in contours_of(rows, believed=believed):
        properties = {
            "frame": int(rows.frames[row]),
            "time": round(float(rows.times[row]), 6),
            "id": int(rows.ids[row]),
            "box": short_row(rows.boxes[row]),
            "class": str(rows.classes[row]),
            "group": int(rows.groups[row]),
            "status": Status(rows.status[row]).word,
            "confidence": round(float(rows.confidence[row]), 4),
            "visibility": round(float(visibility[row]), 4),
            "inferred": bool(rows.inferred[row]),
            "hidden_side": str(rows.hidden_side[row]),
            "outline": of,
        }
        feature = {"type": "Feature", "properties": properties, "geometry": _geometry(outline)}
        file.write(("\n" if first and not count else ",\n") + _dumped(feature))
        count += 1
    return count


def _geometry(outline: Outline) -> dict[str, Any]:
    parts = [[_closed(ring) for ring in (outer, *holes)] for outer, holes in polygons(outline)]
    if len(parts) == 1:
        return {"type": "Polygon", "coordinates": parts[0]}
    return {"type": "MultiPolygon", "coordinates": parts}


def _closed(ring: NDArray[np.float64]) -> list[list[float]]:
    return cast("list[list[float]]", np.round(np.concatenate([ring, ring[:1]]), _DECIMALS).tolist())


def _dumped(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False, ensure_ascii=False)


# Tables ---------------------------------------------------------------------------------------------------------


def write_points(file: IO[str], rows: Tracks, *, believed: bool) -> int:
    """Write a line a point, and return the number of rows: part of the object, ring of the part (0 around it, others holes)."""
    table, count = csv.writer(file, lineterminator="\n"), 0
    for row, outline, _ in contours_of(rows, believed=believed):
        frame, identity = int(rows.frames[row]), int(rows.ids[row])
        for part, (outer, holes) in enumerate(polygons(outline)):
            for number, ring in enumerate((outer, *holes)):
                for point, (x, y) in enumerate(np.round(ring, _DECIMALS).tolist()):
                    table.writerow([frame, identity, part, number, point, x, y])
        count += 1
    return count


def wkt_of(outline: Outline | None) -> str:
    """Return a contour as well-known text; empty for none.

    >>> wkt_of(Outline.of([[[0, 0], [4, 0], [4, 2.5]]]))
    'POLYGON ((0 0, 4 0, 4 2.5, 0 0))'
    """
    if outline is None or not outline.rings:
        return ""
    parts = [
        ", ".join("(" + ", ".join(f"{x:.6g} {y:.6g}" for x, y in _closed(ring)) + ")" for ring in (outer, *holes))
        for outer, holes in polygons(outline)
    ]
    if len(parts) == 1:
        return f"POLYGON ({parts[0]})"
    return "MULTIPOLYGON (" + ", ".join(f"({part})" for part in parts) + ")"


_DECIMALS = 3  # of a pixel; places are kept to a 64th

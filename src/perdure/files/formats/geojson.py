"""GeoJSON as `perdure export` writes it: a feature a row, polygons in pixels, and what the row says as properties."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from perdure.errors import FormatError
from perdure.features.outlines import mask_of
from perdure.files.contours import write_features, write_geojson_begin, write_geojson_end
from perdure.files.formats.content import Content, Format, Gathering, Reading, counted_from_one, cut_to
from perdure.files.formats.jsons import read_json, size_of
from perdure.files.formats.traits import ALL, Trait
from perdure.files.span import shown
from perdure.files.whole import refuse_existing, whole_file
from perdure.types import Mask, Outline, Status

KIND = "FeatureCollection"
_OUTLINES = ("contour", "seen", "believed", "box")


def read(path: Path, reading: Reading) -> Content:
    """Return the rows of a collection, whose features must say frame and id.

    A polygon is a contour, or what the property `outline` says; a row without the property `box` has the polygon's.

    Raises
    ------
    FormatError
        Naming file and feature.
    """
    value = read_json(path)
    features = value.get("features") if isinstance(value, Mapping) else None
    if not isinstance(features, list):
        raise FormatError(f"{path}: wanted is a {KIND} with a list of 'features'")
    rows = Gathering(path)
    for number, feature in enumerate(features, 1):
        place = f"feature {number}"
        try:
            _add(rows, place, feature)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise rows.refuse(place, f"not a row ({_why(error)})") from None
    tracks, notes = counted_from_one(rows.tracks())
    about = value.get("picture")
    size = size_of(path, about) if isinstance(about, Mapping) and "width" in about else None
    timed = any("time" in feature["properties"] for feature in features)
    return Content(cut_to(tracks, size), size=size, timed=timed, notes=notes)


def write(path: Path, content: Content, *, overwrite: bool) -> int:
    """Write a feature a row; rows of no area are left out."""
    refuse_existing(path, overwrite=overwrite)
    with whole_file(path) as file:
        write_geojson_begin(file, content.size)
        count = write_features(file, content.tracks, believed=False, first=True)
        write_geojson_end(file)
    return count


def _add(rows: Gathering, place: str, feature: Mapping[str, Any]) -> None:
    told = feature["properties"]
    outline = Outline(tuple(_rings(feature["geometry"])))
    of = told.get("outline", _OUTLINES[0])
    if of not in _OUTLINES:
        raise ValueError(f"outline {shown(of)} is none of {', '.join(_OUTLINES)}")
    points = np.concatenate(outline.rings)
    around = [*points.min(axis=0).tolist(), *points.max(axis=0).tolist()]
    rows.add(
        place,
        frame=told["frame"],
        identity=told["id"],
        box=told.get("box", around),
        time=told.get("time", 0.0),
        status=Status[told.get("status", "visible").upper()],
        confidence=told.get("confidence", 1.0),
        kind=_word(told, "class"),
        group=told.get("group", 0),
        inferred=bool(told.get("inferred", False)),
        mask=mask_of(outline) if of == "seen" else Mask.empty(),
        believed=mask_of(outline) if of == "believed" else None,
        outline=outline if of == "contour" else None,
        hidden_side=_word(told, "hidden_side"),
    )


def _rings(geometry: Mapping[str, Any]) -> Iterator[np.ndarray[Any, Any]]:
    """The rings of a polygon or of several, each without the first point at its end."""
    kind, parts = geometry["type"], geometry["coordinates"]
    if kind not in ("Polygon", "MultiPolygon"):
        raise ValueError(f"its geometry is a {shown(kind)}; wanted is a Polygon or MultiPolygon")
    parts = parts if kind == "MultiPolygon" else [parts]
    rings = [ring for part in parts for ring in part]
    if not rings:
        raise ValueError("its polygon has no points")
    for ring in rings:
        points = np.array(ring, np.float64)
        if points.ndim != 2 or points.shape[1] < 2 or len(points) < 4 or not np.isfinite(points).all():
            raise ValueError("a ring must be four points or more of finite numbers, the first again at its end")
        yield points[:-1, :2]


def _word(told: Mapping[str, Any], name: str) -> str:
    value = told.get(name, "")
    if not isinstance(value, str):
        raise ValueError(f"{name} {value!r} is not a text")
    return value


def _why(error: Exception) -> str:
    return f"{error.args[0]!r} is missing or not known" if isinstance(error, KeyError) else str(error)


FORMAT = Format(
    "geojson",
    "GeoJSON, contours as polygons in pixels, a feature a row; frames from 0",
    read,
    write,
    suffixes=(".geojson",),
    holds=ALL - {Trait.MASK_TOO, Trait.BELIEVED, Trait.GROUND, Trait.LINKS},
    rounds={"times": 1e-6, "confidence": 1e-4},
)

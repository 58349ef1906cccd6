"""The part of the picture in which something may be seen: an image, a box, or polygons.

A pixel is inside when its centre is: the polygon '0,0 4,0 4,4 0,4' is the box '0,0,4,4'.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from perdure.errors import FormatError, ParameterError, VideoError
from perdure.files.lines import why_not_json
from perdure.files.shapes import Ring, filled, is_file, is_polygon, place, read_ring, read_shape
from perdure.files.span import shown
from perdure.types import Bits

_FORMS = "an image or a file of polygons, a box 'x,y,w,h', or a polygon 'x,y x,y x,y'"


def read_roi(text_or_path: str | Path, width: int, height: int) -> Bits:
    """Read a region of interest.

    Parameters
    ----------
    text_or_path : str or Path
        An image of the scene's size (not black is inside), a box 'x,y,w,h', a polygon 'x,y x,y x,y …',
        or a file of polygons: GeoJSON in pixels, or one polygon a line.
    width, height : int
        The scene's size in pixels.

    Returns
    -------
    (height, width) bool array
        True inside.

    Raises
    ------
    ParameterError
        For a text that is none of these, or a region without a pixel inside the scene.
    FormatError
        For a file that is none of these.
    """
    if not isinstance(text_or_path, (str, Path)):
        raise ParameterError(f"roi = {shown(text_or_path)} is no region: give {_FORMS}")
    text = str(text_or_path)
    try:
        inside = _read(text, width, height)
    except ValueError as error:
        raise ParameterError(f"roi = {shown(text)}: {error}") from None
    if not inside.any():
        raise ParameterError(f"the roi {shown(text)} has no pixel inside the scene of {width}x{height}")
    return inside


def _read(text: str, width: int, height: int) -> Bits:
    """The region that a text is or names; ValueError for a coordinate too far out."""
    drawn = read_shape(text, width, height)
    if drawn is not None:
        return drawn
    if is_file(text):
        return _read_file(Path(text), width, height)
    raise ParameterError(f"roi = {shown(text)} is no file and no region: give {_FORMS}")


def _read_file(path: Path, width: int, height: int) -> Bits:
    """An image, GeoJSON, or lines of polygons, whichever the file holds."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        return _read_image(path, width, height)
    except OSError as error:
        raise FormatError(f"{path} cannot be read ({error.strerror})") from None
    if "\0" in text:
        return _read_image(path, width, height)
    if text.lstrip().startswith(("{", "[")):
        return filled(list(_read_json(path, text)), width, height)
    return filled(list(_read_lines(path, text)), width, height)


def _read_image(path: Path, width: int, height: int) -> Bits:
    from perdure.files.images import read_pixels

    try:
        pixels = read_pixels(path)  # (H, W, 3)
    except VideoError as error:
        raise FormatError(f"the roi {error}") from None
    if pixels.shape[:2] != (height, width):
        raise FormatError(f"the roi {path} is {pixels.shape[1]}x{pixels.shape[0]}, the scene {width}x{height}")
    return np.asarray(pixels.any(axis=2), np.bool_)  # (H, W)


def _read_lines(path: Path, text: str) -> Iterator[list[Ring]]:
    found = False
    for number, line in enumerate(text.splitlines(), 1):
        bare = line.split("#")[0].strip()
        if not bare:
            continue
        if not is_polygon(bare):
            raise FormatError(f"{path}, line {number}: not a polygon 'x,y x,y x,y': {shown(line.strip())}")
        found = True
        try:
            yield [read_ring(bare)]
        except ValueError as error:
            raise FormatError(f"{path}, line {number}: {error}") from None
    if not found:
        raise FormatError(f"the roi {path} holds no polygon")


def _read_json(path: Path, text: str) -> Iterator[list[Ring]]:
    try:
        written = json.loads(text)
    except (ValueError, RecursionError) as error:
        line = f", line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise FormatError(f"{path}{line}: not JSON ({why_not_json(error)})") from None
    try:
        polygons = [[_points(ring) for ring in polygon] for polygon in _polygons(written)]
    except ValueError as error:
        raise FormatError(f"{path}: {error}") from None
    except (KeyError, TypeError, RecursionError):
        raise FormatError(
            f"{path} is not GeoJSON of Polygon or MultiPolygon: points are [x, y] in pixels, at least three a ring"
        ) from None
    if not polygons:
        raise FormatError(f"the roi {path} holds no polygon")
    yield from polygons


def _polygons(written: Any) -> Iterator[Sequence[Any]]:
    """The polygons of a GeoJSON object, each a list of rings: the outer one, then holes."""
    kind = written["type"]
    if kind == "FeatureCollection":
        for feature in written["features"]:
            yield from _polygons(feature)
    elif kind == "Feature":
        yield from _polygons(written["geometry"])
    elif kind == "GeometryCollection":
        for geometry in written["geometries"]:
            yield from _polygons(geometry)
    elif kind == "MultiPolygon":
        yield from written["coordinates"]
    elif kind == "Polygon":
        yield written["coordinates"]
    else:
        raise TypeError


def _points(ring: Any) -> Ring:
    """The points of a ring; TypeError for what is none, ValueError for one too far out."""
    if len(ring) < 3 or not all(isinstance(point, list) and len(point) > 1 for point in ring):
        raise TypeError
    if not {type(one) for point in ring for one in point[:2]} <= {int, float}:
        raise TypeError
    return [(place(point[0]), place(point[1])) for point in ring]

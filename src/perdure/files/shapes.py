"""Boxes and polygons as a user types them, and the pixels in them.

A pixel is inside when its centre is: the polygon '0,0 4,0 4,4 0,4' is the box '0,0,4,4'.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from perdure.types import Bits

Ring = list[tuple[float, float]]

_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)"
_BOX = re.compile(rf"\s*{_NUMBER}(?:\s*,\s*{_NUMBER}){{3}}\s*", re.ASCII)
_POLYGON = re.compile(rf"\s*{_NUMBER},{_NUMBER}(?:\s+{_NUMBER},{_NUMBER}){{2,}}\s*", re.ASCII)
_FARTHEST = 10**6  # px


def read_shape(text: str, width: int, height: int) -> Bits | None:
    """Return the pixels (height, width) of a box 'x,y,w,h' or a polygon 'x,y x,y x,y …'; None for another text.

    Raises
    ------
    ValueError
        For a coordinate too far out.
    """
    if is_box(text):
        return _box(text, width, height)
    return filled([[read_ring(text)]], width, height) if is_polygon(text) else None


def is_box(text: str) -> bool:
    """Return whether a text is 'x,y,w,h'."""
    return _BOX.fullmatch(text) is not None


def is_polygon(text: str) -> bool:
    """Return whether a text is 'x,y x,y x,y …', of three points at least."""
    return _POLYGON.fullmatch(text) is not None


def is_file(text: str | Path) -> bool:
    """Return whether a text names a file that is there; a polygon or an address may be too long for a name."""
    try:
        return Path(text).is_file()
    except (OSError, ValueError):  # too long, or not a path at all
        return False


def read_ring(text: str) -> Ring:
    """Return the points of a polygon's text; ValueError for one too far out."""
    pairs = (one.split(",") for one in text.split())
    return [(place(float(x)), place(float(y))) for x, y in pairs]


def place(number: float) -> float:
    """Return a coordinate; ValueError for one too far out."""
    if not abs(number) <= _FARTHEST:
        raise ValueError(f"a coordinate must lie in -{_FARTHEST} to {_FARTHEST} pixels")
    return float(number)


def filled(polygons: list[list[Ring]], width: int, height: int) -> Bits:
    """Return the pixels whose centre is inside any polygon: crossed an odd number of times by a ray to the left."""
    inside = np.zeros((height, width), np.bool_)
    columns, rows = np.arange(width) + 0.5, np.arange(height) + 0.5
    for polygon in polygons:
        odd = np.zeros((height, width), np.bool_)
        for ring in polygon:
            for (x1, y1), (x2, y2) in zip(ring, [*ring[1:], ring[0]], strict=True):
                across = np.flatnonzero((rows >= min(y1, y2)) & (rows < max(y1, y2)))
                if across.size:
                    x = x1 + (rows[across] - y1) * (x2 - x1) / (y2 - y1)  # where each row meets the edge
                    odd[across] ^= columns[None] >= x[:, None]
        inside |= odd
    return inside


def _box(text: str, width: int, height: int) -> Bits:
    """The pixels whose centre is in the half-open box."""
    x, y, w, h = (place(float(one)) for one in text.split(","))
    columns, rows = np.arange(width) + 0.5, np.arange(height) + 0.5
    across, down = (columns >= x) & (columns < x + w), (rows >= y) & (rows < y + h)
    inside = np.zeros((height, width), np.bool_)
    inside[np.ix_(down, across)] = True
    return inside

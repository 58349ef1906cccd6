"""Zones that are proposed, and what speaks for them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.scene.zones import Polygon, Zone, rectangle, shape_of

Float = NDArray[np.float64]
Bools = NDArray[np.bool_]
AROUND = 0.25  # of things' size, that is left round them
LEAST = 3  # paths that make a zone inside the picture


@dataclass(frozen=True)
class Proposal:
    """A zone, and what speaks for it."""

    zone: Zone
    count: int  # paths, or things hidden
    reason: str


def proposed(kind: str, name: str, place: tuple[Polygon, ...], count: int, reason: str) -> Proposal:
    """A zone that so many speak for."""
    return Proposal(Zone(kind, name, place), count, reason)


def touches(one: Proposal, others: Iterable[Proposal]) -> bool:
    """Whether a zone shares a place with another."""
    own = shape_of(one.zone.polygons)
    return any(own.intersection(shape_of(other.zone.polygons)).area > 0 for other in others)


def touching(boxes: Float, shape: Any) -> Bools:
    """Which (N,) boxes (N, 4) touch a geometry of shapely, if there is one."""
    import shapely

    if shape is None or not len(boxes):
        return np.zeros(len(boxes), np.bool_)
    return np.asarray(shapely.intersects(shape, shapely.box(*boxes.T)), np.bool_)


def touch_any(boxes: Float, proposals: Sequence[Proposal]) -> Bools:
    """Which boxes (N, 4) touch a zone that is proposed."""
    behind = np.zeros(len(boxes), np.bool_)
    for one in proposals:
        behind |= touching(boxes, shape_of(one.zone.polygons))
    return behind


def numbered(proposals: Sequence[Proposal]) -> list[Proposal]:
    """From left to right, top to bottom; where several have one name, with a number."""
    ordered = sorted(proposals, key=lambda one: (one.zone.name, min(one.zone.polygons[0][0])))
    told = []
    names = [one.zone.name for one in ordered]
    for number, one in enumerate(ordered):
        name = one.zone.name
        if names.count(name) > 1:
            name = f"{name} {names[: number + 1].count(name)}"
        told.append(Proposal(Zone(one.zone.kind, name, one.zone.polygons), one.count, one.reason))
    return told


def around(points: Float, margin: float, size: tuple[int, int]) -> tuple[Polygon, ...]:
    """A rectangle round points (N, 2), in the picture."""
    (x1, y1), (x2, y2) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return rectangle_in(x1, y1, x2, y2, size)


def rectangle_in(x1: float, y1: float, x2: float, y2: float, size: tuple[int, int]) -> tuple[Polygon, ...]:
    """A rectangle in whole pixels in the picture, at least a pixel wide and high."""
    height, width = size
    left, top = min(max(0, round(x1)), width - 1), min(max(0, round(y1)), height - 1)
    right, bottom = min(width, max(round(x2), left + 1)), min(height, max(round(y2), top + 1))
    return rectangle(float(left), float(top), float(right), float(bottom))

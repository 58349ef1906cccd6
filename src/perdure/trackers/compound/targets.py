"""Targets: what is believed of each thing, in columns; prediction and the best generic point (III.B, IV.A)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.features.appearance import GRID
from perdure.features.boxes import centres, sizes
from perdure.maths import polyline
from perdure.maths.polyline import Polylines
from perdure.types import Boxes, Frame

Float = NDArray[np.float32]
Index = NDArray[np.intp]
CENTRE = 0  # of the generic points: centre, top, bottom, left, right
OFFSETS = np.array([[0, 0], [0, -0.5], [0, 0.5], [-0.5, 0], [0.5, 0]], np.float32)  # of the points, in sizes
SIDES = ("left", "top", "right", "bottom")
TOLERANCE = 0.12  # target sizes that a location may lie off a segment
_RELIABLE = 0.4  # s that a segment must have lasted
_HORIZON = 0.5  # s that an unreliable trajectory looks back
_LONGEST = 2.0  # s of a segment


@dataclass(frozen=True, eq=False)
class Targets:
    """N targets, a row each: things tracked by themselves, those frozen in a compound, and temporary ones."""

    keys: NDArray[np.int64]  # (N,) ≥ 1, never used twice
    ids: NDArray[np.int64]  # (N,) what they are called; 0 until confirmed
    temporary: NDArray[np.bool_]  # (N,) a region of a compound, tracked as a whole
    compound: NDArray[np.int64]  # (N,) the compound that it belongs to; 0 for none
    within: NDArray[np.int64]  # (N,) of an ambiguous target: the key of the temporary one that holds it; else 0
    points: Float  # (N, 5, 2) generic points where last seen or believed: centre, top, bottom, left, right
    size: Float  # (N, 2) mean width and height
    lines: Polylines  # N trajectories of the centres
    ice: NDArray[
        np.float64
    ]  # (N, 5) time, x, y, speed x, speed y when last tracked by itself, before an ambiguity
    born: NDArray[np.float64]  # (N,) s, first seen
    seen: NDArray[np.float64]  # (N,) s, last seen by itself
    shared: NDArray[np.float64]  # (N,) s, when it last shared a region
    whole: NDArray[np.float64]  # (N,) s, when it was last one region, or none
    missed: NDArray[np.float64]  # (N,) s for which it might have been seen since, and was not
    partly: NDArray[np.float64]  # (N,) s for which a side has been hidden
    hits: NDArray[np.int64]  # (N,) regions it had for itself
    scores: Float  # (N,) of its last region
    classes: NDArray[np.str_]  # (N,) of its last region
    hidden: NDArray[np.int8]  # (N,) bits of the hidden sides, in the order of SIDES
    surprise: NDArray[np.float64]  # (N, 2) where last seen, off where it was going, sizes; NaN if not by itself
    looks: Float  # (N, *GRID, 4) mean colour and share seen of every cell of the box
    first: NDArray[np.int64]  # (N,) the frame in which it was first seen
    latest: NDArray[np.int64]  # (N,) the last frame in which it had a region
    evidence: NDArray[np.float64]  # (N,) s for which it must be seen where it came in, before it is said
    entry: NDArray[np.int64]  # (N,) the entry zone in which it came in; -1 for none
    behind: NDArray[np.int64]  # (N,) the occluder behind which it is hidden; -1 for none

    def __len__(self) -> int:
        return len(self.keys)

    @property
    def boxes(self) -> Boxes:
        """Mean size round the centre (N, 4)."""
        return around(self.points[:, CENTRE], self.size)

    @property
    def frozen(self) -> NDArray[np.bool_]:
        """Which are ambiguous: kept in a compound, not tracked by themselves."""
        return (self.compound > 0) & ~self.temporary

    def take(self, rows: Index | NDArray[np.bool_]) -> Targets:
        """Return the named targets."""
        index = np.flatnonzero(rows) if rows.dtype == np.bool_ else rows
        columns = {name: getattr(self, name)[index] for name in _ARRAYS}
        return Targets(**columns, lines=self.lines.take(index))

    def join(self, others: Targets) -> Targets:
        """Return these targets and the others after them."""
        columns = {name: np.concatenate([getattr(self, name), getattr(others, name)]) for name in _ARRAYS}
        return Targets(**columns, lines=self.lines.join(others.lines))

    def with_(self, rows: ArrayLike, **values: ArrayLike) -> Targets:
        """Return targets with some columns changed on some rows."""
        changed = {}
        for name, value in values.items():
            column = getattr(self, name).copy()
            column[rows] = value
            changed[name] = column
        return self.replace(**changed)

    def replace(self, **columns: Any) -> Targets:
        """Return targets with whole columns in the place of others; `dataclasses.replace` would set every one anew."""
        changed = object.__new__(Targets)
        changed.__dict__.update(self.__dict__, **columns)
        return changed


_ARRAYS = tuple(one.name for one in fields(Targets) if one.name != "lines")


def newborn(frame: Frame, boxes: Boxes, scores: Float, classes: NDArray[np.str_], first_key: int) -> Targets:
    """Return a target for every box (N, 4), without an id."""
    count = len(boxes)
    none = np.zeros(count, np.int64)
    now = np.full(count, frame.time)
    size = np.maximum(sizes(boxes), 1.0)
    return Targets(
        keys=first_key + np.arange(count),
        ids=none,
        temporary=np.zeros(count, np.bool_),
        compound=none,
        within=none,
        points=generic_points(boxes),
        size=size,
        lines=Polylines.starting(frame.time, centres(boxes)),
        ice=np.zeros((count, 5)),
        born=now,
        seen=now,
        shared=np.full(count, -np.inf),
        whole=now,
        missed=np.zeros(count),
        partly=np.zeros(count),
        hits=np.ones(count, np.int64),
        scores=np.asarray(scores, np.float32),
        classes=np.asarray(classes, np.str_),
        hidden=np.zeros(count, np.int8),
        surprise=np.full((count, 2), np.nan),
        looks=np.zeros((count, *GRID, 4), np.float32),
        first=np.full(count, frame.index, np.int64),
        latest=np.full(count, frame.index, np.int64),
        evidence=np.zeros(count),
        entry=np.full(count, -1, np.int64),
        behind=np.full(count, -1, np.int64),
    )


def generic_points(boxes: Boxes) -> Float:
    """Return centre and middles of top, bottom, left and right side (N, 5, 2) of boxes (fig. 1)."""
    return np.asarray(centres(boxes)[:, None] + OFFSETS * sizes(boxes)[:, None], np.float32)


def around(centre: Float, size: Float) -> Boxes:
    """Return boxes (N, 4) of a size (N, 2) round centres (N, 2)."""
    half = size / 2
    return np.asarray(np.concatenate([centre - half, centre + half], axis=1), np.float32)


def motions(targets: Targets) -> Float:
    """Return the motion vectors (N, 2), px/s (IV.A): of the last segment if it is reliable, else of more of them."""
    return polyline.motion(targets.lines, TOLERANCE * extent(targets.size), _RELIABLE, _HORIZON).astype(np.float32)


def extended(targets: Targets, rows: Index, time: float, centre: Float, size: Float) -> Targets:
    """Return targets whose trajectories, on some rows, have one location (K, 2) more."""
    lines = polyline.extend(targets.lines, rows, time, centre, TOLERANCE * extent(size), _LONGEST)
    return targets.replace(lines=lines)


def extent(size: Float) -> NDArray[np.float64]:
    """Return the side (N,) of the square as large as a box of a size (N, 2)."""
    return np.asarray(np.sqrt(np.multiply(size[:, 0], size[:, 1], dtype=np.float64)), np.float64)


def predicted(targets: Targets, motion: Float, time: float, patience: float) -> Boxes:
    """Return the boxes (N, 4) where the motion vectors (N, 2) lead; a target unseen for long is thought to slow down."""
    elapsed = time - targets.lines.last[:, 0]
    reach = patience * -np.expm1(-elapsed / max(patience, 1e-6))
    centre = targets.lines.last[:, 1:] + motion * reach[:, None]
    return around(centre.astype(np.float32), targets.size)


def side_words(hidden: NDArray[np.int8]) -> list[str]:
    """Return 'left', 'top+right', … for the bits of hidden sides."""
    return ["+".join(word for bit, word in enumerate(SIDES) if bits >> bit & 1) for bits in hidden.tolist()]

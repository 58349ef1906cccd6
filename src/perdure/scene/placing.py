"""Rows put on the ground plane: where each stands, in metres, and how fast it goes.

A row stands where the middle of its box's lower edge is: the box is the whole thing as believed, so that hidden feet
are where the tracker believes them. A box that ends at the picture's lower border says nothing of feet: no place. The
speed is that of the straight line fitted to the places of the last second, of rows that were seen; it needs 0.4 s, and
begins anew when one who was hidden is seen again: where he comes out is not where he was believed to be.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from perdure.scene.ground import Ground, feet
from perdure.types import Ground as Place
from perdure.types import Status, Tracks

OVER = 1.0  # s, over which a speed is smoothed
_LEAST = 0.4  # s of places, from which there is a speed
_BORDER = 1.0  # px from the lower border
_SEEN = (Status.VISIBLE, Status.PARTLY_OCCLUDED, Status.AMBIGUOUS)
Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Paths:
    """The last places of each id: (N, 3) of time, x, y, none older than `OVER` before the newest row."""

    of: Mapping[int, Float]

    @staticmethod
    def none() -> Paths:
        """Return the paths before the first row."""
        return Paths(MappingProxyType({}))


def placed(ground: Ground, paths: Paths, rows: Tracks) -> tuple[Paths, Tracks]:
    """Return the paths after these rows, and the rows with their places and speeds."""
    if not len(rows):
        return paths, rows
    where = ground.places(feet(rows.boxes))
    where[np.abs(rows.boxes[:, 3] - ground.size[1]) <= _BORDER] = np.nan
    there = np.isfinite(where).all(axis=1)
    seen = there & np.isin(rows.status, _SEEN)
    now = float(rows.times.max())
    kept = {one: path[path[:, 0] > now - OVER] for one, path in paths.of.items()}
    found: list[Place | None] = [None] * len(rows)
    for identity in np.unique(rows.ids[there]).tolist():
        own = np.flatnonzero(there & (rows.ids == identity))
        new = own[seen[own]]
        path = np.concatenate([paths.of.get(identity, _NOWHERE), np.c_[rows.times[new], where[new]]])
        path = path[np.argsort(path[:, 0], kind="stable")]
        hidden = rows.times[rows.ids == identity][~np.isin(rows.status[rows.ids == identity], _SEEN)]
        path = path[path[:, 0] > hidden.max(initial=-np.inf)]
        for row in own.tolist():
            speed = _speed(path, float(rows.times[row])) if seen[row] else None
            found[row] = Place(round(float(where[row, 0]), 3), round(float(where[row, 1]), 3), speed)
        kept[identity] = path[path[:, 0] > now - OVER]
    return Paths({one: path for one, path in kept.items() if len(path)}), rows.replace(ground=tuple(found))


def _speed(path: Float, time: float) -> float | None:
    """The speed of the line through the places of the time before; None where they are too short."""
    lately = path[(path[:, 0] > time - OVER - 1e-9) & (path[:, 0] <= time)]
    if len(lately) < 2 or lately[-1, 0] - lately[0, 0] < _LEAST - 1e-9:
        return None
    off = lately - lately.mean(axis=0)
    return round(float(np.hypot(*(off[:, 0] @ off[:, 1:]))) / float(off[:, 0] @ off[:, 0]), 3)


_NOWHERE = np.zeros((0, 3))

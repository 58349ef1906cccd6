"""Pairs of boxes: how far they are from being one, and what share of one lies in another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel, kernel_for

Float = NDArray[np.float32]
Index = NDArray[np.int64]
Nearby = tuple[Index, Index, Float, NDArray[np.bool_]]
_SPECK = 1e-6  # no side and no area is smaller, where they divide


def distances(one: Float, other: Float) -> Float:
    """Return the distances (N, M) of boxes (N, 4) from others (M, 4), in [0, inf).

    1 - IoU where they overlap, else 1 + distance of the centres / the longest side of both.
    """
    found = np.empty((len(one), len(other)), np.float32)
    _distances(one, other, found)
    return found


@kernel_for(given(np.float32, 2), given(np.float32, 2), changed(np.float32, 2))
def _distances(one: Float, other: Float, found: Float) -> None:
    full, half = np.float32(1), np.float32(2)
    for n in range(len(one)):
        for m in range(len(other)):
            both = _shared(one, n, other, m)
            if both > 0:
                found[n, m] = full - both / (_area(one, n) + _area(other, m) - both)
                continue
            x = (one[n, 0] + one[n, 2]) / half - (other[m, 0] + other[m, 2]) / half
            y = (one[n, 1] + one[n, 3]) / half - (other[m, 1] + other[m, 3]) / half
            found[n, m] = np.sqrt(x * x + y * y) / _larger(_longest(one, n), _longest(other, m)) + full


def nearby(one: Float, other: Float, farthest: float, size_ratio: float) -> Nearby:
    """Return the pairs of boxes whose 1 - IoU is below `farthest`; boxes that do not touch are no pair.

    Parameters
    ----------
    one, other : (N, 4) and (M, 4) float32
        x1, y1, x2, y2.
    farthest : float
        In [0, 1].
    size_ratio : float
        Ratio of areas up to which two boxes are of similar size.

    Returns
    -------
    (K,) int, (K,) int, (K,) float32, (K,) bool
        Row in `one`, row in `other`, 1 - IoU, whether both are of similar size; in the order of the rows.
    """
    space, room = np.empty(len(other), np.float32), 4 * max(len(one), len(other))
    while True:
        rows, columns = np.empty(room, np.int64), np.empty(room, np.int64)
        apart, alike = np.empty(room, np.float32), np.empty(room, np.bool_)
        count = _nearby(
            one, other, np.float32(farthest), np.float32(size_ratio), space, rows, columns, apart, alike
        )
        if count <= room:
            return rows[:count], columns[:count], apart[:count], alike[:count]
        room = count


@kernel_for(
    given(np.float32, 2),
    given(np.float32, 2),
    np.float32,
    np.float32,
    changed(np.float32),
    changed(np.int64),
    changed(np.int64),
    changed(np.float32),
    changed(np.bool_),
)
def _nearby(
    one: Float,
    other: Float,
    limit: np.float32,
    ratio: np.float32,
    space: Float,
    rows: Index,
    columns: Index,
    apart: Float,
    alike: NDArray[np.bool_],
) -> int:
    """Write as many pairs as there is room for; return how many there are."""
    least, full, count = np.float32(_SPECK), np.float32(1), 0
    for m in range(len(other)):
        space[m] = _area(other, m)
    for n in range(len(one)):
        left, right, mine = one[n, 0], one[n, 2], _area(one, n)
        for m in range(len(other)):
            if _smaller(right, other[m, 2]) <= _larger(left, other[m, 0]):  # most are beside each other
                continue
            both = _shared(one, n, other, m)
            if both > 0:
                distance = full - both / (mine + space[m] - both)
                if distance < limit:
                    if count < len(rows):
                        rows[count], columns[count], apart[count] = n, m, distance
                        small = _larger(_smaller(mine, space[m]), least)
                        alike[count] = _larger(mine, space[m]) <= ratio * small
                    count += 1
    return count


def shares(one: Float, other: Float) -> Float:
    """Return what share (N, M), in [0, 1], of each of some boxes (N, 4) lies in each of others (M, 4)."""
    found = np.empty((len(one), len(other)), np.float32)
    _shares(one, other, found)
    return found


@kernel_for(given(np.float32, 2), given(np.float32, 2), changed(np.float32, 2))
def _shares(one: Float, other: Float, found: Float) -> None:
    for n in range(len(one)):
        whole = _larger(_area(one, n), np.float32(_SPECK))
        for m in range(len(other)):
            found[n, m] = _shared(one, n, other, m) / whole


@kernel
def _shared(one: Float, n: int, other: Float, m: int) -> np.float32:
    """Return the area that two boxes share."""
    across = _smaller(one[n, 2], other[m, 2]) - _larger(one[n, 0], other[m, 0])
    down = _smaller(one[n, 3], other[m, 3]) - _larger(one[n, 1], other[m, 1])
    return np.float32(across * down) if across > 0 and down > 0 else np.float32(0)


@kernel
def _area(boxes: Float, n: int) -> np.float32:
    nothing = np.float32(0)
    return _larger(boxes[n, 2] - boxes[n, 0], nothing) * _larger(boxes[n, 3] - boxes[n, 1], nothing)


@kernel
def _longest(boxes: Float, n: int) -> np.float32:
    return _larger(_larger(boxes[n, 2] - boxes[n, 0], boxes[n, 3] - boxes[n, 1]), np.float32(_SPECK))


@kernel
def _larger(one: np.float32, other: np.float32) -> np.float32:
    return one if one >= other else other


@kernel
def _smaller(one: np.float32, other: np.float32) -> np.float32:
    return one if one <= other else other


def distances_twin(one: Float, other: Float) -> Float:
    """Do the same with whole matrices: the oracle of `distances`."""
    both = _shared_twin(one, other)
    overlap = np.divide(both, _areas(one)[:, None] + _areas(other) - both, out=np.zeros_like(both), where=both > 0)
    centres = [(boxes[:, :2] + boxes[:, 2:]) / 2 for boxes in (one, other)]
    x, y = centres[0].T[:, :, None] - centres[1].T[:, None, :]  # (N, M) each
    sides = [(boxes[:, 2:] - boxes[:, :2]).max(axis=1, initial=_SPECK) for boxes in (one, other)]
    apart = np.sqrt(x * x + y * y) / np.maximum(sides[0][:, None], sides[1])
    return np.asarray(np.where(both > 0, 1 - overlap, 1 + apart), np.float32)


def nearby_twin(one: Float, other: Float, farthest: float, size_ratio: float) -> Nearby:
    """Do the same with whole matrices: the oracle of `nearby`."""
    shared = _shared_twin(one, other)
    row, column = np.nonzero(shared)
    both, mine, theirs = shared[row, column], _areas(one)[row], _areas(other)[column]
    distance = 1 - both / (mine + theirs - both)
    alike = np.maximum(mine, theirs) <= size_ratio * np.maximum(np.minimum(mine, theirs), _SPECK)
    kept = distance < farthest
    return row[kept], column[kept], distance[kept], alike[kept]


def shares_twin(one: Float, other: Float) -> Float:
    """Do the same with whole matrices: the oracle of `shares`."""
    return np.asarray(_shared_twin(one, other) / np.maximum(_areas(one), _SPECK)[:, None], np.float32)


def _shared_twin(one: Float, other: Float) -> Float:
    across = np.minimum(one[:, 2, None], other[:, 2]) - np.maximum(one[:, 0, None], other[:, 0])  # (N, M)
    down = np.minimum(one[:, 3, None], other[:, 3]) - np.maximum(one[:, 1, None], other[:, 1])  # (N, M)
    return np.asarray(np.maximum(across, 0) * np.maximum(down, 0), np.float32)


def _areas(boxes: Float) -> Float:
    return np.asarray(np.maximum(boxes[:, 2:] - boxes[:, :2], 0).prod(axis=1), np.float32)

"""A spatial pyramid over a box (Grauman & Darrell 2005), as sections 2.1.5 and 2.1.6 use it.

Level i has 2^i x 2^i cells. Of each level the half of the cells with the lowest distance is averaged, so that what is
hidden drops out; of n cells that can be compared ⌈n/2⌉ are the half. Levels are weighed with 1/2^(L - i), L the last one,
normalised to sum to 1 over those that have a cell. What is added up over pixels is added up for the finest cells only:
the coarser ones are their sums, which is what integral images would give.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating]
Number = TypeVar("Number", bound=np.number)


def cells_of(levels: int) -> int:
    """Return how many cells all levels have together.

    >>> cells_of(3)
    21
    """
    return int(4**levels - 1) // 3


def with_coarser(finest: NDArray[Number]) -> NDArray[Number]:
    """Return the sums (N, cells, ...) of all levels, the coarsest first, from those of the finest (N, 2^L, 2^L, ...)."""
    levels = [finest]
    while levels[0].shape[1] > 1:
        count, side, _, *rest = levels[0].shape
        levels.insert(
            0, levels[0].reshape(count, side // 2, 2, side // 2, 2, *rest).sum(axis=(2, 4), dtype=finest.dtype)
        )
    return np.concatenate([one.reshape(len(one), one.shape[1] ** 2, *one.shape[3:]) for one in levels], axis=1)


def pyramid_distance(distances: Float) -> NDArray[np.float32]:
    """Return the distance (P,) of pairs from those of their cells (P, cells), inf where there is nothing to compare.

    A level of which nothing can be compared does not count; inf where no level can.

    >>> pyramid_distance(np.array([[4.0, 0.0, 1.0, np.inf, 9.0]]))  # (1/3) 4 + (2/3) (0 + 1) / 2
    array([1.6666666], dtype=float32)
    """
    pairs, cells = distances.shape
    total, weights = np.zeros(pairs), np.zeros(pairs)
    begin, level = 0, 0
    while begin < cells:
        near = np.sort(distances[:, begin : begin + 4**level], axis=1)  # inf last
        half = (np.isfinite(near).sum(axis=1) + 1) // 2  # (P,)
        counted = np.arange(4**level) < half[:, None]  # (P, 4^level)
        mean = np.where(counted, near, 0.0).sum(axis=1) / np.maximum(half, 1)
        weight = 2.0**level * (half > 0)
        total, weights = total + weight * mean, weights + weight
        begin, level = begin + 4**level, level + 1
    distance = np.divide(total, weights, out=np.full(pairs, np.inf), where=weights > 0)
    return np.asarray(distance, np.float32)

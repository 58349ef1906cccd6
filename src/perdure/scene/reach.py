"""Who can have got where: targets and regions compared on the ground, in metres, instead of in pixels.

A target stands about where it was expected: the less surely, the longer ago it was seen (it may have changed its mind
by so many metres a second), and the fewer pixels a metre there is. A region that lies `DEVIATIONS` or more off, or is
as many higher or lower, is not the target, however much the boxes overlap. One that has no place is not compared.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.scene.ground import Ground, feet
from perdure.scene.lens import Float
from perdure.types import Boxes

DEVIATIONS = 5.0
_FOOT = (0.08, 0.06)  # deviations of a foot's x and y, in widths and heights of the box
_TALL = 0.14  # of the logarithm of two heights' ratio
_LEAST = 1.0  # px


def within_reach(
    ground: Ground, expected: Boxes, elapsed: NDArray[np.float64], regions: Boxes, wander: float
) -> NDArray[np.bool_]:
    """Return which pairs (K,) may be one thing.

    Parameters
    ----------
    ground : Ground
        Where it lies.
    expected : (K, 4)
        Boxes in which the targets are expected.
    elapsed : (K,)
        Seconds since each was seen.
    regions : (K, 4)
        Boxes of the regions.
    wander : float
        Metres a second by which a target may stray from where it was expected (one deviation).
    """
    if not len(expected):
        return np.ones(0, np.bool_)
    wandered = ((wander * elapsed) ** 2)[:, None, None] * np.eye(2)
    gap = ground.places(feet(regions)) - ground.places(feet(expected))  # (K, 2)
    total = _jitter(ground, expected) + _jitter(ground, regions) + wandered  # (K, 2, 2)
    with np.errstate(all="ignore"):
        tall = np.log(ground.heights(regions) / ground.heights(expected)) / _TALL
        return ~((_squared(gap, total) > DEVIATIONS**2) | (np.abs(tall) > DEVIATIONS))


def _squared(gap: Float, spread: Float) -> Float:
    """Squared deviations (K,) of gaps (K, 2) with covariances (K, 2, 2); NaN where there is none."""
    (xx, xy), (_, yy) = spread.transpose(1, 2, 0)
    x, y = gap.T
    return np.asarray((yy * x**2 - 2 * xy * x * y + xx * y**2) / (xx * yy - xy**2), np.float64)


def _jitter(ground: Ground, boxes: Boxes) -> Float:
    sides = np.asarray(boxes[:, 2:] - boxes[:, :2], np.float64)
    return ground.jitter(feet(boxes), np.maximum(sides * _FOOT, _LEAST))

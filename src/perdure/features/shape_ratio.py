"""Shape ratio: how wide a box is for its height (feature 3, eq. 2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import sizes
from perdure.features.feature import Float, Memory
from perdure.types import Frame, Regions, Scene


@dataclass(frozen=True)
class ShapeRatio:
    """min(W/H, W'/H') / max(W/H, W'/H')."""

    name = "shape_ratio"
    needs_pixels = False
    moves = False
    varies = True

    def start(self, scene: Scene) -> Memory:
        """Return nothing: nothing is carried along."""
        return {}

    def describe(self, memory: Memory, frame: Frame, regions: Regions) -> tuple[Memory, Float]:
        """Return width over height (N, 1); 0 for a box without area."""
        width, height = sizes(regions.boxes).T
        there = (width > 0) & (height > 0)
        ratio = np.divide(width, height, out=np.zeros_like(width), where=there)
        return memory, ratio[:, None]

    def similarity(self, one: Float, other: Float, elapsed: NDArray[np.floating]) -> Float:
        """Return the smaller ratio over the larger (P,) (eq. 2); 0 where one is not known."""
        return less_over_more(one[:, 0], other[:, 0])


def less_over_more(one: Float, other: Float) -> Float:
    """Return min / max (P,) of numbers ≥ 0; 0 where both are 0.

    >>> less_over_more(np.array([2.0, 0.0], np.float32), np.array([4.0, 0.0], np.float32)).tolist()
    [0.5, 0.0]
    """
    less, more = np.minimum(one, other), np.maximum(one, other)
    return np.asarray(np.divide(less, more, out=np.zeros_like(more), where=more > 0), np.float32)

"""Overlap of boxes: intersection over union (ours; not among the paper's eight).

Of what is carried on along a trajectory it says more than the displacement of centres, and needs no scale.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import centres, sizes
from perdure.features.feature import Float, Memory
from perdure.types import Frame, Regions, Scene


@dataclass(frozen=True)
class Overlap:
    """Intersection over union of the boxes."""

    name = "overlap"
    needs_pixels = False
    moves = True
    varies = False

    def start(self, scene: Scene) -> Memory:
        """Return nothing: nothing is carried along."""
        return {}

    def describe(self, memory: Memory, frame: Frame, regions: Regions) -> tuple[Memory, Float]:
        """Return centres and sizes (N, 4) in pixels; zeros for a box without area."""
        extent = sizes(regions.boxes)
        rows = np.concatenate([centres(regions.boxes), extent], axis=1)  # (N, 4)
        rows[(extent <= 0).any(axis=1)] = 0.0
        return memory, rows

    def similarity(self, one: Float, other: Float, elapsed: NDArray[np.floating]) -> Float:
        """Return intersection over union (P,)."""
        size, theirs = np.maximum(one[:, 2:], 0.0), np.maximum(other[:, 2:], 0.0)
        low = np.maximum(one[:, :2] - size / 2, other[:, :2] - theirs / 2)
        high = np.minimum(one[:, :2] + size / 2, other[:, :2] + theirs / 2)
        shared = np.maximum(high - low, 0.0).prod(axis=1)
        union = size.prod(axis=1) + theirs.prod(axis=1) - shared
        return np.asarray(np.divide(shared, union, out=np.zeros_like(shared), where=union > 0), np.float32)

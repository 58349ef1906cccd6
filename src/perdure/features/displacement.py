"""Displacement in the picture: how far a thing would have moved (feature 2, eq. 1).

The paper gives D_max in pixels a frame. Here it is in heights of the thing a second, so that one number does for near
and far things and for every frame rate, and a part of a height is allowed at any time: boxes jitter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import centres, sizes
from perdure.features.feature import Float, Memory
from perdure.params import parameter
from perdure.types import Frame, Regions, Scene


@dataclass(frozen=True)
class Displacement:
    """max(0, 1 - d / (slack + D_max t)), with d between centres, in heights of the larger box."""

    farthest: float = parameter(
        1.0, "how far a thing may go in the picture", unit="heights/s", low=0.01, high=1000.0, symbol="D_max"
    )
    slack: float = parameter(0.5, "how far its box may jitter", unit="heights", low=0.01, high=100.0)

    name = "displacement_2d"
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
        """Return how near (P,) they are for the time between them (eq. 1)."""
        way = np.hypot(one[:, 0] - other[:, 0], one[:, 1] - other[:, 1])
        height = np.maximum(np.maximum(one[:, 3], other[:, 3]), 1.0)
        return np.asarray(
            np.maximum(0.0, 1.0 - way / (height * (self.slack + self.farthest * elapsed))), np.float32
        )

"""Area: how large a box is (feature 4, eq. 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import areas
from perdure.features.feature import Float, Memory
from perdure.features.shape_ratio import less_over_more
from perdure.types import Frame, Regions, Scene


@dataclass(frozen=True)
class Area:
    """min(W H, W' H') / max(W H, W' H')."""

    name = "area"
    needs_pixels = False
    moves = False
    varies = True

    def start(self, scene: Scene) -> Memory:
        """Return nothing: nothing is carried along."""
        return {}

    def describe(self, memory: Memory, frame: Frame, regions: Regions) -> tuple[Memory, Float]:
        """Return areas (N, 1) in square pixels."""
        return memory, areas(regions.boxes)[:, None]

    def similarity(self, one: Float, other: Float, elapsed: NDArray[np.floating]) -> Float:
        """Return the smaller area over the larger (P,) (eq. 3); 0 where one is not known."""
        return less_over_more(one[:, 0], other[:, 0])

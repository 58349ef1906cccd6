"""Colour histogram: which colours a thing's pixels have, wherever they are (feature 5, eq. 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Float, Memory
from perdure.features.pixels import pixels_of
from perdure.params import parameter
from perdure.types import Frame, Regions, Scene


@dataclass(frozen=True)
class ColourHistogram:
    """Σ min(H, H') / 3 over K bins of each of R, G and B, each channel summing to 1."""

    bins: int = parameter(16, "bins of a colour channel", low=1, high=256, symbol="K")

    name = "histogram"
    needs_pixels = True
    moves = False
    varies = True

    def start(self, scene: Scene) -> Memory:
        """Return nothing: nothing is carried along."""
        return {}

    def describe(self, memory: Memory, frame: Frame, regions: Regions) -> tuple[Memory, Float]:
        """Return histograms (N, 3 K); zeros where no pixel is seen."""
        from perdure.maths.kernels.colours import count_channels

        counts = np.zeros((len(regions), 3, self.bins), np.int64)
        if frame.image is not None:
            for row, y, x, step, bits in pixels_of(regions, *frame.image.shape[:2]):
                height, width = bits.shape
                part = frame.image[y : y + height * step : step, x : x + width * step : step]
                count_channels(part, bits, counts[row])
        totals = np.maximum(counts.sum(axis=2, keepdims=True), 1)
        return memory, (counts / totals).reshape(len(regions), 3 * self.bins).astype(np.float32)

    def similarity(self, one: Float, other: Float, elapsed: NDArray[np.floating]) -> Float:
        """Return what histograms have in common (P,) (eq. 4)."""
        return np.asarray(np.minimum(np.minimum(one, other).sum(axis=1) / 3.0, 1.0), np.float32)

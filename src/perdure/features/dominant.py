"""Dominant colours: the few colours that most of a thing's pixels have, and where (feature 8, eq. 9).

MPEG-7's description of each cell of a pyramid: colours and their shares of the pixels, found by Lloyd's iteration over
counts of coarse colours; compared by the similarity of Yang et al. (2008).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Float, Memory
from perdure.features.pixels import pixels_of
from perdure.features.pyramid import cells_of, pyramid_distance, with_coarser
from perdure.params import parameter
from perdure.types import Frame, Regions, Scene


@dataclass(frozen=True)
class DominantColours:
    """1 - d, d the pyramid's distance of dominant colours."""

    colours: int = parameter(4, "dominant colours of a cell at most", low=1, high=16, symbol="A")
    apart: float = parameter(
        30.0,
        "distance of colours from which they are not alike",
        unit="grey levels",
        low=1.0,
        high=442.0,
        symbol="T_d",
    )
    levels: int = parameter(3, "levels of the pyramid", low=1, high=4)
    fewest: int = parameter(12, "pixels that a cell must have to count", unit="px", low=1, high=100000)

    name = "dominant"
    needs_pixels = True
    moves = False
    varies = True

    def start(self, scene: Scene) -> Memory:
        """Return nothing: nothing is carried along."""
        return {}

    def describe(self, memory: Memory, frame: Frame, regions: Regions) -> tuple[Memory, Float]:
        """Return colours and shares (N, cells, A, 4): R, G, B from 0 to 255, and parts of the cell's pixels.

        A cell with too few pixels is zeros.
        """
        from perdure.maths.kernels.dominant import BINS, dominant, tally

        cells, side = cells_of(self.levels), 2 ** (self.levels - 1)
        found = np.zeros((len(regions), cells, self.colours, 4), np.float32)
        if frame.image is None:
            return memory, found
        points, room = np.empty((BINS, 4)), np.empty((2 * self.colours, 4))
        for row, y, x, step, bits in pixels_of(regions, *frame.image.shape[:2]):
            height, width = bits.shape
            part = frame.image[y : y + height * step : step, x : x + width * step : step]
            rows, columns = _cells(regions.boxes[row], y, x, step, bits.shape, side)
            finest = np.zeros((side * side, BINS, 4), np.int32)
            tally(part, bits, rows * side, columns, finest)
            sums = with_coarser(finest.reshape(1, side, side, BINS, 4))[0]
            dominant(sums, self.fewest, self.apart, _ROUNDS, points, room, found[row])
        return memory, found

    def similarity(self, one: Float, other: Float, elapsed: NDArray[np.floating]) -> Float:
        """Return how alike (P,) dominant colours are (eq. 9); 0 where nothing can be compared."""
        from perdure.maths.kernels.dominant import unlikeness

        pairs, cells = one.shape[:2]
        distances = np.empty(pairs * cells, np.float32)
        shape = (-1, self.colours, 4)
        unlikeness(one.reshape(shape), other.reshape(shape), self.apart, self.apart * _SPAN, distances)
        return np.asarray(np.maximum(0.0, 1.0 - pyramid_distance(distances.reshape(pairs, cells))), np.float32)


_ROUNDS = 4  # of Lloyd's iteration
_SPAN = 1.0  # d_max / T_d


def _cells(
    box: Float, y: int, x: int, step: int, shape: tuple[int, ...], side: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Which row and column of cells each row and column of pixels is in."""
    x1, y1, x2, y2 = box.tolist()
    down = (y + 0.5 + step * np.arange(shape[0]) - y1) / (y2 - y1) * side
    across = (x + 0.5 + step * np.arange(shape[1]) - x1) / (x2 - x1) * side
    return np.clip(down.astype(np.int64), 0, side - 1), np.clip(across.astype(np.int64), 0, side - 1)

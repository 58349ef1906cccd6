"""Colour covariance: how place, colours and gradients of a thing's pixels go together (feature 7, eq. 7 and 8).

Each cell of a pyramid has the covariance of eleven descriptors: x, y, R, G, B, and magnitude and orientation of the
gradient of each channel. Adding a constant to all colours does not change it, nor does the size of the box. Departures:
places are parts of the box; an orientation is that of the line, mirrored to 0 to π/2 as Tuzel et al. have it, since an
angle that wraps has no covariance; a part of its trace is added to each diagonal.
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
class ColourCovariance:
    """max(0, 1 - d / D_max), d the pyramid's distance of covariances."""

    farthest: float = parameter(
        6.0, "distance of covariances that have nothing in common", low=0.01, high=1000.0, symbol="D_cov_max"
    )
    levels: int = parameter(3, "levels of the pyramid", low=1, high=4)
    fewest: int = parameter(30, "pixels that a cell must have to count", unit="px", low=1, high=100000)
    ridge: float = parameter(0.001, "what is added to variances, as a part of their mean", low=1e-6, high=1.0)

    name = "covariance"
    needs_pixels = True
    moves = False
    varies = True

    def start(self, scene: Scene) -> Memory:
        """Return nothing: nothing is carried along."""
        return {}

    def describe(self, memory: Memory, frame: Frame, regions: Regions) -> tuple[Memory, Float]:
        """Return the Cholesky factors of the cells' covariances (N, cells, 66), lower triangles row by row.

        A cell with too few pixels is zeros.
        """
        from perdure.maths.kernels.covariances import PACKED, SIZE, WIDE, add_products, factor

        cells, side = cells_of(self.levels), 2 ** (self.levels - 1)
        if frame.image is None:
            return memory, np.zeros((len(regions), cells, PACKED), np.float32)
        finest = np.zeros((len(regions), side * side, WIDE * WIDE))
        boxes, one = regions.boxes.astype(np.float64), np.empty(WIDE)
        for row, y, x, step, bits in pixels_of(regions, *frame.image.shape[:2]):
            add_products(frame.image, bits, y, x, step, boxes[row], side, one, finest[row])
        sums = with_coarser(finest.reshape(len(regions), side, side, WIDE * WIDE)).reshape(-1, WIDE * WIDE)
        factors = np.empty((len(sums), PACKED), np.float32)
        factor(sums, self.fewest, self.ridge, _FLOOR, np.empty((SIZE, SIZE)), factors)
        return memory, factors.reshape(len(regions), cells, PACKED)

    def similarity(self, one: Float, other: Float, elapsed: NDArray[np.floating]) -> Float:
        """Return how alike (P,) covariances are (eq. 8); 0 where nothing can be compared."""
        return np.asarray(np.maximum(0.0, 1.0 - self.distance(one, other) / self.farthest), np.float32)

    def distance(self, one: Float, other: Float) -> Float:
        """Return the pyramid's distance d_cov (P,); inf where nothing can be compared."""
        from perdure.maths.kernels.covariances import WIDE, forstner

        pairs, cells, packed = one.shape
        distances = np.empty(pairs * cells, np.float32)
        room, rows = np.empty((2 * WIDE, WIDE)), np.empty((4, WIDE))
        forstner(one.reshape(-1, packed), other.reshape(-1, packed), room, rows, distances)
        return pyramid_distance(distances.reshape(pairs, cells))


_FLOOR = 1e-6  # variance, of descriptors about 1 wide: a quarter of a grey level

"""Heavy tails: Student's distribution with three degrees of freedom, in the plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for

Float = NDArray[np.float32]


@kernel_for(
    given(np.float32, 3, "C"), given(np.float32), given(np.float32), np.float32, np.float32, changed(np.float32, 2)
)
def student_ratios(
    vectors: Float, middle: Float, spread: Float, rest: np.float32, bound: np.float32, out: Float
) -> None:
    """Write the log ratio of two densities at every vector, within ± bound: about a middle, and about zero.

    Each is (1 + ‖vector / spread‖² / 2) to the power of -1.5, over the product of the spreads.

    Parameters
    ----------
    vectors : (H, W, 2) float32
        All finite.
    middle, spread : (2,) float32
        Of the density above the line; spread > 0.
    rest : float32
        > 0, the spread of the density below, in both directions.
    bound : float32
        ≥ 0.
    out : (H, W) float32, changed
        Every element is written.
    """
    one, half = np.float32(1.0), np.float32(0.5)
    x0, y0, across, down, still = middle[0], middle[1], one / spread[0], one / spread[1], one / rest
    constant = np.log(rest * across * rest * down)
    for v in range(out.shape[0]):
        for u in range(out.shape[1]):
            x, y = vectors[v, u, 0], vectors[v, u, 1]
            a, b, c, d = (x - x0) * across, (y - y0) * down, x * still, y * still
            ratio = (one + half * (c * c + d * d)) / (one + half * (a * a + b * b))
            out[v, u] = min(max(np.float32(1.5) * np.log(ratio) + constant, -bound), bound)


def student_ratios_twin(
    vectors: Float, middle: Float, spread: Float, rest: np.float32, bound: np.float32, out: Float
) -> None:
    """Do the same in NumPy: the oracle of `student_ratios`."""
    away = (vectors.astype(np.float64) - middle) / spread
    still = vectors / np.float64(rest)
    own = -1.5 * np.log1p((away**2).sum(axis=2) / 2) - np.log(spread).sum()
    other = -1.5 * np.log1p((still**2).sum(axis=2) / 2) - 2 * np.log(rest)
    out[...] = np.clip(own - other, -bound, bound)

"""How much the pixels of a picture differ from their neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for
from perdure.maths.maxflow import STEPS

Float = NDArray[np.float32]


@kernel_for(given(np.float32, 3, "C"), changed(np.float32, 3))
def squared_differences(colours: Float, out: Float) -> float:
    """Write the squared distance of each pixel's colour from its neighbours'; return the sum of all.

    Parameters
    ----------
    colours : (H, W, 3) float32
        All finite.
    out : (4, H, W) float32, changed
        To the neighbours E, S, SE, SW; 0 where there is none.
    """
    height, width, total = colours.shape[0], colours.shape[1], 0.0
    for d in range(4):
        down, right = (0, 1) if d == 0 else (1, 0 if d == 1 else (1 if d == 2 else -1))
        for y in range(height):
            sum_of_row = 0.0
            begin, end = max(-right, 0), min(width - right, width) if y + down < height else 0
            for x in range(width):
                squared = np.float32(0.0)
                if begin <= x < end:
                    one, other = colours[y, x], colours[y + down, x + right]
                    a, b, c = one[0] - other[0], one[1] - other[1], one[2] - other[2]
                    squared = a * a + b * b + c * c
                out[d, y, x] = squared
                sum_of_row += float(squared)
            total += sum_of_row
    return total


def squared_differences_twin(colours: Float, out: Float) -> float:
    """Do the same in NumPy: the oracle of `squared_differences`."""
    height, width = colours.shape[:2]
    out[...] = 0
    for one, (down, right) in zip(out, STEPS, strict=True):
        left, end = max(0, -right), width - max(0, right)
        off = colours[: height - down, left:end] - colours[down:, left + right : end + right]
        one[: height - down, left:end] = (off**2).sum(axis=2)
    return float(out.sum(dtype=np.float64))

"""Means and variances of what each place looks like, learnt where nothing is before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for

Bits = NDArray[np.bool_]
Float = NDArray[np.float32]
NEAR, QUICK, SLOW = (
    9.0,
    0.1,
    0.02,
)  # variances within which a colour is the one known; by which this, and another, is learnt


@kernel_for(
    given(np.uint8, 3, "C"),
    given(np.bool_, 2, "C"),
    np.float32,
    changed(np.float32, 3),
    changed(np.float32, 2),
    changed(np.bool_, 2),
)
def learn(
    colours: NDArray[np.uint8], things: Bits, floor: np.float32, mean: Float, variance: Float, known: Bits
) -> None:
    """Learn the colours of a frame wherever nothing is before the backdrop; take over what is seen there first.

    Parameters
    ----------
    colours : (H, W, 3) uint8
        Of the frame.
    things : (H, W) bool
        Where something is before it.
    floor : float32
        Least variance by which it is judged whether a colour is near the one known.
    mean : (H, W, 3) float32, changed
        The backdrop.
    variance : (H, W) float32, changed
        Of one channel.
    known : (H, W) bool, changed
        Where it has ever been seen.
    """
    quick, slow, near, third = np.float32(QUICK), np.float32(SLOW), np.float32(NEAR), np.float32(1 / 3)
    for row in range(known.shape[0]):
        for column in range(known.shape[1]):
            if things[row, column]:
                continue
            a = np.float32(colours[row, column, 0]) - mean[row, column, 0]
            b = np.float32(colours[row, column, 1]) - mean[row, column, 1]
            c = np.float32(colours[row, column, 2]) - mean[row, column, 2]
            if not known[row, column]:
                known[row, column] = True
                rate = np.float32(1)
            else:
                square = (a * a + b * b + c * c) * third
                rate = quick if square < near * max(variance[row, column], floor) else slow
                variance[row, column] += rate * (square - variance[row, column])
            mean[row, column, 0] += rate * a
            mean[row, column, 1] += rate * b
            mean[row, column, 2] += rate * c


def learn_twin(
    colours: NDArray[np.uint8], things: Bits, floor: np.float32, mean: Float, variance: Float, known: Bits
) -> None:
    """Do the same in NumPy: the oracle of `learn`."""
    off = colours - mean
    square = (off**2).mean(axis=2)
    rate = np.where(square < NEAR * np.maximum(variance, floor), QUICK, SLOW)
    seen, fresh = ~things & known, ~things & ~known
    variance[seen] += (rate * (square - variance))[seen]
    mean[seen] += (rate[..., None] * off)[seen]
    mean[fresh] = colours[fresh]
    known |= fresh

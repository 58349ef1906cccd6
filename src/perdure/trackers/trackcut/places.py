"""Which colours were the object's at which place: votes of the pixels of the frame before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]
_LEVELS = 16  # of each colour channel
_CELL = 16  # cells of the window, a side of the places
_EPSILON = 0.02  # votes of nobody


def vote(before: NDArray[np.uint8], own: NDArray[np.bool_], colours: NDArray[np.uint8], bound: float) -> Float:
    """Return ln of votes for and against (h, w), within ± bound.

    A pixel of the frame before votes where it is now, and one place further all round, for what has its colour or one
    much alike.

    Parameters
    ----------
    before : (h, w, 3) uint8
        Colours of the frame before, carried to where they are now.
    own : (h, w) bool
        Which were the object's.
    colours : (h, w, 3) uint8
        Those of now.
    bound : float
        Nats.
    """
    height, width = own.shape
    rows, columns = -(-height // _CELL), -(-width // _CELL)
    y, x = np.mgrid[:height, :width]
    place = ((y // _CELL) * columns + x // _CELL) * _LEVELS**3
    shape = (rows, columns, _LEVELS, _LEVELS, _LEVELS)
    cell = place + _colour(before)
    size = int(np.prod(shape))
    votes = [np.bincount(cell[which], minlength=size).astype(np.float32).reshape(shape) for which in (own, ~own)]
    asked = place + _colour(colours)
    for_it, against = (_spread(one).ravel()[asked] for one in votes)
    return np.asarray(np.clip(np.log((for_it + _EPSILON) / (against + _EPSILON)), -bound, bound), np.float32)


def _colour(colours: NDArray[np.uint8]) -> NDArray[np.intp]:
    level = (colours // (256 // _LEVELS)).astype(np.intp)
    return (level[..., 0] * _LEVELS + level[..., 1]) * _LEVELS + level[..., 2]


def _spread(votes: Float) -> Float:
    """Means over 3 cells in every direction."""
    out = votes
    for axis in range(5):
        out = _along(out, axis)
    return out


def _along(votes: Float, axis: int) -> Float:
    out = votes.copy()
    ahead = [slice(None)] * votes.ndim
    behind = [slice(None)] * votes.ndim
    ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
    out[tuple(ahead)] += votes[tuple(behind)]
    out[tuple(behind)] += votes[tuple(ahead)]
    out /= 3
    return out

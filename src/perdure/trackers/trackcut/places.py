"""Which colours were the object's at which place: votes of the pixels of the frame before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]


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
    from perdure.maths.kernels.votes import BINS, bins_of, weigh

    bins = np.empty((2, *own.shape), np.int32)
    for one, seen in zip(bins, (before, colours), strict=True):
        bins_of(np.ascontiguousarray(seen), one)
    out, room = np.empty(own.shape, np.float32), np.zeros((2, BINS), np.int32)
    weigh(bins[0], np.ascontiguousarray(own), bins[1], np.float32(bound), room, np.empty(BINS, np.float32), out)
    return out

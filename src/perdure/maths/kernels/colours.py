"""Counts of the colours of a region's pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for

Bytes = NDArray[np.uint8]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


@kernel_for(given(np.uint8, 3), given(np.bool_, 2), changed(np.int64, 2))
def count_channels(colours: Bytes, bits: Bools, counts: Ints) -> None:
    """Add to counts (3, K) the pixels of colours (h, w, 3) with a bit, by channel and bin."""
    bins = counts.shape[1]
    for y in range(bits.shape[0]):
        for x in range(bits.shape[1]):
            if bits[y, x]:
                for channel in range(3):
                    counts[channel, np.int64(colours[y, x, channel]) * bins >> 8] += 1


def count_channels_twin(colours: Bytes, bits: Bools, counts: Ints) -> None:
    """Do the same with a histogram a channel: the oracle of `count_channels`."""
    edges = np.arange(counts.shape[1] + 1) * 256 / counts.shape[1]
    for channel in range(3):
        counts[channel] += np.histogram(colours[bits, channel], edges)[0]

"""Basins of a relief, kept apart where the pass between two of them is narrow: a watershed from the peaks down.

Each pixel, from the highest down, joins the basin of its neighbours or founds one. Where it is the pass between two,
these become one, unless the pass lies low beside both peaks and both are large: the saliency of Najman & Schmitt
(1996), here of the distance to the border, so that what is told apart are bodies joined by a neck.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel, kernel_for


def basins(
    relief: NDArray[np.uint16],
    order: NDArray[np.int64],
    neck: float,
    least_peak: float,
    least_share: float,
    least_area: float,
) -> NDArray[np.int32]:
    """Return the basin of every pixel, (H, W) int32; 0 where the relief is 0.

    Parameters
    ----------
    relief : (H, W) uint16
        0 outside.
    order : (P,) int64
        The flat places of all pixels above 0, the highest first.
    neck : float
        Two basins stay apart where the pass is below this share of the lower peak,
    least_peak, least_share : float
        the lower peak is at least this share of the higher one, the smaller area this share of the larger,
    least_area : float
        and both have at least so many pixels when they meet.
    """
    height, width = relief.shape
    labels = np.zeros(relief.size, np.int32)
    parent, peaks = np.zeros(len(order), np.int32), np.zeros((2, len(order)))
    heights = np.ascontiguousarray(relief).reshape(-1)
    _basins(
        heights,
        height,
        width,
        order,
        neck,
        least_peak,
        least_share,
        least_area,
        labels,
        parent,
        peaks[0],
        peaks[1],
    )
    return labels.reshape(relief.shape)


@kernel_for(
    given(np.uint16, 1, "C"),
    int,
    int,
    given(np.int64),
    float,
    float,
    float,
    float,
    changed(np.int32),
    changed(np.int32),
    changed(np.float64),
    changed(np.float64),
)
def _basins(
    heights: NDArray[np.uint16],
    height: int,
    width: int,
    order: NDArray[np.int64],
    neck: float,
    least_peak: float,
    least_share: float,
    least_area: float,
    labels: NDArray[np.int32],
    parent: NDArray[np.int32],
    peak: NDArray[np.float64],
    area: NDArray[np.float64],
) -> None:
    """Write labels; `parent`, `peak` and `area` are of the basins. All are 0 before."""
    count = 0
    for place in order:
        y, x = place // width, place % width
        mine = -1
        for other_y in range(y - 1 if y > 0 else 0, y + 2 if y + 2 < height else height):
            for other_x in range(x - 1 if x > 0 else 0, x + 2 if x + 2 < width else width):
                label = labels[other_y * width + other_x]
                if label == 0:
                    continue
                other = _root(parent, label - 1)
                if mine < 0:
                    mine = other
                elif other != mine:
                    high, low = (mine, other) if peak[mine] >= peak[other] else (other, mine)
                    small, large = area[high], area[low]
                    if small > large:
                        small, large = large, small
                    apart = heights[place] < neck * peak[low] and peak[low] >= least_peak * peak[high]
                    if not (apart and small >= least_share * large and small >= least_area):
                        parent[low] = high
                        area[high] += area[low]
                    mine = high
        if mine < 0:
            mine, count = count, count + 1
            parent[mine], peak[mine] = mine, heights[place]
        labels[place] = mine + 1
        area[mine] += 1
    for place in order:
        labels[place] = _root(parent, labels[place] - 1) + 1


@kernel
def _root(parent: NDArray[np.int32], basin: int) -> int:
    while parent[basin] != basin:
        basin = parent[basin]
    return basin

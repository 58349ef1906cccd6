"""What is doubtful is kept where it is enclosed by what is sure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, kernel, kernel_for

LEFT, RIGHT, ABOVE, BELOW = 1, 2, 4, 8
BESIDE = LEFT | RIGHT
ALL_BUT_BELOW = BESIDE | ABOVE
PARTLY = 254  # what is enclosed, but not on all four sides


def enclosed(seen: NDArray[np.uint8], reach: NDArray[np.uint8]) -> None:
    """Turn doubtful pixels that sure ones enclose into sure ones, in place: 255 if on all four sides, else PARTLY.

    From a doubtful pixel one goes left, right, up and down as long as pixels are doubtful; it is enclosed if a sure
    one ends the way down, and one the way up or both ways to the sides. What lies on the ground (a shadow) has
    nothing below; a hole in a thing has.

    Parameters
    ----------
    seen : (H, W) uint8, changed
        255 sure, 127 doubtful, 0 nothing.
    reach : (H, W) uint8, changed
        Workspace.
    """
    _enclosed(seen, reach, np.zeros(len(seen), np.bool_))


@kernel_for(changed(np.uint8, 2), changed(np.uint8, 2), changed(np.bool_))
def _enclosed(seen: NDArray[np.uint8], reach: NDArray[np.uint8], doubtful: NDArray[np.bool_]) -> None:
    """Note in `doubtful` which rows have something to decide; most have nothing."""
    height, width = seen.shape
    for y in range(height):
        open_left, open_right, some = False, False, False
        for x in range(width):
            value = seen[y, x]
            if value == 127:
                some = True
                reach[y, x] = (LEFT if open_left else 0) | (
                    ABOVE if y and _meets(seen, reach, y - 1, x, ABOVE) else 0
                )
            else:
                open_left = value == 255
        doubtful[y] = some
        if not some:
            continue
        for x in range(width - 1, -1, -1):
            value = seen[y, x]
            if value == 127:
                reach[y, x] |= RIGHT if open_right else 0
            else:
                open_right = value == 255
    for y in range(height - 1, -1, -1):
        if not doubtful[y]:
            continue
        for x in range(width):
            if seen[y, x] == 127 and y + 1 < height and _meets(seen, reach, y + 1, x, BELOW):
                ways = reach[y, x]
                reach[y, x] = ways | BELOW
                if (ways & ABOVE) or ways & BESIDE == BESIDE:
                    # It has BELOW: for the row above it is as if it were still doubtful.
                    seen[y, x] = 255 if ways == ALL_BUT_BELOW else PARTLY


def enclosed_twin(seen: NDArray[np.uint8], reach: NDArray[np.uint8]) -> None:
    """Do the same pixel by pixel: the oracle of `enclosed`; leaves the workspace alone."""
    before = seen.copy()
    height, width = seen.shape

    def ends_sure(y: int, x: int, down: int, right: int) -> bool:
        while 0 <= y < height and 0 <= x < width and before[y, x] == 127:
            y, x = y + down, x + right
        return 0 <= y < height and 0 <= x < width and bool(before[y, x] == 255)

    for y, x in np.argwhere(before == 127).tolist():
        left, right, above = (ends_sure(y, x, *way) for way in ((0, -1), (0, 1), (-1, 0)))
        if ends_sure(y, x, 1, 0) and (above or (left and right)):
            seen[y, x] = 255 if above and left and right else PARTLY


@kernel
def _meets(seen: NDArray[np.uint8], reach: NDArray[np.uint8], y: int, x: int, way: int) -> bool:
    return bool(seen[y, x] >= PARTLY or (seen[y, x] == 127 and (reach[y, x] & way) != 0))

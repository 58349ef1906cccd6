"""Votes of a picture's pixels, by place and colour, for those of another.

A pixel's colour is one of LEVELS³ bins; a place is CELL x CELL pixels. The votes near a place are one histogram, which
loses a column of places and gains another on its way along a row. Bins are numbered with a border of empty ones, so that
every neighbour is there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for

Bytes = NDArray[np.uint8]
Float = NDArray[np.float32]
Ints = NDArray[np.int32]

SHIFT = 4  # bits of a channel that do not count
LEVELS = 256 >> SHIFT
CELL = 16  # pixels, a side of the places
EPSILON = 0.02  # votes of nobody
_ACROSS, _PLANE = LEVELS + 2, (LEVELS + 2) ** 2  # bins to the next level of the second channel, and of the first
_FIRST, BINS = _PLANE + _ACROSS + 1, (LEVELS + 2) ** 3
_AGAINST = 1 << 16  # a bin has votes for in its lower half; near a place are at most 9 CELL² of either kind


@kernel_for(given(np.uint8, 3, "C"), changed(np.int32, 2))
def bins_of(colours: Bytes, bins: Ints) -> None:
    """Write the bin of each pixel (H, W) of colours (H, W, 3)."""
    for y in range(bins.shape[0]):
        for x in range(bins.shape[1]):
            first, second, third = colours[y, x, 0] >> SHIFT, colours[y, x, 1] >> SHIFT, colours[y, x, 2] >> SHIFT
            bins[y, x] = _FIRST + np.int64(first) * _PLANE + np.int64(second) * _ACROSS + np.int64(third)


@kernel_for(
    given(np.int32, 2, "C"),
    given(np.bool_, 2, "C"),
    given(np.int32, 2, "C"),
    np.float32,
    changed(np.int32, 2),
    changed(np.float32),
    changed(np.float32, 2),
)
def weigh(
    before: Ints, own: NDArray[np.bool_], asked: Ints, bound: np.float32, room: Ints, said: Float, out: Float
) -> None:
    """Write ln of the mean votes for and against each pixel, within ± bound.

    The mean is over 3 x 3 places and 3 x 3 x 3 bins of colour; what lies outside has no votes.

    Parameters
    ----------
    before : (H, W) int32
        Bins of those who vote.
    own : (H, W) bool
        Who votes for; the others vote against.
    asked : (H, W) int32
        Bins of what is voted on.
    bound : float32
        ≥ 0.
    room, said : (2, BINS) int32 and (BINS,) float32, changed
        Scratch, `room` zeros before.
    out : (H, W) float32, changed
        Every element is written.
    """
    height, width = own.shape
    votes, last = room[0], room[1]  # the votes near a place, and at which place a bin was last asked for
    share, none, place = np.float32(1 / 243), np.float32(EPSILON), 0
    rows, columns = (height + CELL - 1) // CELL, (width + CELL - 1) // CELL
    for row in range(rows):
        top, bottom = max((row - 1) * CELL, 0), min((row + 2) * CELL, height)
        for number in range(BINS):
            votes[number] = 0
        for come in range(columns + 1):  # a column of places comes, that three before it goes
            for turn in range(2):
                begin, sign = (come - 3 * turn) * CELL, 1 - 2 * turn
                for y in range(top, bottom):
                    for x in range(max(begin, 0), min(begin + CELL, width)):
                        votes[before[y, x]] += sign if own[y, x] else sign * _AGAINST
            place += 1
            for y in range(row * CELL, min((row + 1) * CELL, height)):
                for x in range(max(come - 1, 0) * CELL, min(come * CELL, width)):
                    here = asked[y, x]
                    if last[here] != place:
                        last[here] = place
                        total = 0
                        for line in range(9):
                            near = here + (line // 3 - 1) * _PLANE + (line % 3 - 1) * _ACROSS
                            total += votes[near - 1] + votes[near] + votes[near + 1]
                        mine = np.float32(total & (_AGAINST - 1)) * share + none
                        theirs = np.float32(total >> 16) * share + none
                        said[here] = min(max(np.log(mine / theirs), -bound), bound)
                    out[y, x] = said[here]


def bins_of_twin(colours: Bytes, bins: Ints) -> None:
    """Do the same in NumPy: the oracle of `bins_of`."""
    bins[...] = (colours >> SHIFT).astype(np.int32) @ (_PLANE, _ACROSS, 1) + _FIRST


def weigh_twin(
    before: Ints, own: NDArray[np.bool_], asked: Ints, bound: np.float32, room: Ints, said: Float, out: Float
) -> None:
    """Do the same with every bin of every place: the oracle of `weigh`."""
    height, width = own.shape
    places = np.indices(own.shape) // CELL
    y, x = places[0], places[1]
    shape = (-(-height // CELL), -(-width // CELL), LEVELS, LEVELS, LEVELS)
    means = []
    for who in (own, ~own):
        votes: NDArray[np.float64] = np.zeros([one + 2 for one in shape])  # with a border, as bins have one
        colours = np.unravel_index(before[who], (_ACROSS,) * 3)
        np.add.at(votes, (y[who] + 1, x[who] + 1, *colours), 1)
        for axis in range(5):
            begins = np.arange(shape[axis])
            votes = np.stack([votes.take(begins + off, axis) for off in range(3)]).mean(axis=0)
        means.append(votes[(y, x, *(one - 1 for one in np.unravel_index(asked, (_ACROSS,) * 3)))])
    out[...] = np.clip(np.log((means[0] + EPSILON) / (means[1] + EPSILON)), -bound, bound)

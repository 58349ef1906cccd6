"""Boxes followed by the generic points that match best; their sizes averaged (Brémond & Thonnat, III.B)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for

Float = NDArray[np.float32]
Followed = tuple[Float, NDArray[np.int8], Float]
POINTS = (
    (0.0, 0.0),
    (0.0, -0.5),
    (0.0, 0.5),
    (-0.5, 0.0),
    (0.5, 0.0),
)  # centre, top, bottom, left, right, in sizes
_OFFSETS = np.array(POINTS)
_SIDES = np.array([3, 1, 4, 2])  # points of the left, top, right and bottom side, as the bits of what is hidden
_OPPOSITE = np.array([4, 2, 3, 1])
_ERROR, _PLACE, _SIZE, _OLD, _WAS = range(5)  # rows of scratch


def follow(
    expected: Float, boxes: Float, entering: NDArray[np.bool_], pace: Float, picture: Float, partial: float
) -> Followed:
    """Return generic points, hidden sides and sizes of K things, expected at boxes, that are seen at others.

    The points that match about as well as the best locate the thing together; the others follow from the mean size.
    A side whose point does not match, while the opposite one does, on a box that is too small, is hidden. The mean
    size follows where a side fits, or the middle does, by `pace`; at once while the thing comes into view; by half of
    it where the box is larger, by an eighth where it is smaller.

    Parameters
    ----------
    expected, boxes : (K, 4) float32
        x1, y1, x2, y2: where each should be, at its mean size, and where it is seen.
    entering : (K,) bool
        Whether it may still be coming into view.
    pace : (K,) float32
        Share of the way to the size seen, in [0, 1].
    picture : (2,) float32
        Width and height: a box that touches the border may be cut by it.
    partial : float
        Mismatch, in sizes, from which a point does not match.

    Returns
    -------
    (K, 5, 2) float32, (K,) int8, (K, 2) float32
        Points: centre, middles of top, bottom, left, right; bits of the hidden sides: left, top, right, bottom; mean
        widths and heights, ≥ 1.
    """
    count = len(boxes)
    points, hidden = np.empty((count, 5, 2), np.float32), np.zeros(count, np.int8)
    mean = np.empty((count, 2), np.float32)
    _follow(expected, boxes, entering, pace, picture, partial, np.empty((5, 5)), points, hidden, mean)
    return points, hidden, mean


@kernel_for(
    given(np.float32, 2),
    given(np.float32, 2),
    given(np.bool_),
    given(np.float32),
    given(np.float32),
    float,
    changed(np.float64, 2),
    changed(np.float32, 3),
    changed(np.int8),
    changed(np.float32, 2),
)
def _follow(
    expected: Float,
    boxes: Float,
    entering: NDArray[np.bool_],
    pace: Float,
    picture: Float,
    partial: float,
    room: NDArray[np.float64],
    points: Float,
    hidden: NDArray[np.int8],
    mean: Float,
) -> None:
    """Write points, hidden sides (0 before) and mean sizes; (5, 5) `room` is scratch."""
    for k in range(len(boxes)):
        for axis in range(2):
            usual, seen = expected[k, axis + 2] - expected[k, axis], boxes[k, axis + 2] - boxes[k, axis]
            room[_OLD, axis] = usual if usual > 1.0 else 1.0
            room[_WAS, axis] = (expected[k, axis + 2] + expected[k, axis]) / 2
            room[_SIZE, axis] = seen if seen > 0.0 else 0.0
            room[_PLACE, axis] = (boxes[k, axis + 2] + boxes[k, axis]) / 2
        best = np.inf
        for p in range(5):
            squared = 0.0
            for axis in range(2):
                from_place = room[_PLACE, axis] + _OFFSETS[p, axis] * room[_SIZE, axis]
                away = (from_place - room[_WAS, axis] - _OFFSETS[p, axis] * room[_OLD, axis]) / room[_OLD, axis]
                squared += away * away
            room[_ERROR, p] = np.sqrt(squared)
            best = room[_ERROR, p] if room[_ERROR, p] < best else best
        limit = best + partial / 2
        limit = partial if partial > limit else limit
        for axis in range(2):
            centre, number = 0.0, 0
            for p in range(5):
                if room[_ERROR, p] <= limit:
                    centre += room[_PLACE, axis] + _OFFSETS[p, axis] * (room[_SIZE, axis] - room[_OLD, axis])
                    number += 1
            centre = centre / number
            points[k, 0, axis] = centre
            for p in range(1, 5):
                seen = room[_PLACE, axis] + _OFFSETS[p, axis] * room[_SIZE, axis]
                implied = centre + _OFFSETS[p, axis] * room[_OLD, axis]
                points[k, p, axis] = seen if room[_ERROR, p] <= limit else implied
        for side in range(4):
            short = room[_SIZE, side & 1] < (1 - partial) * room[_OLD, side & 1]
            if short and room[_ERROR, _SIDES[side]] > limit and room[_ERROR, _OPPOSITE[side]] <= limit:
                hidden[k] |= 1 << side
        for axis in range(2):
            size, old = room[_SIZE, axis], room[_OLD, axis]
            cut = boxes[k, axis] <= 1 or boxes[k, axis + 2] >= picture[axis] - 1
            grows = size > old
            step = float(pace[k])
            if grows and (cut or entering[k]):
                step = 1.0
            elif (
                abs(size - old) > partial * old and abs(room[_PLACE, axis] - room[_WAS, axis]) > partial / 2 * old
            ):
                step = step / 2 if grows else step / 8
            size = old + step * (size - old)
            mean[k, axis] = size if size > 1.0 else 1.0


def follow_twin(
    expected: Float, boxes: Float, entering: NDArray[np.bool_], pace: Float, picture: Float, partial: float
) -> Followed:
    """Do the same with whole columns: the oracle of `follow`."""
    ends, starts = boxes.astype(np.float64), expected.astype(np.float64)
    old, was = np.maximum(starts[:, 2:] - starts[:, :2], 1.0), (starts[:, 2:] + starts[:, :2]) / 2
    size, place = np.maximum(ends[:, 2:] - ends[:, :2], 0.0), (ends[:, 2:] + ends[:, :2]) / 2
    seen = place[:, None] + _OFFSETS * size[:, None]  # (K, 5, 2)
    away = (seen - was[:, None] - _OFFSETS * old[:, None]) / old[:, None]
    error = np.sqrt((away**2).sum(axis=2))  # (K, 5)
    good = error <= np.maximum(partial, error.min(axis=1, initial=np.inf) + partial / 2)[:, None]
    implied = seen - _OFFSETS * old[:, None]  # (K, 5, 2) centres
    centre = (implied * good[..., None]).sum(axis=1) / good.sum(axis=1)[:, None]  # (K, 2)
    points = np.where(good[..., None], seen, centre[:, None] + _OFFSETS * old[:, None])
    points[:, 0] = centre
    short = np.tile(size < (1 - partial) * old, 2)  # (K, 4) left, top, right, bottom
    bits = (short & ~good[:, _SIDES] & good[:, _OPPOSITE]) * (1 << np.arange(4))
    cut = (ends[:, :2] <= 1) | (ends[:, 2:] >= picture - 1)
    grows = size > old
    step = np.broadcast_to(pace.astype(np.float64)[:, None], size.shape)
    strange = (np.abs(size - old) > partial * old) & (np.abs(place - was) > partial / 2 * old)
    step = np.where(strange, np.where(grows, step / 2, step / 8), step)
    step = np.where(grows & (cut | entering[:, None]), 1.0, step)
    mean = np.maximum(old + step * (size - old), 1.0)
    return points.astype(np.float32), bits.sum(axis=1).astype(np.int8), mean.astype(np.float32)

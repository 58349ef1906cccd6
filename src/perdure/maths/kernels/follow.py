"""Boxes followed by the generic points that match best; their sizes averaged (Brémond & Thonnat, III.B)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import given, kernel_for

Float = NDArray[np.float32]
Followed = tuple[Float, NDArray[np.int8], Float]
POINTS = (
    (0.0, 0.0),
    (0.0, -0.5),
    (0.0, 0.5),
    (-0.5, 0.0),
    (0.5, 0.0),
)  # centre, top, bottom, left, right, in sizes
_SIDES = (3, 1, 4, 2)  # points of the left, top, right and bottom side, as the bits of what is hidden
_OPPOSITE = (4, 2, 3, 1)


@kernel_for(
    given(np.float32, 2), given(np.float32, 2), given(np.bool_), given(np.float32), given(np.float32), float
)
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
    points = np.empty((count, 5, 2), np.float32)
    hidden = np.zeros(count, np.int8)
    mean = np.empty((count, 2), np.float32)
    error, good = np.empty(5), np.empty(5, np.bool_)
    place, size, old, was = np.empty(2), np.empty(2), np.empty(2), np.empty(2)
    for k in range(count):
        for axis in range(2):
            old[axis] = max(expected[k, axis + 2] - expected[k, axis], 1.0)
            was[axis] = (expected[k, axis + 2] + expected[k, axis]) / 2
            size[axis] = max(boxes[k, axis + 2] - boxes[k, axis], 0.0)
            place[axis] = (boxes[k, axis + 2] + boxes[k, axis]) / 2
        best = np.inf
        for p in range(5):
            across = (place[0] + POINTS[p][0] * size[0] - was[0] - POINTS[p][0] * old[0]) / old[0]
            down = (place[1] + POINTS[p][1] * size[1] - was[1] - POINTS[p][1] * old[1]) / old[1]
            error[p] = np.sqrt(across * across + down * down)
            best = min(best, error[p])
        limit = max(partial, best + partial / 2)
        x, y, number = 0.0, 0.0, 0
        for p in range(5):
            good[p] = error[p] <= limit
            if good[p]:
                x += place[0] + POINTS[p][0] * (size[0] - old[0])
                y += place[1] + POINTS[p][1] * (size[1] - old[1])
                number += 1
        x, y = x / number, y / number
        points[k, 0, 0], points[k, 0, 1] = x, y
        for p in range(1, 5):
            if good[p]:
                points[k, p, 0] = place[0] + POINTS[p][0] * size[0]
                points[k, p, 1] = place[1] + POINTS[p][1] * size[1]
            else:
                points[k, p, 0] = x + POINTS[p][0] * old[0]
                points[k, p, 1] = y + POINTS[p][1] * old[1]
        for side in range(4):
            short = size[side % 2] < (1 - partial) * old[side % 2]
            if short and not good[_SIDES[side]] and good[_OPPOSITE[side]]:
                hidden[k] |= 1 << side
        for axis in range(2):
            cut = boxes[k, axis] <= 1 or boxes[k, axis + 2] >= picture[axis] - 1
            grows = size[axis] > old[axis]
            step = float(pace[k])
            if grows and (cut or entering[k]):
                step = 1.0
            elif (
                abs(size[axis] - old[axis]) > partial * old[axis]
                and abs(place[axis] - was[axis]) > partial / 2 * old[axis]
            ):
                step = step / 2 if grows else step / 8
            mean[k, axis] = max(old[axis] + step * (size[axis] - old[axis]), 1.0)
    return points, hidden, mean


def follow_twin(
    expected: Float, boxes: Float, entering: NDArray[np.bool_], pace: Float, picture: Float, partial: float
) -> Followed:
    """Do the same with whole columns: the oracle of `follow`."""
    offsets = np.array(POINTS)
    ends, starts = boxes.astype(np.float64), expected.astype(np.float64)
    old, was = np.maximum(starts[:, 2:] - starts[:, :2], 1.0), (starts[:, 2:] + starts[:, :2]) / 2
    size, place = np.maximum(ends[:, 2:] - ends[:, :2], 0.0), (ends[:, 2:] + ends[:, :2]) / 2
    seen = place[:, None] + offsets * size[:, None]  # (K, 5, 2)
    away = (seen - was[:, None] - offsets * old[:, None]) / old[:, None]
    error = np.sqrt((away**2).sum(axis=2))  # (K, 5)
    good = error <= np.maximum(partial, error.min(axis=1, initial=np.inf) + partial / 2)[:, None]
    implied = seen - offsets * old[:, None]  # (K, 5, 2) centres
    centre = (implied * good[..., None]).sum(axis=1) / good.sum(axis=1)[:, None]  # (K, 2)
    points = np.where(good[..., None], seen, centre[:, None] + offsets * old[:, None])
    points[:, 0] = centre
    short = np.tile(size < (1 - partial) * old, 2)  # (K, 4) left, top, right, bottom
    bits = (short & ~good[:, list(_SIDES)] & good[:, list(_OPPOSITE)]) * (1 << np.arange(4))
    cut = (ends[:, :2] <= 1) | (ends[:, 2:] >= picture - 1)
    grows = size > old
    step = np.broadcast_to(pace.astype(np.float64)[:, None], size.shape)
    strange = (np.abs(size - old) > partial * old) & (np.abs(place - was) > partial / 2 * old)
    step = np.where(strange, np.where(grows, step / 2, step / 8), step)
    step = np.where(grows & (cut | entering[:, None]), 1.0, step)
    mean = np.maximum(old + step * (size - old), 1.0)
    return points.astype(np.float32), bits.sum(axis=1).astype(np.int8), mean.astype(np.float32)

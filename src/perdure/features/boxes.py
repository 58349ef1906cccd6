"""Numbers of boxes and of pairs of boxes; boxes are (N, 4) x1 y1 x2 y2, half-open, in pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.types import Boxes

Float = NDArray[np.float32]


def sizes(boxes: Boxes) -> Float:
    """Return widths and heights (N, 2), never negative."""
    return np.asarray(np.maximum(boxes[:, 2:] - boxes[:, :2], 0.0), np.float32)


def centres(boxes: Boxes) -> Float:
    """Return centres (N, 2)."""
    return np.asarray((boxes[:, :2] + boxes[:, 2:]) / 2.0, np.float32)


def areas(boxes: Boxes) -> Float:
    """Return areas (N,) in square pixels."""
    return np.asarray(sizes(boxes).prod(axis=1), np.float32)


def intersections(one: Boxes, other: Boxes) -> Float:
    """Return the areas (N, M) that the boxes of `one` share with those of `other`."""
    # Each side for itself: a last axis of two would make NumPy slow.
    across = np.minimum(one[:, 2, None], other[:, 2]) - np.maximum(one[:, 0, None], other[:, 0])  # (N, M)
    down = np.minimum(one[:, 3, None], other[:, 3]) - np.maximum(one[:, 1, None], other[:, 1])  # (N, M)
    return np.asarray(np.maximum(across, 0.0) * np.maximum(down, 0.0), np.float32)


def overlaps(one: Boxes, other: Boxes) -> Float:
    """Return intersection over union (N, M) in [0, 1]; 0 for two boxes without area.

    >>> overlaps(np.array([[0, 0, 2, 2]], np.float32), np.array([[1, 0, 3, 2]], np.float32)).tolist()
    [[0.3333333432674408]]
    """
    shared = intersections(one, other)
    union = areas(one)[:, None] + areas(other)[None, :] - shared
    return np.asarray(np.divide(shared, union, out=np.zeros_like(shared), where=union > 0), np.float32)


def exact_overlaps(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return intersection over union (N, M) in float64, for scores: a threshold may hang on the last digit."""
    low = np.maximum(one[:, None, :2], other[None, :, :2])  # (N, M, 2)
    high = np.minimum(one[:, None, 2:], other[None, :, 2:])  # (N, M, 2)
    side = np.maximum(high - low, 0.0)
    shared = side[..., 0] * side[..., 1]
    extent = [np.maximum(boxes[:, 2:] - boxes[:, :2], 0.0) for boxes in (one, other)]
    union = extent[0].prod(axis=1)[:, None] + extent[1].prod(axis=1)[None, :] - shared
    return np.asarray(np.divide(shared, union, out=np.zeros_like(shared), where=union > EPSILON), np.float64)


EPSILON = float(np.finfo(np.float64).eps)


def distances_between(one: Boxes, other: Boxes) -> Float:
    """Return how far apart (N, M) boxes are, edge to edge, in pixels; 0 where they touch."""
    gap = np.maximum(
        one[:, None, :2] - other[None, :, 2:], other[None, :, :2] - one[:, None, 2:]
    )  # (N, M, 2), negative where they overlap
    return np.asarray(np.hypot(*np.moveaxis(np.maximum(gap, 0.0), 2, 0)), np.float32)


def hull(boxes: Boxes) -> Float:
    """Return the smallest box (4,) that holds all of (N, 4), N ≥ 1."""
    return np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])

"""Silhouettes: making them disjoint, keeping them inside the frame, run lengths."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from perdure.types import Boxes, Mask


def disjoint(masks: Sequence[Mask], height: int, width: int) -> tuple[Mask, ...]:
    """Return the masks cut to the frame, each pixel kept by the first that claims it, tight again.

    >>> both = disjoint([Mask(0, 0, np.ones((2, 2), bool)), Mask(0, 1, np.ones((2, 3), bool))], 9, 9)
    >>> [mask.box for mask in both]
    [(0, 0, 2, 2), (2, 0, 4, 2)]
    """
    kept: list[Mask] = []
    for mask in masks:
        bits = _inside(mask, height, width)
        for earlier in kept:
            _remove(bits, mask, earlier)
        kept.append(
            mask if np.array_equal(bits, mask.bits) and _is_tight(bits) else Mask.of_image(bits, mask.y, mask.x)
        )
    return tuple(kept)


def holding(boxes: Boxes, masks: Sequence[Mask]) -> Boxes:
    """Return the boxes (N, 4), enlarged where a mask leaves its box."""
    around = [mask.box if mask.area else tuple(box) for mask, box in zip(masks, boxes, strict=True)]
    seen = np.array(around, np.float32).reshape(-1, 4)
    return np.concatenate([np.minimum(boxes[:, :2], seen[:, :2]), np.maximum(boxes[:, 2:], seen[:, 2:])], axis=1)


def run_lengths(mask: Mask) -> list[int]:
    """Return lengths of alternating runs of false and true, column by column, beginning with false."""
    flat = mask.bits.ravel(order="F")
    if not flat.size:
        return []
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    runs = np.diff(np.concatenate([[0], changes, [flat.size]]))
    return ([0] if flat[0] else []) + [int(run) for run in runs]


def of_run_lengths(runs: Sequence[int], y: int, x: int, height: int, width: int) -> Mask:
    """Return the mask whose `run_lengths` these are.

    Raises
    ------
    ValueError
        If the runs are negative or do not fill the crop.
    """
    counts = np.asarray(runs, np.int64)
    if (counts < 0).any() or int(counts.sum()) != height * width:
        raise ValueError(f"runs of {int(counts.sum())} pixels do not fill a crop of {width}x{height}")
    flat: NDArray[np.bool_] = np.repeat(np.arange(len(counts)) % 2 == 1, counts)
    return Mask(y, x, flat.reshape((height, width), order="F"))


def _inside(mask: Mask, height: int, width: int) -> NDArray[np.bool_]:
    bits = mask.bits.copy()
    bits[: max(0, -mask.y)] = False
    bits[:, : max(0, -mask.x)] = False
    bits[max(0, height - mask.y) :] = False
    bits[:, max(0, width - mask.x) :] = False
    return bits


def _remove(bits: NDArray[np.bool_], mask: Mask, other: Mask) -> None:
    x1, y1, x2, y2 = mask.box
    a1, b1, a2, b2 = other.box
    left, top, right, bottom = max(x1, a1), max(y1, b1), min(x2, a2), min(y2, b2)
    if left < right and top < bottom:
        bits[top - y1 : bottom - y1, left - x1 : right - x1] &= ~other.bits[
            top - b1 : bottom - b1, left - a1 : right - a1
        ]


def _is_tight(bits: NDArray[np.bool_]) -> bool:
    if not bits.size:
        return True
    return bool(bits[0].any() and bits[-1].any() and bits[:, 0].any() and bits[:, -1].any())

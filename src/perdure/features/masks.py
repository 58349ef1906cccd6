"""Silhouettes: making them disjoint, keeping them inside the frame, run lengths, and numbers of pairs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from perdure.types import Bits, Boxes, Mask, Regions


def disjoint(masks: Sequence[Mask], height: int, width: int) -> tuple[Mask, ...]:
    """Return the masks cut to the frame, each pixel kept by the first that claims it, tight again.

    >>> both = disjoint([Mask(0, 0, np.ones((2, 2), bool)), Mask(0, 1, np.ones((2, 3), bool))], 9, 9)
    >>> [mask.box for mask in both]
    [(0, 0, 2, 2), (2, 0, 4, 2)]
    """
    kept: list[Mask] = []
    claimed: list[Mask] = []  # of those, the ones that have a pixel
    for mask in masks:
        if not mask.bits.size:
            kept.append(mask)
            continue
        bits = _inside(mask, height, width)
        for earlier in claimed:
            _remove(bits, mask, earlier)
        kept.append(
            mask if np.array_equal(bits, mask.bits) and _is_tight(bits) else Mask.of_image(bits, mask.y, mask.x)
        )
        claimed.append(kept[-1])
    return tuple(kept)


def silhouettes(regions: Regions, height: int, width: int) -> list[Mask]:
    """Return the silhouette of every region, inside a picture; its box where it has none.

    >>> [mask.box for mask in silhouettes(Regions.of([[-3, 2, 5, 6]]), 9, 9)]
    [(0, 2, 5, 6)]
    """
    edges = np.clip(np.rint(regions.boxes), 0, (width, height, width, height)).astype(int).tolist()
    return [
        disjoint([mask], height, width)[0] if mask.area else Mask(y1, x1, np.ones((y2 - y1, x2 - x1), np.bool_))
        for mask, (x1, y1, x2, y2) in zip(regions.masks, edges, strict=True)
    ]


def holding(boxes: Boxes, masks: Sequence[Mask]) -> Boxes:
    """Return the boxes (N, 4), enlarged where a mask leaves its box."""
    around = [mask.box if mask.area else tuple(box) for mask, box in zip(masks, boxes, strict=True)]
    seen = np.array(around, np.float32).reshape(-1, 4)
    return np.concatenate([np.minimum(boxes[:, :2], seen[:, :2]), np.maximum(boxes[:, 2:], seen[:, 2:])], axis=1)


def picture_runs(mask: Mask, height: int, width: int) -> NDArray[np.int64]:
    """Return the run lengths (K,) of the whole (height, width) picture with the mask in it, without drawing it.

    They alternate between false and true, column by column, begin with false and add up to height * width;
    what lies outside the picture is cut.

    >>> picture_runs(Mask(1, 1, np.ones((2, 1), bool)), 3, 3).tolist()
    [4, 2, 3]
    """
    x1, y1, x2, y2 = mask.box
    left, top, right, bottom = max(x1, 0), max(y1, 0), min(x2, width), min(y2, height)
    if left >= right or top >= bottom:
        return np.array([height * width], np.int64)
    bits = mask.bits[top - y1 : bottom - y1, left - x1 : right - x1]  # (h, w)
    framed = np.zeros((right - left, bottom - top + 2), np.bool_)  # (w, h + 2): a column a row, false at both ends
    framed[:, 1:-1] = bits.T
    column, row = np.nonzero(framed[:, 1:] != framed[:, :-1])
    changes = (column + left) * height + row + top  # of the picture's pixels, column by column
    # A run down to the foot of a column goes on at the head of the next one: two changes in one place are none.
    twice = np.flatnonzero(changes[1:] == changes[:-1])
    changes = np.delete(changes, np.concatenate([twice, twice + 1]))
    changes = changes[changes < height * width]
    return np.diff(np.concatenate([[0], changes, [height * width]])).astype(np.int64)


def of_picture_runs(runs: NDArray[np.int64], height: int, width: int) -> Mask:
    """Return the tight mask of which these are the `picture_runs`; nothing larger than the crop's columns is drawn.

    Raises
    ------
    ValueError
        If the runs are negative or do not fill the picture.
    """
    if (runs < 0).any() or (runs > height * width).any() or int(runs.sum()) != height * width:
        raise ValueError(f"the runs do not fill a picture of {width}x{height}")
    ends = np.cumsum(runs)
    begins, ends = ends[0:-1:2], ends[1::2]  # of the runs of true pixels
    begins, ends = begins[begins < ends], ends[begins < ends]
    if not begins.size:
        return Mask.empty()
    left, right = int(begins[0]) // height, int(ends[-1] - 1) // height + 1
    if (begins // height != (ends - 1) // height).any():  # one goes round the foot of a column
        top, bottom = 0, height
    else:
        top, bottom = int((begins % height).min()), int(((ends - 1) % height).max()) + 1
    edges = np.stack([begins, ends], axis=1).ravel() - left * height
    lengths = np.diff(np.concatenate([[0], edges, [(right - left) * height]]))
    flat = np.repeat(np.arange(len(lengths)) % 2 == 1, lengths)
    crop = flat.reshape(right - left, height)[:, top:bottom]  # (w, h)
    return Mask(top, left, np.ascontiguousarray(crop.T))


def mask_overlaps(one: Sequence[Mask], other: Sequence[Mask]) -> NDArray[np.float64]:
    """Return intersection over union (N, M) in [0, 1] of the silhouettes; 0 for two empty ones.

    >>> mask_overlaps([Mask(0, 0, np.ones((2, 2), bool))], [Mask(0, 1, np.ones((2, 2), bool))]).tolist()
    [[0.3333333333333333]]
    """
    shared = _shared(one, other)
    union = _areas(one)[:, None] + _areas(other)[None, :] - shared
    return np.divide(shared, union, out=np.zeros(shared.shape), where=union > 0)


def mask_shares(one: Sequence[Mask], other: Sequence[Mask]) -> NDArray[np.float64]:
    """Return which share (N, M), in [0, 1], of each silhouette of `one` lies in each of `other`; 0 for empty ones.

    >>> mask_shares([Mask(0, 0, np.ones((2, 2), bool))], [Mask(0, 1, np.ones((9, 9), bool))]).tolist()
    [[0.5]]
    """
    shared = _shared(one, other)
    whole = np.broadcast_to(_areas(one)[:, None], shared.shape)
    return np.divide(shared, whole, out=np.zeros(shared.shape), where=whole > 0)


def touching(
    one: NDArray[np.int64], other: NDArray[np.int64]
) -> Iterator[tuple[int, int, tuple[int, int, int, int]]]:
    """Yield (row, column, shared box) for every pair of boxes, (N, 4) and (M, 4), that share a pixel."""
    low = np.maximum(one[:, None, :2], other[None, :, :2])  # (N, M, 2)
    high = np.minimum(one[:, None, 2:], other[None, :, 2:])  # (N, M, 2)
    rows, columns = np.nonzero((low < high).all(axis=2))
    shared = np.concatenate([low[rows, columns], high[rows, columns]], axis=1)  # (K, 4)
    yield from zip(rows.tolist(), columns.tolist(), map(tuple, shared.tolist()), strict=True)


def crops(masks: Sequence[Mask]) -> NDArray[np.int64]:
    """Return the boxes (N, 4) of the masks' crops, x1 y1 x2 y2."""
    return np.array([mask.box for mask in masks], np.int64).reshape(-1, 4)


def part(mask: Mask, box: tuple[int, int, int, int]) -> Bits:
    """Return the bits of a mask inside a box that lies in its crop."""
    x1, y1, x2, y2 = box
    return mask.bits[y1 - mask.y : y2 - mask.y, x1 - mask.x : x2 - mask.x]


def _shared(one: Sequence[Mask], other: Sequence[Mask]) -> NDArray[np.float64]:
    """Pixels in common (N, M)."""
    shared = np.zeros((len(one), len(other)))
    for row, column, box in touching(crops(one), crops(other)):
        shared[row, column] = np.count_nonzero(part(one[row], box) & part(other[column], box))
    return shared


def _areas(masks: Sequence[Mask]) -> NDArray[np.float64]:
    return np.array([mask.area for mask in masks], np.float64)


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


def union(masks: Sequence[Mask]) -> Mask:
    """Return the mask of all pixels that are in any of the masks.

    >>> union([Mask(0, 0, np.ones((1, 1), bool)), Mask(0, 2, np.ones((1, 1), bool))]).bits.tolist()
    [[True, False, True]]
    """
    known = [mask for mask in masks if mask.bits.size]
    if len(known) < 2:
        return known[0] if known else Mask.empty()
    box = crops(known)
    (x1, y1), (x2, y2) = box[:, :2].min(axis=0).tolist(), box[:, 2:].max(axis=0).tolist()
    bits = np.zeros((y2 - y1, x2 - x1), np.bool_)
    for mask in known:
        bits[mask.y - y1 : mask.box[3] - y1, mask.x - x1 : mask.box[2] - x1] |= mask.bits
    return Mask(y1, x1, bits)

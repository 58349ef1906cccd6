"""Which pixels of a picture are looked at for a region: those of its mask, within its box and the picture.

A region without a mask shows all of its box. Of a large box a grid of pixels is taken, so that no box costs without
bound.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.types import Bits, Boxes, Mask, Regions

MOST = 4096  # pixels of a region that are looked at


class Pixels(NamedTuple):
    """A grid of pixels: row r and column c of `bits` is pixel (y + r step, x + c step)."""

    row: int  # of the region
    y: int
    x: int
    step: int
    bits: Bits  # (h, w), which are looked at


def pixels_of(regions: Regions, height: int, width: int, most: int = MOST) -> Iterator[Pixels]:
    """Yield the pixels of each region that has any on a picture (height, width), `most` at most."""
    for row, (box, mask) in enumerate(zip(_whole(regions.boxes).tolist(), regions.masks, strict=True)):
        x1, y1, x2, y2 = mask.box if mask.bits.size else (0, 0, width, height)
        left, top = max(box[0], x1, 0), max(box[1], y1, 0)
        right, bottom = min(box[2], x2, width), min(box[3], y2, height)
        if left >= right or top >= bottom:
            continue
        step = math.ceil(math.sqrt((right - left) * (bottom - top) / most))
        yield Pixels(row, top, left, step, _bits(mask, top, left, bottom, right)[::step, ::step])


def _whole(boxes: Boxes) -> NDArray[np.int64]:
    """The pixels (N, 4), half-open, whose middles lie in boxes."""
    return np.asarray(np.ceil(boxes - 0.5), np.int64)


def _bits(mask: Mask, top: int, left: int, bottom: int, right: int) -> Bits:
    if mask.bits.size == 0:
        return np.broadcast_to(np.True_, (bottom - top, right - left))
    return mask.bits[top - mask.y : bottom - mask.y, left - mask.x : right - mask.x]

"""The moving pixels in a box, of which colours are taken (section 2.1.3), where the detector gives no silhouettes.

What looks like the place with nothing before it is not the thing's. The place is learnt from what lies in no box. While
it is not what it was, since the camera moves or the light has changed, all pixels of a box count.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from perdure.scene.backdrop import LEAST, Backdrop, learn
from perdure.types import Bits, Boxes, Image, Mask, Regions

_BARE = 2.5  # deviations of each channel, up to which a colour is that of the place
_FEWEST = 0.2  # share of a box that must move; where less does, all of it counts
_STEADY = 0.7  # share of the place, seen on a grid, that must look as it did
_GRID = 8  # px
_MARGIN = 0.1  # of a box's sides, about it, that may be the thing's too


def moving(backdrop: Backdrop, image: Image, regions: Regions) -> Regions:
    """Return the regions with masks of their moving pixels; as they are, where one has a mask or the place is unsteady."""
    if any(mask.bits.size for mask in regions.masks) or not len(regions):
        return regions
    if not _steady(backdrop, image, regions.boxes):
        return regions
    return replace(regions, masks=tuple(_moving(backdrop, image, box) for box in regions.boxes))


def learnt(backdrop: Backdrop, image: Image, boxes: Boxes) -> Backdrop:
    """Return the backdrop after a picture in which things may be in boxes (N, 4)."""
    learn(backdrop, image, covered(boxes, *image.shape[:2]))
    return backdrop


def covered(boxes: Boxes, height: int, width: int) -> Bits:
    """Return the pixels (height, width) in boxes or close to them."""
    found = np.zeros((height, width), np.bool_)
    margin = _MARGIN * (boxes[:, 2:] - boxes[:, :2])
    low = np.maximum(np.floor(boxes[:, :2] - margin), 0).astype(np.intp)
    high = np.maximum(np.ceil(boxes[:, 2:] + margin), 0).astype(np.intp)
    for (left, top), (right, bottom) in zip(low.tolist(), high.tolist(), strict=True):
        found[top:bottom, left:right] = True
    return found


def _steady(backdrop: Backdrop, image: Image, boxes: Boxes) -> bool:
    grid = (slice(None, None, _GRID), slice(None, None, _GRID))
    free = ~covered(boxes, *image.shape[:2])[grid] & backdrop.known[grid]
    return bool(free.any() and _bare(backdrop, image, grid)[free].mean() >= _STEADY)


def _moving(backdrop: Backdrop, image: Image, box: Boxes) -> Mask:
    """The moving pixels of one box; the empty mask, which stands for all, where too few move."""
    height, width = image.shape[:2]
    left, top = (max(round(float(one)), 0) for one in box[:2])
    right, bottom = min(round(float(box[2])), width), min(round(float(box[3])), height)
    if left >= right or top >= bottom:
        return Mask.empty()
    there = ~_bare(backdrop, image, (slice(top, bottom), slice(left, right)))
    return Mask(top, left, there) if np.count_nonzero(there) >= _FEWEST * there.size else Mask.empty()


def _bare(backdrop: Backdrop, image: Image, where: tuple[slice, slice]) -> Bits:
    """Which pixels of a part of the picture look as if nothing were there."""
    off = image[where].astype(np.float32) - backdrop.colours[where]
    squares = np.einsum("hwc,hwc->hw", off, off)
    limit = 3 * _BARE**2 * np.maximum(backdrop.variance[where], np.float32(LEAST))
    return np.asarray(backdrop.known[where] & (squares < limit), np.bool_)

"""Regions that are holes in the model: what stood there when the model learnt, and is gone.

A thing has a border in the picture, the model none there; a ghost has its border in the model, the picture none
(Cucchiara, Grana, Piccardi, Prati 2003 call such objects ghosts and find them by their stillness; here their edges
tell at once).
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.types import Bits, Image, Mask, Regions

Single = NDArray[np.float32]


def ghosts(regions: Regions, image: Image, mean: Single) -> Bits:
    """Return which regions, (N,) bool, have their border in the model's mean and not in the picture.

    Parameters
    ----------
    regions : Regions
        With masks.
    image : (H, W, 3) uint8
        The picture that they were found in.
    mean : (H, W, 3) float32
        The model's.
    """
    some = np.zeros(image.shape[:2], np.uint8)  # of any region
    for mask in regions.masks:
        x1, y1, x2, y2 = mask.box
        np.maximum(some[y1:y2, x1:x2], mask.bits, out=some[y1:y2, x1:x2])
    return np.array([_is_ghost(mask, some, image, mean) for mask in regions.masks], np.bool_)


def _is_ghost(mask: Mask, some: NDArray[np.uint8], image: Image, mean: Single) -> bool:
    bits, y, x = mask.bits, mask.y, mask.x
    top, left = min(y, _MARGIN), min(x, _MARGIN)
    height, width = bits.shape
    inside = np.zeros(
        (min(y + height + _MARGIN, image.shape[0]) - y + top, min(x + width + _MARGIN, image.shape[1]) - x + left),
        np.uint8,
    )
    inside[top : top + height, left : left + width] = bits
    part = np.s_[y - top : y - top + inside.shape[0], x - left : x - left + inside.shape[1]]
    ring = cv2.morphologyEx(inside, cv2.MORPH_GRADIENT, _NEAR) > 0
    others = some[part] & ~inside & 1
    if others.any():  # where bodies were told apart there is no border of a thing
        whole = np.count_nonzero(ring)
        ring &= cv2.dilate(others, _NEAR) == 0
        if 2 * np.count_nonzero(ring) < whole:
            return False
    if not ring.any():
        return False
    seen, known = (_slope(picture[part])[ring].mean() for picture in (image, mean))
    return bool(known > _STEEPER * seen + _LEAST_SLOPE)


def _slope(picture: NDArray[Any]) -> Single:
    """Grey levels a pixel, (H, W): of the channel that changes most."""
    levels = np.ascontiguousarray(picture, np.float32)
    across, down = (cv2.Sobel(levels, cv2.CV_32F, *way, scale=0.125) for way in ((1, 0), (0, 1)))
    steep = cv2.magnitude(across, down)
    return np.maximum(np.maximum(steep[..., 0], steep[..., 1]), steep[..., 2])  # quicker than a reduction


_NEAR = np.ones((5, 5), np.uint8)
_MARGIN = 3  # pixels around a region
_STEEPER = 1.2  # how much steeper a ghost's border is in the model than in the picture
_LEAST_SLOPE = 1.0  # grey levels a pixel

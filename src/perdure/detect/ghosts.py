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

from perdure.types import Bits, Image, Regions

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
    return np.array([_is_ghost(mask.bits, mask.y, mask.x, image, mean) for mask in regions.masks], np.bool_)


def _is_ghost(bits: Bits, y: int, x: int, image: Image, mean: Single) -> bool:
    top, left = min(y, _MARGIN), min(x, _MARGIN)
    height, width = bits.shape
    inside = np.zeros(
        (min(y + height + _MARGIN, image.shape[0]) - y + top, min(x + width + _MARGIN, image.shape[1]) - x + left),
        np.uint8,
    )
    inside[top : top + height, left : left + width] = bits
    part = np.s_[y - top : y - top + inside.shape[0], x - left : x - left + inside.shape[1]]
    ring = cv2.morphologyEx(inside, cv2.MORPH_GRADIENT, np.ones((5, 5), np.uint8)) > 0
    seen, known = (_slope(picture[part])[ring].mean() if ring.any() else 0.0 for picture in (image, mean))
    return bool(known > _STEEPER * seen + _LEAST_SLOPE)


def _slope(picture: NDArray[Any]) -> Single:
    """Grey levels a pixel, (H, W): of the channel that changes most."""
    levels = np.ascontiguousarray(picture, np.float32)
    across, down = (cv2.Sobel(levels, cv2.CV_32F, *way, scale=0.125) for way in ((1, 0), (0, 1)))
    steep = cv2.magnitude(across, down)
    return np.maximum(np.maximum(steep[..., 0], steep[..., 1]), steep[..., 2])  # quicker than a reduction


_MARGIN = 3  # pixels around a region
_STEEPER = 1.2  # how much steeper a ghost's border is in the model than in the picture
_LEAST_SLOPE = 1.0  # grey levels a pixel

"""Foreground pixels to regions: clean, label, measure."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.types import Bits, Mask, Regions


def clean(foreground: NDArray[np.uint8], closing: int) -> NDArray[np.uint8]:
    """Remove specks by a 5x5 median and close gaps of up to about `closing` pixels; 0 or 255 in and out."""
    smooth = cv2.medianBlur(foreground, 5)
    if closing < 1:
        return np.asarray(smooth, np.uint8)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * closing + 1, 2 * closing + 1))
    return np.asarray(cv2.morphologyEx(smooth, cv2.MORPH_CLOSE, disc), np.uint8)


def components(foreground: NDArray[np.uint8], least_area: float, roi: Bits | None = None) -> Regions:
    """Return the 8-connected components of at least `least_area` pixels, inside the roi, with their masks.

    Parameters
    ----------
    foreground : (H, W) uint8
        Nonzero where something moves.
    least_area : float
        Pixels.
    roi : (H, W) bool or None
        Only pixels inside count.
    """
    if roi is not None:
        foreground = np.where(roi, foreground, np.uint8(0))
    count, labels, numbers, _ = cv2.connectedComponentsWithStats(foreground, connectivity=8, ltype=cv2.CV_32S)
    large = [label for label in range(1, count) if numbers[label, cv2.CC_STAT_AREA] >= max(least_area, 1.0)]
    if not large:
        return Regions.empty()
    corners = numbers[large][:, [cv2.CC_STAT_LEFT, cv2.CC_STAT_TOP]]  # (N, 2)
    sizes = numbers[large][:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]  # (N, 2)
    masks = [
        Mask(int(y), int(x), labels[y : y + height, x : x + width] == label)
        for label, (x, y), (width, height) in zip(large, corners, sizes, strict=True)
    ]
    return Regions.of(np.concatenate([corners, corners + sizes], axis=1).astype(np.float32), masks=masks)

"""Foreground pixels to regions: clean, decide what is doubtful, close gaps, label, tell bodies apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.detect.joining import joined
from perdure.types import Bits, Mask, Regions


@dataclass(frozen=True)
class Stage:
    """How foreground becomes regions; pixels.

    Parameters
    ----------
    closing : int
        Gaps of up to about this are closed.
    least_area : float
        Smaller components are left out.
    neck : float
        A region is taken apart where it is narrower than this share of both its parts; 0: never.
    hole : float
        Holes of at most this share of a region's area are filled.
    """

    closing: int = 0
    least_area: float = 1.0
    neck: float = 0.0
    hole: float = 0.0


def regions_of(
    foreground: NDArray[np.uint8], stage: Stage, roi: Bits | None = None, mean: NDArray[np.float32] | None = None
) -> Regions:
    """Return the regions of a foreground: cleaned, doubt decided, gaps closed, bodies told apart, pieces joined.

    Parameters
    ----------
    foreground : (H, W) uint8
        255 moving, 0 background; what lies between is doubtful: shadow, or a thing that hardly differs from the ground.
    stage : Stage
        How.
    roi : (H, W) bool or None
        Only pixels inside count.
    mean : (H, W, 3) float32 or None
        The model's mean picture, which tells what may stand in front; None: not known.
    """
    seen, sure = smooth(foreground)
    if roi is not None:
        seen = np.where(roi, seen, np.uint8(0))
    found = components(close(seen, stage.closing), _PIECE * stage.least_area, hole=stage.hole)
    bodies = [
        part
        for mask in found.masks
        for part in (told_apart(mask, sure, stage) if stage.neck and mask.area >= stage.least_area else [mask])
    ]
    masks = [
        mask
        for mask in joined(bodies, mean, stage.closing + _MAJORITY // 2)
        if mask.area >= max(stage.least_area, 1.0)
    ]
    return Regions.of(np.array([mask.box for mask in masks], np.float32), masks=masks)


class Smoothed(NamedTuple):
    """What most of each 5x5 neighbourhood says; 0 or 255."""

    seen: NDArray[np.uint8]  # (H, W) with what is doubtful where moving pixels enclose it
    sure: NDArray[np.uint8]  # (H, W) only where they do so on all four sides


def smooth(foreground: NDArray[np.uint8]) -> Smoothed:
    """Keep what most of each 5x5 neighbourhood says; what is doubtful only where moving pixels enclose it."""
    from perdure.maths.kernels.enclosed import PARTLY, enclosed

    seen, certain = np.zeros_like(foreground), np.zeros_like(foreground)
    moving = cv2.threshold(foreground, 254, 255, cv2.THRESH_BINARY)[1]
    x, y, width, height = cv2.boundingRect(moving)
    if not width:
        return Smoothed(seen, certain)
    reach = _MAJORITY // 2
    rim = (  # outside of it nothing is seen
        slice(max(0, y - reach), y + height + reach),
        slice(max(0, x - reach), x + width + reach),
    )
    sure = _majority(moving[rim])
    some = _majority(cv2.threshold(foreground[rim], 0, 255, cv2.THRESH_BINARY)[1])
    doubtful = np.maximum(sure, some & 127)  # 0, 127, 255
    enclosed(doubtful, np.empty_like(doubtful))
    seen[rim] = cv2.threshold(doubtful, PARTLY - 1, 255, cv2.THRESH_BINARY)[1]
    certain[rim] = cv2.threshold(doubtful, PARTLY, 255, cv2.THRESH_BINARY)[1]
    return Smoothed(seen, certain)


def close(seen: NDArray[np.uint8], closing: int) -> NDArray[np.uint8]:
    """Close gaps of up to about `closing` pixels; 0 or 255."""
    x, y, width, height = cv2.boundingRect(seen)
    if closing < 1 or not width:
        return seen
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * closing + 1, 2 * closing + 1))
    closed = np.zeros_like(seen)  # closing never leaves the box around everything
    cv2.morphologyEx(
        seen[y : y + height, x : x + width], cv2.MORPH_CLOSE, disc, closed[y : y + height, x : x + width]
    )
    return closed


def told_apart(mask: Mask, sure: NDArray[np.uint8], stage: Stage) -> list[Mask]:
    """Return the bodies of a region that hang together by a neck only, by shadow or by a closed gap; else the region.

    Bodies are of like thickness and area: legs, heads and wings are none.
    """
    x1, y1, x2, y2 = mask.box
    step = max(1, math.isqrt(mask.bits.size // _DETAIL))  # a large region is looked at more coarsely
    bits = np.pad(mask.bits[::step, ::step], 1)
    firm = bits & np.pad(sure[y1:y2:step, x1:x2:step] > 0, 1)
    distance = cv2.distanceTransform(firm.view(np.uint8), cv2.DIST_L2, 3)
    relief = np.minimum(4.0 * distance, 65535.0).astype(np.uint16)
    relief[bits & (relief == 0)] = 1  # what was filled or closed joins, but at the lowest
    if relief.max() < 4.0 * _LEAST_THICKNESS:
        return [mask]
    from perdure.maths.kernels.basins import basins

    order = np.argsort(relief, axis=None, kind="stable")[::-1][: np.count_nonzero(relief)]
    least = 2.0 * stage.least_area / step**2
    labels = basins(relief, order, stage.neck, _LIKE_THICKNESS, _LIKE_AREA, least)[1:-1, 1:-1]
    names = np.unique(labels[labels > 0])
    if len(names) < 2:
        return [mask]
    height, width = mask.bits.shape
    whole = np.repeat(np.repeat(labels, step, axis=0), step, axis=1)[:height, :width]
    return [part for name in names if (part := Mask.of_image(mask.bits & (whole == name), mask.y, mask.x)).area]


_MAJORITY = 5  # pixels, the side of the neighbourhood that votes
_PIECE = 0.5  # of the smallest region: what may be a piece of one
_DETAIL = 8192  # pixels of a crop beyond which every second, third, … is enough
_LEAST_THICKNESS = 2.0  # pixels from the middle to the border, below which nothing is a body
_LIKE_THICKNESS = 0.5  # of the thicker body
_LIKE_AREA = 0.35  # of the larger body


def _majority(marks: NDArray[Any]) -> NDArray[np.uint8]:
    share = cv2.blur(marks, (_MAJORITY, _MAJORITY))  # 13 of 25 pixels give 133, 12 give 122
    return np.asarray(cv2.threshold(share, 127, 255, cv2.THRESH_BINARY)[1], np.uint8)


def components(
    foreground: NDArray[np.uint8], least_area: float, roi: Bits | None = None, hole: float = 0.0
) -> Regions:
    """Return the 8-connected components of at least `least_area` pixels, inside the roi, with their masks.

    Components are found by their borders (Suzuki & Abe 1985) and filled one by one, from top to bottom:
    much faster than labelling every pixel of a picture that is mostly background.

    Parameters
    ----------
    foreground : (H, W) uint8
        Nonzero where something moves.
    least_area : float
        Pixels.
    roi : (H, W) bool or None
        Only pixels inside count.
    hole : float
        Holes of at most this share of a component's area are filled.
    """
    if roi is not None:
        foreground = np.where(roi, foreground, np.uint8(0))
    borders, tree = cv2.findContours(foreground, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    masks = []
    for number in range(len(borders) - 1, -1, -1):
        if tree[0, number, _PARENT] < 0:  # not the border of a hole
            x, y, width, height = cv2.boundingRect(borders[number])
            if width * height >= least_area:
                crop = np.zeros((height, width), np.uint8)
                cv2.drawContours(crop, borders, number, 1, cv2.FILLED, 8, tree, 1, (-x, -y))
                inside, largest = tree[0, number, _CHILD], hole * cv2.contourArea(borders[number])
                while inside >= 0:
                    if cv2.contourArea(borders[inside]) < largest:
                        cv2.drawContours(crop, borders, inside, 1, cv2.FILLED, 8, None, 1, (-x, -y))
                    inside = tree[0, inside, _NEXT]
                if np.count_nonzero(crop) >= max(least_area, 1.0):
                    masks.append(Mask(y, x, crop.view(np.bool_)))
    boxes = np.array([mask.box for mask in masks], np.float32)
    return Regions.of(boxes, masks=masks)


_NEXT, _CHILD, _PARENT = 0, 2, 3  # columns of cv2's contour tree

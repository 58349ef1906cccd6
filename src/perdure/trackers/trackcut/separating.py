"""Who owns which pixel where several objects claim the same (§4, eq. 17, 18)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from perdure.features.masks import mask_shares
from perdure.maths.expansion import expand
from perdure.trackers.trackcut.cutting import contrast
from perdure.trackers.trackcut.shapes import depth, in_window
from perdure.trackers.trackcut.targets import Shape
from perdure.trackers.trackcut.windows import around
from perdure.types import Mask

Float = NDArray[np.float32]
_OUTSIDE = 4.0  # κ: what a pixel outside an object's prediction costs it
_LOOKS = 0.3  # weight of what a pixel looks like
_FAR = 0.1  # of each cell of distance from the prediction
_BEFORE = 1.0  # what a pixel that was another's in the frame before costs
_MARGIN = 4.0  # pixels round a cluster


def clusters(masks: list[Mask]) -> list[list[int]]:
    """Return the numbers of masks that hang together by common pixels, of every company of two or more."""
    company, common = list(range(len(masks))), mask_shares(masks, masks) > 0
    for one in range(len(masks)):
        for other in range(one):
            if company[one] != company[other] and common[one, other]:
                old, new = company[one], company[other]
                company = [new if number == old else number for number in company]
    found = [[k for k, number in enumerate(company) if number == one] for one in sorted(set(company))]
    return [some for some in found if len(some) > 1]


def separate(
    masks: list[Mask],
    predicted: list[Shape],
    before: list[Mask],
    looks: list[Callable[[Float], Float]],
    colours: NDArray[np.uint8],
    weight: float,
    cells: int,
) -> list[Mask]:
    """Return the masks of objects that overlap, each pixel given to one of them (eq. 17).

    Parameters
    ----------
    masks : list of Mask
        What each object claims.
    predicted : list of Shape
        Where each should be.
    before : list of Mask
        What each had in the frame before, every pixel carried on by flow.
    looks : list of functions
        Of each object: ln p (h, w) of colours (h, w, 3).
    colours : (H, W, 3) uint8
        The picture.
    weight : float
        λ3.
    cells : int
        How finely it is looked at, at most.
    """
    height, width = colours.shape[:2]
    window = around([mask.box for mask in masks], _MARGIN, cells, (height, width))
    claimed = np.stack([window.of_mask(mask) > 0.5 for mask in masks])  # (N, h, w)
    domain = np.asarray(claimed.any(axis=0), np.bool_)
    seen = window.cut(colours).astype(np.float32)
    costs, _ = contrast(seen, weight)
    unary = np.zeros((len(masks), *window.shape), np.float64)
    for number, shape in enumerate(predicted):
        inside = in_window(shape, window) > 0.5
        unary[number] = (
            _OUTSIDE * ~inside
            - _BEFORE * (window.of_mask(before[number]) > 0.5)
            - _LOOKS * looks[number](seen)
            - _FAR * np.clip(depth(inside), -20, 20)
        )
    labels = expand(unary, costs.astype(np.float64), domain=domain).labels
    return [window.to_mask((labels == number) & domain, height, width) for number in range(len(masks))]

"""Observations compete: which part of each may be whose, before anything is cut out (§3.2, beyond the paper).

The paper lets every object take any observation that its prediction touches. An object then keeps hold of all that it
ever touched: of a company's one region, and of both when the company parts. Here a region that several objects claim
is divided among them by how deep each pixel lies in their predictions, with a band that stays open for the second
energy; and an object that holds several regions lets go of those that are too far from its main one to be parts of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.features.masks import mask_shares
from perdure.trackers.trackcut.shapes import depth
from perdure.types import Mask

Box = tuple[int, int, int, int]
_CLAIM = 0.2  # common share of the smaller of a prediction and an observation, from which it is claimed
_BAND = 0.12  # of the square root of a prediction's area, pixels: how far across the middle a part reaches
HALF = 0.3  # of the area of the larger of two regions, that the smaller has if they may be two objects
_GAP = 0.35  # of the shorter side of an object's main observation, that its other ones may be away from it
_NEAR = 4.0  # pixels, that they always may


class Claim(NamedTuple):
    """What an object may take of an observation."""

    number: int  # of the observation
    part: Mask  # of it
    alone: bool  # whether nobody else claims any of it


def claims(
    predicted: Sequence[Mask], seen: Sequence[bool], single: Sequence[bool], observations: Sequence[Mask]
) -> list[list[Claim]]:
    """Return what each object may take.

    Parameters
    ----------
    predicted : N masks
        Where each object should be.
    seen : N bool
        Whether it was seen in the frame before; who was not claims what nobody else does, and divides nothing.
    single : N bool
        Whether it has held several large regions for so long that it can have only one of them.
    observations : M masks
        The regions of the frame.
    """
    if not len(predicted) or not len(observations):
        return [[] for _ in predicted]
    of_prediction = mask_shares(predicted, observations)  # (N, M)
    of_observation = mask_shares(observations, predicted).T
    claimed = np.maximum(of_prediction, of_observation) >= _CLAIM
    areas = np.array([one.area for one in predicted], np.float64)
    common = of_prediction * areas[:, None]
    for i, there in enumerate(seen):
        if there:
            _let_go(claimed[i], common[i], observations, single[i])
    visible = claimed & np.asarray(seen)[:, None]
    found: list[list[Claim]] = [[] for _ in predicted]
    for j, observation in enumerate(observations):
        those = np.flatnonzero(visible[:, j]).tolist()
        if len(those) > 1:
            parts = divided(observation, [predicted[i] for i in those])
            for i, part in zip(those, parts, strict=True):
                found[i].append(Claim(j, part, False))
        for i in np.flatnonzero(claimed[:, j]).tolist():
            if len(those) <= 1 or i not in those:
                found[i].append(Claim(j, observation, not those or those == [i]))
    return found


def divided(observation: Mask, predicted: Sequence[Mask]) -> list[Mask]:
    """Return the part of an observation that each of several predictions may take; they overlap by a band."""
    boxes = [observation.box, *(one.box for one in predicted)]
    x1, y1 = min(box[0] for box in boxes) - 1, min(box[1] for box in boxes) - 1
    x2, y2 = max(box[2] for box in boxes) + 1, max(box[3] for box in boxes) + 1
    where = (x1, y1, x2, y2)
    deep = np.stack([depth(_crop(one, where)) for one in predicted])  # (N, h, w)
    bits = _crop(observation, where)
    parts = []
    for number, one in enumerate(predicted):
        others = np.delete(deep, number, axis=0).max(axis=0)
        parts.append(Mask.of_image(bits & (deep[number] >= others - _BAND * np.sqrt(one.area)), y1, x1))
    return parts


def _let_go(
    claimed: NDArray[np.bool_], common: NDArray[np.float64], observations: Sequence[Mask], single: bool
) -> None:
    """Take from an object's claims (M,) those that are too far from the one it has most in common with."""
    mine = np.flatnonzero(claimed)
    if len(mine) < 2:
        return
    main = observations[int(mine[np.argmax(common[mine])])]
    x1, y1, x2, y2 = main.box
    reach = max(_GAP * min(x2 - x1, y2 - y1), _NEAR)
    for j in mine.tolist():
        if observations[j] is main:
            continue
        if (single and observations[j].area >= HALF * main.area) or apart(main, observations[j]) > reach:
            claimed[j] = False


def apart(one: Mask, other: Mask) -> float:
    """Return the least distance between two silhouettes, pixels."""
    boxes = (one.box, other.box)
    where = (
        min(box[0] for box in boxes),
        min(box[1] for box in boxes),
        max(box[2] for box in boxes),
        max(box[3] for box in boxes),
    )
    bits = _crop(one, where)
    if not bits.any() or not other.area:
        return float("inf")
    away = cv2.distanceTransform((~bits).astype(np.uint8), cv2.DIST_L2, 3)
    return float(away[_crop(other, where)].min())


def _crop(mask: Mask, where: Box) -> NDArray[np.bool_]:
    """The pixels (h, w) of a mask in a box that holds it."""
    x1, y1, x2, y2 = where
    bits = np.zeros((y2 - y1, x2 - x1), np.bool_)
    left, top, right, bottom = mask.box
    bits[top - y1 : bottom - y1, left - x1 : right - x1] = mask.bits
    return bits

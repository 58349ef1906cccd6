"""Companies: who is together with whom, and who of them is hidden (beyond the paper)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.features.masks import mask_shares
from perdure.trackers.trackcut.expecting import Expected
from perdure.trackers.trackcut.placing import Company
from perdure.trackers.trackcut.targets import Target
from perdure.types import Mask

_SQUEEZED = 10  # frames after which who has a small share of one silhouette is hidden
_SMALL_PART, _ONE = 0.5, 1.25  # of its own size, that such a share has at most; of the other's, that both have
_BEFORE = 0.2  # share of a hidden object's place, from which what covers it is its company


def sharing(links: list[tuple[int, ...]], met: list[list[int]]) -> NDArray[np.bool_]:
    """Return which objects (N, N) share an observation or pixels."""
    near = np.zeros((len(links), len(links)), np.bool_)
    for i, one in enumerate(links):
        for j, other in enumerate(links[:i]):
            near[i, j] = near[j, i] = bool(set(one) & set(other))
    for some in met:
        near[np.ix_(some, some)] = True
    np.fill_diagonal(near, False)
    return near


def companies(
    targets: list[Target], masks: list[Mask], predicted: list[Mask], near: NDArray[np.bool_]
) -> list[tuple[int, ...]]:
    """Return whom each object may be mistaken for: with whom it has been together since it was last by itself."""
    keys = {one.key for one in targets}
    hidden = [k for k, mask in enumerate(masks) if not mask.area]
    near = near.copy()
    for k in hidden:
        before = mask_shares([predicted[k]], masks)[0] > _BEFORE
        near[k] |= before
        near[:, k] |= before
    return [
        tuple(sorted({*one.company, *(targets[int(k)].key for k in np.flatnonzero(row))} & keys))
        for one, row in zip(targets, near, strict=True)
    ]


def company_of(
    target: Target, targets: list[Target], ahead: list[Expected], observations: list[Mask], size: tuple[int, int]
) -> Company | None:
    """Return among whom an object is, if it is together with any."""
    if not target.together or not target.company:
        return None
    rivals, places = [], []
    for number, one in enumerate(targets):
        if one.key in target.company:
            rivals.append(one.first)
            if one.missed == 0 and number < len(ahead):
                places.append(ahead[number].window.to_mask(ahead[number].belief > 0.5, *size))
            elif one.missed == 0:
                places.append(one.mask)
    return Company(rivals, places, observations) if rivals else None


def hosts(targets: list[Target], masks: list[Mask], near: NDArray[np.bool_]) -> tuple[list[int], list[Mask]]:
    """Return for how many frames what each object shares with another has been no more than that one, and the masks.

    Who has had a small share of another's silhouette for long is hidden: the other has it.
    """
    masks, counts = list(masks), []
    for k, one in enumerate(targets):
        part = masks[k].area
        others = [
            i
            for i in np.flatnonzero(near[k]).tolist()
            if masks[i].area > part and masks[i].area + part <= _ONE * targets[i].mean
        ]
        if one.marked or not part or part >= _SMALL_PART * one.mean or not others:
            counts.append(max(one.squeezed - 1, 0))
            continue
        counts.append(min(one.squeezed + 1, 2 * _SQUEEZED))
        if counts[-1] >= _SQUEEZED:
            host = max(others, key=lambda i: masks[i].area)
            masks[host], masks[k] = _joined(masks[host], masks[k]), Mask.empty()
    return counts, masks


def _joined(one: Mask, other: Mask) -> Mask:
    """The pixels of both."""
    x1, y1 = min(one.box[0], other.box[0]), min(one.box[1], other.box[1])
    x2, y2 = max(one.box[2], other.box[2]), max(one.box[3], other.box[3])
    bits = np.zeros((y2 - y1, x2 - x1), np.bool_)
    for mask in (one, other):
        left, top, right, bottom = mask.box
        bits[top - y1 : bottom - y1, left - x1 : right - x1] |= mask.bits
    return Mask(y1, x1, bits)

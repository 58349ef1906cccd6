"""The silhouette of what somebody drew a box or a rough outline around: GrabCut, its colours learnt without chance.

"GrabCut": Rother, Kolmogorov, Blake: Interactive foreground extraction using iterated graph cuts, SIGGRAPH 2004, as
OpenCV has it. OpenCV begins with k-means, which draws from a generator that the whole process shares; here the two
mixtures are given to it, each of five equal shares of the pixels along their strongest change of colour, as the
paper's own colour quantisation begins. Nothing is drawn from a generator, and nobody else's draws are changed.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.types import Bits, Image, Mask

_ROUNDS = 5  # of learning colours and cutting
_COMPONENTS = 5  # of each mixture; OpenCV's own number
_SURROUNDINGS = 0.25  # of the outline's longer side: how far around it the ground is looked at
_LEAST_SURROUNDINGS = 8  # px
_CORE = 0.9  # of the largest distance to the outline: what lies deeper is the thing
_LEAST_FILLED = 0.05  # of what may be the thing: where less is found, nothing is
_LEAST_VARIANCE = 1.0  # squared grey levels, of a component
_SMALLEST_PIECE = 0.1  # of the largest piece; what is smaller is a speck
_LARGEST = 100_000  # px: a larger part of the picture is made smaller first


def silhouette(image: Image, outline: Mask) -> Mask:
    """Return the thing inside an outline, as its colours tell it from what lies around.

    Parameters
    ----------
    image : (H, W, 3) uint8
        The picture.
    outline : Mask
        The thing lies inside it, its innermost pixels are the thing's, and what lies outside is ground.

    Returns
    -------
    Mask
        Tight, inside the outline and the picture; empty where the colours tell next to nothing from the ground.
    """
    height, width = image.shape[:2]
    x1, y1, x2, y2 = _surroundings(outline, height, width)
    part = np.ascontiguousarray(image[y1:y2, x1:x2])  # (h, w, 3)
    inside = outline.to_image(height, width)[y1:y2, x1:x2]  # (h, w)
    scale = min(1.0, (_LARGEST / max(inside.size, 1)) ** 0.5)
    if scale == 1.0:
        return Mask.of_image(_cut(part, inside), y1, x1)
    size = round(scale * (x2 - x1)), round(scale * (y2 - y1))
    small = cv2.resize(inside.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    little = np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_AREA), np.uint8)
    found = _cut(little, small).astype(np.float32)
    return Mask.of_image((cv2.resize(found, (x2 - x1, y2 - y1)) > 0.5) & inside, y1, x1)


def _cut(image: Image, inside: Bits) -> Bits:
    """The thing's pixels (h, w) among those inside."""
    if inside.all() or not inside.any():
        return inside
    depth = cv2.distanceTransform(np.pad(inside, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]  # (h, w) px
    labels = np.where(inside, cv2.GC_PR_FGD, cv2.GC_BGD).astype(np.uint8)  # (h, w)
    labels[depth >= _CORE * depth.max()] = cv2.GC_FGD
    undecided = np.count_nonzero(labels == cv2.GC_PR_FGD)
    ground, thing = _mixture(image[~inside]), _mixture(image[inside])
    cv2.grabCut(image, labels, None, ground, thing, _ROUNDS, cv2.GC_EVAL)  # type: ignore[call-overload]
    if np.count_nonzero(labels == cv2.GC_PR_FGD) < _LEAST_FILLED * undecided:
        return np.zeros_like(inside)
    return _without_specks((labels == cv2.GC_PR_FGD) | (labels == cv2.GC_FGD))


def _surroundings(outline: Mask, height: int, width: int) -> tuple[int, int, int, int]:
    """The box x1 y1 x2 y2 in the picture that is looked at."""
    x1, y1, x2, y2 = outline.box
    reach = max(_LEAST_SURROUNDINGS, round(_SURROUNDINGS * max(x2 - x1, y2 - y1)))
    return max(x1 - reach, 0), max(y1 - reach, 0), min(x2 + reach, width), min(y2 + reach, height)


def _mixture(colours: NDArray[np.uint8]) -> NDArray[np.float64]:
    """The first mixture of colours (N, 3), as OpenCV keeps it: weights, means, covariances in one row."""
    values = colours.astype(np.float64)  # (N, 3)
    axis = np.linalg.eigh(np.cov(values.T, bias=True))[1][:, -1] if len(values) > 1 else np.ones(3)
    order = np.argsort(values @ axis, kind="stable")  # (N,)
    weights, means = np.zeros(_COMPONENTS), np.zeros((_COMPONENTS, 3))
    covariances = np.tile(_LEAST_VARIANCE * np.eye(3), (_COMPONENTS, 1, 1))  # (5, 3, 3)
    for number, share in enumerate(np.array_split(values[order], _COMPONENTS)):
        if len(share):
            weights[number], means[number] = len(share) / len(values), share.mean(axis=0)
            covariances[number] += np.cov(share.T, bias=True)
    return np.concatenate([weights, means.ravel(), covariances.ravel()])[None]  # (1, 65)


def _without_specks(bits: Bits) -> Bits:
    """The pieces that are not tiny beside the largest."""
    count, pieces, numbers, _ = cv2.connectedComponentsWithStats(bits.astype(np.uint8), connectivity=8)
    if count < 2:
        return bits
    areas = numbers[:, cv2.CC_STAT_AREA]  # (K,)
    kept = areas >= _SMALLEST_PIECE * areas[1:].max()
    kept[0] = False
    return np.asarray(kept[pieces], np.bool_)

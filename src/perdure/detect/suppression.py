"""Of several boxes of one thing the surest: non-maximum suppression, class by class."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import overlaps
from perdure.types import Boxes


def one_each(
    boxes: Boxes, scores: NDArray[np.floating], kinds: NDArray[np.integer], most: float
) -> NDArray[np.intp]:
    """Return which boxes stay, the surest first: none that overlaps a surer one of its kind by more than `most`.

    Parameters
    ----------
    boxes : (N, 4) float32
        Finite.
    scores : (N,) float
        Of equal ones the first is the surer.
    kinds : (N,) int
        Number of the class; boxes of different kinds do not suppress each other.
    most : float
        Intersection over union in [0, 1].

    >>> one_each(np.float32([[0, 0, 9, 9], [1, 0, 9, 9], [1, 0, 9, 9]]), np.array([.5, .9, .3]), np.array([0, 0, 1]), .45)
    array([1, 2])
    """
    order = np.argsort(-scores, kind="stable")
    boxes, kinds = boxes[order], kinds[order]
    stays = np.ones(len(order), np.bool_)
    for k in range(len(order)):
        if stays[k]:
            later = k + 1 + np.flatnonzero(stays[k + 1 :] & (kinds[k + 1 :] == kinds[k]))
            stays[later] = overlaps(boxes[k : k + 1], boxes[later])[0] <= most
    return np.asarray(order[stays], np.intp)

"""Where an object is in its company: its silhouette laid where what is seen looks most like it (beyond the paper).

Who is partly hidden is carried on by few pixels, and who is hidden by none; both stray within some frames. Here the
remembered silhouette is tried at every place near the expected one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.trackers.trackcut.likelihoods import of_looks
from perdure.trackers.trackcut.targets import Colours
from perdure.types import Mask

Float = NDArray[np.float32]
_FAR = 0.15  # of the silhouette's side: the deviation of the place that is expected
_LEAST = 3.0  # cells, that it is at least
_REACH = 2.0  # deviations, that are tried
_FOR, _AGAINST = 2.0, 1.0  # nats of a pixel, at most; less against, as another may be before it
_EXPLAINED, _UNEXPLAINED = 0.3, 0.5  # nats at most where another is, and more where nobody is
_OPEN = 2.0  # nats against a pixel where the detector saw the background
_WEIGHT = 15.0  # pixels that count as independent


class Company(NamedTuple):
    """Among whom an object is."""

    rivals: Sequence[Colours]  # what the others look like
    places: Sequence[Mask]  # where those are that were seen
    observed: Sequence[Mask]  # the regions of the frame


def placed(
    belief: Float,
    colours: Float,
    own: Colours,
    company: Company,
    foreground: NDArray[np.bool_] | None,
    explained: NDArray[np.bool_],
) -> tuple[int, int]:
    """Return by how many cells, across and down, a silhouette is to be moved.

    Parameters
    ----------
    belief : (h, w) in [0, 1]
        The silhouette where it is expected.
    colours : (h, w, 3)
        What is seen.
    own : Colours
        What the object looked like before it met the others.
    company : Company
        The others.
    foreground : (h, w) bool, or None
        What the detector saw; None if it saw nothing.
    explained : (h, w) bool
        Where others are: what is seen there tells little of this one.
    """
    rows, columns = np.nonzero(belief > 0.5)
    if not len(rows):
        return 0, 0
    height, width = belief.shape
    top, bottom, left, right = rows.min(), rows.max() + 1, columns.min(), columns.max() + 1
    spread = max(_FAR * float(np.sqrt(len(rows))), _LEAST)
    reach = int(np.ceil(_REACH * spread))
    y1, y2, x1, x2 = top - reach, bottom + reach, left - reach, right + reach
    inner = (slice(max(y1, 0), min(y2, height)), slice(max(x1, 0), min(x2, width)))
    points = colours[inner].reshape(-1, 3)
    others = [of_looks(points, one) for one in company.rivals] + [_elsewhere(points, own)]
    ratio = of_looks(points, own) - np.max(others, axis=0)
    score = np.clip(ratio, -_AGAINST, _FOR).reshape(colours[inner].shape[:2]).astype(np.float32)
    score = np.where(explained[inner], np.minimum(score, _EXPLAINED), score + _UNEXPLAINED).astype(np.float32)
    if foreground is not None:
        score[~foreground[inner]] = -_OPEN
    sides = (max(-y1, 0), max(y2 - height, 0), max(-x1, 0), max(x2 - width, 0))
    score = cv2.copyMakeBorder(score, *sides, cv2.BORDER_CONSTANT, value=-_OPEN)
    kernel = (belief[top:bottom, left:right] > 0.5).astype(np.float32)
    fit = cv2.matchTemplate(score, kernel, cv2.TM_CCORR) / kernel.sum()  # (2 reach + 1, 2 reach + 1)
    steps = np.arange(-reach, reach + 1)
    far = (steps[:, None] ** 2 + steps[None] ** 2) / (2 * spread**2)
    down, across = np.unravel_index(int(np.argmax(_WEIGHT * fit - far)), fit.shape)
    return int(across) - reach, int(down) - reach


def _elsewhere(points: Float, own: Colours) -> Float:
    """Return ln p (N,) of colours (N, 3) under what surrounded the object."""
    return of_looks(points, Colours(own.other, own.own))

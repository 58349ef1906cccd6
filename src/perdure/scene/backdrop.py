"""The backdrop: what each place of the picture looks like when nothing is before it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.types import Bits

Float = NDArray[np.float32]
LEAST = 9.0  # variance of one channel, that a place has at least
_UNSURE = 60.0  # that it has at first


@dataclass(frozen=True, eq=False)
class Backdrop:
    """What is behind everything that is followed.

    Parameters
    ----------
    colours : (H, W, 3) float32
        Mean of what was seen.
    variance : (H, W) float32
        Of one channel about it.
    known : (H, W) bool
        Where anything was seen.
    """

    colours: Float
    variance: Float
    known: Bits

    @staticmethod
    def unknown(height: int, width: int) -> Backdrop:
        """Return the backdrop of which nothing was seen."""
        variance = np.full((height, width), _UNSURE, np.float32)
        return Backdrop(np.zeros((height, width, 3), np.float32), variance, np.zeros((height, width), np.bool_))


def carried(backdrop: Backdrop, camera: NDArray[np.float64]) -> Backdrop:
    """Return the backdrop as a camera sees it that has moved: by (2, 3), from pixels before to pixels now."""
    if np.array_equal(camera, np.eye(2, 3)):
        return backdrop
    size = (backdrop.known.shape[1], backdrop.known.shape[0])
    known = cv2.warpAffine(backdrop.known.view(np.uint8), camera, size, flags=cv2.INTER_NEAREST)
    return Backdrop(
        np.asarray(cv2.warpAffine(backdrop.colours, camera, size, borderMode=cv2.BORDER_REPLICATE), np.float32),
        np.asarray(cv2.warpAffine(backdrop.variance, camera, size, borderMode=cv2.BORDER_REPLICATE), np.float32),
        np.asarray(known, np.uint8).view(np.bool_),
    )


def learn(backdrop: Backdrop, colours: NDArray[np.uint8], things: Bits) -> None:
    """Learn the colours (H, W, 3) of a frame into a backdrop, but for where things (H, W) are before it.

    What was seen for long is learnt quickly, anything else at a place slowly: it may be a thing that nobody noticed.
    """
    from perdure.maths.kernels import backdrops

    backdrops.learn(
        np.ascontiguousarray(colours),
        np.ascontiguousarray(things),
        np.float32(LEAST),
        backdrop.colours,
        backdrop.variance,
        backdrop.known,
    )

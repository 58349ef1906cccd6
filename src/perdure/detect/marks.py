"""What the neighbourhood says of a pixel's mark: evenly darker ground is shadow, a pale rim is a halo."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.types import Image

Single = NDArray[np.float32]
Marks = NDArray[np.uint8]  # (H, W), those of perdure.maths.kernels.gaussian


class Ground(NamedTuple):
    """The model's picture and noise."""

    mean: Single  # (H, W, 3) grey levels
    variance: Single  # (H, W) squared grey levels
    least_noise: float  # grey levels, assumed where less is measured


def take_out_shadows(marks: Marks, image: Image, exposure: Single, ground: Ground) -> None:
    """Decide what is much darker than the ground: a shadow where it is so evenly, and around such places; in place.

    Parameters
    ----------
    marks : (H, W) uint8, changed
        DARKENED ones become SHADOW or MOVING.
    image : (H, W, 3) uint8
        The picture.
    exposure : (3,) float32
        What brings it to the model's exposure.
    ground : Ground
        The model.
    """
    from perdure.maths.kernels.gaussian import DARKENED, MOVING, SHADOW
    from perdure.maths.kernels.shadow import REACH, evenly_darker

    x, y, width, height = cv2.boundingRect(marks)
    part = np.s_[y : y + height, x : x + width]
    here = marks[part]
    darkened = here == DARKENED
    if not darkened.any():
        return
    even = np.empty_like(here)
    least, uneven = np.float32(ground.least_noise**2), np.float32(_UNEVEN)
    evenly_darker(image[part], exposure, ground.mean[part], ground.variance[part], here, even, least, uneven)
    around = cv2.dilate(even, np.ones((2 * REACH + 1, 2 * REACH + 1), np.uint8))
    here[darkened] = np.where(around[darkened], SHADOW, MOVING)


def take_off_halo(marks: Marks, contrast: NDArray[np.uint8]) -> None:
    """Leave undecided what is far paler than a neighbour: lens, codec and colour sampling draw borders out; in place.

    Parameters
    ----------
    marks : (H, W) uint8, changed
        MOVING ones may become WEAK.
    contrast : (H, W) uint8
        Grey levels between picture and model.
    """
    from perdure.maths.kernels.gaussian import MOVING, WEAK

    x, y, width, height = cv2.boundingRect(marks)
    if not width:
        return
    part = np.s_[y : y + height, x : x + width]
    here, seen = marks[part], contrast[part]
    strongest = cv2.dilate(seen, np.ones((3, 3), np.uint8))
    paler = cv2.compare(seen, cv2.LUT(strongest, _HALO), cv2.CMP_LT)
    np.copyto(here, WEAK, where=(paler > 0) & (here == MOVING))


_UNEVEN = 1.5  # squared noises that a shadow may differ from the ground times one factor
_PALER = 0.4  # of a neighbour's contrast: what has less may be its halo
_HALO = np.ceil(_PALER * np.arange(256)).astype(np.uint8)  # least contrast beside each

"""Sudden light: a change of the whole picture's brightness, and a model brought to another light place by place.

A lamp, a cloud or the camera's gain multiplies what is seen, by one factor or by one that varies slowly over the picture;
the ground's texture stays. So a model need not be learnt anew: the factor of each place is the median of picture / model
over a block, which is the ground's as long as things cover less than half of it.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.detect.first_look import MOST
from perdure.types import Event, Image

Single = NDArray[np.float32]


@dataclass(frozen=True)
class Light:
    """How bright the picture is beside the model, and how much of it moves."""

    level: float = math.inf  # log of the brightness, picture / model, running mean; infinite at first
    busy: float = 0.0  # share of the picture that moves, running mean
    told: float = -math.inf  # s, when a change was last told
    blind: int = -1  # frame from which on nothing can be seen; -1: all is well
    since: float = 0.0  # s, the same


def followed(
    light: Light, factor: Single, frame: int, time: float, elapsed: float
) -> tuple[Light, tuple[Event, ...]]:
    """Follow the picture's brightness; tell of a jump.

    Parameters
    ----------
    light : Light
        As of the frame before.
    factor : (3,) float32
        What brings the picture to the model's exposure.
    frame, time, elapsed : int, float, float
        This frame, its time and that since the one before, s.
    """
    level = -float(np.log(factor).mean())
    if not math.isfinite(light.level):
        return dataclasses.replace(light, level=level), ()
    jump = level - light.level
    if abs(jump) < _JUMP:
        share = 1.0 - math.exp(-elapsed / _FOLLOWED)
        return dataclasses.replace(light, level=light.level + share * jump), ()
    events: tuple[Event, ...] = ()
    if time - light.told > _FOLLOWED:
        events = (Event("light", frame, frame, why=f"all of the picture is {math.exp(jump):.2f} times as bright"),)
    return dataclasses.replace(light, level=level, told=time), events


def is_sudden(light: Light, busy: float, jumped: bool = False) -> bool:
    """Whether so large a share of the picture moves, and moved so little before, that the light must have changed.

    A smaller share is enough if the whole picture's brightness has jumped with it: then not all of it by one factor.
    """
    return (busy > _MOST and busy - light.busy > _SUDDEN) or (jumped and busy - light.busy > _UNEVEN)


def busier(light: Light, busy: float, elapsed: float) -> Light:
    """Follow the share of the picture that moves."""
    share = 1.0 - math.exp(-elapsed / _FOLLOWED)
    return dataclasses.replace(light, busy=light.busy + share * (busy - light.busy))


def is_empty(image: Image, mean: Single) -> bool:
    """Return whether a picture has nothing in it, all of one brightness, where the model has."""
    step = max(1, min(mean.shape[:2]) // _SAMPLED)
    return bool(np.ptp(image[::step, ::step]) < _FLAT and np.ptp(mean[::step, ::step]) > 2 * _FLAT)


def texture(image: Image, exposure: Single, mean: Single) -> float:
    """Return how much of the model's texture a picture shows, at most about 1; 0 where nothing of it is left.

    The least squares factor between their slopes: a light dims the texture as it dims the ground, and a relit model
    allows for that; fog, glare, a hand before the lens or black take it away.

    Parameters
    ----------
    image : (H, W, 3) uint8
        The picture.
    exposure : (3,) float32
        What each channel is multiplied by first.
    mean : (H, W, 3) float32
        The model's, in the light of the picture.
    """
    step = max(1, min(mean.shape[:2]) // _SAMPLED)
    seen, known = image[::step, ::step, 1] * exposure[1], mean[::step, ::step, 1]
    both = length = 0.0
    for axis in (0, 1):
        slope = np.diff(known, axis=axis)
        both += float(np.vdot(slope, np.diff(seen, axis=axis)))
        length += float(np.vdot(slope, slope))
    return both / length if length > 0.0 else 0.0


def relit(image: Image, exposure: Single, mean: Single, held: NDArray[np.uint8]) -> Single:
    """Return the model's picture in the light of this one, (H, W, 3).

    Parameters
    ----------
    image : (H, W, 3) uint8
        The picture.
    exposure : (3,) float32
        What each channel is multiplied by first.
    mean : (H, W, 3) float32
        The model's, grey levels.
    held : (H, W) uint8
        Not 0 where something stood in the frame before: there the light is that of the places around.
    """
    height, width = mean.shape[:2]
    side = max(_LEAST_SIDE, min(height, width) // _BLOCKS)
    rows, columns = max(1, height // side), max(1, width // side)
    y, x = np.linspace(0, height, rows + 1).astype(int), np.linspace(0, width, columns + 1).astype(int)
    field, known = np.ones((rows, columns, 3), np.float32), np.zeros((rows, columns, 1), np.float32)
    for i in range(rows):
        for j in range(columns):
            block = np.s_[y[i] : y[i + 1] : 2, x[j] : x[j + 1] : 2]
            free = held[block] == 0
            if 2 * np.count_nonzero(free) > free.size:
                ratio = image[block][free].astype(np.float32) * exposure / np.maximum(mean[block][free], 1.0)
                field[i, j], known[i, j] = np.median(ratio, axis=0), 1.0
    if min(rows, columns) >= 3:  # a thing that fills a block is no lamp
        smooth = np.dstack([cv2.medianBlur(np.ascontiguousarray(field[..., c]), 3) for c in range(3)])
        field = np.where(known > 0, smooth, field)
    if known.any():
        field = _filled(field, known)
    field = np.clip(field, 1.0 / MOST, MOST)  # beyond, it is no light: a cap on the lens, or the sun in it
    whole = cv2.resize(field, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(mean * whole, np.float32)


def _filled(field: Single, known: Single) -> Single:
    """The field with unknown blocks (known is 0, else 1; (h, w, 1)) filled from those around them, ring by ring."""
    box = (3, 3)
    while not known.all():
        weight = cv2.blur(known, box, borderType=cv2.BORDER_CONSTANT)[..., None]
        around = cv2.blur(field * known, box, borderType=cv2.BORDER_CONSTANT) / np.maximum(weight, 1e-6)
        field = np.where(known > 0, field, around).astype(np.float32)
        known = (weight > 1e-6).astype(np.float32)
    return field


_SAMPLED = 144  # rows at which pictures are compared
_FLAT = 40  # grey levels between the darkest and the brightest pixel
_JUMP = math.log(1.2)  # of the brightness: less is the camera's gain, all day long
_FOLLOWED = 0.5  # s over which brightness and movement are averaged
_MOST = 0.5  # of the picture: things do not come to cover more at once
_SUDDEN = 0.35  # of the picture: how much more moves than did
_UNEVEN = 0.1  # of the picture: how much more moves if not all of it changed by one factor
_BLOCKS = 18  # along the shorter side
_LEAST_SIDE = 8  # pixels

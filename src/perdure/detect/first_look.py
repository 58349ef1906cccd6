"""A first look: the median and the quiet noise of pictures spread over a film, or over the first seconds of a live source."""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.detect.steady import aligned
from perdure.types import Image

Single = NDArray[np.float32]
Pictures = NDArray[np.uint8]  # (N, H, W, 3)


@dataclass(frozen=True, eq=False)
class FirstLook:
    """What a look over several pictures gave: the median picture and its noise."""

    mean: Single  # (H, W, 3) grey levels
    variance: Single  # (H, W) squared grey levels, mean over channels


@dataclass(frozen=True, eq=False)
class Early:
    """Pictures of the first seconds of a live source, gathered for a look over them."""

    pictures: Pictures  # none once all is gathered
    count: int = 0  # pictures gathered so far
    due: float = -np.inf  # s, when the next one is

    @staticmethod
    def none_yet(height: int, width: int) -> Early:
        """Return what has been gathered before the first picture of this size."""
        return Early(np.empty((0, height, width, 3), np.uint8))

    @staticmethod
    def no_more(height: int, width: int) -> Early:
        """Return what is left when nothing is to be gathered any more."""
        return Early(np.empty((0, height, width, 3), np.uint8), _LOOKS[-1])

    @property
    def is_over(self) -> bool:
        """Whether all is gathered."""
        return self.count >= _LOOKS[-1]

    def with_picture(self, picture: Image, time: float) -> tuple[Early, FirstLook | None]:
        """Take in a picture if one is due; now and then, return a look over all of them."""
        if self.is_over or time < self.due:
            return self, None
        pictures = np.concatenate([self.pictures, picture[None]])
        early = Early(pictures, len(pictures), time + _APART)
        if early.count not in _LOOKS:
            return early, None
        return dataclasses.replace(early, pictures=pictures[:0]) if early.is_over else early, look_over(pictures)


def look_over(images: NDArray[np.uint8]) -> FirstLook:
    """Return median and noise of pictures spread over a film, (N, H, W, 3) uint8.

    All are first brought to one exposure, that of their median, so that a slow change of light is not taken for
    noise, and laid onto one another if the camera shook. The noise is that of the quieter third: a low quantile of the deviations from the median, scaled to a
    Gaussian's standard deviation; where things pass for half of the time it is still that of the background.
    """
    images = images[: len(images) - (1 - len(images) % 2)]  # an odd number: the median is one of them
    mean, _ = _median_and_noise(images)
    factors = [exposure(image, mean) for image in images]
    if any((factor != 1.0).any() for factor in factors):
        images = np.stack([exposed(image, factor) for image, factor in zip(images, factors, strict=True)])
    return FirstLook(*_median_and_noise(aligned(images)))


def _median_and_noise(images: NDArray[np.uint8]) -> tuple[Single, Single]:
    """The median (H, W, 3) and the squared noise (H, W) of an odd number of pictures."""
    half, low = len(images) // 2, round(_QUIET * (len(images) - 1))
    mean = np.empty(images.shape[1:], np.float32)
    variance = np.empty(images.shape[1:3], np.float32)

    def look(y: int) -> None:
        strip = images[:, y : y + _STRIP]  # (N, strip, W, 3)
        middle = np.partition(strip, half, axis=0)[half]
        deviation = np.partition(np.maximum(strip, middle) - np.minimum(strip, middle), low, axis=0)[low]
        mean[y : y + _STRIP] = middle
        variance[y : y + _STRIP] = np.square(deviation * _GAUSSIAN).mean(axis=2)

    with ThreadPoolExecutor(2) as threads:  # strips that stay in the cache; each writes its own rows
        list(threads.map(look, range(0, images.shape[1], _STRIP)))
    return mean, variance


def exposed(image: Image, factor: Single) -> Image:
    """Return a picture whose channels are multiplied, in whole grey levels."""
    levels = np.arange(256, dtype=np.float32)[:, None] * factor  # (256, 3)
    table = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(image, table[None]), np.uint8)


def exposure(image: Image, mean: Single) -> Single:
    """Return the factor per channel (3,) that brings a picture to the model's exposure.

    The median of mean / image over a coarse grid: right as long as less than half of it is foreground.
    Within one percent it is 1, so that a still scene stays untouched; beyond a factor of MOST no light explains it.
    """
    step = max(1, min(image.shape[:2]) // _GRID)
    seen = image[::step, ::step].astype(np.float32)
    factors = np.median(np.maximum(mean[::step, ::step], 1.0) / np.maximum(seen, 1.0), axis=(0, 1))
    factors = np.clip(factors, 1.0 / MOST, MOST)
    return np.where(np.abs(factors - 1.0) < 0.01, 1.0, factors).astype(np.float32)


def has_colour(image: Image) -> bool:
    """Return whether a picture has colour at all; in a grey one nothing tells a shadow from a dark thing."""
    step = max(1, min(image.shape[:2]) // _GRID)
    seen = image[::step, ::step].astype(np.int16)
    return bool((np.ptp(seen, axis=2) > _GREY).any())


MOST = 5.0  # times brighter or darker
_GREY = 4  # grey levels that the channels of a colourless picture may differ by
_STRIP = 32  # rows
_GRID = 32  # rows of the grid on which the exposure is measured
_QUIET = (
    0.3  # quantile of the deviations that tells the noise: traffic may hide the background for longer than half
)
_GAUSSIAN = 1 / 0.3853  # standard deviation of a Gaussian / that quantile of its absolute deviations
_LOOKS = (5, 9, 17)  # pictures of the first seconds after which they are looked over
_APART = 0.2  # s between two of them

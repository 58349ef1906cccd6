"""A picture brought to the size and the values that a network wants, and boxes brought back."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.types import Boxes, Image

Float = NDArray[np.float32]

CORNER, MIDDLE, STRETCHED = "in the corner", "in the middle", "stretched"
GREY = 114  # what surrounds a picture that does not fill the input: YOLO's grey


@dataclass(frozen=True)
class Fit:
    """How pictures come into an input of one size.

    Parameters
    ----------
    height, width : int
        Pixels of the input.
    place : str
        `CORNER` or `MIDDLE`: in its own shape, as large as it goes, grey on the rest; `STRETCHED`: all of the input.
    bgr : bool
        Blue first; else red first.
    most : float
        The value of white; that of black is 0.
    mean, spread : 3 floats each
        Taken off, and divided by, after that.
    """

    height: int
    width: int
    place: str = MIDDLE
    bgr: bool = False
    most: float = 1.0
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spread: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def fitted(self, image: Image) -> Float:
        """Return the input (height, width, 3) for a picture (H, W, 3) RGB uint8."""
        left, top, width, height = self._span(*image.shape[:2])
        part = image
        if (height, width) != image.shape[:2]:
            part = np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_LINEAR), np.uint8)
        whole = np.full((self.height, self.width, 3), GREY, np.uint8)
        whole[top : top + height, left : left + width] = part[..., ::-1] if self.bgr else part
        values: Float = whole.astype(np.float32)
        if self.most != 255.0:
            values *= np.float32(self.most / 255.0)
        if self.mean != (0.0, 0.0, 0.0) or self.spread != (1.0, 1.0, 1.0):
            values = np.asarray((values - self.mean) / self.spread, np.float32)
        return values

    def back(self, boxes: Boxes, height: int, width: int) -> Boxes:
        """Return boxes (N, 4) of the input in pixels of the picture (height, width) that was fitted in."""
        left, top, across, down = self._span(height, width)
        scale = np.array([width / across, height / down] * 2, np.float32)
        return np.asarray((boxes - np.array([left, top] * 2, np.float32)) * scale, np.float32)

    def about(self) -> str:
        """Return what a network is given, in words."""
        values = f"0 to {self.most:g}" if self.spread == (1.0, 1.0, 1.0) else "normalised as on ImageNet"
        return f"{self.width}x{self.height}, {self.place}, {'BGR' if self.bgr else 'RGB'} {values}"

    def _span(self, height: int, width: int) -> tuple[int, int, int, int]:
        """Left, top, width and height in the input of a picture of this size."""
        if self.place == STRETCHED:
            return 0, 0, self.width, self.height
        scale = min(self.width / width, self.height / height)
        across, down = max(1, round(width * scale)), max(1, round(height * scale))
        if self.place == CORNER:
            return 0, 0, across, down
        return (self.width - across) // 2, (self.height - down) // 2, across, down

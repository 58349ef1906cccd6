"""The part of a picture in which a target is cut out, and how finely it is looked at."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.types import Bits, Mask

ONE_MAP: Any = None  # the second map of cv2.remap, where the first has both x and y; OpenCV's stubs want two


class Window(NamedTuple):
    """Pixels x1 … x2, y1 … y2 of a picture, seen in cells of `step` x `step` pixels; sides are multiples of it."""

    x1: int
    y1: int
    x2: int
    y2: int
    step: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of cells."""
        return (self.y2 - self.y1) // self.step, (self.x2 - self.x1) // self.step

    def cut(self, picture: NDArray[Any]) -> NDArray[Any]:
        """Return the cells (h, w, …) of a picture (H, W, …): means of their pixels, borders repeated outside."""
        height, width = picture.shape[:2]
        x1, y1, x2, y2 = max(self.x1, 0), max(self.y1, 0), min(self.x2, width), min(self.y2, height)
        part = picture[y1:y2, x1:x2]
        sides = (y1 - self.y1, self.y2 - y2, x1 - self.x1, self.x2 - x2)
        if any(sides):
            part = cv2.copyMakeBorder(part, *sides, cv2.BORDER_REPLICATE)
        if self.step == 1:
            return np.ascontiguousarray(part)
        return cv2.resize(part, self.shape[::-1], interpolation=cv2.INTER_AREA)

    def of_mask(self, mask: Mask) -> NDArray[np.float32]:
        """Return the share (h, w) of each cell that a mask covers."""
        x1, y1 = max(mask.box[0], self.x1), max(mask.box[1], self.y1)
        x2, y2 = min(mask.box[2], self.x2), min(mask.box[3], self.y2)
        if x1 >= x2 or y1 >= y2:
            return np.zeros(self.shape, np.float32)
        bits = np.zeros((self.y2 - self.y1, self.x2 - self.x1), np.float32)
        part = mask.bits[y1 - mask.y : y2 - mask.y, x1 - mask.x : x2 - mask.x]
        bits[y1 - self.y1 : y2 - self.y1, x1 - self.x1 : x2 - self.x1] = part
        if self.step == 1:
            return bits
        return np.asarray(cv2.resize(bits, self.shape[::-1], interpolation=cv2.INTER_AREA), np.float32)

    def of_masks(self, masks: Iterable[Mask]) -> Bits:
        """Return the cells (h, w) that any of some masks holds."""
        held = np.zeros(self.shape, np.bool_)
        for one in masks:
            x1, y1, x2, y2 = one.box
            if x1 < self.x2 and self.x1 < x2 and y1 < self.y2 and self.y1 < y2:
                held |= self.of_mask(one) > 0.5
        return held

    def to_mask(self, cells: Bits, height: int, width: int) -> Mask:
        """Return the mask, inside a picture, of the cells (h, w) that are true; edges are made smooth."""
        bits = cells
        if self.step > 1:
            size = (self.x2 - self.x1, self.y2 - self.y1)
            bits = cv2.resize(cells.astype(np.float32), size, interpolation=cv2.INTER_LINEAR) > 0.5
        x1, y1, x2, y2 = max(self.x1, 0), max(self.y1, 0), min(self.x2, width), min(self.y2, height)
        inside = bits[y1 - self.y1 : y2 - self.y1, x1 - self.x1 : x2 - self.x1]
        return Mask.of_image(np.ascontiguousarray(inside), y1, x1)

    def places(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return x and y (h, w) of the middles of the cells, pixels."""
        both = self.grid()
        return both[..., 0].copy(), both[..., 1].copy()

    def grid(self) -> NDArray[np.float32]:
        """Return x, y (h, w, 2) of the middles of the cells, pixels."""
        height, width = self.shape
        half = (self.step - 1) / 2
        both = np.empty((height, width, 2), np.float32)
        both[..., 0] = np.arange(width, dtype=np.float32) * self.step + np.float32(self.x1 + half)
        both[..., 1] = (np.arange(height, dtype=np.float32) * self.step + np.float32(self.y1 + half))[:, None]
        return both


def around(boxes: Sequence[Sequence[float]], ring: float, cells: int, size: tuple[int, int]) -> Window:
    """Return the window that holds boxes (x1, y1, x2, y2) and a ring round them, inside a picture (height, width).

    Cells become larger, by doubling, until there are at most `cells` of them.
    """
    x1, y1 = min(box[0] for box in boxes) - ring, min(box[1] for box in boxes) - ring
    x2, y2 = max(box[2] for box in boxes) + ring, max(box[3] for box in boxes) + ring
    left, top = int(np.clip(np.floor(x1), 0, size[1] - 1)), int(np.clip(np.floor(y1), 0, size[0] - 1))
    right, bottom = int(np.clip(np.ceil(x2), left + 1, size[1])), int(np.clip(np.ceil(y2), top + 1, size[0]))
    step = 1
    while (right - left) * (bottom - top) > cells * step * step:
        step *= 2
    return Window(
        left, top, left + -(-(right - left) // step) * step, top + -(-(bottom - top) // step) * step, step
    )

"""What a frame shows: colours, and how everything has moved since the frame before."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.maths.flow import Flow, dense, global_motion
from perdure.trackers.trackcut.windows import ONE_MAP, Window
from perdure.types import Bits, Image, Mask

Float = NDArray[np.float32]
_FLOW_ROWS = 300  # rows of the picture, about, in which flow is looked for


class Sight(NamedTuple):
    """A frame."""

    colours: NDArray[np.uint8]  # (H, W, 3) Lab: distances are as seen, light is one channel
    grey: NDArray[np.uint8]  # (h, w), smaller by `step`
    step: int


class Motion(NamedTuple):
    """How what is seen came here from the frame before."""

    flow: Flow  # (h, w, 2) px of the small picture, from there to here
    camera: NDArray[np.float64]  # (2, 3) affine, small picture before -> small picture now, of what stands still
    step: int

    def at(self, window: Window) -> Float:
        """Return the displacement (h, w, 2), px a frame, of what is now in each cell of a window."""
        half = np.float32((self.step - 1) / 2)
        there = (window.grid() - half) / np.float32(self.step)
        moved = cv2.remap(self.flow.vectors, there, ONE_MAP, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return moved * np.float32(self.step)

    def camera_of_pixels(self) -> NDArray[np.float64]:
        """Return the camera's motion (2, 3), from pixels of the frame before to those of this one."""
        half = (self.step - 1) / 2
        camera = self.camera.copy()
        if not np.array_equal(camera, np.eye(2, 3)):
            camera[:, 2] = camera[:, 2] * self.step - camera[:, :2] @ (half, half) + half
        return camera

    def of_camera(self, x: Float, y: Float) -> Float:
        """Return the displacement (…, 2), px a frame, that the camera's motion gives what is now at x, y."""
        return self.of_camera_at(np.stack([x, y], axis=-1))

    def of_camera_at(self, places: Float) -> Float:
        """Return the same of what is now at places (…, 2)."""
        half = (self.step - 1) / 2
        back = cv2.invertAffineTransform(self.camera)
        away = np.eye(2, 3) - back  # (2, 3), what is there less what was
        away[:, 2] = away[:, 2] * self.step - away[:, :2] @ (half, half)
        return np.asarray(cv2.transform(places.reshape(-1, 1, 2), away), np.float32).reshape(places.shape)


def covered(masks: Iterable[Mask], size: tuple[int, int], beside: int) -> Bits:
    """Return where in a picture (height, width) any of some masks are, and some pixels beside them."""
    held = np.zeros(size, np.uint8)
    for one in masks:
        x1, y1, x2, y2 = max(one.box[0], 0), max(one.box[1], 0), min(one.box[2], size[1]), min(one.box[3], size[0])
        if x1 < x2 and y1 < y2:
            held[y1:y2, x1:x2] |= one.bits[y1 - one.y : y2 - one.y, x1 - one.x : x2 - one.x].view(np.uint8)
    side = 2 * beside + 1
    return np.asarray(cv2.dilate(held, np.ones((side, side), np.uint8)), np.uint8).view(np.bool_)


def look_at(image: Image) -> Sight:
    """Return what a picture (H, W, 3) RGB shows."""
    step = max(1, round(min(image.shape[:2]) / _FLOW_ROWS))
    grey = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    if step > 1:
        grey = cv2.resize(grey, (grey.shape[1] // step, grey.shape[0] // step), interpolation=cv2.INTER_AREA)
    return Sight(np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2LAB), np.uint8), np.asarray(grey, np.uint8), step)


def motion_between(before: NDArray[np.uint8], now: Sight, things: Bits) -> Motion:
    """Return the motion from a small grey picture (h, w) to a frame; `things` (h, w) do not tell of the camera's."""
    return Motion(
        dense(before, now.grey, preset="medium", astray=np.inf), global_motion(before, now.grey, things), now.step
    )


def colours_of(sight: Sight, mask: Mask) -> Float:
    """Return the colours (N, 3) of the pixels of a mask that lies inside the picture."""
    x1, y1, x2, y2 = mask.box
    return np.asarray(sight.colours[y1:y2, x1:x2][mask.bits], np.float32)

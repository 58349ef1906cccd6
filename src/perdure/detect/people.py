"""People told from all else by the outlines they have: OpenCV's HOG and linear SVM (Dalal & Triggs 2005).

This is the detector of the multi-feature tracker's paper. It looks at each picture alone, so that nothing is carried
along and the camera may move. Its window is 64 x 128 pixels with a margin about the person, which is taken off the
boxes; a picture is enlarged so that smaller people fill a window.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import centres, overlaps
from perdure.params import parameter
from perdure.types import Bits, Boxes, Frame, Image, Regions, Scene

Float = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PeopleState:
    """Where something may be seen; nothing is carried along."""

    roi: Bits | None


@dataclass(frozen=True)
class People:
    """Upright people, as boxes of class 'person' with a score."""

    least_height: float = parameter(
        60.0,
        "people less high are not looked for; half of it takes four times as long",
        unit="px",
        low=16.0,
        high=2000.0,
    )
    svm_margin: float = parameter(
        0.5, "how far on the side of people a window must lie by the SVM, whose border is 0", low=-2.0, high=5.0
    )
    window_step: int = parameter(
        8,
        "how far apart windows are in the enlarged picture; taken down to a multiple of 8",
        unit="px",
        low=8,
        high=64,
    )
    window_growth: float = parameter(1.05, "how much larger the windows of the next look are", low=1.01, high=2.0)
    one_person: float = parameter(
        0.4, "overlap of two windows from which only the surer one is a person", unit="IoU", low=0.0, high=1.0
    )

    needs_pixels = True

    def start(self, scene: Scene) -> PeopleState:
        """Return the state before the first frame."""
        return PeopleState(scene.roi)

    def step(self, state: PeopleState, frame: Frame) -> tuple[PeopleState, Regions]:
        """Return the people in one picture, the surest first; inside the roi only.

        A score is the logistic function of the SVM's distance from its border: .5 at 0, .73 at 1, .88 at 2.
        """
        if frame.image is None:
            return state, Regions.empty()
        windows, margins = self._windows(frame.image)
        order = np.argsort(-margins, kind="stable")
        windows, margins = windows[order], margins[order]
        kept = surest(windows, self.one_person)
        height, width = frame.image.shape[:2]
        boxes = np.clip(without_margin(windows[kept]), 0, np.array([width, height, width, height], np.float32))
        boxes = np.asarray(np.rint(boxes), np.float32)
        scores = 1.0 / (1.0 + np.exp(-margins[kept]))
        inside = _inside(boxes, state.roi)
        boxes, scores = boxes[inside], scores[inside]
        return state, Regions.of(boxes, scores, ["person"] * len(boxes))

    def _windows(self, image: Image) -> tuple[Boxes, Float]:
        """Windows (N, 4) in which the SVM sees a person, in pixels of the picture, and their distances (N,) from its border."""
        none = np.zeros((0, 4), np.float32), np.zeros(0, np.float32)
        height, width = image.shape[:2]
        larger = _PERSON[3] - _PERSON[1]
        scale = larger * _WINDOW[1] / self.least_height  # so that the smallest fills a window
        size = max(round(width * scale), 1), max(round(height * scale), 1)
        picture = cv2.resize(image, size, interpolation=cv2.INTER_LINEAR if scale > 1 else cv2.INTER_AREA)
        if size[0] < _WINDOW[0] or size[1] < _WINDOW[1]:
            return none
        hog = cv2.HOGDescriptor()
        hog.setSVMDetector(cv2.HOGDescriptor.getDefaultPeopleDetector())  # type: ignore[call-overload]
        step = self.window_step // 8 * 8
        found, distances = hog.detectMultiScale(
            cv2.cvtColor(picture, cv2.COLOR_RGB2BGR),
            hitThreshold=self.svm_margin,
            winStride=(step, step),
            padding=(16, 16),
            scale=self.window_growth,
            groupThreshold=0,
        )
        corner = np.asarray(found, np.float32).reshape(-1, 4) / scale
        windows = np.concatenate([corner[:, :2], corner[:, :2] + corner[:, 2:]], axis=1)
        margins = np.asarray(distances, np.float32).reshape(-1)
        order = np.lexsort((*windows.T, -margins))  # OpenCV's threads find them in any order
        return windows[order], margins[order]


_WINDOW = (64, 128)  # pixels
_PERSON = (0.24, 0.11, 0.76, 0.86)  # where a person is in a window, in its sizes: 96 of 128 pixels high


def without_margin(windows: Boxes) -> Boxes:
    """Return the boxes (N, 4) of people in windows (N, 4)."""
    size = windows[:, 2:] - windows[:, :2]
    low, high = np.array(_PERSON[:2], np.float32), np.array(_PERSON[2:], np.float32)
    return np.concatenate([windows[:, :2] + low * size, windows[:, :2] + high * size], axis=1)


def surest(boxes: Boxes, most: float) -> NDArray[np.intp]:
    """Return which boxes (N, 4), the surest first, overlap no surer one that is kept by more than `most` (IoU)."""
    shared, left = overlaps(boxes, boxes), np.ones(len(boxes), np.bool_)
    for k in range(len(boxes)):
        if left[k]:
            left[k + 1 :] &= shared[k, k + 1 :] <= most
    return np.flatnonzero(left)


def _inside(boxes: Boxes, roi: Bits | None) -> NDArray[np.bool_]:
    """Whether each box has an area and its feet are in the roi."""
    inside = (boxes[:, 2:] > boxes[:, :2]).all(axis=1)
    if roi is None or not len(boxes):
        return np.asarray(inside)
    height, width = roi.shape
    x = np.clip(centres(boxes)[:, 0], 0, width - 1).astype(np.intp)
    y = np.clip(boxes[:, 3] - 1, 0, height - 1).astype(np.intp)
    return np.asarray(inside & roi[y, x])

"""What a context is told by: how many things there are, how they hide one another, light, contrast and depth.

A fold over frames and their regions whose state is a few arrays, with old frames forgotten exponentially, so that it
can be asked at any time what the video is like now.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import areas, intersections, sizes
from perdure.types import Boxes, Frame, Image, Regions, Scene

MEMORY = 60.0  # s after which a frame counts for 1/e
HIDDEN = 0.2  # share of a box in another one, from which it counts as overlapped
_BINS, _LOW, _HIGH = 96, math.log(2.0), math.log(4096.0)  # of heights in pixels, by their logarithms
_PIXELS = 40_000  # of a picture that are looked at, about
_GREY = np.array([0.299, 0.587, 0.114], np.float32)


class Scale(NamedTuple):
    """What is compared of a measure, and by how much it may differ to count as one."""

    of: Callable[[float], float]
    unit: float
    words: str


def _plain(value: float) -> float:
    return value


@dataclass(frozen=True)
class Measures:
    """What a video is like; NaN nowhere: None where a measure is not known."""

    objects: float | None = None  # mean number in a frame
    cover: float | None = None  # share of the picture that boxes cover, summed up, so that it may exceed 1
    occlusion: float | None = None  # share of objects of which another box covers a fifth or more
    depth: float | None = None  # ln of the 90th over the 10th percentile of box heights
    illumination: float | None = None  # mean grey, 0 to 255
    contrast: float | None = None  # standard deviation of grey within a frame
    fps: float | None = None
    pictures: bool = False  # whether it has any
    ground: bool = False  # whether its ground plane is known


SCALES = {
    "objects": Scale(math.log1p, math.log(2.0), "objects in a frame"),  # one apart: twice as many
    "cover": Scale(lambda share: math.log(share + 0.02), math.log(2.0), "share of the picture covered"),
    "occlusion": Scale(_plain, 0.2, "share of objects overlapped"),
    "depth": Scale(_plain, 0.5, "ln of tall over small heights"),
    "illumination": Scale(_plain, 40.0, "mean grey"),
    "contrast": Scale(_plain, 20.0, "deviation of grey"),
    "fps": Scale(lambda rate: math.log(max(rate, 1e-3)), math.log(2.0), "frames a second"),
}
NAMES = tuple(one.name for one in fields(Measures))


@dataclass(frozen=True)
class Measuring:
    """Weighted sums over the frames so far; a frame's weight decays with time."""

    time: float  # s, of the last frame
    frames: float  # weight of all frames
    seconds: float  # between them, weighted alike
    steps: float
    boxes: float  # weight of all boxes
    hidden: float
    cover: float
    heights: NDArray[np.float64]  # (_BINS,) weight of boxes by the logarithm of their height
    pictures: float
    grey: float
    contrast: float


def start() -> Measuring:
    """Return the state before the first frame."""
    return Measuring(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, np.zeros(_BINS), 0.0, 0.0, 0.0)


def measure(state: Measuring, frame: Frame, regions: Regions, scene: Scene, memory: float = MEMORY) -> Measuring:
    """Return the state after a frame and its regions; `memory` is in seconds, infinite to forget nothing."""
    elapsed = max(0.0, frame.time - state.time) if state.frames > 0 else 0.0
    kept = math.exp(-elapsed / memory)
    grey, contrast = _light(frame.image) if frame.image is not None else (0.0, 0.0)
    boxes = _inside(regions.boxes, scene)
    heights = np.log(np.maximum(sizes(boxes)[:, 1].astype(np.float64), 2.0))
    places = np.clip((heights - _LOW) / (_HIGH - _LOW) * _BINS, 0, _BINS - 1).astype(np.intp)
    return Measuring(
        time=frame.time,
        frames=kept * state.frames + 1.0,
        seconds=kept * state.seconds + elapsed,
        steps=kept * state.steps + (1.0 if elapsed > 0 else 0.0),
        boxes=kept * state.boxes + len(boxes),
        hidden=kept * state.hidden + float(_overlapped(boxes).sum()),
        cover=kept * state.cover + float(areas(boxes).sum()) / max(1, scene.width * scene.height),
        heights=kept * state.heights + np.bincount(places, minlength=_BINS),
        pictures=kept * state.pictures + (frame.image is not None),
        grey=kept * state.grey + grey,
        contrast=kept * state.contrast + contrast,
    )


def measures_of(state: Measuring, scene: Scene) -> Measures:
    """Return what the frames so far tell."""
    seen, pictured = state.boxes > 1e-9, state.pictures > 1e-9
    if state.frames <= 0:
        return Measures(ground=scene.ground is not None)
    return Measures(
        objects=state.boxes / state.frames,
        cover=state.cover / state.frames,
        occlusion=state.hidden / state.boxes if seen else None,
        depth=_quantile(state.heights, 0.9) - _quantile(state.heights, 0.1) if seen else None,
        illumination=state.grey / state.pictures if pictured else None,
        contrast=state.contrast / state.pictures if pictured else None,
        fps=state.steps / state.seconds if state.seconds > 0 else scene.fps,
        pictures=pictured,
        ground=scene.ground is not None,
    )


def difference(one: Measures, other: Measures) -> float:
    """Return the root mean square difference of what both know, each in its scale; 0 where they know nothing."""
    parts = []
    for name, scale in SCALES.items():
        values = getattr(one, name), getattr(other, name)
        if None not in values:
            parts.append((scale.of(values[0]) - scale.of(values[1])) / scale.unit)
    return math.sqrt(sum(part * part for part in parts) / len(parts)) if parts else 0.0


def _inside(boxes: Boxes, scene: Scene) -> Boxes:
    """Boxes as far as they lie in the picture, those with an area."""
    cut = np.clip(boxes, 0, (scene.width, scene.height, scene.width, scene.height)).astype(np.float32)
    return np.asarray(cut[areas(cut) > 0])


def _overlapped(boxes: Boxes) -> NDArray[np.bool_]:
    """Which boxes (N,) another one covers to a fifth or more."""
    shared = intersections(boxes, boxes)
    np.fill_diagonal(shared, 0.0)
    return np.asarray(shared.max(axis=1, initial=0.0) >= HIDDEN * areas(boxes))


def _light(image: Image) -> tuple[float, float]:
    """Mean and standard deviation of grey, of pixels on a grid."""
    step = max(1, round(math.sqrt(image.shape[0] * image.shape[1] / _PIXELS)))
    grey = image[::step, ::step].astype(np.float32) @ _GREY
    return float(grey.mean()), float(grey.std())


def _quantile(histogram: NDArray[np.float64], share: float) -> float:
    """The logarithm of a height below which a share of the boxes lies."""
    total = np.concatenate([[0.0], np.cumsum(histogram)])
    edges = np.linspace(_LOW, _HIGH, _BINS + 1)
    return float(np.interp(share * total[-1], total, edges))

"""Embedding: what a re-identification network says of a thing's looks (ours; not in the paper)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Float, Memory
from perdure.params import parameter
from perdure.types import Frame, Regions, Scene


class Network(Protocol):
    """Crops (N, height, width, 3) float32 RGB, 0 to 255, to vectors (N, size); `perdure.files.models` reads one."""

    @property
    def height(self) -> int:
        """Pixels."""

    @property
    def width(self) -> int:
        """Pixels."""

    @property
    def size(self) -> int:
        """D of a vector."""

    def __call__(self, crops: Float) -> Float:
        """Return vectors (N, size)."""


@dataclass(frozen=True)
class Embedding:
    """The cosine of two vectors, from the one that strangers have (0) to that of the same picture (1)."""

    network: Network = field(repr=False, compare=False)
    strange: float = parameter(0.0, "cosine of two looks that have nothing in common", low=-1.0, high=0.95)

    name = "embedding"
    needs_pixels = True
    moves = False
    varies = True

    def start(self, scene: Scene) -> Memory:
        """Return nothing: nothing is carried along."""
        return {}

    def describe(self, memory: Memory, frame: Frame, regions: Regions) -> tuple[Memory, Float]:
        """Return unit vectors (N, size); zeros for a box that has no pixel in the picture."""
        rows = np.zeros((len(regions), self.network.size), np.float32)
        if frame.image is None:
            return memory, rows
        height, width = frame.image.shape[:2]
        boxes = np.rint(np.clip(regions.boxes, 0, (width, height, width, height))).astype(int)
        seen = np.flatnonzero((boxes[:, 2:] > boxes[:, :2]).all(axis=1))
        shape = (self.network.width, self.network.height)
        crops = np.zeros((len(seen), shape[1], shape[0], 3), np.float32)
        for crop, (x1, y1, x2, y2) in zip(crops, boxes[seen], strict=True):
            crop[:] = cv2.resize(frame.image[y1:y2, x1:x2], shape, interpolation=cv2.INTER_LINEAR)
        vectors = self.network(crops)
        length = np.sqrt((vectors**2).sum(axis=1, keepdims=True))
        rows[seen] = np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)
        return memory, rows

    def similarity(self, one: Float, other: Float, elapsed: NDArray[np.floating]) -> Float:
        """Return how alike (P,) the looks are."""
        cosine = (one * other).sum(axis=1)
        return np.asarray(np.clip((cosine - self.strange) / (1.0 - self.strange), 0.0, 1.0), np.float32)

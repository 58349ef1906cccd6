"""Displacement on the ground, in metres (feature 1, eq. 1); it says nothing where the plane is not known.

The place is that of the foot of the box. As in the picture, some metres are allowed at any time: a foot is not placed
exactly, and the less so the farther away it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Float, Memory
from perdure.params import parameter
from perdure.scene.ground import Ground, feet
from perdure.types import Frame, Regions, Scene


@dataclass(frozen=True)
class GroundDisplacement:
    """max(0, 1 - d / (slack + D_max t)), with d on the ground plane."""

    ground: Ground | None = None
    farthest: float = parameter(
        2.5, "how fast a thing may go on the ground", unit="m/s", low=0.01, high=300.0, symbol="D_max"
    )
    slack: float = parameter(0.5, "how far its foot may be misplaced", unit="m", low=0.01, high=100.0)

    name = "displacement_3d"
    needs_pixels = False
    moves = True
    varies = False

    def start(self, scene: Scene) -> Memory:
        """Return nothing: nothing is carried along."""
        return {}

    def describe(self, memory: Memory, frame: Frame, regions: Regions) -> tuple[Memory, Float]:
        """Return places and how surely they are known (N, 4): X, Y, spread in metres, 1; zeros where not known."""
        rows = np.zeros((len(regions), 4), np.float32)
        if self.ground is None or not len(regions):
            return memory, rows
        points = feet(regions.boxes)
        places = self.ground.places(points)
        there = np.flatnonzero(np.isfinite(places).all(axis=1) & (np.abs(places) < _FAR).all(axis=1))
        spread = np.sqrt(np.trace(self.ground.jitter(points[there], _pixels(regions, there)), axis1=1, axis2=2))
        rows[there] = np.column_stack([places[there], np.minimum(spread, _FAR), np.ones(len(there))])
        return memory, rows

    def similarity(self, one: Float, other: Float, elapsed: NDArray[np.floating]) -> Float:
        """Return how near (P,) they are for the time between them (eq. 1)."""
        way = np.hypot(one[:, 0] - other[:, 0], one[:, 1] - other[:, 1])
        slack = self.slack + np.maximum(one[:, 2], other[:, 2])
        return np.asarray(np.maximum(0.0, 1.0 - way / (slack + self.farthest * elapsed)), np.float32)


_FAR = 1e4  # m: farther than this nothing is placed
_FOOT = 0.02  # of a box's height: how surely its foot is placed


def _pixels(regions: Regions, there: NDArray[np.intp]) -> NDArray[np.floating]:
    boxes = regions.boxes[there]
    return np.asarray(np.maximum(1.0, _FOOT * (boxes[:, 3] - boxes[:, 1])))

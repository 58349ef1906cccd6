"""The remembered silhouette: where it should be, and how it changes with what is seen (eq. 2, 3, 14-16)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.trackers.trackcut.targets import RECENT, Shape, Target
from perdure.trackers.trackcut.windows import Window

Float = NDArray[np.float32]
_TURN = 0.05  # rad, or share of the size, by which a shape may turn or grow from frame to frame
_STEPS = 6  # of the robust fit
_FEW = 800  # cells that it looks at, about


def similarity(x: Float, y: Float, flow: Float) -> tuple[NDArray[np.float64], tuple[float, float]]:
    """Return (dx, dy, growth, turn) that fit motions (N, 2) at places x, y (N,) about their middle, and the middle.

    Least squares, of which what lies far off counts little (Cauchy), as parts of an object move by themselves.
    """
    step = max(1, len(x) // _FEW)
    middle = (float(x.mean()), float(y.mean()))
    across, down, moved = x[::step] - middle[0], y[::step] - middle[1], flow[::step].astype(np.float64)
    one, none = np.ones(len(across)), np.zeros(len(across))
    design = np.concatenate([np.stack([one, none, across, -down], 1), np.stack([none, one, down, across], 1)])
    aim, weight = moved.T.ravel(), np.ones(2 * len(across))
    for _ in range(_STEPS):
        found = np.linalg.lstsq(design * weight[:, None], aim * weight, rcond=None)[0]
        off = np.hypot(*(aim - design @ found).reshape(2, -1))
        scale = max(1.5 * float(np.median(off)), 0.3)
        weight = np.tile(1 / (1 + (off / scale) ** 2), 2)
    found[2:] = np.clip(found[2:], -_TURN, _TURN)
    return np.asarray(found, np.float64), middle


def recent_motion(target: Target) -> NDArray[np.float64]:
    """Return the mean (2,) of the last displacements (eq. 16; eq. 2 where there is one)."""
    known = target.motions[np.isfinite(target.motions[:, 0])]
    return known[-RECENT:].mean(axis=0) if len(known) else np.zeros(2)


def in_window(
    shape: Shape, window: Window, move: tuple[NDArray[np.float64], tuple[float, float]] | None = None
) -> Float:
    """Return the belief (h, w) in each cell of a window, after a similarity about a place now, if one is given."""
    x, y = window.places()
    if move is not None:
        (dx, dy, growth, turn), (middle_x, middle_y) = move
        across, down = x - middle_x, y - middle_y
        x = x - np.float32(dx) - np.float32(growth) * across + np.float32(turn) * down
        y = y - np.float32(dy) - np.float32(turn) * across - np.float32(growth) * down
    return np.asarray(
        cv2.remap(
            shape.belief,
            (x - np.float32(shape.x)).astype(np.float32),
            (y - np.float32(shape.y)).astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=0,
        ),
        np.float32,
    )


def to_shape(belief: Float, window: Window) -> Shape:
    """Return the shape whose belief (h, w) in the cells of a window is given."""
    if window.step > 1:
        size = (window.x2 - window.x1, window.y2 - window.y1)
        belief = np.asarray(cv2.resize(belief, size, interpolation=cv2.INTER_LINEAR), np.float32)
    rows, columns = np.nonzero(belief > 0.05)
    if not len(rows):
        return Shape(float(window.y1), float(window.x1), np.zeros((1, 1), np.float32))
    top, bottom, left, right = rows.min(), rows.max() + 1, columns.min(), columns.max() + 1
    return Shape(float(window.y1 + top), float(window.x1 + left), belief[top:bottom, left:right].copy())


def depth(inside: NDArray[np.bool_]) -> Float:
    """Return the distance (h, w), cells, from the edge: positive inside."""
    bits = inside.astype(np.uint8)
    within = cv2.distanceTransform(bits, cv2.DIST_L2, 3)
    without = cv2.distanceTransform(1 - bits, cv2.DIST_L2, 3)
    if not inside.any():
        without = np.full(inside.shape, float(max(inside.shape)), np.float32)
    return np.asarray(within - without, np.float32)

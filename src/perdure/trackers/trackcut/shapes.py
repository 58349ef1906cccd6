"""The remembered silhouette: where it should be, and how it changes with what is seen (eq. 2, 3, 14-16)."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.features.masks import mask_shares
from perdure.trackers.trackcut.targets import LATEST, Shape, Target
from perdure.trackers.trackcut.windows import Window
from perdure.types import Mask

Float = NDArray[np.float32]
_COVERED = 0.5  # share of a silhouette that others must be before, for it to be hidden by them
_NEARER = (0.2, 0.4, 0.6, 0.8, 1.0)  # of the way to the middle of another
_NONE = 0.05  # belief that is none


def recent_motion(target: Target) -> NDArray[np.float64]:
    """Return the displacement (2,), px a frame, of the last frames (eq. 16; eq. 2 where there is one).

    It is the mean of five, as the paper has it, where motion is that of flow alone. Where a detector says how the whole
    silhouette moved, it is the median of more: limbs swing, and who goes behind something seems to slow down.
    """
    known = target.motions[np.isfinite(target.motions[:, 0])]
    if not len(known):
        return np.zeros(2)
    return known[-LATEST:].mean(axis=0) if target.marked else np.asarray(np.median(known, axis=0))


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


def behind(shape: Shape, others: Sequence[Mask], before: bool) -> tuple[Shape, bool]:
    """Return where an object is that is not seen, and whether others that are seen are before it.

    What is not seen is where it cannot be seen: one that was behind others, and should have come out from behind them
    but was not seen to, is moved towards the nearest of them until half of it is covered.
    """
    whole = shape.to_mask()
    others = [one for one in others if one.area]
    if not whole.area or not others:
        return shape, False
    if mask_shares([whole], others).sum() >= _COVERED:
        return shape, True
    if not before:
        return shape, False
    x1, y1, x2, y2 = shape.box
    middles = [((one.box[0] + one.box[2]) / 2, (one.box[1] + one.box[3]) / 2) for one in others]
    ways = [(x - (x1 + x2) / 2, y - (y1 + y2) / 2) for x, y in middles]
    across, down = min(ways, key=lambda way: float(np.hypot(*way)))
    if np.hypot(across, down) > max(x2 - x1, y2 - y1):
        return shape, False
    for share in _NEARER:
        moved = Shape(shape.y + share * down, shape.x + share * across, shape.belief)
        if mask_shares([moved.to_mask()], others).sum() >= _COVERED:
            return moved, True
    return shape, False


def over(shape: Shape, piece: Mask) -> Shape:
    """Return a shape, moved as little as it takes for its box to hold a piece, or the piece's to hold it."""
    x1, y1, x2, y2 = shape.box
    left, top, right, bottom = piece.box

    def off(low: float, high: float, begin: float, end: float) -> float:
        before, after = begin - low, end - high  # by which it lies over the one and the other side
        if before >= 0 >= after or before <= 0 <= after:
            return 0.0
        return min(before, after, key=abs)

    return Shape(shape.y + off(y1, y2, top, bottom), shape.x + off(x1, x2, left, right), shape.belief)


def of_size(belief: Float, least: float, most: float) -> Float:
    """Return a belief (h, w) of which at least so many, and at most so many cells are believed rather than not."""
    believed = float((belief > 0.5).sum())
    if least <= believed <= most:
        return belief
    wanted = int(min(max(believed, least), most))
    known = np.sort(belief[belief > _NONE])[::-1]
    if not len(known) or wanted <= 0:
        return belief
    level = float(known[min(wanted, len(known)) - 1])
    raised = np.clip(belief + np.float32(0.5 + 1e-3 - level), 0.0, 1.0)
    return np.asarray(raised * (belief > _NONE), np.float32)


def depth(inside: NDArray[np.bool_]) -> Float:
    """Return the distance (h, w), cells, from the edge: positive inside."""
    bits = inside.astype(np.uint8)
    within = cv2.distanceTransform(bits, cv2.DIST_L2, 3)
    without = cv2.distanceTransform(1 - bits, cv2.DIST_L2, 3)
    if not inside.any():
        without = np.full(inside.shape, float(max(inside.shape)), np.float32)
    return np.asarray(within - without, np.float32)

"""What a frame shows of one object: where it should be, and how much each pixel there looks like it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.maths import lie
from perdure.trackers.contour import observer
from perdure.trackers.contour.correcting import evident, registered
from perdure.trackers.contour.expecting import Expected, expectation
from perdure.trackers.contour.measuring import Measured, Single
from perdure.trackers.contour.observer import Float, State
from perdure.trackers.contour.rules import HIDDEN, TELLING, WHOLE, Rules
from perdure.trackers.contour.seeing import Weights, Window, evidence, velocity_by_flow, window_round
from perdure.trackers.contour.targets import Place, Target
from perdure.types import Bits, Mask

_FAR, _BETTER = 0.1, 0.05  # what the farthest shift must gain more, and any, of 2 between all wrong and all right
_SMOOTH = 3  # cells across which evidence is averaged
_EDGE = 0.8  # |f_in - f_out| averaged over the reach, from which there is no edge within it
_NEAR_EDGE = 0.45  # the same where flow tells how it moves


class Seen(NamedTuple):
    """What a frame shows of one object."""

    window: Window
    colours: Single
    evidence: Single  # (h, w)
    state: State  # with the motion that the flow shows
    edge: float  # |f_in - f_out| averaged over the reach, from which an edge is not the contour's
    pose: Float  # where it should be
    depth: Float  # (h, w) cells, signed distances of the silhouette there
    known: Bits
    expected: Expected | None
    covered: Bits  # (h, w) where an object has been seen before


def moved(by: Rules, target: Target, before: NDArray[np.uint8], now: NDArray[np.uint8]) -> tuple[Target, float]:
    """Return an object with the velocity that what is seen of it has had, and how far from the contour edges are its own.

    Where flow tells, only near ones are: others are those of what comes before it.
    """
    if target.missed > 0 or before.shape != now.shape or target.visible < TELLING or not by.flow:
        return target, _EDGE
    pose = observer.pose_of(target.state, by.group)
    found = velocity_by_flow(
        before, now, target.seen, pose, target.state.velocity, by.group, whole=target.visible >= WHOLE
    )
    if found is None:
        return target, _EDGE
    return replace(target, state=replace(target.state, velocity=found)), _NEAR_EDGE


def look(by: Rules, target: Target, edge: float, lab: NDArray[np.uint8], place: Place) -> Seen:
    """Return what a frame shows round where an object is expected: first by colours anywhere, then at their places."""
    weights = Weights(by.place, by.trust, by.bound)
    size = (lab.shape[0], lab.shape[1])
    expected = expectation(by, target)
    pose = observer.predicted(target.state, by.group)
    hidden = target.visible < WHOLE and expected is not None
    if hidden and expected is not None:
        target = replace(target, state=replace(target.state, shape=expected.shape))
        pose = expected.pose
    ring = by.ring + by.searched(target) - by.search
    window = window_round(target.state.shape, pose, ring, by.cells)
    colours = window.cut(lab).astype(np.float32)
    inside = window.inside(size)
    depth = window.drawn(target.state.shape, pose)
    outside = depth > by.reach
    plain = evidence(window, colours, target.looks, place, outside, None, weights)
    one = evident(by, window, plain, inside)
    if by.automatic and not hidden:
        pose = pose + _shifted(by, target, one, depth)
    state = observer.towards(target.state, pose, by.group)
    if hidden:
        pass
    elif target.missed == 0 or support(depth, one, by.reach) >= HIDDEN * target.usual:
        found = registered(by, state, one, edge, target.visible >= WHOLE)
        near = by.reach / 2 * window.step if target.visible < WHOLE else np.inf
        pose = found if np.abs(found[:2, 2] - pose[:2, 2]).max() <= near else pose
        state = observer.towards(target.state, pose, by.group)
    depth = window.drawn(target.state.shape, pose)
    full = evidence(window, colours, target.looks, place, depth > by.reach, pose, weights)
    smooth = np.asarray(cv2.blur(full, (_SMOOTH, _SMOOTH)), np.float32)
    covered = window.cut(place.covered.view(np.uint8)).astype(np.bool_)
    return Seen(window, colours, smooth, state, edge, pose, depth, inside, expected, covered)


def _shifted(by: Rules, target: Target, one: Measured, depth: Float) -> Float:
    """Return the shift (3, 3) to the place of least energy (3) near: the descent begins there.

    E(d) = const + the sum of f_in - f_out over the silhouette; far shifts must gain more.
    """
    most = max(1, int(by.searched(target) / one.step))
    out = np.zeros((3, 3))
    inside = depth < 0
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    if not len(rows):
        return out
    piece = inside[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].astype(np.float32)
    field = cv2.copyMakeBorder(one.pull, most, most, most, most, cv2.BORDER_CONSTANT, value=0)
    field = field[rows[0] : rows[-1] + 1 + 2 * most, columns[0] : columns[-1] + 1 + 2 * most]
    sums = cv2.matchTemplate(field, piece, cv2.TM_CCORR) / float(piece.sum())  # (2 most + 1, 2 most + 1)
    y, x = np.mgrid[-most : most + 1, -most : most + 1]
    sums = sums + _FAR * (x**2 + y**2) / most**2
    best = np.unravel_index(int(np.argmin(np.round(sums, 4) + 1e-9 * (x**2 + y**2))), sums.shape)
    gained = float(sums[most, most] - sums[best])
    hidden = target.visible < WHOLE and (sums[best] >= 0 or gained < 4 * _BETTER)
    if hidden or gained < _BETTER:
        return out
    out[0, 2], out[1, 2] = float(x[best]) * one.step, float(y[best]) * one.step
    return out


def support(depth: Float, one: Measured, reach: int) -> float:
    """How many pixels look like the object, in a silhouette, signed distances (h, w), and within reach of it."""
    return float(((depth < reach) & (one.pull < 0)).sum()) * one.step**2


def mask_of(window: Window, cells: Bits) -> Mask:
    """Return the cells (h, w) of a window as pixels."""
    bits = cells
    if window.step > 1:
        size = (window.width * window.step, window.height * window.step)
        bits = cv2.resize(cells.astype(np.float32), size, interpolation=cv2.INTER_LINEAR) > 0.5
    return Mask.of_image(bits, window.y, window.x)


def silhouette_of(target: Target, group: lie.Group) -> Mask:
    """Return the whole silhouette: it may leave the picture."""
    pose = observer.pose_of(target.state, group)
    window = window_round(target.state.shape, pose, 3.0, 10**9)
    return Mask.of_image(window.drawn(target.state.shape, pose) < 0, window.y, window.x)


def boxed(targets: Sequence[Target], size: tuple[int, int], group: lie.Group) -> Bits:
    """Return where (H, W) objects may be: in their boxes and beside them."""
    things = np.zeros(size, np.bool_)
    for one in targets:
        x1, y1, x2, y2 = silhouette_of(one, group).box
        things[max(y1 - 6, 0) : max(y2 + 6, 0), max(x1 - 6, 0) : max(x2 + 6, 0)] = True
    return things

"""An object whose outline is another in every frame, while it is hidden: its shape, and where what is seen fits into it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from perdure.maths import levelset, lie
from perdure.trackers.contour import observer, recalling
from perdure.trackers.contour.expecting import Expected
from perdure.trackers.contour.looking import Seen, mask_of, support
from perdure.trackers.contour.measuring import Measured, Single, measured
from perdure.trackers.contour.observer import Float, State
from perdure.trackers.contour.rules import AGO, HIDDEN, TELLING, WHOLE, Rules
from perdure.trackers.contour.targets import Target
from perdure.types import Bits, Mask

_MISSING = 0.15  # what a pixel of a silhouette counts that does not look like it, beside one that does
_STRAY = 0.03  # what the farthest shift must cover more, of all
_DRIFT = 0.4  # rate at which the path of a hidden object follows what is seen of it
_STRAYING = 0.06  # rate at which its velocity does
_SOLID = 5  # cells across, from which a part is one
_FORGOTTEN = 0.015  # rate at which the usual support of what is partly hidden is forgotten


def placed(by: Rules, target: Target, expected: Expected, sight: Seen, one: Measured) -> tuple[float, Float]:
    """Return which share of an object is seen, and where (3, 3) what is seen lies in the shape that it should have."""
    poses = [expected.pose]
    if target.visible >= WHOLE:
        poses.append(sight.pose)
    best: tuple[float, Float] = (-1.0, expected.pose)
    for pose in poses:
        depth = sight.window.drawn(expected.shape, pose)
        near = by.searched(target) / 2 + 1
        x, y = covering(depth, one.pull, int(near / one.step), by.reach, sight.covered)
        moved = pose.copy()
        moved[:2, 2] += np.array([x, y]) * one.step
        depth = sight.window.drawn(expected.shape, moved)
        was, now = depth < 0, (one.pull < 0) & (depth < by.reach)
        vacated = sight.covered & (one.pull > 0)
        change = float(solid(was & ~now & ~vacated).sum()) - float(solid(now & ~was).sum())
        share = float(np.clip(1 - change / max(was.sum(), 1), 0.0, 1.0))
        if expected.recalled < 0:
            share = max(share, min(1.0, support(depth, one, by.reach) / max(target.usual, 1.0)))
        if share > best[0] + 0.02:
            best = share, moved
    return best


def hidden(
    by: Rules,
    target: Target,
    expected: Expected,
    sight: Seen,
    one: Measured,
    place: Float,
    visible: float,
    gain: float,
    waited: float,
) -> Target:
    """Return an object that is partly or wholly hidden: μ is what it should be, where what is seen fits into it."""
    gone = visible < HIDDEN
    pose = expected.pose if gone else place
    state = replace(target.state, shape=expected.shape)
    state = observer.towards(state, pose, by.group)
    state = observer.coasted(state, measured(np.zeros((1, 1)), 0), by.group, window=by.window)
    if expected.recalled < 0 and visible >= TELLING:
        parts = _gone(by, expected.shape, pose, sight, one)
        shape = observer.towards_least(state.shape, pose[None], [one], gain, by.reach)
        state = _with_parts(by, replace(state, shape=shape), sight, parts)
    pose = observer.pose_of(state, by.group)
    depth = sight.window.drawn(state.shape, pose)
    seen = Mask.empty() if gone else mask_of(sight.window, (depth < 0) & (one.pull < 0))
    drift, straying = straying_of(target, place[:2, 2] - expected.pose[:2, 2], 0.0 if gone else 1.0)
    return replace(
        target, state=state, seen=seen, visible=visible, recalled=expected.recalled, drift=drift, straying=straying,
        usual=target.usual * (1 - _FORGOTTEN) if visible > 0.5 else target.usual,
        missed=target.missed + waited if gone else 0.0, links=(), age=target.age + 1,
    )  # fmt: skip


def straying_of(target: Target, off: Float, told: float) -> tuple[Float, Float]:
    """Return how far (2,) px a hidden object is off its path, and by how much (2,) px/frame more in every frame.

    It is found `off` (2,) px where it was expected: it may have slowed down or sped up since it was seen whole. That is
    believed of its speed as far as something is `told` in [0, 1]: of one who is not seen it only says where she can be.
    """
    since = 0.0 if target.visible >= WHOLE else 1.0
    straying = since * target.straying + told * _STRAYING * off
    return since * target.drift + straying + _DRIFT * off, straying


def holding(by: Rules, target: Target, state: State, sight: Seen, one: Measured) -> State:
    """Return a state whose μ keeps for some frames what has gone where nothing has ever been seen: what stands there may hide it."""
    pose = observer.pose_of(state, by.group)
    return _with_parts(by, state, sight, _gone(by, recalling.drawn(target.past[-AGO]), pose, sight, one))


def _gone(by: Rules, shape: Float, pose: Float, sight: Seen, one: Measured) -> Bits:
    """Return which cells (h, w) of μ do not look like the object any more, but may be hidden."""
    before = sight.window.drawn(shape, pose) < 0
    return solid(before & (one.pull >= 0) & ~(sight.covered & (one.pull > 0)))


def _with_parts(by: Rules, state: State, sight: Seen, parts: Bits) -> State:
    """Return a state whose μ holds parts (h, w), too."""
    if not parts.any():
        return state
    window, pose = sight.window, observer.pose_of(state, by.group)
    there = observer.about(state.shape.shape) @ lie.inverse(pose) @ lie.inverse(window.to_cells())
    kept = levelset.carried(levelset.signed_distance(parts), there, state.shape.shape)
    shape = levelset.redistance(np.minimum(state.shape, kept))
    return observer.gauged(replace(state, shape=shape), group=by.group)


def covering(depth: Float, pull: Single, most: int, reach: int, covered: Bits) -> tuple[int, int]:
    """Return the shift (x, y), of at most so many cells, at which a silhouette covers most of what looks like it.

    What of it does not look like it counts little, since it may be hidden; but in full where objects have been seen
    before (h, w), since nothing stands there that could hide it.
    """
    most = max(most, 1)
    inside = (depth < 0).astype(np.float32)
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    if not len(rows):
        return 0, 0
    part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    amiss = np.where(covered, np.float32(1), np.float32(_MISSING))
    gain = np.where(pull < 0, -pull, -amiss * pull) * (depth < most + reach)
    field = cv2.copyMakeBorder(gain.astype(np.float32), most, most, most, most, cv2.BORDER_CONSTANT, value=0)
    field = field[part[0].start : part[0].stop + 2 * most, part[1].start : part[1].stop + 2 * most]
    sums = cv2.matchTemplate(field, np.ascontiguousarray(inside[part]), cv2.TM_CCORR) / float(inside.sum())
    y, x = np.mgrid[-most : most + 1, -most : most + 1]
    sums = sums - _STRAY * (x**2 + y**2) / most**2
    best = np.unravel_index(int(np.argmax(np.round(sums, 4) - 1e-9 * (x**2 + y**2))), sums.shape)
    return int(x[best]), int(y[best])


def solid(bits: Bits) -> Bits:
    """Return what of bits (h, w) is more than some cells thick."""
    brush = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_SOLID, _SOLID))
    return np.asarray(cv2.morphologyEx(bits.astype(np.uint8), cv2.MORPH_OPEN, brush)) > 0

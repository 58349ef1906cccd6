"""The tracker: predict, measure, update, learn, say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.features.masks import mask_overlaps, mask_shares, silhouettes
from perdure.maths import levelset, lie
from perdure.maths.mixture import log_density
from perdure.params import Schedule, parameter
from perdure.scene.whereabouts import Waiting, awaited
from perdure.scene.zones import Zones, counting, renumbered
from perdure.trackers.contour import observer, recalling
from perdure.trackers.contour.measuring import Measured, measured, of_evidence
from perdure.trackers.contour.observer import Gains, State
from perdure.trackers.contour.saying import gone, happenings, has_left, rows_of
from perdure.trackers.contour.seeing import (
    Weights,
    Window,
    evidence,
    fitted,
    lab_of,
    learnt_layer,
    learnt_place,
    moved_on,
    small_grey,
    velocity_by_flow,
    window_round,
)
from perdure.trackers.contour.targets import Looks, Place, Target
from perdure.types import Bits, Event, Frame, Image, Mask, Regions, Report, Scene

Float = NDArray[np.float64]
Single = NDArray[np.float32]
_HIDDEN = 0.15  # share of a silhouette that is seen, below which nothing is
_FROZEN = 0.6  # below which nothing is learnt of its shape and looks
_WIDER = 3.0  # by which the search grows in a second
_STEADY = 0.08  # rate at which the velocity for hidden times follows
_WHOLE = 0.9  # below which it is only shifted: no turn or growth is believed
_MORE, _LESS = 0.2, 0.015  # rates at which the usual support follows what is seen, where that is more, or less
_FAR, _BETTER = 0.1, 0.05  # what the farthest shift must gain more, and any, of 2 between all wrong and all right
_COVERED, _SAME = 0.2, 0.3
_MARKED = 0.5
_AGO = 8  # frames ago, with which what is seen is compared
_DEGREES = {"position": 0, "velocity": 1, "acceleration": 2}
_RESTLESS = 0.12  # share of an outline that is another in every frame, from which it is
_MISSING = 0.15  # what a pixel of a silhouette counts that does not look like it, beside one that does
_STRAY = 0.03  # what the farthest shift must cover more, of all
_DRIFT = 0.4  # rate at which the path of a hidden object follows what is seen of it
_SOLID = 5  # cells across, from which a part is one
_SMOOTH = 3  # cells across which evidence is averaged
_EDGE = 0.8  # |f_in - f_out| averaged over the reach, from which there is no edge within it
_TELLING = 0.35  # share seen from which flow tells how the whole moves
_NEAR_EDGE = 0.45  # the same where flow tells how it moves
_RATE = 0.25  # at which an object's own picture is brought up to date
_PLACE_RATE = 0.2


@dataclass(frozen=True, eq=False)
class ContourState:
    """All objects, and the place."""

    targets: tuple[Target, ...]
    waiting: tuple[Waiting, ...]
    place: Place
    light: NDArray[np.uint8]  # (H, W) grey of the frame before; (0, 0) before the first
    next_key: int
    next_id: int
    time: float
    size: tuple[int, int]  # height, width
    zones: Zones


class _Seen(NamedTuple):
    """What a frame shows of one object."""

    window: Window
    colours: Single
    evidence: Single  # (h, w)
    state: State  # with the motion that the flow shows
    edge: float  # |f_in - f_out| averaged over the reach, from which an edge is not the contour's
    pose: Float  # where it should be
    depth: Float  # (h, w) cells, signed distances of the silhouette there
    known: Bits
    expected: _Expected | None
    covered: Bits  # (h, w) where an object has been seen before


class _Expected(NamedTuple):
    """What an object should be like in a frame, by its past."""

    shape: Float  # μ
    pose: Float  # (3, 3)
    recalled: int  # how old it was when it had that shape; -1: now


@dataclass(frozen=True)
class Contour:
    """The contour observer: a shape that deforms slowly, and the motion of a group, corrected by what each frame shows."""

    shape_gain: Schedule = parameter(
        Schedule(0.8),
        "how much of a measured shape is believed, as '0.1,0.5@40' from frames on",
        low=0.0,
        high=1.0,
        symbol="L_μ",
    )
    motion_gain: Schedule = parameter(
        Schedule(0.6),
        "how much of a measured motion is believed, as '0.1,0.5@40' from frames on",
        low=0.0,
        high=1.0,
        symbol="L_v",
    )
    gains: str = parameter(
        "automatic", "gains as they are, or by the share that is seen", choices=("automatic", "constant")
    )
    group: str = parameter("se2", "motions of the whole", choices=tuple(lie.GROUPS))
    motion: str = parameter(
        "velocity", "what stays constant while nothing is seen", choices=tuple(observer.MOTIONS)
    )
    window: int = parameter(4, "frames whose motions are corrected", low=1, high=50, symbol="k")
    iterations: int = parameter(10, "steps down each gradient, a frame", low=1, high=1000)
    reach: int = parameter(8, "how far from the contour an edge is looked for", unit="cells", low=1, high=100)
    giving: float = parameter(0.3, "how fast a shape gives up pixels, beside taking them in", low=0.0, high=1.0)
    search: float = parameter(
        16.0, "how far from where it is expected an object is looked for", unit="px", low=1.0, high=500.0
    )
    curvature: float = parameter(0.02, "weight of the contour's length", unit="cells", low=0.0, high=10.0)
    components: int = parameter(5, "Gaussians of a mixture of colours", low=1, high=50)
    trust: float = parameter(0.5, "trust in the colours seen at first against those seen last", low=0.0, high=1.0)
    place: float = parameter(0.5, "trust in colours at their places against colours anywhere", low=0.0, high=1.0)
    bound: float = parameter(4.0, "largest evidence for a pixel", unit="nats", low=0.1, high=60.0)
    ring: float = parameter(40.0, "how far round an object it is looked for", unit="px", low=4.0, high=2000.0)
    cells: int = parameter(40000, "cells in which an object is looked at, at most", low=1000, high=10**7)
    patience: float = parameter(
        2.0, "how long an object that is hidden is looked for", unit="s", low=0.0, high=3600.0
    )
    smallest: float = parameter(
        0.0004, "area of the smallest object that an observation founds", unit="of the picture", low=0.0, high=1.0
    )
    flow: bool = parameter(True, "whether what is seen of an object tells by its flow how it moves")
    moved: Callable[[Float], Float] | None = field(default=None, repr=False)  # the user's own motion model
    gained: Callable[[int], Gains] | None = field(default=None, repr=False)  # and his own gains of a frame
    reserved: int = field(default=0, repr=False)  # ids up to it are those of marks, also of later ones

    needs_pixels = True
    follows_marks = True

    def start(self, scene: Scene) -> ContourState:
        """Return the state without an object."""
        none = Place(
            np.zeros((0, 0, 3), np.uint8),
            np.zeros((0, 0), np.bool_),
            np.zeros((0, 0), np.bool_),
            np.zeros((0, 0), np.uint8),
            1,
        )
        size = (scene.height, scene.width)
        return ContourState((), (), none, none.grey, 1, self.reserved + 1, 0.0, size, Zones.of(scene))

    def step(self, state: ContourState, frame: Frame, regions: Regions) -> tuple[ContourState, Report]:
        """Predict, measure and update every object, learn, find new ones, say."""
        if frame.image is None:
            return replace(state, time=frame.time), Report()
        after, report, numbers = counting(state.zones, regions, partial(self._step, state, frame, frame.image))
        return after, replace(report, rows=renumbered(report.rows, frame.index, numbers))

    def _step(
        self, state: ContourState, frame: Frame, image: Image, regions: Regions
    ) -> tuple[ContourState, Report]:
        """Step on the regions that count."""
        zones = state.zones
        lab = lab_of(image)
        grey, step = small_grey(image)
        nothing = np.zeros(lab.shape[:2], np.bool_)
        place = Place(lab, nothing, nothing, grey, step)
        if state.place.grey.shape == grey.shape:
            place, camera = moved_on(state.place, grey, step, self._things(state.targets, state.size))
            if not np.array_equal(
                camera, np.eye(2, 3)
            ):  # outlines change with what is behind: no gait is told from it
                state = replace(state, targets=tuple(replace(one, restless=0.0) for one in state.targets))
        light = np.asarray(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY), np.uint8)
        sights = [self._look(*self._moved(one, state.light, light), lab, place) for one in state.targets]
        waited = frame.time - state.time
        targets = self._updated(state.targets, sights, self._gains_of(frame.index), waited)
        targets = [_allowed(zones, was, one, waited) for was, one in zip(state.targets, targets, strict=True)]
        targets, born, waiting, events = self._born(state, targets, frame, lab, place, regions)
        covered = np.any([nothing, *(one.seen.to_image(*state.size) for one in targets)], axis=0)
        place = learnt_place(place, lab, self._things(targets, state.size), covered, _PLACE_RATE)
        kept, believed = [], []
        for one in targets:
            whole = self._silhouette(one)
            seen = one.seen.box if one.missed == 0 and one.seen.area else None
            one = replace(one, last_seen=one.last_seen.after(zones, seen, whole.box))
            left = has_left(whole.box, state.size) and one.missed > 0 and one.last_seen.behind < 0
            if one.missed > one.last_seen.kept(zones, self.patience, left) + 1e-9 or left or not whole.area:
                events.append(gone(one, frame, left, zones))
            else:
                kept.append(one)
                believed.append(whole)
        rows = rows_of(kept, believed, frame, state.size, self.patience, self._group)
        events += happenings(state.targets, kept, frame, zones)
        next_id = max([state.next_id, *(one.id + 1 for one in born)])
        after = ContourState(
            tuple(kept), waiting, place, light, state.next_key + len(born), next_id, frame.time, state.size, zones
        )
        return after, Report(rows, events=tuple(events))

    def finish(self, state: ContourState) -> Report:
        """Return nothing: all has been said."""
        return Report()

    @property
    def _group(self) -> lie.Group:
        return lie.GROUPS[self.group]

    @property
    def _motion(self) -> Callable[[Float], Float]:
        return self.moved or observer.MOTIONS[self.motion]

    def _gains_of(self, index: int) -> Gains:
        """Return the gains of a frame, before anything is known of what is seen."""
        if self.gained is not None:
            return self.gained(index)
        return Gains(Schedule(self.shape_gain).at(index), Schedule(self.motion_gain).at(index))

    def _expectation(self, target: Target) -> _Expected | None:
        """Return which shape an object should have, and where it should be, by what is known of its past."""
        past = target.past
        if self.gains == "constant" or len(past) < _AGO or target.restless < _RESTLESS:
            return None
        seen = target.visible >= _WHOLE
        before = target.recalled
        if seen:
            again = recalling.recalled(past)
            before = -1 if again is None else past[again].age
        age = -1 if before < 0 else recalling.following(past, before)
        now = recalling.nearest(past, age) if age >= 0 else len(past) - 1
        shape = recalling.drawn(past[now]) if age >= 0 else target.state.shape
        pose = observer.pose_of(target.state, self._group).copy()
        if self.moved is None:
            place = recalling.place(past, target.age + 1, age, _DEGREES[self.motion])
        else:
            place = pose[:2, 2] + self.moved(target.state.velocities)[:2] - target.drift
        pose[:2, 2] = place + (0.0 if seen else target.drift)
        return _Expected(shape, pose, age)

    # Measuring ----------------------------------------------------------------------------------------------

    def _look(self, target: Target, edge: float, lab: NDArray[np.uint8], place: Place) -> _Seen:
        """Return what a frame shows round where an object is expected: first by colours anywhere, then at their places."""
        weights = Weights(self.place, self.trust, self.bound)
        size = (lab.shape[0], lab.shape[1])
        expected = self._expectation(target)
        pose = observer.predicted(target.state, self._group)
        hidden = target.visible < _WHOLE and expected is not None
        if hidden and expected is not None:
            target = replace(target, state=replace(target.state, shape=expected.shape))
            pose = expected.pose
        ring = self.ring + self._searched(target) - self.search
        window = window_round(target.state.shape, pose, ring, self.cells)
        colours = window.cut(lab).astype(np.float32)
        inside = window.inside(size)
        depth = window.drawn(target.state.shape, pose)
        outside = depth > self.reach
        plain = evidence(window, colours, target.looks, place, outside, None, weights)
        one = self._measured(window, plain, inside)
        if self.gains == "automatic" and not hidden:
            pose = pose + self._shifted(target, one, depth)
        state = observer.towards(target.state, pose, self._group)
        if hidden:
            pass
        elif target.missed == 0 or _support(depth, one, self.reach) >= _HIDDEN * target.usual:
            found = self._registered(state, one, edge, target.visible >= _WHOLE)
            near = self.reach / 2 * window.step if target.visible < _WHOLE else np.inf
            pose = found if np.abs(found[:2, 2] - pose[:2, 2]).max() <= near else pose
            state = observer.towards(target.state, pose, self._group)
        depth = window.drawn(target.state.shape, pose)
        full = evidence(window, colours, target.looks, place, depth > self.reach, pose, weights)
        smooth = np.asarray(cv2.blur(full, (_SMOOTH, _SMOOTH)), np.float32)
        covered = window.cut(place.covered.view(np.uint8)).astype(np.bool_)
        return _Seen(window, colours, smooth, state, edge, pose, depth, inside, expected, covered)

    def _moved(self, target: Target, before: NDArray[np.uint8], now: NDArray[np.uint8]) -> tuple[Target, float]:
        """Return an object with the velocity that what is seen of it has had, and how far from the contour edges are its own.

        Where flow tells, only near ones are: others are those of what comes before it.
        """
        if target.missed > 0 or before.shape != now.shape or target.visible < _TELLING or not self.flow:
            return target, _EDGE
        pose = observer.pose_of(target.state, self._group)
        found = velocity_by_flow(
            before, now, target.seen, pose, target.state.velocity, self._group, whole=target.visible >= _WHOLE
        )
        if found is None:
            return target, _EDGE
        return replace(target, state=replace(target.state, velocity=found)), _NEAR_EDGE

    def _measured(self, window: Window, found: Single, known: Bits) -> Measured:
        return of_evidence(found, known, self.reach, window.x, window.y, window.step)

    def _shifted(self, target: Target, one: Measured, depth: Float) -> Float:
        """Return the shift (3, 3) to the place of least energy (3) near: the descent begins there.

        E(d) = const + the sum of f_in - f_out over the silhouette; far shifts must gain more.
        """
        most = max(1, int(self._searched(target) / one.step))
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
        hidden = target.visible < _WHOLE and (sums[best] >= 0 or gained < 4 * _BETTER)
        if hidden or gained < _BETTER:
            return out
        out[0, 2], out[1, 2] = float(x[best]) * one.step, float(y[best]) * one.step
        return out

    def _searched(self, target: Target) -> float:
        """Return how far an object is looked for, pixels: the farther, the longer it has not been seen."""
        return self.search * (1 + _WIDER * target.missed)

    def _registered(self, state: State, one: Measured, edge: float, whole: bool) -> Float:
        """Return the pose (3, 3) of the contour in this frame alone."""
        gains = Gains(0.0, 1.0)
        after = self._observed(
            replace(
                state, velocities=state.velocities[:0], measurements=(), base=observer.pose_of(state, self._group)
            ),
            one,
            gains,
            edge,
            whole,
        )
        return observer.pose_of(after, self._group)

    def _observed(
        self, state: State, one: Measured, gains: Gains, edge: float, whole: bool = True, *, least: bool = False
    ) -> State:
        automatic = self.gains == "automatic"
        return observer.updated(
            state, one, gains, self._group,
            window=self.window, steps=self.iterations, motion=self._motion, reach=self.reach,
            curvature=self.curvature, robust=edge if automatic else 2.0,
            force=self._force(whole, least) if automatic else None, free=6 if whole or not automatic else 2,
            least=automatic and whole and least,
        )  # fmt: skip

    def _force(self, whole: bool, least: bool) -> Callable[[Float, Float], Float] | None:
        """Return what is made of (5)."""
        if whole and least:
            return None
        return self._slower if whole else self._heard

    def _changed(self, sight: _Seen, one: Measured) -> float:
        """Return which share of an outline is another in this frame: 1 - IoU of μ and what looks like it."""
        pose = observer.pose_of(observer.coasted(sight.state, one, self._group, window=1), self._group)
        shape = sight.state.shape
        found = observer.towards_least(shape, pose[None], [one], 1.0, self.reach)
        was, now = shape < 0, found < 0
        return 1 - float((was & now).sum()) / max(float((was | now).sum()), 1.0)

    def _heard(self, push: Float, shape: Float) -> Float:
        """Return (5) of an object that is partly hidden: where nothing within reach looks like it, μ is rigid."""
        own = ((push < -0.2) & (shape < self.reach)).astype(np.uint8)
        side = 2 * self.reach + 1
        near = cv2.dilate(own, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)))
        return np.where(np.asarray(near) > 0, self._slower(push, shape), 0.0)

    def _slower(self, push: Float, shape: Float) -> Float:
        """Return (5), weaker where μ gives up pixels: what is hidden looks as if it were no more."""
        return np.where(push > 0, self.giving * push, push)

    # Updating -----------------------------------------------------------------------------------------------

    def _updated(
        self, targets: tuple[Target, ...], sights: list[_Seen], gains: Gains, waited: float
    ) -> list[Target]:
        """Return the objects with shape, pose and looks brought up to date."""
        found = []
        for number, (target, sight) in enumerate(zip(targets, sights, strict=True)):
            taken = self._taken(number, sights)
            known = sight.known & ~taken
            found.append(self._one_updated(target, sight, known, gains, waited))
        return found

    def _taken(self, number: int, sights: list[_Seen]) -> Bits:
        """Return which cells (h, w) look more like another object that should be there."""
        own = sights[number]
        taken = np.zeros(own.evidence.shape, np.bool_)
        for other, sight in enumerate(sights):
            if other == number:
                continue
            there = own.window.to_cells() @ lie.inverse(sight.window.to_cells())
            claim = np.where(sight.depth < 0, sight.evidence, np.float32(-99))
            size = (own.window.width, own.window.height)
            moved = cv2.warpAffine(
                claim, there[:2], size, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=-99
            )
            taken |= (moved > 0) & ((own.depth >= 0) | (moved >= own.evidence))
        return taken

    def _one_updated(self, target: Target, sight: _Seen, known: Bits, gains: Gains, waited: float) -> Target:
        one = self._measured(sight.window, sight.evidence, known)
        area = _support(sight.depth, one, self.reach)
        visible = min(1.0, area / max(target.usual, 1.0))
        if sight.expected is not None:
            visible, place = self._placed(target, sight.expected, sight, one)
            if visible < _WHOLE:
                return self._hidden(target, sight.expected, sight, one, place, visible, gains.shape, waited)
        state, group = sight.state, self._group
        share = 1.0
        if self.gains == "automatic":
            share = min(max((visible - _FROZEN) / (_WHOLE - _FROZEN), 0.0), 1.0)
            gains = Gains(gains.shape * share, gains.motion * visible)
        if visible < _HIDDEN and self.gains == "automatic":
            blank = measured(np.zeros((1, 1)), 0)
            state = observer.coasted(
                observer.towards(target.state, observer.predicted(target.state, group), group),
                blank,
                group,
                window=self.window,
            )
            state = self._steadied(state, target.steady, 0.0)
            return replace(
                target,
                state=state,
                seen=Mask.empty(),
                visible=visible,
                missed=target.missed + waited,
                links=(),
                age=target.age + 1,
            )
        restless, least = target.restless, target.restless >= _RESTLESS
        if visible >= _WHOLE:
            restless = restless + max(_STEADY, 1 / (target.frames + 1)) * (self._changed(sight, one) - restless)
        state = self._observed(state, one, gains, sight.edge, visible >= _WHOLE, least=least)
        steady, past = target.steady, target.past
        if visible >= _WHOLE:
            at = observer.pose_of(state, group)[:2, 2]
            raw = state.shape
            if sight.expected is not None:
                state = self._holding(target, state, sight, one)
            past = recalling.kept(past, raw, target.age + 1, at)
            steady = steady + max(_STEADY, 1 / (target.frames + 1)) * (state.velocities[-1] - steady)
        state = self._steadied(state, steady, share)
        pose = observer.pose_of(state, group)
        depth = sight.window.drawn(state.shape, pose)
        seen = (depth < 0) & (one.pull < 0)
        usual = target.usual + (_MORE if area > target.usual else _LESS) * (area - target.usual)
        mask = self._mask(sight.window, seen)
        looks = target.looks
        if visible >= _FROZEN:
            looks = self._learnt(looks, sight, depth, seen, pose)
        return replace(
            target,
            state=state,
            looks=looks,
            seen=mask,
            visible=visible,
            usual=usual,
            steady=steady,
            past=past,
            recalled=-1,
            restless=restless,
            drift=np.zeros(2),
            age=target.age + 1,
            missed=0.0,
            frames=target.frames + 1,
            links=(),
        )

    def _placed(self, target: Target, expected: _Expected, sight: _Seen, one: Measured) -> tuple[float, Float]:
        """Return which share of an object is seen, and where (3, 3) what is seen lies in the shape that it should have."""
        poses = [expected.pose]
        if target.visible >= _WHOLE:
            poses.append(sight.pose)
        best: tuple[float, Float] = (-1.0, expected.pose)
        for pose in poses:
            depth = sight.window.drawn(expected.shape, pose)
            near = self._searched(target) / 2 + 1
            x, y = covering(depth, one.pull, int(near / one.step), self.reach)
            moved = pose.copy()
            moved[:2, 2] += np.array([x, y]) * one.step
            depth = sight.window.drawn(expected.shape, moved)
            was, now = depth < 0, (one.pull < 0) & (depth < self.reach)
            vacated = sight.covered & (one.pull > 0)
            change = float(solid(was & ~now & ~vacated).sum()) - float(solid(now & ~was).sum())
            share = float(np.clip(1 - change / max(was.sum(), 1), 0.0, 1.0))
            if expected.recalled < 0:
                share = max(share, min(1.0, _support(depth, one, self.reach) / max(target.usual, 1.0)))
            if share > best[0] + 0.02:
                best = share, moved
        return best

    def _holding(self, target: Target, state: State, sight: _Seen, one: Measured) -> State:
        """Return a state whose μ keeps for some frames what has gone where nothing has ever been seen: what stands there may hide it."""
        pose = observer.pose_of(state, self._group)
        return self._with_parts(state, sight, self._gone(recalling.drawn(target.past[-_AGO]), pose, sight, one))

    def _gone(self, shape: Float, pose: Float, sight: _Seen, one: Measured) -> Bits:
        """Return which cells (h, w) of μ do not look like the object any more, but may be hidden."""
        before = sight.window.drawn(shape, pose) < 0
        return solid(before & (one.pull >= 0) & ~(sight.covered & (one.pull > 0)))

    def _with_parts(self, state: State, sight: _Seen, parts: Bits) -> State:
        """Return a state whose μ holds parts (h, w), too."""
        if not parts.any():
            return state
        window, pose = sight.window, observer.pose_of(state, self._group)
        there = observer.about(state.shape.shape) @ lie.inverse(pose) @ lie.inverse(window.to_cells())
        kept = levelset.carried(levelset.signed_distance(parts), there, state.shape.shape)
        shape = levelset.redistance(np.minimum(state.shape, kept))
        return observer.gauged(replace(state, shape=shape), group=self._group)

    def _hidden(
        self,
        target: Target,
        expected: _Expected,
        sight: _Seen,
        one: Measured,
        place: Float,
        visible: float,
        gain: float,
        waited: float,
    ) -> Target:
        """Return an object that is partly or wholly hidden: μ is what it should be, where what is seen fits into it."""
        gone = visible < _HIDDEN
        pose = expected.pose if gone else place
        state = replace(target.state, shape=expected.shape)
        state = observer.towards(state, pose, self._group)
        state = observer.coasted(state, measured(np.zeros((1, 1)), 0), self._group, window=self.window)
        if expected.recalled < 0 and visible >= _TELLING:
            parts = self._gone(expected.shape, pose, sight, one)
            shape = observer.towards_least(state.shape, pose[None], [one], gain, self.reach)
            state = self._with_parts(replace(state, shape=shape), sight, parts)
        pose = observer.pose_of(state, self._group)
        depth = sight.window.drawn(state.shape, pose)
        seen = Mask.empty() if gone else self._mask(sight.window, (depth < 0) & (one.pull < 0))
        drift = (np.zeros(2) if target.visible >= _WHOLE else target.drift) + (
            0.0 if gone else _DRIFT * (place[:2, 2] - expected.pose[:2, 2])
        )
        return replace(
            target, state=state, seen=seen, visible=visible, recalled=expected.recalled, drift=drift,
            usual=target.usual * (1 - _LESS) if visible > 0.5 else target.usual,
            missed=target.missed + waited if gone else 0.0, links=(), age=target.age + 1,
        )  # fmt: skip

    def _steadied(self, state: State, steady: Float, share: float) -> State:
        """Return the state with a prediction that is the steadier, the less is seen; it turns and grows by half at most."""
        if self.gains == "constant":
            return state
        velocity = share * state.velocity + (1 - share) * steady
        velocity[2:] = share * state.velocity[2:] / 2
        return replace(state, velocity=velocity)

    def _learnt(self, looks: Looks, sight: _Seen, depth: Float, seen: Bits, pose: Float) -> Looks:
        layer = learnt_layer(
            looks.layer, sight.window, sight.colours, (depth < -1) & (sight.evidence > -1), pose, _RATE
        )
        return replace(
            looks,
            last_own=fitted(sight.colours[seen], self.components, looks.last_own),
            last_other=fitted(sight.colours[depth > 2], self.components, looks.last_other),
            layer=layer,
        )

    def _mask(self, window: Window, cells: Bits) -> Mask:
        bits = cells
        if window.step > 1:
            size = (window.width * window.step, window.height * window.step)
            bits = cv2.resize(cells.astype(np.float32), size, interpolation=cv2.INTER_LINEAR) > 0.5
        return Mask.of_image(bits, window.y, window.x)

    def _silhouette(self, target: Target) -> Mask:
        """Return the whole silhouette: it may leave the picture."""
        pose = observer.pose_of(target.state, self._group)
        window = window_round(target.state.shape, pose, 3.0, 10**9)
        return Mask.of_image(window.drawn(target.state.shape, pose) < 0, window.y, window.x)

    def _things(self, targets: list[Target] | tuple[Target, ...], size: tuple[int, int]) -> Bits:
        things = np.zeros(size, np.bool_)
        for one in targets:
            x1, y1, x2, y2 = self._silhouette(one).box
            things[max(y1 - 6, 0) : max(y2 + 6, 0), max(x1 - 6, 0) : max(x2 + 6, 0)] = True
        return things

    # Births -------------------------------------------------------------------------------------------------

    def _born(
        self,
        state: ContourState,
        targets: list[Target],
        frame: Frame,
        lab: NDArray[np.uint8],
        place: Place,
        regions: Regions,
    ) -> tuple[list[Target], list[Target], tuple[Waiting, ...], list[Event]]:
        """Found objects on regions that are nobody's, and on marks."""
        marks = regions.data.get("mark")
        if marks is None and regions.blind:
            return targets, [], state.waiting, []
        targets = list(targets)
        masks = silhouettes(regions, *state.size)
        least = max(self.smallest * state.size[0] * state.size[1], 1)
        born: list[Target] = []
        waiting: list[Waiting] = []
        events: list[Event] = []
        next_id = max([state.next_id, *(one.id + 1 for one in targets)])
        held = [self._silhouette(one) for one in targets]
        for number, mask in enumerate(masks):
            identity, entry = int(marks[number]) if marks is not None else 0, -1
            if not identity:
                if mask_shares([mask], held).sum() >= _COVERED or mask.area < least:
                    continue
                known = awaited(mask, state.waiting, _SAME)
                new = known or Waiting.first(state.zones, mask, frame.time)
                if not np.isfinite(new.evidence):
                    continue
                if len(state.place.grey) and not (known and new.is_due(frame.time)):
                    waiting.append(new)
                    continue
                entry = new.entry
            elif mask.area < 1:
                continue
            lost = _marked_before(targets, held, mask, identity) if identity else None
            if lost is not None:
                was = targets[lost]
                targets[lost] = self._newborn(mask, lab, place, regions, number, frame, was.key, identity)
                if identity != was.id:
                    events.append(Event("entered", frame.index, frame.index, (identity,)))
                continue
            identity = identity or next_id
            next_id = max(next_id, identity + 1)
            one = self._newborn(mask, lab, place, regions, number, frame, state.next_key + len(born), identity)
            born.append(one)
            held.append(mask)
            events.append(Event("entered", frame.index, frame.index, (identity,), state.zones.name(entry)))
        if not masks:
            waiting = list(state.waiting)
        return [*targets, *born], born, tuple(waiting), events

    def _newborn(
        self,
        mask: Mask,
        lab: NDArray[np.uint8],
        place: Place,
        regions: Regions,
        row: int,
        frame: Frame,
        key: int,
        identity: int,
    ) -> Target:
        """Return an object that is a region (§III: the initialisation phase)."""
        height, width = mask.bits.shape
        cell = float(_cell_of(width, height, self.ring, self.cells))
        state = observer.initial(mask.bits, mask.x, mask.y, self._group, cell)
        pose = observer.pose_of(state, self._group)
        window = window_round(state.shape, pose, self.ring, self.cells)
        colours = window.cut(lab).astype(np.float32)
        depth = window.drawn(state.shape, pose)
        within = window.inside((lab.shape[0], lab.shape[1]))
        own, other = colours[(depth < 0) & within], colours[(depth > 2) & within]
        inner, outer = fitted(own, self.components, None), fitted(other, self.components, None)
        if not regions.masks[row].area:  # a box: what is in it, by its colours (§III, the initialisation phase)
            likely = np.clip(log_density(inner, colours) - log_density(outer, colours), -self.bound, self.bound)
            state = observer.settled_shape(
                state, self._measured(window, likely, within), self.curvature, self._group
            )
            pose = observer.pose_of(state, self._group)
            depth = window.drawn(state.shape, pose)
        layer = learnt_layer(None, window, colours, (depth < -0.5) & within, pose, 1.0)
        return Target(
            key, identity, state, Looks(inner, outer, inner, outer, layer), mask, 1.0, float(mask.area), np.zeros(self._group.dimension), (), -1, 2 * _RESTLESS, np.zeros(2), 0, 1, 0.0, frame.time,
            float(regions.scores[row]), str(regions.classes[row]), (row,),
            bool(regions.data["mark"][row]) if "mark" in regions.data else False,
        )  # fmt: skip


def _allowed(zones: Zones, was: Target, now: Target, waited: float) -> Target:
    """Return an object as it is now, or as one that is still not seen where a rule forbids that it is found there."""
    found = was.missed > 0 == now.missed and now.seen.area
    if not found or not was.last_seen.is_forbidden(zones, now.seen.box, was.missed + waited):
        return now
    return replace(was, missed=was.missed + waited, seen=Mask.empty(), links=())


def covering(depth: Float, pull: Single, most: int, reach: int) -> tuple[int, int]:
    """Return the shift (x, y), of at most so many cells, at which a silhouette covers most of what looks like it.

    What of it does not look like it counts little: it may be hidden.
    """
    most = max(most, 1)
    inside = (depth < 0).astype(np.float32)
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    if not len(rows):
        return 0, 0
    part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    gain = np.where(pull < 0, -pull, np.float32(-_MISSING) * pull) * (depth < most + reach)
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


def _share(depth: Float, one: Measured, reach: int) -> float:
    """Which share of a silhouette, signed distances (h, w), has support in the picture: in it or within reach of it."""
    return min(1.0, float(((depth < reach) & (one.pull < 0)).sum() / max((depth < 0).sum(), 1)))


def _support(depth: Float, one: Measured, reach: int) -> float:
    """How many pixels look like the object, in a silhouette, signed distances (h, w), and within reach of it."""
    return float(((depth < reach) & (one.pull < 0)).sum()) * one.step**2


def _cell_of(width: int, height: int, ring: float, cells: int) -> int:
    """Return how many pixels a cell is across, for an object of so many pixels."""
    step = 1
    while (width + 2 * ring) * (height + 2 * ring) > cells * step * step:
        step *= 2
    return step


def _marked_before(targets: list[Target], held: list[Mask], mask: Mask, identity: int) -> int | None:
    """Which object a mark means, if any: the one of that id, or one of no mark that is where the mark is."""
    same = [number for number, one in enumerate(targets) if one.id == identity]
    if same or not targets:
        return same[0] if same else None
    common = mask_overlaps([mask], held[: len(targets)])[0]
    free = [number for number, one in enumerate(targets) if not one.marked and common[number] >= _MARKED]
    return max(free, key=common.__getitem__, default=None)

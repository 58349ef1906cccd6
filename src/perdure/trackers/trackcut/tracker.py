"""The tracker: predict, cut, separate, learn, say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from perdure.features.masks import disjoint, mask_overlaps, mask_shares
from perdure.maths.mixture import log_density
from perdure.params import parameter
from perdure.trackers.trackcut.cutting import Observed, contrast, cut_out, touching
from perdure.trackers.trackcut.expecting import Expected, Weights, expect
from perdure.trackers.trackcut.likelihoods import learn_colours, of_colours
from perdure.trackers.trackcut.saying import gone, happenings, has_left, rows_of
from perdure.trackers.trackcut.seeing import Motion, Sight, look_at, motion_between
from perdure.trackers.trackcut.separating import clusters, separate
from perdure.trackers.trackcut.shapes import to_shape
from perdure.trackers.trackcut.targets import RECENT, Shape, Target
from perdure.trackers.trackcut.windows import around
from perdure.types import Event, Frame, Mask, Regions, Report, Scene

Float = NDArray[np.float32]
_GONE = 0.05  # share of its mean size, below which an object is not seen
_NEW_COVERED = 0.2  # share of an observation that objects may hold, for it to be a new one
_SAME = 0.3  # share of an observation that one of the frame before held, for both to be one
_GAIN, _LOSE = 0.5, 0.25  # by which the remembered silhouette takes up and gives up pixels, a frame
_HALF_SEEN = 0.75  # share of the remembered silhouette below which it gives up nothing
_KNOWN = 5  # frames from which a size is known (§3.3)
_SPREAD = 0.05  # of the mean size, that its deviation is at least
_FAMILIAR = 25  # frames until which an object that came in is still getting known
_ALONE, _UNSURE = (
    0.4,
    2.0,
)  # s for which an object is too small, seen by itself or without observation, until it has changed
_MARKED = 0.5  # IoU from which an object is what is marked there
_RATE = 0.1  # share of a new size
_ALIKE = 0.5  # nats a pixel by which what is found must look more like the object than like its surroundings
_SIMILAR = (0.4, 2.5)  # ratio of sizes of one that is found again


@dataclass(frozen=True, eq=False)
class TrackCutState:
    """All objects, and the frame before."""

    targets: tuple[Target, ...]
    waiting: tuple[Mask, ...]  # observations of the frame before that were nobody's
    colours: NDArray[np.uint8]  # (H, W, 3) of the frame before; (0, 0, 3) before the first
    grey: NDArray[np.uint8]  # (h, w)
    next_key: int
    next_id: int
    time: float  # s
    size: tuple[int, int]  # height, width


@dataclass(frozen=True)
class TrackCut:
    """Track and Cut: masks that are followed and cut out in one energy, from a mark or from any detector's regions."""

    contrast: float = parameter(
        2.0, "weight of contrast: what a cut through an even area costs", low=0.0, high=1000.0
    )
    link: float = parameter(2.0, "weight of an observation for its pixels", low=0.0, high=1000.0, symbol="λ2")
    apart: float = parameter(
        20.0, "weight of contrast between objects that overlap", low=0.0, high=1000.0, symbol="λ3"
    )
    components: int = parameter(5, "Gaussians of a mixture of colours", low=1, high=50)
    looks: float = parameter(1.0, "weight of colours", low=0.0, high=100.0)
    trust: float = parameter(0.8, "trust in the colours seen at first against those seen last", low=0.0, high=1.0)
    place: float = parameter(2.0, "weight of colours at their places", low=0.0, high=100.0)
    moving: float = parameter(1.0, "weight of motion against the background's", low=0.0, high=100.0)
    form: float = parameter(0.5, "weight of the predicted silhouette", low=0.0, high=100.0)
    bound: float = parameter(4.0, "largest evidence of one kind for a pixel", unit="nats", low=0.1, high=60.0)
    outside: float = parameter(
        4.0,
        "evidence against pixels that no observation holds, where one holds others of the object",
        unit="nats",
        low=0.0,
        high=60.0,
    )
    ring: float = parameter(60.0, "how far round an object it is looked for", unit="px", low=4.0, high=2000.0)
    cells: int = parameter(15000, "cells in which an object is cut out, at most", low=1000, high=10**7)
    hidden_for: float = parameter(
        2.0, "how long an object that is hidden is looked for", unit="s", low=0.0, high=3600.0
    )
    smallest: float = parameter(
        0.0004, "area of the smallest object that an observation founds", unit="of the picture", low=0.0, high=1.0
    )
    second: bool = parameter(True, "whether objects that overlap are separated by the second energy")
    reserved: int = field(default=0, repr=False)  # ids up to it are those of marks, also of later ones

    needs_pixels = True
    follows_marks = True

    def start(self, scene: Scene) -> TrackCutState:
        """Return the state without an object."""
        none = np.zeros((0, 0), np.uint8)
        return TrackCutState(
            (), (), np.zeros((0, 0, 3), np.uint8), none, 1, self.reserved + 1, 0.0, (scene.height, scene.width)
        )

    def step(self, state: TrackCutState, frame: Frame, regions: Regions) -> tuple[TrackCutState, Report]:
        """Predict and cut out every object, separate those that overlap, learn, find new ones, say."""
        if frame.image is None:
            return replace(state, time=frame.time), Report()
        sight = look_at(frame.image)
        observations = [_mask_of(regions, row, state.size) for row in range(len(regions))]
        targets = list(state.targets)
        events: list[Event] = []
        if state.grey.shape == sight.grey.shape and targets:
            motion = motion_between(state.grey, sight, _things(targets, sight))
            targets = self._followed(state, targets, frame, sight, motion, observations, regions.blind)
        targets, born, waiting, told = self._born(state, targets, frame, sight, regions, observations)
        events += told
        next_id = max([state.next_id, *(one.id + 1 for one in born)])
        kept = []
        for one in targets:
            if one.missed > self.hidden_for + 1e-9 or has_left(one, state.size):
                events.append(gone(one, frame, state.size))
            else:
                kept.append(one)
        rows = rows_of(kept, frame, state.size, self.hidden_for)
        events += happenings(state.targets, kept, frame)
        state = TrackCutState(
            tuple(kept),
            waiting,
            sight.colours,
            sight.grey,
            state.next_key + len(born),
            next_id,
            frame.time,
            state.size,
        )
        return state, Report(rows, events=tuple(events))

    def finish(self, state: TrackCutState) -> Report:
        """Return nothing: all has been said."""
        return Report()

    def _followed(
        self,
        state: TrackCutState,
        targets: list[Target],
        frame: Frame,
        sight: Sight,
        motion: Motion,
        observations: list[Mask],
        blind: bool,
    ) -> list[Target]:
        """Return the objects as they are in this frame."""
        weights = Weights(self.looks, self.trust, self.place, self.moving, self.form, self.bound)
        found: list[tuple[Expected, NDArray[np.bool_], tuple[int, ...]]] = []
        for target in targets:
            ring, fineness = self.ring, self.cells
            if target.links and observations:  # it is where it was observed: looked at closely
                ring, fineness = ring / 2, fineness * 4
            for _ in range(2):
                expected = expect(target, state.colours, sight, motion, ring, fineness, weights)
                cells, matched, touches = self._cut(target, expected, [] if blind else observations)
                if not touches:
                    break
                ring *= 2
            if blind:  # §6: only the prediction is kept
                cells, matched = expected.predicted, ()
            found.append((expected, cells, matched))
        height, width = state.size
        masks = [expected.window.to_mask(cells, height, width) for expected, cells, _ in found]
        met = clusters(masks)
        if self.second:
            masks = self._separated(targets, masks, found, sight)
        waited = 0.0 if blind else frame.time - state.time
        links = [matched for *_, matched in found]
        shared = [
            any(set(one) & set(other) for place, other in enumerate(links) if place != k)
            for k, one in enumerate(links)
        ]
        for some in met:
            for k in some:
                shared[k] = True
        return [
            self._learnt(target, expected, mask, (matched, common), sight, waited, blind)
            for target, (expected, _, matched), mask, common in zip(targets, found, masks, shared, strict=True)
        ]

    def _cut(
        self, target: Target, expected: Expected, observations: list[Mask]
    ) -> tuple[NDArray[np.bool_], tuple[int, ...], bool]:
        """Return the pixels of least energy, the observations matched, and whether they reach the ring."""
        window, colours = expected.window, expected.colours
        costs, sigma = contrast(colours, self.contrast)
        seen, numbers = [], []
        unary = expected.unary
        covered = np.zeros(window.shape, np.bool_)
        for number, mask in enumerate(observations):
            cells = window.of_mask(mask) > 0.5
            if not cells.any():
                continue
            covered |= cells
            if not (cells & expected.predicted).any():
                continue
            mean = colours[cells].mean(axis=0)
            ratio = float(of_colours(mean[None], target.first, target.last, self.trust, self.bound)[0])
            seen.append(Observed(cells, ratio, mean))
            numbers.append(number)
        if seen:
            unary = unary + np.float32(self.outside) * np.where(covered, -0.5, 1.0).astype(np.float32)
        best = cut_out(unary, costs, sigma, colours, seen, self.link, self.bound / 4)
        anchors = expected.predicted.copy()
        for one, matched in zip(seen, best.matched, strict=True):
            if matched:
                anchors |= one.cells
        cells = touching(best.cells, anchors)
        hidden = target.missed > 0 or not expected.last.any()
        if hidden and cells.any():
            points = colours[cells]
            if of_colours(points, target.first, target.last, self.trust, self.bound).mean() < _ALIKE:
                cells = np.zeros_like(cells)
        links = tuple(number for number, matched in zip(numbers, best.matched, strict=True) if matched)
        return cells, links, best.touches

    def _separated(
        self,
        targets: list[Target],
        masks: list[Mask],
        found: list[tuple[Expected, NDArray[np.bool_], tuple[int, ...]]],
        sight: Sight,
    ) -> list[Mask]:
        """Return the masks, of which none overlap."""
        for some in clusters(masks):
            shapes = [_as_shape(found[k][0], targets[k].together) for k in some]
            looks = [_log_density_of(targets[k]) for k in some]
            parts = separate([masks[k] for k in some], shapes, looks, sight.colours, self.apart, self.cells)
            for k, mask in zip(some, parts, strict=True):
                masks[k] = mask
        return masks

    def _learnt(
        self,
        target: Target,
        expected: Expected,
        mask: Mask,
        matched: tuple[tuple[int, ...], bool],
        sight: Sight,
        waited: float,
        blind: bool,
    ) -> Target:
        """Return an object brought up to date with its pixels."""
        window, size = expected.window, mask.area
        links, shared = matched
        motions = np.concatenate([target.motions[1:], [expected.moved]])
        if size < max(_GONE * target.mean, 4.0):
            shape = to_shape(expected.belief, window)
            return replace(
                target, mask=Mask.empty(), shape=shape, missed=target.missed + waited, links=(), partly=False
            )
        cells = window.of_mask(mask) > 0.5
        deviation = max(float(np.sqrt(target.variance)), _SPREAD * target.mean)
        partly = target.seen_frames >= _KNOWN and size < target.mean - 3 * deviation
        belief = expected.belief
        small = target.small + waited if partly and not shared else 0.0
        if small > (_ALONE if links else _UNSURE):
            partly, small = False, 0.0
        hidden = shared or cells.sum() < _HALF_SEEN * (belief > 0.5).sum()
        rate = np.where(cells, _GAIN / 5 if shared else _GAIN, 0.0 if hidden else _LOSE).astype(np.float32)
        shape = to_shape((belief + rate * (cells - belief)).astype(np.float32), window)
        motions = target.motions if partly or target.partly else motions
        target = replace(
            target,
            mask=mask,
            shape=shape,
            motions=motions,
            missed=0.0,
            links=links,
            partly=partly,
            small=small,
            together=shared,
        )
        if partly or blind or shared:
            return target
        last = learn_colours(expected.colours, cells, np.ones_like(cells), self.components, target.last)
        share = max(_RATE, 1.0 / (target.seen_frames + 1))
        off = size - target.mean
        first = last if target.seen_frames < _FAMILIAR and not target.marked else target.first
        return replace(
            target,
            first=first,
            last=last,
            mean=target.mean + share * off,
            variance=(1 - share) * (target.variance + share * off**2),
            seen_frames=target.seen_frames + 1,
        )

    def _born(
        self,
        state: TrackCutState,
        targets: list[Target],
        frame: Frame,
        sight: Sight,
        regions: Regions,
        observations: list[Mask],
    ) -> tuple[list[Target], list[Target], tuple[Mask, ...], list[Event]]:
        """Found objects on observations that are nobody's (§3.4); lost ones are looked for in them first."""
        marks = regions.data.get("mark")
        if marks is None and regions.blind:
            return targets, [], state.waiting, []
        taken = {number for one in targets for number in one.links}
        least = self.smallest * state.size[0] * state.size[1]
        born: list[Target] = []
        waiting: list[Mask] = []
        events: list[Event] = []
        next_id = max([state.next_id, *(one.id + 1 for one in targets)])
        for number, mask in enumerate(observations):
            identity = int(marks[number]) if marks is not None else 0
            if not identity:
                held = [one.mask for one in (*targets, *(one for one in born if one.marked))]
                covered = mask_shares([mask], held).sum()
                if number in taken or covered >= _NEW_COVERED or mask.area < max(least, 1):
                    continue
                if len(state.colours) and not (mask_shares([mask], state.waiting) > _SAME).any():
                    waiting.append(mask)
                    continue
            lost = self._found_again(targets, mask, sight, identity)
            if lost is not None:
                was = targets[lost]
                targets[lost] = self._newborn(mask, sight, regions, number, frame, was.key, identity or was.id)
                if identity and identity != was.id:
                    events.append(Event("entered", frame.index, frame.index, (identity,)))
                continue
            identity = identity or next_id
            next_id = max(next_id, identity + 1)
            born.append(self._newborn(mask, sight, regions, number, frame, state.next_key + len(born), identity))
            events.append(Event("entered", frame.index, frame.index, (identity,)))
        if not observations:  # a frame in which nothing was looked for: who waits goes on waiting
            waiting = list(state.waiting)
        return [*targets, *born], born, tuple(waiting), events

    def _found_again(self, targets: list[Target], mask: Mask, sight: Sight, identity: int) -> int | None:
        """Return which object an observation is, if any: the one of that id, the one marked now, a lost one like it."""
        if identity:
            same = [number for number, one in enumerate(targets) if one.id == identity]
            return same[0] if same else _found_there(targets, mask)
        best, least = None, _ALIKE
        for number, one in enumerate(targets):
            if one.missed <= 0 or not _SIMILAR[0] <= mask.area / max(one.mean, 1.0) <= _SIMILAR[1]:
                continue
            points = _colours_of(sight, mask)
            likeness = float(of_colours(points, one.first, one.last, self.trust, self.bound).mean())
            if likeness > least:
                best, least = number, likeness
        return best

    def _newborn(
        self, mask: Mask, sight: Sight, regions: Regions, row: int, frame: Frame, key: int, identity: int
    ) -> Target:
        """Return an object that is an observation."""
        height, width = sight.colours.shape[:2]
        window = around([mask.box], self.ring, self.cells, (height, width))
        cells = window.of_mask(mask)
        colours = learn_colours(
            window.cut(sight.colours).astype(np.float32),
            cells > 0.5,
            np.ones(cells.shape, np.bool_),
            self.components,
        )
        return Target(
            key,
            identity,
            mask,
            to_shape(cells, window),
            colours,
            colours,
            np.full((RECENT, 2), np.nan),
            float(mask.area),
            0.0,
            1,
            frame.time,
            0.0,
            False,
            0.0,
            False,
            float(regions.scores[row]),
            str(regions.classes[row]),
            (row,),
            bool(regions.data["mark"][row]) if "mark" in regions.data else False,
        )


def _mask_of(regions: Regions, row: int, size: tuple[int, int]) -> Mask:
    """The silhouette of an observation inside a picture (height, width); its box where there is none."""
    height, width = size
    if regions.masks[row].area:
        return disjoint([regions.masks[row]], height, width)[0]
    x1, y1, x2, y2 = np.clip(np.rint(regions.boxes[row]), 0, (width, height, width, height)).astype(int).tolist()
    return Mask(y1, x1, np.ones((y2 - y1, x2 - x1), np.bool_))


def _found_there(targets: list[Target], mask: Mask) -> int | None:
    """Which object of no mark is where a mark is now, if any: half of both is common."""
    common = mask_overlaps([mask], [one.mask for one in targets])[0] if targets else np.zeros(0)  # (N,)
    free = [number for number, one in enumerate(targets) if not one.marked and common[number] >= _MARKED]
    return max(free, key=common.__getitem__, default=None)


def _things(targets: list[Target], sight: Sight) -> NDArray[np.bool_]:
    """Where (h, w) of the small picture objects are."""
    things = np.zeros(sight.grey.shape, np.bool_)
    for one in targets:
        x1, y1, x2, y2 = (round(edge / sight.step) for edge in one.shape.box)
        things[max(y1 - 3, 0) : max(y2 + 3, 0), max(x1 - 3, 0) : max(x2 + 3, 0)] = True
    return things if not things.all() else np.zeros_like(things)


def _as_shape(expected: Expected, together: bool) -> Shape:
    """Where an object should be (O at t given t-1), as a shape."""
    whole = expected.belief if together else np.maximum(expected.last, expected.belief)
    return to_shape(whole.astype(np.float32), expected.window)


def _log_density_of(target: Target) -> Callable[[Float], Float]:
    """Return ln p of colours (h, w, 3) under an object's looks."""

    def looks(colours: Float) -> Float:
        points = colours.reshape(-1, 3)
        return np.asarray(log_density(target.last.own, points).reshape(colours.shape[:2]), np.float32)

    return looks


def _colours_of(sight: Sight, mask: Mask) -> Float:
    x1, y1, x2, y2 = mask.box
    return np.asarray(sight.colours[y1:y2, x1:x2][mask.bits], np.float32)

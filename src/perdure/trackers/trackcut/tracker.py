"""The tracker: predict, cut, separate, learn, say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from perdure.features.masks import silhouettes
from perdure.maths.mixture import log_density
from perdure.params import parameter
from perdure.scene.advice import Advice
from perdure.scene.backdrop import Backdrop, carried, learn
from perdure.scene.whereabouts import Waiting
from perdure.scene.zones import Zones, counting, renumbered
from perdure.trackers.trackcut.births import Nursery, births
from perdure.trackers.trackcut.companies import companies, company_of, hosts, sharing
from perdure.trackers.trackcut.competing import Claim, claims
from perdure.trackers.trackcut.cutting import Observed, contrast, cut_out, touching
from perdure.trackers.trackcut.expecting import Expected, Weights, expect
from perdure.trackers.trackcut.learning import FAMILIAR, LONG, Seen, learnt, pieces
from perdure.trackers.trackcut.likelihoods import of_colours, unlike
from perdure.trackers.trackcut.parting import ALONE, parted
from perdure.trackers.trackcut.placing import Company
from perdure.trackers.trackcut.saying import gone, happenings, has_left, rows_of
from perdure.trackers.trackcut.seeing import Motion, Sight, colours_of, covered, look_at, motion_between
from perdure.trackers.trackcut.separating import clusters, separate
from perdure.trackers.trackcut.shapes import to_shape
from perdure.trackers.trackcut.targets import Shape, Target
from perdure.types import Event, Frame, Image, Mask, Regions, Report, Scene

Float = NDArray[np.float32]
# Evidence of an observation for its pixels, against that of none: shared, its own, its own while the object comes in.
_SHARED, _OWN, _OF_NEW = 0.5, 1.0, 4.0
_ALIKE = 0.5  # nats a pixel by which what is found must look more like the object than like its surroundings
_LARGER = 1.6  # times its mean size, from which an observation is not one object's alone
_REFUSED = 3.0  # of that evidence, more, against the observations that are not the object's
_BESIDE = 2  # pixels round what may be an object, that tell nothing of what is behind it
_OTHERS = 0.5  # of the evidence against what lies outside its observations: against the places of others


@dataclass(frozen=True, eq=False)
class TrackCutState:
    """All objects, and the frame before."""

    targets: tuple[Target, ...]
    waiting: tuple[Waiting, ...]  # observations of the frame before that were nobody's
    colours: NDArray[np.uint8]  # (H, W, 3) of the frame before; (0, 0, 3) before the first
    grey: NDArray[np.uint8]  # (h, w)
    next_key: int
    next_id: int
    time: float  # s
    size: tuple[int, int]  # height, width
    backdrop: Backdrop  # in Lab, as `colours`
    zones: Zones
    advice: Advice = field(default_factory=Advice.none)  # how long who is kept, of interpretation


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
    backdrop: float = parameter(2.0, "weight of looking as if nothing were there", low=0.0, high=100.0)
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
            (),
            (),
            np.zeros((0, 0, 3), np.uint8),
            none,
            1,
            self.reserved + 1,
            0.0,
            (scene.height, scene.width),
            Backdrop.unknown(scene.height, scene.width),
            Zones.of(scene),
        )

    def step(self, state: TrackCutState, frame: Frame, regions: Regions) -> tuple[TrackCutState, Report]:
        """Predict and cut out every object, separate those that overlap, learn, find new ones, say."""
        if frame.image is None:
            return replace(state, time=frame.time), Report()
        after, report, numbers = counting(state.zones, regions, partial(self._step, state, frame, frame.image))
        return after, replace(report, rows=renumbered(report.rows, frame.index, numbers))

    def _step(
        self, state: TrackCutState, frame: Frame, image: Image, regions: Regions
    ) -> tuple[TrackCutState, Report]:
        """Step on the regions that count."""
        sight, zones = look_at(image), state.zones
        observations = silhouettes(regions, *state.size)
        targets = list(state.targets)
        events: list[Event] = []
        if state.grey.shape == sight.grey.shape and targets:
            motion = motion_between(state.grey, sight, _things(targets, sight))
            state = replace(state, backdrop=carried(state.backdrop, motion.camera_of_pixels()))
            targets, events = self._followed(state, targets, frame, sight, motion, observations, regions.blind)
        nursery = Nursery(
            self.smallest * state.size[0] * state.size[1],
            self.ring,
            self.cells,
            self.components,
            self.trust,
            self.bound,
            state.backdrop,
            zones,
        )
        waiting = state.waiting if len(state.colours) else None
        keys = (state.next_key, state.next_id)
        born = births(nursery, targets, waiting, keys, frame, sight, regions, observations)
        targets, events = born.targets, events + born.events
        next_id = max([state.next_id, *(one.id + 1 for one in targets[len(targets) - born.new :])])
        kept = []
        for one in targets:
            seen = one.mask.box if one.missed == 0 else None
            one = replace(one, last_seen=one.last_seen.after(zones, seen, one.shape.box))
            out = has_left(one, state.size) and one.last_seen.behind < 0
            patience = one.last_seen.kept(zones, self.hidden_for, out) * float(state.advice.of(one.id))
            if one.missing > patience + 1e-9 or out:
                events.append(gone(one, frame, state.size, zones))
            else:
                kept.append(one)
        things = [*(one.mask for one in kept), *(one.shape.to_mask() for one in kept), *observations]
        learn(state.backdrop, sight.colours, covered(things, state.size, _BESIDE))
        rows = rows_of(kept, frame, state.size, self.hidden_for)
        events += happenings(state.targets, kept, frame, zones)
        state = TrackCutState(
            tuple(kept),
            born.waiting,
            sight.colours,
            sight.grey,
            state.next_key + born.new,
            next_id,
            frame.time,
            state.size,
            state.backdrop,
            zones,
        )
        return state, Report(rows, events=tuple(events))

    def heed(self, state: TrackCutState, advice: Advice) -> TrackCutState:
        """Return the state, in which targets are kept for as many times as long as interpretation advises (IV.D)."""
        return replace(state, advice=advice)

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
    ) -> tuple[list[Target], list[Event]]:
        """Return the objects as they are in this frame, and whose names were exchanged."""
        weights = Weights(self.looks, self.trust, self.place, self.moving, self.form, self.backdrop, self.bound)
        height, width = state.size
        behind = state.backdrop
        ahead: list[Expected] = []
        among: list[Company | None] = []
        for target in targets:
            ring, fineness = self._closeness(target, observations)
            among.append(company_of(target, targets, ahead, [] if blind else observations, state.size))
            ahead.append(expect(target, state.colours, sight, motion, ring, fineness, weights, behind, among[-1]))
        predicted = [one.window.to_mask(one.predicted, height, width) for one in ahead]
        there = [one.missed == 0 for one in targets]
        halves = [one.pieces >= LONG for one in targets]
        claimed = claims(predicted, there, halves, [] if blind else observations)
        owned = {claim.number for some in claimed for claim in some}
        found: list[tuple[Expected, NDArray[np.bool_], tuple[int, ...]]] = []
        for number, (target, expected) in enumerate(zip(targets, ahead, strict=True)):
            others = [one for k, one in enumerate(predicted) if k != number and there[k]]
            known = {claim.number for claim in claimed[number]}
            refused = [] if blind else [one for k, one in enumerate(observations) if k not in known]
            cells, matched, touches = self._cut(target, expected, claimed[number], others, refused)
            if touches:
                ring, fineness = self._closeness(target, observations)
                expected = expect(
                    target, state.colours, sight, motion, 2 * ring, fineness, weights, behind, among[number]
                )
                cells, matched, _ = self._cut(target, expected, claimed[number], others, refused)
            nobodys = [one for k, one in enumerate(observations) if k not in owned]
            if not blind and nobodys:  # what it has let go of is no part of it
                expected = expected._replace(belief=expected.belief * ~expected.window.of_masks(nobodys))
            if blind:  # §6: only the prediction is kept
                cells, matched = expected.predicted, ()
            found.append((expected, cells, matched))
        masks = [expected.window.to_mask(cells, height, width) for expected, cells, _ in found]
        met = clusters(masks)
        if self.second:
            masks = self._separated(targets, masks, found, sight)
        waited = 0.0 if blind else frame.time - state.time
        links = [matched for *_, matched in found]
        near = sharing(links, met)
        shared = [bool(row.any()) for row in near]
        squeezed, masks = hosts(targets, masks, near)
        company = companies(targets, masks, predicted, near)
        after = []
        for number, (target, (expected, _, matched), mask) in enumerate(zip(targets, found, masks, strict=True)):
            others = [one for k, one in enumerate(masks) if k != number]
            if target.pieces >= LONG and claimed[number]:  # it was two: what it keeps is its size
                target = replace(target, mean=float(max(mask.area, 1)), variance=0.0)
            target = replace(
                target,
                company=company[number],
                pieces=pieces(target, claimed[number]),
                squeezed=squeezed[number],
            )
            seen = Seen(expected, mask, others, matched, shared[number], motion, waited, bool(observations), blind)
            now = learnt(target, seen, self.components)
            if _is_forbidden(state.zones, target, now, waited):
                now = learnt(target, seen._replace(mask=Mask.empty(), links=()), self.components)
            after.append(now)
        asked = {one.key: colours_of(sight, one.mask) for one in after if one.company and one.alone >= ALONE}
        return parted(after, asked, frame)

    def _closeness(self, target: Target, observations: list[Mask]) -> tuple[float, int]:
        """Return the ring round an object, px, and the cells in it; one that was observed is looked at closely."""
        return (self.ring / 2, 4 * self.cells) if target.links and observations else (self.ring, self.cells)

    def _cut(
        self, target: Target, expected: Expected, claimed: list[Claim], others: list[Mask], refused: list[Mask]
    ) -> tuple[NDArray[np.bool_], tuple[int, ...], bool]:
        """Return the pixels of least energy, the observations matched, and whether they reach the ring."""
        window, colours = expected.window, expected.colours
        costs, sigma = contrast(colours, self.contrast)
        seen, numbers = [], []
        held = np.zeros(window.shape, np.float32)
        doubtful = np.zeros(window.shape, np.bool_)
        for claim in claimed:
            cells = window.of_mask(claim.part) > 0.5
            if not cells.any():
                continue
            new = target.seen_frames < FAMILIAR and not target.marked
            trust = _SHARED
            if claim.alone and (new or claim.part.area < _LARGER * target.mean):
                trust = _OF_NEW if new else _OWN
            own = unlike(cells, expected.bare) if self.backdrop else cells
            doubtful |= cells & ~own
            cells = own
            held[cells] = np.maximum(held[cells], trust)
            mean = colours[cells].mean(axis=0)
            ratio = float(of_colours(mean[None], target.first, target.last, self.trust, self.bound)[0])
            seen.append(Observed(cells, ratio, mean))
            numbers.append(claim.number)
        unary = expected.unary + np.float32(_OTHERS * self.outside) * _elsewhere(others, expected)
        if seen:
            without = np.where(
                doubtful, np.float32(0), np.float32(1)
            )  # an observation's holes may have been filled
            unary = unary + np.float32(self.outside) * np.where(held > 0, -held, without)
            unary[window.of_masks(refused) & (held == 0)] += _REFUSED * self.outside
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
            before = [found[k][0].window.to_mask(found[k][0].last, *sight.colours.shape[:2]) for k in some]
            parts = separate(
                [masks[k] for k in some], shapes, before, looks, sight.colours, self.apart, self.cells
            )
            for k, mask in zip(some, parts, strict=True):
                masks[k] = mask
        return masks


def _is_forbidden(zones: Zones, was: Target, now: Target, waited: float) -> bool:
    """Whether an object that was lost is found where a rule forbids it."""
    found = was.missed > 0 == now.missed and now.mask.area > 0
    return found and was.last_seen.is_forbidden(zones, now.mask.box, was.missed + waited)


def _elsewhere(others: list[Mask], expected: Expected) -> Float:
    """1 in the cells (h, w) where another object should be and this one should not, else 0."""
    return (expected.window.of_masks(others) & ~expected.predicted).astype(np.float32)


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

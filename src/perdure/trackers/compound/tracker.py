"""The tracker of compound targets: predict, match, resolve, update, say."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from perdure.features.appearance import look, signature
from perdure.maths.jitter import Jitter
from perdure.maths.jitter import learnt as surprised
from perdure.params import parameter
from perdure.scene.advice import Advice
from perdure.scene.ground import Ground
from perdure.scene.reach import within_reach
from perdure.scene.zones import Zones, counting, renumbered
from perdure.trackers.compound.bodies import Bodies
from perdure.trackers.compound.companies import Pair, accompany
from perdure.trackers.compound.darting import darted
from perdure.trackers.compound.gathering import HIDDEN, Held, Sight, gather
from perdure.trackers.compound.identity import Judge
from perdure.trackers.compound.matrix import Possible, Thresholds, match
from perdure.trackers.compound.meetings import Compound as Record
from perdure.trackers.compound.meetings import form, resolve
from perdure.trackers.compound.mending import Mended, mend, remember
from perdure.trackers.compound.recalling import Found, leaving, recall
from perdure.trackers.compound.saying import Moment, happenings, say
from perdure.trackers.compound.targets import Float, Targets, motions, newborn, predicted
from perdure.trackers.compound.updating import learn, looked, unclaimed, update
from perdure.trackers.compound.zoning import coming_in, hidden, place_of, placed, returned
from perdure.types import Boxes, Event, Frame, Mask, Regions, Report, Scene, Tracks

_UNNAMED = 0.2  # distance that a target without a name is put behind others
_UNSEEN = 0.2  # the same of one not seen for `patience` seconds, where regions are silhouettes
_JITTER = 2.5  # and where they are boxes, times what boxes jitter by: so much may one lie off that is hers
_PART = 0.5  # share of a region in a target, or a target in a region, that makes one part of the other


@dataclass(frozen=True, eq=False)
class CompoundState:
    """All targets and compounds, and what has been learnt of the place."""

    targets: Targets
    unsaid: Tracks  # rows of targets without a name; their ids are the targets' keys
    early: Tracks  # regions of young targets since each came in; their ids are the targets' keys
    compounds: tuple[Record, ...]
    pairs: tuple[Pair, ...]  # who is with whom
    bodies: Bodies
    jitter: Jitter
    next_key: int
    next_id: int
    time: float  # s, of the last frame
    size: tuple[int, int]  # height, width of the picture
    ground: Ground | None  # where it lies, if it is known and wanted
    zones: Zones
    advice: Advice = field(default_factory=Advice.none)  # how long who is kept, of interpretation


@dataclass(frozen=True)
class Compound:
    """Compound targets: identities that survive meetings, on silhouettes or on boxes alone."""

    max_distance: float = parameter(
        0.85,
        "distance (1 - IoU, or more where boxes are apart) below which a region may be a target",
        low=0.0,
        high=5.0,
    )
    max_size_ratio: float = parameter(
        4.0, "ratio of areas up to which a region may be a target", low=1.0, high=100.0
    )
    sure_score: float = parameter(
        0.6, "score from which a region may be any target; others get a second look", low=0.0, high=1.0
    )
    birth_score: float = parameter(0.7, "score from which a region may be a new target", low=0.0, high=1.0)
    weak_score: float = parameter(0.1, "score from which a region gets a second look", low=0.0, high=1.0)
    patience: float = parameter(
        2.0, "how long a target that is not seen is looked for where it was going", unit="s", low=0.0, high=3600.0
    )
    recall: float = parameter(
        6.0,
        "how long a target lost inside the picture may be found again by its colours",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    longest: float = parameter(
        10.0, "how long a target may be hidden by others in one region", unit="s", low=0.0, high=3600.0
    )
    confirm: float = parameter(
        0.25, "how long a target must have been seen before it is said", unit="s", low=0.0, high=60.0
    )
    inertia: float = parameter(0.6, "time over which the size is averaged", unit="s", low=0.0, high=60.0)
    partial: float = parameter(
        0.2, "mismatch of a side that signals a partial occlusion", unit="target sizes", low=0.0, high=1.0
    )
    apart: float = parameter(
        0.3, "gap from which regions have moved away from each other", unit="widths", low=0.0, high=10.0
    )
    settle: float = parameter(
        0.7, "how long regions are apart until that is believed without a gap", unit="s", low=0.0, high=60.0
    )
    colour: float = parameter(
        16.0, "weight of colours against motion and order, log odds; 0 does not look at them", low=0.0, high=1000.0
    )
    likeness: float = parameter(
        0.75, "similarity of colours from which a lost target is found again", low=0.0, high=1.0
    )

    on_ground: bool = parameter(
        True, "whether distances and sizes are compared in metres where the ground plane is known"
    )
    wander: float = parameter(
        1.0,
        "how fast a target may stray on the ground from where it is expected, where the plane is known",
        unit="m/s",
        low=0.0,
        high=100.0,
    )

    needs_pixels = False

    def start(self, scene: Scene) -> CompoundState:
        """Return the state without a target."""
        nobody = newborn(
            Frame(0, 0.0), np.zeros((0, 4), np.float32), np.zeros(0, np.float32), np.zeros(0, np.str_), 1
        )
        return CompoundState(
            nobody,
            Tracks.empty(),
            Tracks.empty(),
            (),
            (),
            Bodies.unknown(),
            Jitter.unknown(),
            1,
            1,
            0.0,
            (scene.height, scene.width),
            scene.ground if self.on_ground else None,
            Zones.of(scene),
        )

    def step(self, state: CompoundState, frame: Frame, regions: Regions) -> tuple[CompoundState, Report]:
        """Predict, match, gather, form and resolve compounds, update, give birth, find again, say, retire."""
        after, report, numbers = counting(state.zones, regions, partial(self._step, state, frame))
        if numbers is None:
            return after, report
        unsaid, early = (renumbered(rows, frame.index, numbers) for rows in (after.unsaid, after.early))
        after = replace(after, unsaid=unsaid, early=early)
        return after, replace(report, rows=renumbered(report.rows, frame.index, numbers))

    def _step(self, state: CompoundState, frame: Frame, regions: Regions) -> tuple[CompoundState, Report]:
        """Step on the regions that count."""
        targets, time, zones = state.targets, frame.time, state.zones
        motion = motions(targets)
        expected = predicted(targets, motion, time, self.patience)
        blobs = _are_silhouettes(regions)
        held = self._gathered(state, expected, frame, regions, blobs)
        meeting = form(targets, state.compounds, state.next_key, held, motion, frame, regions)
        judge = Judge(frame, regions, state.pairs, self.colour)
        meeting = resolve(meeting, frame, regions, self.apart, self.settle, judge)
        targets = update(
            meeting.targets,
            meeting.region,
            held,
            expected,
            regions,
            time,
            state.size,
            self.partial,
            self.inertia,
            np.ones(2) if blobs else state.jitter.gain,  # silhouettes do not jitter
        )
        jitter = surprised(state.jitter, meeting.targets.surprise, targets.surprise)
        births = unclaimed(targets, meeting.region, held, regions, self.birth_score)
        births = coming_in(zones, births, regions)
        if len(births):
            boxes, scores, classes = regions.boxes[births], regions.scores[births], regions.classes[births]
            new = newborn(frame, boxes, scores, classes, meeting.next_key)
            targets = targets.join(placed(zones, new, boxes, state.targets, state.early))
        region = np.concatenate([meeting.region, births])
        waited = 0.0 if regions.blind else time - state.time
        targets = _waited(targets, region, held, waited, frame.index)
        targets = hidden(zones, targets, region, _expected(expected, targets))
        bodies = state.bodies
        if blobs:  # a detector's boxes hold whole bodies as they are
            bodies = learn(bodies, targets, region, time - state.time, state.size, _BODIES)
        back = returned(zones, targets, region, frame, self.confirm, self.likeness)
        targets, found = self._recalled(back.targets, back.region, held, frame, regions, state.size, zones)
        region, unsaid = found.region, _rekeyed(_rekeyed(state.unsaid, back.keys), found.keys)
        company = accompany(state.pairs, targets, region, frame, regions.blind)
        where = zones.held(_expected(expected, targets), targets.behind)
        moment = Moment(frame, regions, region, held, where, blobs, state.size, zones)
        said = say(targets, state.next_id, unsaid, moment, self.confirm, self.patience)
        early, mended = state.early, Mended(said.targets, Tracks.empty(), (), ())
        if blobs:
            early = remember(early, said.targets, region, held, (frame, regions), bodies, self.longest)
            newly = np.flatnonzero((said.targets.ids >= state.next_id) & ~said.targets.temporary)
            mended = mend(early, said.targets, newly, bodies, state.size)
        told = happenings(state.targets, mended.targets, moment)
        kept, gone = self._retired(mended.targets, region, frame, state, regions.blind)
        live = set(kept.compound.tolist())
        compounds = tuple(one for one in meeting.compounds if one.key in live)
        key = meeting.next_key + len(births)
        state = CompoundState(
            kept,
            said.unsaid,
            early,
            compounds,
            company.pairs,
            bodies,
            jitter,
            key,
            said.next_id,
            time,
            state.size,
            state.ground,
            zones,
        )
        rows = Tracks.join([mended.rows, said.rows])
        again = (*back.events, *found.events)
        events = (*said.events, *mended.events, *company.events, *meeting.events, *again, *told, *gone)
        return state, Report(rows, (*meeting.renamed, *back.renamed, *found.renamed), mended.dropped, events)

    def heed(self, state: CompoundState, advice: Advice) -> CompoundState:
        """Return the state, in which targets are kept for as many times as long as interpretation advises (IV.D)."""
        return replace(state, advice=advice)

    def finish(self, state: CompoundState) -> Report:
        """Return what is left to say: who had left when the film ended."""
        targets = state.targets
        unseen = (targets.ids > 0) & ~targets.temporary & ~targets.frozen & (targets.missed > 0)
        out = leaving(targets, motions(targets), state.size) | (state.zones.left(targets.boxes) >= 0)
        gone = np.flatnonzero(unseen & out)
        return Report(
            events=tuple(_gone(targets, gone, int(targets.latest.max(initial=0)), state.size, state.zones))
        )

    def _gathered(
        self, state: CompoundState, expected: Boxes, frame: Frame, regions: Regions, blobs: bool
    ) -> Held:
        """Who is in which region; hidden members of compounds are looked for too, where they would have come out."""
        targets = state.targets
        patience = self.patience * state.zones.stays(targets.boxes)
        lately = np.where(targets.frozen, targets.missed > 0, targets.missed <= patience + 1e-9)
        active = lately.nonzero()[0]
        unseen = np.minimum(targets.missed / max(self.patience, 1e-6), 1.0)
        behind = _UNSEEN if blobs else _JITTER * state.jitter.spread
        cost = np.where(targets.ids == 0, _UNNAMED, 0.0) + behind * unseen
        limits = Thresholds(
            self.max_distance,
            self.max_size_ratio,
            _SECOND,
            self.sure_score,
            self.weak_score,
            _PART,
            *(_BLOBS if blobs else _BOXES),
        )
        possible = None if blobs else self._possible(state, expected, active, frame, regions)
        found = match(
            regions.boxes,
            regions.scores,
            expected[active],
            targets.temporary[active],
            cost[active].astype(np.float32),
            limits,
            possible,
            place_of(state.zones, targets, active, expected, frame, regions),
        )
        sure = regions.scores >= self.sure_score
        eager = (targets.ids > 0) & (targets.missed == 0) & ~targets.temporary & ~targets.frozen
        if state.zones.has("occlusion"):  # she may have gone behind it
            eager &= state.zones.behind(targets.boxes, expected) < 0
        found = darted(found, regions.boxes, sure, expected[active], eager[active], possible, state.size)
        fresh = (targets.ids == 0) & (frame.time - targets.born < self.confirm)
        near = self.apart if blobs else -1.0
        sight = Sight(frame, regions, state.size, state.bodies, near, self.colour > 0)
        return gather(targets, expected, active, found, fresh, sight)

    def _possible(
        self, state: CompoundState, expected: Boxes, active: NDArray[np.intp], frame: Frame, regions: Regions
    ) -> Possible | None:
        """Which boxes may be which active targets for where they stand; None where the ground is not known.

        Not asked of silhouettes: one may hold several, or a piece, and stand where none of them stands.
        """
        ground = state.ground
        if ground is None:
            return None

        def possible(region: NDArray[np.intp], target: NDArray[np.intp]) -> NDArray[np.bool_]:
            rows = active[target]
            elapsed = frame.time - state.targets.seen[rows]
            return within_reach(ground, expected[rows], elapsed, regions.boxes[region], self.wander)

        return possible

    def _recalled(
        self,
        targets: Targets,
        region: NDArray[np.intp],
        held: Held,
        frame: Frame,
        regions: Regions,
        size: tuple[int, int],
        zones: Zones,
    ) -> tuple[Targets, Found]:
        """Bring looks up to date and find lost targets again by them; nothing without a picture."""
        image = frame.image
        if image is None or not self.colour:
            return targets, Found(targets, region, {}, (), ())

        def now(row: int) -> Float:
            x1, y1, x2, y2 = map(float, held.boxes[row])
            return signature(look(image, held.masks.get(row, Mask.empty()), (x1, y1, x2, y2)))

        targets = looked(targets, region, image, regions)
        found = recall(targets, region, motions(targets), frame, size, self.confirm, self.likeness, now, zones)
        return found.targets, found

    def _retired(
        self,
        targets: Targets,
        region: NDArray[np.intp],
        frame: Frame,
        state: CompoundState,
        blind: bool,
    ) -> tuple[Targets, list[Event]]:
        """Let go of who was not seen for long (IV.D), and of unnamed ones at the first miss."""
        size, zones = state.size, state.zones
        soonest = 0.0 if zones or len(state.advice.ids) else min(self.patience, self.longest)
        doubtful = (targets.missed > soonest) | (targets.ids == 0)
        events: list[Event] = []
        if doubtful.any() and not (kept := self._kept(targets, region, frame, state, blind)).all():
            gone = np.flatnonzero(~kept & (targets.ids > 0) & ~targets.temporary)
            events, targets = _gone(targets, gone, frame.index, size, zones), targets.take(kept)
        if not targets.compound.any():
            return targets, events
        orphans = targets.frozen & ~np.isin(targets.within, targets.keys[targets.temporary])
        return targets.with_(orphans, compound=0, within=0) if orphans.any() else targets, events

    def _kept(
        self,
        targets: Targets,
        region: NDArray[np.intp],
        frame: Frame,
        state: CompoundState,
        blind: bool,
    ) -> NDArray[np.bool_]:
        """Which targets (N,) are not let go of."""
        size, zones = state.size, state.zones
        remembered = self.recall if frame.image is not None and self.colour else self.patience
        limit = np.where(targets.frozen, self.longest, max(remembered, self.patience)) + 1e-9
        if (targets.missed > self.patience).any():  # who was going out over the border will not be found again
            limit = np.where(
                ~targets.frozen & leaving(targets, motions(targets), size), self.patience + 1e-9, limit
            )
        unnamed = ~targets.temporary & (targets.ids == 0)
        seen = region >= 0
        if zones:
            away = np.flatnonzero((targets.missed > 0) & np.isfinite(targets.missed) & ~targets.frozen & ~unnamed)
            boxes, out = targets.boxes[away], leaving(targets, motions(targets), size)[away]
            limit[away] = zones.kept(boxes, targets.behind[away], limit[away], out) + 1e-9
            lasted = frame.time - targets.born >= self.confirm  # would have a name, came it in elsewhere
            seen |= lasted & (targets.evidence > self.confirm) & (targets.missed <= self.confirm + 1e-9)
        if len(state.advice.ids):
            limit *= state.advice.of(targets.ids)
        kept = np.where(unnamed, seen, targets.missed <= limit)
        if blind:
            kept |= unnamed | targets.temporary
        return np.asarray(kept & np.isfinite(targets.missed))


_SECOND = 0.5  # distance up to which a region of low score may be a target
_BLOBS = (0.1, 2.0)  # gain and distance of unions that merge, where regions are silhouettes
_BOXES = (0.35, 0.25)  # and where they are a detector's boxes, which seldom hold two
_BODIES = 120.0  # s of observation after which the size of bodies is forgotten


def _rekeyed(unsaid: Tracks, keys: dict[int, int]) -> Tracks:
    """Rows of targets without a name, some of which have turned out to be others."""
    return unsaid.replace(ids=[keys.get(one, one) for one in unsaid.ids.tolist()]) if keys else unsaid


def _are_silhouettes(regions: Regions) -> bool:
    """Whether the detector gives silhouettes, of which one may hold several bodies, or pieces of one."""
    return any(mask.bits.size for mask in regions.masks)


def _gone(
    targets: Targets, rows: NDArray[np.intp], index: int, size: tuple[int, int], zones: Zones
) -> list[Event]:
    """What is told of targets that are let go: from the first frame without them, whether they left or were lost."""
    if not len(rows):
        return []
    out = leaving(targets, motions(targets), size)[rows]
    exits, behind = zones.left(targets.boxes[rows]), targets.behind[rows]
    return [
        Event(
            "left" if over or by >= 0 else "lost",
            min(int(targets.latest[row]) + 1, index),
            index,
            (int(targets.ids[row]),),
            zones.name(by) if over or by >= 0 else zones.name(back),
            why="over the border"
            if over
            else "through an exit"
            if by >= 0
            else "not seen again inside the picture",
        )
        for row, over, by, back in zip(rows.tolist(), out.tolist(), exits.tolist(), behind.tolist(), strict=True)
    ]


def _expected(expected: Boxes, targets: Targets) -> Boxes:
    """Where each target should be; of new ones, behind the others, where they are."""
    return np.concatenate([expected, targets.boxes[len(expected) :]]) if len(targets) > len(expected) else expected


def _waited(targets: Targets, region: NDArray[np.intp], held: Held, waited: float, index: int) -> Targets:
    """Targets with the time for which each was not seen; who shows too little of herself is not."""
    hidden = np.zeros(len(targets), np.bool_)
    hidden[: len(held.share)] = held.share < HIDDEN
    seen = (region >= 0) & (targets.temporary | ~hidden)
    return targets.replace(
        missed=np.where(seen & np.isfinite(targets.missed), 0.0, targets.missed + waited),
        latest=np.where(seen, index, targets.latest),
    )

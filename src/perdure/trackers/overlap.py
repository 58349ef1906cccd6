"""The smallest tracker, the example to copy: what overlaps what was expected is the same thing.

Each target is expected where its last speed would bring it; regions are given to targets so that as many
as possible overlap, and overlap most (Bewley et al. 2016, *SORT*, without its Kalman filter). A target not
seen is kept for `patience` seconds, which do not pass while the detector is blind; one seen for `confirm` seconds gets an id, and its first rows are said late.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import centres, overlaps
from perdure.features.masks import disjoint, holding
from perdure.maths.assign import assign
from perdure.params import parameter
from perdure.scene.advice import Advice
from perdure.scene.ground import Ground
from perdure.scene.reach import within_reach
from perdure.scene.zones import FORBIDDEN, Zones, counting, renumbered
from perdure.types import Boxes, Event, Frame, Mask, Regions, Report, Scene, Status, Tracks

Index = NDArray[np.intp]
_COLUMNS = ("ids", "boxes", "speed", "born", "seen", "missed", "evidence", "entry", "behind")


@dataclass(frozen=True, eq=False)
class OverlapState:
    """All targets, a row each."""

    ids: NDArray[np.int64]  # (N,), 0 until confirmed
    boxes: Boxes  # (N, 4) where last seen
    speed: NDArray[np.float32]  # (N, 2) px/s
    born: NDArray[np.float64]  # (N,) s, first seen
    seen: NDArray[np.float64]  # (N,) s, last seen
    missed: NDArray[np.float64]  # (N,) s for which it might have been seen since, and was not
    unsaid: tuple[Tracks, ...]  # N; rows earned before the id
    next_id: int
    time: float  # s, of the last frame
    scene_size: tuple[int, int]  # height, width
    ground: Ground | None  # where it lies, if it is known and wanted
    zones: Zones
    evidence: NDArray[np.float64]  # (N,) s for which each must be seen where it came in
    entry: Index  # (N,) the entry by which it came in; -1 for none
    behind: Index  # (N,) the occluder behind which it is; -1 for none
    advice: Advice = field(default_factory=Advice.none)  # how long who is kept, of interpretation


@dataclass(frozen=True)
class Overlap:
    """Track by overlap alone: right where targets move less than their own size and rarely meet."""

    least_overlap: float = parameter(
        0.15, "overlap (IoU) below which a region is not the target", low=0.001, high=1.0
    )
    patience: float = parameter(1.0, "how long an unseen target is kept", unit="s", low=0.0, high=3600.0)
    confirm: float = parameter(
        0.25, "how long a target must have been seen before it is said", unit="s", low=0.0, high=60.0
    )
    inertia: float = parameter(0.3, "time over which speed is averaged", unit="s", low=0.0, high=60.0)

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

    def start(self, scene: Scene) -> OverlapState:
        """Return the state without a target."""
        none, places = np.zeros(0), np.zeros((0, 4), np.float32)
        size = (scene.height, scene.width)
        ids, nowhere, zones = none.astype(np.int64), none.astype(np.intp), Zones.of(scene)
        ground = scene.ground if self.on_ground else None
        return OverlapState(
            ids, places, places[:, :2], none, none, none, (), 1, 0.0, size, ground, zones, none, nowhere, nowhere
        )

    def step(self, state: OverlapState, frame: Frame, regions: Regions) -> tuple[OverlapState, Report]:
        """Predict, match, update, give birth, say, retire, on the regions that count."""
        after, report, numbers = counting(state.zones, regions, partial(self._step, state, frame))
        unsaid = tuple(renumbered(part, frame.index, numbers) for part in after.unsaid)
        rows = renumbered(report.rows, frame.index, numbers)
        return replace(after, unsaid=unsaid), replace(report, rows=rows)

    def _step(self, state: OverlapState, frame: Frame, regions: Regions) -> tuple[OverlapState, Report]:
        pairs, unmatched, again = self._matched(state, frame, regions.boxes)
        state = self._update(state, frame.time, regions.boxes, pairs)
        unmatched = unmatched[np.isfinite(state.zones.evidence(regions.boxes[unmatched]))]
        state = _give_birth(state, frame.time, regions.boxes[unmatched])
        link = np.full(len(state.ids), -1)  # the region of each target
        link[pairs[:, 0]] = pairs[:, 1]
        link[len(link) - len(unmatched) :] = unmatched
        waited = 0.0 if regions.blind else frame.time - state.time
        missed = np.where(link >= 0, 0.0, state.missed + waited)
        state = replace(state, missed=missed, time=frame.time)
        state, hidden = _hidden(state, frame)
        state, rows, events = self._say(state, frame, regions, link)
        state, left = self._retire(state, frame, link, regions.blind)
        return state, Report(rows, events=(*events, *again, *hidden, *left))

    def heed(self, state: OverlapState, advice: Advice) -> OverlapState:
        """Return the state, in which targets are kept for as many times as long as interpretation advises (IV.D)."""
        return replace(state, advice=advice)

    def finish(self, state: OverlapState) -> Report:
        """Return what is left to say: nothing."""
        return Report.empty()

    def _refused(
        self, state: OverlapState, cost: NDArray[np.floating], frame: Frame, boxes: Boxes
    ) -> NDArray[np.floating]:
        """The cost (N, M) with pairs forbidden that are too far apart on the ground, or too unlike in height."""
        if state.ground is None:
            return cost
        rows, columns = np.nonzero(np.isfinite(cost))
        elapsed = frame.time - state.seen[rows]
        expected = _expected(state, frame.time)[rows]
        near = within_reach(state.ground, expected, elapsed, boxes[columns], self.wander)
        cost[rows[~near], columns[~near]] = np.inf
        return cost

    def _matched(self, state: OverlapState, frame: Frame, boxes: Boxes) -> tuple[Index, Index, list[Event]]:
        """Give regions (M, 4) to targets, by overlap, then by what occluders and rules let expect; those left over too."""
        zones, expected = state.zones, _expected(state, frame.time)
        overlap = overlaps(expected, boxes)  # (N, M)
        cost = np.where(overlap >= self.least_overlap / zones.reach(expected)[:, None], 1.0 - overlap, np.inf)
        cost = self._refused(state, cost, frame, boxes)
        lost = np.flatnonzero((state.missed > 0) & (state.ids > 0))
        if not zones or not len(lost) or not len(boxes):
            pairs, _, unmatched = assign(cost)
            return pairs, unmatched, []
        where = state.boxes[lost], state.behind[lost]
        gaps = np.repeat(frame.time - state.seen[lost][:, None], len(boxes), axis=1)  # (L, M)
        cost[lost] = np.where(zones.verdicts(*where, boxes, gaps) == FORBIDDEN, np.inf, cost[lost])
        pairs, rows, unmatched = assign(cost)
        again = zones.returning(*where, boxes[unmatched], gaps[:, unmatched])
        again[~np.isin(lost, rows)] = np.inf
        found, _, left = assign(again)
        returned = np.column_stack([lost[found[:, 0]], unmatched[found[:, 1]]])
        events = []
        for row, number in returned.tolist():
            rule = zones.rule(state.boxes[row], boxes[number])
            if rule is not None and state.behind[row] < 0:
                events.append(_event("found_again", frame, state.ids[row], rule.found_in))
        return np.concatenate([pairs, returned]), unmatched[left], events

    def _update(self, state: OverlapState, time: float, seen_boxes: Boxes, pairs: Index) -> OverlapState:
        """Move matched targets to their regions; average the speed over the last `inertia` seconds."""
        rows, columns = pairs.T
        boxes, speed, seen = state.boxes.copy(), state.speed.copy(), state.seen.copy()
        elapsed = np.maximum(time - seen[rows], 1e-6)[:, None]  # (K, 1)
        known = np.minimum(self.inertia, seen[rows] - state.born[rows])[:, None]  # (K, 1)
        moved = (centres(seen_boxes[columns]) - centres(boxes[rows])) / elapsed  # (K, 2)
        moved[state.missed[rows] > self.patience] = 0.0  # found elsewhere by a rule: nothing is known of the way
        speed[rows] += (moved - speed[rows]) * elapsed / (elapsed + known)
        boxes[rows], seen[rows] = seen_boxes[columns], time
        return replace(state, boxes=boxes, speed=speed, seen=seen)

    def _say(
        self, state: OverlapState, frame: Frame, regions: Regions, link: Index
    ) -> tuple[OverlapState, Tracks, list[Event]]:
        """Name the targets that have been seen long enough; say the rows of all that have a name."""
        needed = np.maximum(state.evidence, self.confirm) - 1e-9
        named = np.flatnonzero((state.ids == 0) & (link >= 0) & (frame.time - state.born >= needed))
        ids = state.ids.copy()
        ids[named] = state.next_id + np.arange(len(named))
        rows = self._rows(replace(state, ids=ids), frame, regions, link)
        late = [state.unsaid[i].replace(ids=np.full(len(state.unsaid[i]), ids[i])) for i in named]
        first = [int(part.frames[0]) if len(part) else frame.index for part in late]
        events = [
            Event("entered", begin, begin, (int(ids[row]),), state.zones.name(state.entry[row]))
            for begin, row in zip(first, named, strict=True)
        ]
        unsaid = tuple(
            Tracks.empty() if ids[i] else Tracks.join([part, rows.take([i])])
            for i, part in enumerate(state.unsaid)
        )
        state = replace(state, ids=ids, unsaid=unsaid, next_id=state.next_id + len(named))
        return state, Tracks.join([*late, rows.take(ids > 0)]), events

    def _rows(self, state: OverlapState, frame: Frame, regions: Regions, link: Index) -> Tracks:
        """Return a row for every target; an unseen one is LOST, where it is expected, less and less surely."""
        hope = 1.0 - state.missed / max(self.patience, 1e-6)
        seen, away = link >= 0, np.where(state.behind >= 0, Status.OCCLUDED, Status.LOST)
        masks = disjoint([(*regions.masks, Mask.empty())[j] for j in link], *state.scene_size)
        return Tracks.of(
            frames=frame.index,
            times=frame.time,
            ids=state.ids,
            boxes=holding(state.zones.held(_expected(state, frame.time), state.behind), masks),
            status=np.where(seen, Status.VISIBLE, away),
            confidence=np.where(seen, np.append(regions.scores, 0)[link], np.clip(hope, 0.0, 1.0)),
            classes=np.append(regions.classes, "")[link],
            inferred=~seen,
            masks=masks,
            links=[(int(j),) if j >= 0 else () for j in link],
        )

    def _retire(
        self, state: OverlapState, frame: Frame, link: Index, blind: bool
    ) -> tuple[OverlapState, list[Event]]:
        """Let go of targets not seen for `patience` seconds, and of unconfirmed ones at the first miss."""
        usual, inside = np.full(len(link), self.patience), np.zeros(len(link), np.bool_)
        patience = state.zones.kept(state.boxes, state.behind, usual, inside) * state.advice.of(state.ids)
        awaited = (state.evidence > self.confirm) & (frame.time - state.born >= self.confirm)
        awaited &= state.missed <= self.confirm + 1e-9  # would have a name, had it come in elsewhere
        kept = np.where(state.ids > 0, state.missed <= patience + 1e-9, (link >= 0) | blind | awaited)
        gone = np.flatnonzero(~kept & (state.ids > 0))
        exits = state.zones.left(state.boxes[gone])
        left = [
            _event("left", frame, state.ids[row], state.zones.name(by))
            for row, by in zip(gone, exits, strict=True)
        ]
        columns = {name: getattr(state, name)[kept] for name in _COLUMNS}
        return replace(state, **columns, unsaid=tuple(state.unsaid[i] for i in np.flatnonzero(kept))), left


def _expected(state: OverlapState, time: float) -> Boxes:
    """Where the last speed brings each target (N, 4)."""
    shift = state.speed * (time - state.seen)[:, None]  # (N, 2)
    return np.asarray(state.boxes + np.tile(shift, 2), np.float32)


def _hidden(state: OverlapState, frame: Frame) -> tuple[OverlapState, list[Event]]:
    """Note who has got behind an occluder, and who is seen again."""
    if not state.zones.has("occlusion") and not state.zones.rules:
        return state, []
    away = state.missed > 0
    lost = np.flatnonzero(away & (state.behind < 0))
    behind = np.where(away, state.behind, -1)
    behind[lost] = state.zones.behind(state.boxes[lost], _expected(state, frame.time)[lost])
    changes = (("occluded", behind, state.behind), ("found_again", state.behind, behind))
    events = [
        _event(kind, frame, state.ids[row], state.zones.name(one[row]))
        for kind, one, other in changes
        for row in np.flatnonzero((one >= 0) & (other < 0) & (state.ids > 0))
    ]
    return replace(state, behind=behind), events


def _event(kind: str, frame: Frame, identity: int, zone: str) -> Event:
    return Event(kind, frame.index, frame.index, (int(identity),), zone)


def _give_birth(state: OverlapState, time: float, boxes: Boxes) -> OverlapState:
    """Add an unnamed target for every region that nobody claimed."""
    count = len(boxes)
    now = np.full(count, time)
    return replace(
        state,
        ids=np.concatenate([state.ids, np.zeros(count, np.int64)]),
        boxes=np.concatenate([state.boxes, boxes]),
        speed=np.concatenate([state.speed, np.zeros((count, 2), np.float32)]),
        born=np.concatenate([state.born, now]),
        seen=np.concatenate([state.seen, now]),
        missed=np.concatenate([state.missed, np.zeros(count)]),
        evidence=np.concatenate([state.evidence, state.zones.evidence(boxes)]),
        entry=np.concatenate([state.entry, state.zones.first(boxes, "entry")]),
        behind=np.concatenate([state.behind, np.full(count, -1)]),
        unsaid=state.unsaid + (Tracks.empty(),) * count,
    )

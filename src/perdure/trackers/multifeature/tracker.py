"""The multi-feature tracker (Chau, Brémond & Thonnat, *A multi-feature tracking algorithm enabling adaptation to context
variations*, 2011): what is detected is linked by many features at once, weighed as the context has taught.

An object links to the trajectories of the last T2 seconds whose last object is alike enough (eq. 10, Th1). Of these
links the globally most similar become official: what the object is like now and what the trajectory was like over its
last Q objects both count (eq. 15-18). Who makes no link for T2 is let go, and what lives shortly or comes no way is
noise (section 4.4).

Where we depart: places are carried on along the trajectory before they are compared (`motion`); overlap is a feature;
regions of low score get a second look; boxes without silhouettes are cut to what moves (`moving`); who met somebody is
judged once more by looks when they have parted (`exchanging`), and who was lost is found again by them, long after T2
(`recalling`); how looks of one and of two differ is learnt from the film itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.features.embedding import Network
from perdure.features.feature import Feature, Float
from perdure.features.pool import known
from perdure.maths.jitter import Jitter
from perdure.maths.jitter import learnt as surprised
from perdure.params import parameter
from perdure.scene import measuring
from perdure.scene.advice import Advice
from perdure.scene.backdrop import Backdrop
from perdure.scene.context import Context, distance, nearest
from perdure.scene.ground import Ground
from perdure.scene.measuring import Measuring
from perdure.scene.zones import FORBIDDEN, Zones, counting, renumbered
from perdure.trackers.multifeature.exchanging import Exchanged, Meetings, exchange, in_doubt, met
from perdure.trackers.multifeature.explaining import explained, restated
from perdure.trackers.multifeature.fathers import ASSIGNMENTS
from perdure.trackers.multifeature.links import Links, compare, described, global_similarity, weighted
from perdure.trackers.multifeature.motion import boxes_of, expected, surprise
from perdure.trackers.multifeature.moving import learnt, moving
from perdure.trackers.multifeature.recalling import Recalled, Telling, looked, recall, within
from perdure.trackers.multifeature.saying import Moment, between, event, rekeyed, say
from perdure.trackers.multifeature.targets import NEVER, Rows, Targets, extended, newborn
from perdure.trackers.multifeature.weights import DEFAULT, GATE, features_for, looks_for, weights_of
from perdure.trackers.multifeature.zoning import by_zones, hidden_behind
from perdure.types import Boxes, Event, Frame, Regions, Report, Scene, Tracks

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class MultiFeatureState:
    """All trajectories under way, what features carry along, and what has been learnt of looks."""

    targets: Targets
    measuring: Measuring  # what the scene is like
    context: str  # the name of the one in force; empty before one is chosen
    checked: float  # s, when that was
    memories: dict[str, dict[str, NDArray[Any]]]  # of each feature
    unsaid: Tracks  # rows of targets without an id; their ids are the targets' keys
    telling: Telling
    meetings: Meetings
    jitter: Jitter
    backdrop: Backdrop  # of no size before the first picture
    next_key: int
    next_id: int
    time: float  # s, of the last frame
    size: tuple[int, int]  # height, width of the picture
    fps: float
    ground: Ground | None  # where it lies, if it is known and wanted
    zones: Zones
    advice: Advice = field(default_factory=Advice.none)  # how long who is kept, of interpretation


@dataclass(frozen=True)
class MultiFeature:
    """Eight cues or more, weighed for the context; links over a window of time, so that missed detections do not matter."""

    window: float = parameter(
        1.8, "how long a target that is not seen can still be linked", unit="s", low=0.0, high=3600.0, symbol="T2"
    )
    similar: float = parameter(
        0.0,
        "similarity from which an object may be a target; 0 for that of the context",
        low=0.0,
        high=1.0,
        symbol="Th1",
    )
    long_term: float = parameter(
        0.3, "highest weight of the long-term similarity", low=0.0, high=1.0, symbol="Th4"
    )
    lookback: float = parameter(
        0.9, "time over whose objects a trajectory is averaged", unit="s", low=0.01, high=60.0, symbol="Q"
    )
    confirm: float = parameter(
        0.25, "how long a target must have been seen before it is said", unit="s", low=0.0, high=60.0, symbol="Th5"
    )
    least_way: float = parameter(
        0.0, "how far a target must have come before it is said", unit="heights", low=0.0, high=100.0, symbol="Th6"
    )
    weights: str = parameter(
        "",
        "weights of the features as 'displacement_2d=1,area=0.5'; those of the context where none are given",
        symbol="w_k",
    )
    assignment: str = parameter(
        "optimal",
        "who gets which object: fathers as in the paper, fathers until nothing changes, or the highest total",
        choices=tuple(ASSIGNMENTS),
    )
    inertia: float = parameter(0.9, "time over which speed is averaged", unit="s", low=0.01, high=60.0)
    believed_after: float = parameter(
        0.05, "time that a target must be followed for its speed to be believed", unit="s", low=0.001, high=60.0
    )
    waning: float = parameter(
        0.2, "how much less similar a target counts that is not seen, at the end of the window", low=0.0, high=1.0
    )
    sure_score: float = parameter(
        0.6, "score from which a region may be any target; others get a second look", low=0.0, high=1.0
    )
    birth_score: float = parameter(0.7, "score from which a region may be a new target", low=0.0, high=1.0)
    weak_score: float = parameter(0.1, "score from which a region gets a second look", low=0.0, high=1.0)
    weak_similar: float = parameter(
        0.55, "similarity from which a region of low score may be a target", low=0.0, high=1.0
    )
    fill: float = parameter(
        1.0, "gap up to which interpolated rows count as results", unit="s", low=0.0, high=3600.0
    )
    recall: float = parameter(
        10.0,
        "how long a target lost in the picture may be found again by its looks",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    likeness: float = parameter(
        0.0, "log odds of looks and way from which a lost target is found again", unit="nats", low=-20.0, high=20.0
    )
    exchange: float = parameter(
        5.0, "log odds of looks from which two who met have changed places", unit="nats", low=-20.0, high=100.0
    )
    gap: float = parameter(
        0.0, "how long one that has not been said yet may be missed", unit="s", low=0.0, high=60.0
    )
    explain: bool = parameter(True, "whether the reason of every link is put down, for `perdure explain`")
    smooth: float = parameter(
        1.0, "how much of the jitter of boxes, which is learnt, is smoothed away", low=0.0, high=1.0
    )
    moving_pixels: bool = parameter(
        True, "whether colours are taken of what differs from the place alone, in boxes without silhouettes"
    )
    on_ground: bool = parameter(
        True, "whether distances are compared in metres too where the ground plane is known"
    )

    recheck: float = parameter(
        10.0, "how often the nearest context is chosen anew", unit="s", low=0.1, high=3600.0
    )
    contexts: tuple[Context, ...] = field(default=(), repr=False)  # of which the nearest is in force
    network: Network | None = field(default=None, repr=False)  # of the embedding

    needs_pixels = False

    def __post_init__(self) -> None:
        """Refuse weights that name no feature, or are all 0."""
        if self.weights:
            weights_of(self.weights)

    def start(self, scene: Scene) -> MultiFeatureState:
        """Return the state without a target."""
        ground = scene.ground if self.on_ground else None
        known = replace(scene, ground=ground, zones=(), rules=(), roi=None)
        objects = int(np.clip(round(self.lookback * scene.fps), *_OBJECTS))
        looks = looks_for(known, self.network)
        nobody, nothing = Frame(0, 0.0), Regions.empty()
        shapes = {one.name: one.describe({}, nobody, nothing)[1].shape[1:] for one in looks}
        features = features_for(self.in_force(""), known, self.network)
        memories = {one.name: dict(one.start(known)) for one in features}
        _, rows = described(features, memories, nobody, nothing, known)
        return MultiFeatureState(
            targets=newborn(nobody, nothing, rows, features, shapes, 1, objects),
            memories=memories,
            measuring=measuring.start(),
            context="",
            checked=0.0,
            unsaid=Tracks.empty(),
            telling=Telling.unknown(looks),
            meetings=Meetings.none(),
            jitter=Jitter.unknown(),
            backdrop=Backdrop.unknown(0, 0),
            next_key=1,
            next_id=1,
            time=0.0,
            size=(scene.height, scene.width),
            fps=scene.fps,
            ground=ground,
            zones=Zones.of(scene),
        )

    def in_force(self, name: str) -> Context:
        """Return the context in force: what the user gave, the one chosen by name, or that of boxes."""
        if self.weights:
            return Context("given", weights_of(self.weights), DEFAULT.similar)
        if len(self.contexts) == 1:
            return self.contexts[0]
        return next((one for one in self.contexts if one.name == name), DEFAULT)

    def _chosen(
        self, state: MultiFeatureState, frame: Frame, regions: Regions, scene: Scene
    ) -> tuple[MultiFeatureState, list[Event]]:
        """Measure what the scene is like, and choose the nearest of the contexts by it, from time to time anew."""
        if self.weights or len(self.contexts) < 2:
            return state, []
        seen = regions.take(regions.scores >= self.sure_score)
        state = replace(state, measuring=measuring.measure(state.measuring, frame, seen, scene))
        first = not state.context
        due = frame.time - state.checked >= (_FIRST_CHECK if first else self.recheck)
        if not due:
            return state, []
        found = nearest(self.contexts, measuring.measures_of(state.measuring, scene))
        state = replace(state, checked=frame.time)
        mine = next((one for one in self.contexts if one.name == state.context), None)
        if mine is not None:
            own = distance(mine, measuring.measures_of(state.measuring, scene))
            if own - found.distance < _NEARER:
                return state, []
        rival = (
            "" if found.runner_up is None else f"; next {found.runner_up.name} at {found.runner_up_distance:.2f}"
        )
        why = f"{found.context.name}: the nearest, at {found.distance:.2f}{rival}"  # the name first: `run.json` tells it
        return replace(state, context=found.context.name), [Event("context", frame.index, frame.index, why=why)]

    def step(self, state: MultiFeatureState, frame: Frame, regions: Regions) -> tuple[MultiFeatureState, Report]:
        """Describe, compare, link, update, give birth, find again, say, retire, on the regions that count."""
        after, report, numbers = counting(state.zones, regions, partial(self._step, state, frame))
        unsaid = renumbered(after.unsaid, frame.index, numbers)
        rows = renumbered(report.rows, frame.index, numbers)
        reasons = restated(report.explanations, {}, numbers)
        return replace(after, unsaid=unsaid), replace(report, rows=rows, explanations=reasons)

    def _step(self, state: MultiFeatureState, frame: Frame, regions: Regions) -> tuple[MultiFeatureState, Report]:
        zones, scene = state.zones, Scene(state.size[1], state.size[0], state.fps, ground=state.ground)
        state, chosen = self._chosen(state, frame, regions, scene)
        context = self.in_force(state.context)
        features = features_for(context, scene, self.network)
        seen, backdrop = self._moving(state, regions, frame)
        memories, rows = described(features, state.memories, frame, seen, scene)
        state = replace(state, targets=state.targets.described_by(features, rows))
        places = expected(state.targets, frame.time, self.inertia, self.believed_after)
        where = boxes_of(places[GATE])
        onward = boxes_of(expected(state.targets, frame.time, self.inertia, self.believed_after, 0.0)[GATE])
        links = self._links(state.targets, features, places, regions, rows, frame, context, zones)
        score = self._scores(links, state, where, regions, frame, context)
        pairs = self._official(state, score, regions, frame)
        told = explained(state.targets, links, score, pairs, regions, context) if self.explain else ()
        targets, again = self._followed(state, links, pairs, regions, rows, frame)
        smooth = boxes_of(expected(targets, frame.time, self.inertia, self.believed_after, 1.0)[GATE])
        targets = targets.replace(surprise=surprise(state.targets, pairs, onward, regions))
        jitter = surprised(state.jitter, targets.surprise, state.targets.surprise)
        gaps = between(state.targets, targets, pairs[:, 0], frame, self.fill)
        region = np.full(len(targets), -1)
        region[pairs[:, 0]] = pairs[:, 1]
        targets, hidden = hidden_behind(zones, targets, region, where, frame)
        births = self._births(zones, regions, pairs[:, 1])
        targets = targets.join(self._new(state, features, births, regions, rows, frame))
        region, where = np.concatenate([region, births]), np.concatenate([where, regions.boxes[births]])
        smooth = np.concatenate([smooth, regions.boxes[births]])
        telling, meetings, swapped, found = self._known_again(state, targets, region, where, seen, frame, scene)
        known_as = dict(
            zip(state.targets.ids.tolist(), found.targets.ids.tolist(), strict=False)
        )  # but for newborn ones
        targets, region, where = found.targets.take(found.kept), region[found.kept], where[found.kept]
        smooth = smooth[found.kept]
        unsaid, gaps = (rekeyed(rekeyed(some, swapped.keys), found.keys) for some in (state.unsaid, gaps))
        moment = Moment(
            frame, regions, region, where, smooth, self.smooth * (1 - state.jitter.gain.mean()), state.size, zones
        )
        said = say(targets, state.next_id, unsaid, gaps, moment, self.confirm, self.least_way, self.window)
        kept, left = self._retired(said.targets, region, regions.blind, frame, state)
        after = replace(
            state,
            targets=kept,
            memories=memories,
            unsaid=said.unsaid,
            telling=telling,
            meetings=meetings,
            jitter=jitter,
            backdrop=backdrop,
            next_key=state.next_key + len(births),
            next_id=said.next_id,
            time=frame.time,
        )
        events = (*chosen, *said.events, *again, *swapped.events, *found.events, *hidden, *left)
        return after, Report(
            said.rows,
            renamed=(*swapped.renamed, *found.renamed),
            events=events,
            explanations=restated(told, known_as),
        )

    def _known_again(
        self,
        state: MultiFeatureState,
        targets: Targets,
        region: Index,
        where: Boxes,
        seen: Regions,
        frame: Frame,
        scene: Scene,
    ) -> tuple[Telling, Meetings, Exchanged, Recalled]:
        """Judge by looks who has changed places with whom, and who was lost before; nothing without a picture."""
        swapped = Exchanged(targets, state.meetings, {}, (), ())
        if frame.image is None:
            return state.telling, state.meetings, swapped, Recalled.nobody(targets)
        kinds = looks_for(scene, self.network)
        doubt = in_doubt(targets, state.meetings)
        targets, telling, fresh = looked(kinds, targets, region, state.telling, frame, seen, state.size, doubt)
        active = targets.missed <= self.window + 1e-9
        meetings = met(state.meetings, targets, where, active, frame)
        swapped = exchange(kinds, telling, targets, meetings, fresh, frame, self.exchange)
        limits = (self.recall * state.advice.of(swapped.targets.ids), self.likeness)
        found = recall(kinds, telling, swapped.targets, region, fresh, frame, state.size, state.zones, limits)
        return telling, swapped.meetings, swapped, found

    def heed(self, state: MultiFeatureState, advice: Advice) -> MultiFeatureState:
        """Return the state, in which targets are kept for as many times as long as interpretation advises (IV.D)."""
        return replace(state, advice=advice)

    def finish(self, state: MultiFeatureState) -> Report:
        """Return what is left to say: nothing."""
        return Report.empty()

    def _moving(self, state: MultiFeatureState, regions: Regions, frame: Frame) -> tuple[Regions, Backdrop]:
        """Return the regions with their moving pixels, and what is now known of the place behind them."""
        if frame.image is None or not self.moving_pixels:
            return regions, state.backdrop
        known = state.backdrop if len(state.backdrop.known) else Backdrop.unknown(*state.size)
        seen = moving(known, frame.image, regions)
        lately = state.targets.last[state.targets.missed <= self.window]
        return seen, learnt(known, frame.image, np.concatenate([regions.boxes, lately]))

    def _links(
        self,
        targets: Targets,
        features: list[Feature],
        places: Rows,
        regions: Regions,
        rows: Rows,
        frame: Frame,
        context: Context,
        zones: Zones,
    ) -> Links:
        """Compare every target of the window with every object that it may have come to (section 4.1)."""
        active = np.flatnonzero(targets.missed <= self.window * zones.stays(targets.last) + 1e-9)
        one, other = (part.ravel() for part in np.meshgrid(active, np.arange(len(regions)), indexing="ij"))
        elapsed = np.maximum(frame.time - targets.seen[one], 1e-6)
        gate = next(feature for feature in features if feature.name == GATE)
        both = known(places[GATE])[one] & known(rows[GATE])[other]
        near = both & (gate.similarity(places[GATE][one], rows[GATE][other], elapsed) > 0)
        moved = targets.replace(rows={**targets.rows, **places})
        return compare(features, moved, rows, (one[near], other[near]), elapsed[near], self.long_term, context)

    def _scores(
        self,
        links: Links,
        state: MultiFeatureState,
        where: Boxes,
        regions: Regions,
        frame: Frame,
        context: Context,
    ) -> Float:
        """Return the global similarity (N, M) of targets and regions (eq. 16); -inf where there is no link."""
        targets, zones, weights = state.targets, state.zones, context.weights
        score = np.full((len(targets), len(regions)), -np.inf, np.float32)
        alike = weighted(links.link, links.known, weights)
        total = weighted(global_similarity(links), links.known, weights)
        least = (self.similar or context.similar) / zones.reach(where)[links.target]
        linked = alike >= least
        waning = self.waning * np.minimum(links.elapsed / max(self.window, 1e-6), 1.0)
        score[links.target[linked], links.region[linked]] = (total - waning)[linked]
        lost = np.flatnonzero((targets.missed > 0) & (targets.ids > 0))
        if zones and len(lost) and len(regions):
            gaps = np.repeat(frame.time - targets.seen[lost][:, None], len(regions), axis=1)
            verdicts = zones.verdicts(targets.last[lost], targets.behind[lost], regions.boxes, gaps)
            score[lost] = np.where(verdicts == FORBIDDEN, -np.inf, score[lost])
        return score

    def _official(self, state: MultiFeatureState, score: Float, regions: Regions, frame: Frame) -> Index:
        """Return the official links (K, 2): of sure regions, then of weak ones for targets just seen, then by zones."""
        chosen = ASSIGNMENTS[self.assignment]
        sure = regions.scores >= self.sure_score
        weak = (regions.scores >= self.weak_score) & ~sure
        pairs = chosen(np.where(sure, score, -np.inf))
        if weak.any():
            second = np.where(weak & (score >= self.weak_similar), score, -np.inf)
            second[pairs[:, 0]] = -np.inf
            second[state.targets.missed > _LATELY] = -np.inf
            pairs = np.concatenate([pairs, chosen(second)])
        return np.concatenate([pairs, by_zones(state.zones, state.targets, pairs, regions, frame)])

    def _followed(
        self, state: MultiFeatureState, links: Links, pairs: Index, regions: Regions, rows: Rows, frame: Frame
    ) -> tuple[Targets, list[Event]]:
        """Return the targets with their new objects, and who was found elsewhere by a rule."""
        before, zones = state.targets, state.zones
        targets = extended(before, pairs[:, 0], frame, regions, pairs[:, 1], rows, links.at(pairs))
        far = pairs[before.missed[pairs[:, 0]] > self.window]
        if len(far):
            targets = targets.restarted(far[:, 0])
        events = []
        for row, number in far.tolist():
            rule = zones.rule(before.last[row], regions.boxes[number])
            if rule is not None and before.behind[row] < 0:
                events.append(event("found_again", frame, int(before.ids[row]), rule.found_in))
        waited = 0.0 if regions.blind else frame.time - state.time
        seen = np.isin(np.arange(len(targets)), pairs[:, 0])
        return targets.replace(missed=np.where(seen, 0.0, targets.missed + waited)), events

    def _births(self, zones: Zones, regions: Regions, taken: Index) -> Index:
        """Return the regions that found a trajectory: nobody's, of a sufficient score, where one may come in."""
        free = regions.scores >= self.birth_score
        free[taken] = False
        births = np.flatnonzero(free)
        return births[np.isfinite(zones.evidence(regions.boxes[births]))]

    def _new(
        self,
        state: MultiFeatureState,
        features: list[Feature],
        births: Index,
        regions: Regions,
        rows: Rows,
        frame: Frame,
    ) -> Targets:
        chosen = {name: some[births] for name, some in rows.items()}
        objects = state.targets.times.shape[1]
        shapes = {name: some.shape[2:] for name, some in state.targets.looks.items()}
        new = newborn(frame, regions.take(births), chosen, features, shapes, state.next_key, objects)
        zones = state.zones
        return new.replace(evidence=zones.evidence(new.last), entry=zones.first(new.last, "entry"))

    def _retired(
        self, targets: Targets, region: Index, blind: bool, frame: Frame, state: MultiFeatureState
    ) -> tuple[Targets, list[Event]]:
        """Let go of who made no link for the window (T2), or longer where looks or zones may find it again."""
        zones, size = state.zones, state.size
        remembered = frame.image is not None and self.recall > self.window
        inside = (targets.looked[:, -1] > NEVER) & within(targets, size)
        usual = np.where(inside & remembered, self.recall, self.window).astype(np.float64)
        patience = zones.kept(targets.last, targets.behind, usual, ~within(targets, size))
        patience = patience * state.advice.of(targets.ids)
        awaited = (targets.evidence > self.confirm) & (frame.time - targets.born >= self.confirm)
        awaited &= targets.missed <= self.confirm + 1e-9
        young = (region >= 0) | blind | awaited | (targets.missed <= self.gap + 1e-9)
        kept = np.where(targets.ids > 0, targets.missed <= patience + 1e-9, young)
        gone = np.flatnonzero(~kept & (targets.ids > 0))
        exits = zones.left(targets.last[gone])
        out = ~within(targets, size)[gone]
        events = [
            event("left" if by >= 0 or over else "lost", frame, int(targets.ids[row]), zones.name(int(by)))
            for row, by, over in zip(gone.tolist(), exits.tolist(), out.tolist(), strict=True)
        ]
        return targets.take(kept), events


_OBJECTS = (4, 60)  # at least and at most so many objects of a trajectory are averaged (Q)
_FIRST_CHECK = 2.0  # s after which a context is first chosen
_NEARER = 0.3  # by so much another context must be nearer to take over
_LATELY = 0.2  # s: who was seen so lately may be in a region of low score

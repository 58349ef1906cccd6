"""The tracker: predict, measure, update, learn, say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.maths import lie
from perdure.params import Schedule, parameter
from perdure.scene.advice import Advice
from perdure.scene.whereabouts import Waiting
from perdure.scene.zones import Zones, counting, renumbered
from perdure.trackers.contour import observer
from perdure.trackers.contour.births import Nursery, births
from perdure.trackers.contour.looking import boxed, look, moved, silhouette_of
from perdure.trackers.contour.observer import Float, Gains
from perdure.trackers.contour.rules import Rules
from perdure.trackers.contour.saying import gone, happenings, has_left, rows_of
from perdure.trackers.contour.seeing import lab_of, learnt_place, moved_on, small_grey
from perdure.trackers.contour.targets import Place, Target
from perdure.trackers.contour.updating import updated
from perdure.types import Event, Frame, Image, Mask, Regions, Report, Scene

_PLACE_RATE = 0.2
_DEGREES = {"position": 0, "velocity": 1, "acceleration": 2}


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
    advice: Advice = field(default_factory=Advice.none)  # how long who is kept, of interpretation


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
        by, zones, was = self._rules, state.zones, state.targets
        lab, (grey, step) = lab_of(image), small_grey(image)
        nothing = np.zeros(lab.shape[:2], np.bool_)
        place = Place(lab, nothing, nothing, grey, step)
        if state.place.grey.shape == grey.shape:
            place, camera = moved_on(state.place, grey, step, boxed(was, state.size, by.group))
            if not np.array_equal(camera, np.eye(2, 3)):  # outlines change with what is behind: no gait is told
                was = tuple(replace(one, restless=0.0) for one in was)
        light = np.asarray(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY), np.uint8)
        sights = [look(by, *moved(by, one, state.light, light), lab, place) for one in was]
        waited = frame.time - state.time
        targets = updated(by, was, sights, self._gains_of(frame.index), waited)
        targets = [_allowed(zones, old, one, waited) for old, one in zip(was, targets, strict=True)]
        first = not len(state.place.grey)
        nursery = Nursery(state.waiting, state.next_key, state.next_id, state.size, zones, first)
        born = births(by, nursery, targets, frame, lab, regions)
        targets = born.targets
        covered = np.any([nothing, *(one.seen.to_image(*state.size) for one in targets)], axis=0)
        place = learnt_place(place, lab, boxed(targets, state.size, by.group), covered, _PLACE_RATE)
        kept, believed, lost = self._kept(targets, frame, state)
        rows = rows_of(kept, believed, frame, state.size, self.patience, by.group)
        events = (*born.events, *lost, *happenings(was, kept, frame, zones))
        keys = state.next_key + len(born.new), max([state.next_id, *(one.id + 1 for one in born.new)])
        after = ContourState(tuple(kept), born.waiting, place, light, *keys, frame.time, state.size, zones)
        return after, Report(rows, events=events)

    def heed(self, state: ContourState, advice: Advice) -> ContourState:
        """Return the state, in which targets are kept for as many times as long as interpretation advises (IV.D)."""
        return replace(state, advice=advice)

    def finish(self, state: ContourState) -> Report:
        """Return nothing: all has been said."""
        return Report()

    def _kept(
        self, targets: Sequence[Target], frame: Frame, state: ContourState
    ) -> tuple[list[Target], list[Mask], list[Event]]:
        """Return the objects that are still followed, their silhouettes, and what is told of the others."""
        size, zones = state.size, state.zones
        kept, believed, events = [], [], []
        for one in targets:
            whole = silhouette_of(one, self._rules.group)
            seen = one.seen.box if one.missed == 0 and one.seen.area else None
            one = replace(one, last_seen=one.last_seen.after(zones, seen, whole.box))
            left = has_left(whole.box, size) and one.missed > 0 and one.last_seen.behind < 0
            patience = one.last_seen.kept(zones, self.patience, left) * float(state.advice.of(one.id))
            if one.missed > patience + 1e-9 or left or not whole.area:
                events.append(gone(one, frame, left, zones))
            else:
                kept.append(one)
                believed.append(whole)
        return kept, believed, events

    @property
    def _rules(self) -> Rules:
        return Rules(
            automatic=self.gains == "automatic", group=lie.GROUPS[self.group],
            motion=self.moved or observer.MOTIONS[self.motion], own_motion=self.moved is not None,
            degree=_DEGREES[self.motion], window=self.window, iterations=self.iterations, reach=self.reach,
            giving=self.giving, search=self.search, curvature=self.curvature, components=self.components,
            trust=self.trust, place=self.place, bound=self.bound, ring=self.ring, cells=self.cells,
            smallest=self.smallest, flow=self.flow,
        )  # fmt: skip

    def _gains_of(self, index: int) -> Gains:
        """Return the gains of a frame, before anything is known of what is seen."""
        if self.gained is not None:
            return self.gained(index)
        return Gains(Schedule(self.shape_gain).at(index), Schedule(self.motion_gain).at(index))


def _allowed(zones: Zones, was: Target, now: Target, waited: float) -> Target:
    """Return an object as it is now, or as one that is still not seen where a rule forbids that it is found there."""
    found = was.missed > 0 == now.missed and now.seen.area
    if not found or not was.last_seen.is_forbidden(zones, now.seen.box, was.missed + waited):
        return now
    return replace(was, missed=was.missed + waited, seen=Mask.empty(), links=())

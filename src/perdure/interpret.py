"""Interpretation over tracks, and its feedback to the tracker (III.C, IV.D).

A fold beside the tracker's, over its reports: lives grow, beliefs are formed of them, scenarios are recognised. Who is
believed to be nothing real is taken back as noise, and who does something of interest is kept for longer when lost.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from perdure.params import parameter
from perdure.scene.advice import Advice
from perdure.scene.beliefs import NOISE, Belief, beliefs, measured
from perdure.scene.ground import Ground
from perdure.scene.lives import FRAME, HEIGHT, METRES_X, TIME, WIDTH, Life, X, Y, noted, passed, renamed
from perdure.scene.placing import Paths, placed
from perdure.scene.scenarios import Moment, Recognition, Rules, finished, recognise
from perdure.scene.zones import Zones
from perdure.types import Dropped, Event, Mask, Report, Scene, Status, Tracks

ENDS = ("left", "lost")  # events after which a target is gone
_CHECK = 0.2  # s, after which beliefs are formed anew
_WITHHELD = 60.0  # s of rows of who is taken for noise, which are said if that turns out to be wrong


@dataclass(frozen=True)
class Feedback:
    """What interpretation does to tracks."""

    least_belief: float = parameter(
        0.5, "belief below which a target that looks like noise is taken back", low=0.0, high=1.0
    )
    probation: float = parameter(
        2.0, "age at which a target is first judged by its beliefs while it is there", unit="s", low=0.0, high=60.0
    )
    protect: float = parameter(
        3.0, "times as long who does something of interest is kept when lost", low=1.0, high=100.0
    )
    drop_noise: bool = parameter(True, "whether targets that are taken for noise are taken back")


@dataclass(frozen=True, eq=False)
class InterpreterState:
    """What is known of everybody."""

    lives: tuple[Life, ...]
    beliefs: tuple[Belief, ...]  # of each life
    checked: float  # s, when they were formed last
    recognition: Recognition
    groups: tuple[int, ...]  # ids that are groups'
    noise: tuple[int, ...]  # who is taken for noise
    withheld: Tracks  # rows of who may be noise, or is, without silhouettes
    interesting: tuple[int, ...]
    paths: Paths
    time: float


class Interpreted(NamedTuple):
    """A step of interpretation."""

    state: InterpreterState
    report: Report  # of the tracker, with corrections and events
    advice: Advice


@dataclass(frozen=True)
class Interpreter:
    """Scenarios and beliefs over any tracker's reports."""

    rules: Rules
    feedback: Feedback = field(default_factory=Feedback)
    size: tuple[int, int] = (0, 0)
    zones: Zones = field(default_factory=Zones)
    ground: Ground | None = None

    @staticmethod
    def of(scene: Scene, rules: Rules, feedback: Feedback | None = None) -> Interpreter:
        """Return the interpreter of a scene.

        Raises
        ------
        ParameterError
            If a scenario names a zone that the scene has not.
        """
        zones = Zones.of(scene)
        rules.check_zones(tuple(one.name for one in zones.zones))
        return Interpreter(rules, feedback or Feedback(), (scene.height, scene.width), zones, scene.ground)

    def start(self) -> InterpreterState:
        """Return the state before the first report."""
        nothing: tuple[int, ...] = ()
        return InterpreterState(
            (), (), 0.0, Recognition(), nothing, nothing, Tracks.empty(), nothing, Paths.none(), 0.0
        )

    def step(self, state: InterpreterState, frame: int, time: float, report: Report) -> Interpreted:
        """Return the state after a frame's report, and the report with what interpretation adds and takes back."""
        rows, paths = report.rows, state.paths
        if self.ground is not None:
            paths, rows = placed(self.ground, paths, rows)
        known = {one.id: one for one in state.lives}
        changed = renamed(known, report.renamed)
        names = _names(report, known, changed)
        groups = tuple(sorted({*state.groups, *(int(one) for one in np.unique(rows.groups) if one)}))
        single = rows.take(~np.isin(rows.ids, groups)) if groups else rows
        lives = noted(changed, single)
        ends = [one for event in report.events if event.kind in ENDS for one in event.ids]
        lives = passed(lives, ends, time)
        every = self._beliefs(state, lives, time)
        present = _present(lives, single, frame)
        moment = Moment(frame, time, lives, present, every, self.zones)
        found = recognise(self.rules, state.recognition.renamed(names), moment)
        events, begun = found.over, found.begun
        noise, rows, withheld, corrections, dropped = self._cleaned(state, rows, lives, every, names, frame, time)
        interesting = self._interesting(state, found.state, lives, names)
        after = InterpreterState(
            tuple(lives.values()),
            tuple(every[one] for one in lives),
            time if time - state.checked >= _CHECK - 1e-9 else state.checked,
            found.state,
            groups,
            noise,
            withheld,
            interesting,
            paths,
            time,
        )
        told = (*report.events, *events, *corrections)
        said = replace(report, rows=rows, dropped=(*report.dropped, *dropped), events=told, begun=begun)
        return Interpreted(after, said, self._advice(noise, interesting))

    def finish(self, state: InterpreterState, report: Report) -> Report:
        """Return the tracker's last report with what is over because the video is; who was lost then is judged, too."""
        lives = {
            one.id: replace(one, gone=one.gone or one.last[TIME] < state.time - _CHECK - 1e-9)
            for one in state.lives
        }
        every = self._beliefs(state, lives, state.time)
        frame = max((int(one.last[FRAME]) for one in lives.values()), default=0)
        _, rows, _, events, dropped = self._cleaned(state, report.rows, lives, every, {}, frame, state.time)
        told = (*report.events, *events, *finished(self.rules, state.recognition))
        return replace(report, rows=rows, dropped=(*report.dropped, *dropped), events=told)

    def _beliefs(self, state: InterpreterState, lives: Mapping[int, Life], time: float) -> dict[int, Belief]:
        """Beliefs of all, formed anew where it is time, or where one has just come or gone."""
        before = {one.id: (one.gone, belief) for one, belief in zip(state.lives, state.beliefs, strict=True)}
        due = time - state.checked >= _CHECK - 1e-9
        return {
            one: before[one][1]
            if one in before and before[one][0] == life.gone and (life.gone or not due)
            else self._believed(life)
            for one, life in lives.items()
        }

    def _believed(self, life: Life) -> Belief:
        heights: list[float] = []
        if self.ground is not None and self.ground.has_heights:
            path = life.path[np.isfinite(life.path[:, METRES_X])][-50:]
            half = path[:, WIDTH] / 2
            boxes = np.column_stack(
                [path[:, X] - half, path[:, Y] - path[:, HEIGHT], path[:, X] + half, path[:, Y]]
            )
            heights = self.ground.heights(boxes).tolist() if len(boxes) else []
        total = sum(life.votes)
        votes = {label: vote / total for label, vote in zip(life.labels, life.votes, strict=True)} if total else {}
        return beliefs(measured(life, self.size, heights), self.rules.kinds, votes)

    def _cleaned(
        self,
        state: InterpreterState,
        rows: Tracks,
        lives: Mapping[int, Life],
        every: Mapping[int, Belief],
        names: Mapping[int, int],
        frame: int,
        time: float,
    ) -> tuple[tuple[int, ...], Tracks, Tracks, list[Event], list[Dropped]]:
        """Take back who is noise and withhold its rows; say them after all if it is not."""
        before = {names.get(one, one) for one in state.noise} & set(lives)
        if not self.feedback.drop_noise:
            return (), rows, state.withheld, [], []
        now = {one for one, life in lives.items() if self._is_noise(life, every[one], one in before)}
        events = [_event(lives[one], every[one], frame) for one in sorted(now - before)]
        dropped = [Dropped(one, 0, frame) for one in sorted(now - before)]
        events += [
            Event("believed", lives[one].first, frame, (one,), why=f"not noise after all: {every[one].best}")
            for one in sorted(before - now)
        ]
        young = {one for one, life in lives.items() if not life.gone and life.age <= self.feedback.probation + 1.0}
        kept = _remembered(state.withheld, names, young | now | (before - now), time)
        back = kept.take(np.isin(kept.ids, sorted(before - now)))
        mine = np.isin(rows.ids, sorted(young | now))
        bare = rows.take(mine).replace(masks=(Mask.empty(),) * int(mine.sum()))
        withheld = Tracks.join([kept.take(np.isin(kept.ids, sorted(young | now))), bare])
        said = Tracks.join([back, rows.take(~np.isin(rows.ids, sorted(now)))])
        return tuple(sorted(now)), said, withheld, events, dropped

    def _is_noise(self, life: Life, belief: Belief, before: bool) -> bool:
        """Whether a target is taken for noise: where it is there, not before its probation is over."""
        if life.gone and not life.path.size:
            return before
        if not life.gone and life.age < self.feedback.probation - 1e-9:
            return before
        low = belief.coefficient < self.feedback.least_belief
        return low and belief.of.get(NOISE, 0.0) >= belief.coefficient

    def _interesting(
        self, state: InterpreterState, now: Recognition, lives: Mapping[int, Life], names: Mapping[int, int]
    ) -> tuple[int, ...]:
        """Who takes part in a scenario of interest, or did until it was lost."""
        wanted = {one.name for one in self.rules.scenarios if one.interesting}
        active = {
            one
            for hold in now.holds
            if hold.told and hold.scenario in wanted
            for one in (hold.id, hold.other)
            if one
        }
        active |= {
            one
            for thing in now.things
            if thing.told and thing.scenario in wanted
            for one in (thing.id, thing.owner)
        }
        unseen = {names.get(one, one) for one in state.interesting}
        still = {
            one for one in unseen if one in lives and not lives[one].gone and lives[one].last[TIME] < state.time
        }
        return tuple(sorted(active | still))

    def _advice(self, noise: Iterable[int], interesting: Iterable[int]) -> Advice:
        times = dict.fromkeys(interesting, self.feedback.protect) | dict.fromkeys(noise, 0.0)
        return Advice(np.array(list(times), np.int64), np.array(list(times.values()), np.float64))


@dataclass(frozen=True)
class Placing:
    """Rows put on the ground plane, where nothing else is interpreted."""

    ground: Ground

    def start(self) -> Paths:
        """Return the state before the first report."""
        return Paths.none()

    def step(self, state: Paths, frame: int, time: float, report: Report) -> tuple[Paths, Report, Advice]:
        """Return the state after a frame's report, and the report with places and speeds."""
        paths, rows = placed(self.ground, state, report.rows)
        return paths, replace(report, rows=rows), Advice.none()

    def finish(self, state: Paths, report: Report) -> Report:
        """Return the tracker's last report with places and speeds."""
        return replace(report, rows=placed(self.ground, state, report.rows)[1])


class Told(NamedTuple):
    """What interpretation tells of a finished run."""

    events: tuple[Event, ...]  # in the order in which they began
    beliefs: dict[int, Belief]  # of every id, at the end of its life


def over_run(interpreter: Interpreter, rows: Tracks, frames: Sequence[int], times: Sequence[float]) -> Told:
    """Return what interpretation tells of a run's settled rows; nothing is taken back.

    Parameters
    ----------
    interpreter : Interpreter
        Its feedback is left alone: the tracker is long done.
    rows : Tracks
        Sorted by frame.
    frames, times : (T,)
        All frames of the run and their seconds, also those without a row.
    """
    alone = replace(interpreter, feedback=replace(interpreter.feedback, drop_noise=False), ground=None)
    seen = rows.status != Status.LOST
    lasts = {int(one): int(rows.frames[seen & (rows.ids == one)].max()) for one in np.unique(rows.ids[seen])}
    ends: dict[int, list[int]] = {}
    for one, frame in lasts.items():
        ends.setdefault(frame, []).append(one)
    state, events, known = alone.start(), list[Event](), dict[int, Belief]()
    begins = np.searchsorted(rows.frames, frames, side="left")
    stops = np.searchsorted(rows.frames, frames, side="right")
    gone: list[int] = []
    for frame, time, begin, stop in zip(frames, times, begins.tolist(), stops.tolist(), strict=True):
        over = (Event("lost", frame, frame, (one,)) for one in gone)
        report = Report(rows.take(np.arange(begin, stop)), events=tuple(over))
        state, said, _ = alone.step(state, frame, time, report)
        events += [one for one in said.events if one not in report.events]
        known |= {life.id: belief for life, belief in zip(state.lives, state.beliefs, strict=True)}
        gone = ends.get(frame, [])
    events += alone.finish(state, Report.empty()).events
    return Told(tuple(sorted(events, key=lambda one: one.begin)), known)


def _names(report: Report, before: Mapping[int, Life], after: Mapping[int, Life]) -> dict[int, int]:
    """Who goes on under which id: of several corrections of one, the one that holds for its newest row."""
    names: dict[int, int] = {}
    for one in report.renamed:
        life = before.get(one.old)
        if life is not None and one.begin <= life.path[-1, FRAME] <= one.end and one.old not in names:
            names[one.old] = one.new
    return names


def _present(lives: Mapping[int, Life], rows: Tracks, frame: int) -> tuple[int, ...]:
    there = (rows.frames == frame) & (rows.status != Status.LOST)
    return tuple(
        one for one in sorted(set(rows.ids[there].tolist())) if one in lives and lives[one].last[FRAME] == frame
    )


def _remembered(rows: Tracks, names: Mapping[int, int], ids: Iterable[int], time: float) -> Tracks:
    """Withheld rows of some ids, under their names of now, that are not too old."""
    now = rows.replace(ids=[names.get(one, one) for one in rows.ids.tolist()]) if names else rows
    return now.take(np.isin(now.ids, sorted(ids)) & (now.times >= time - _WITHHELD))


def _event(life: Life, belief: Belief, frame: int) -> Event:
    """That one is taken for noise: it has no rows any more, and is named in words alone."""
    strength = belief.of.get(NOISE, 0.0)
    why = f"id {life.id} is taken back: {belief.why.get(NOISE, 'nothing is known')}; believed {belief.coefficient:.2f}"
    return Event(NOISE, life.first, frame, (), "", round(float(strength), 3), why)

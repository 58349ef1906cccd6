"""The fold: a state, a frame, its regions, a report; and `settle`, which applies late corrections.

`Tracker` and `Detector` are the only contract. `detect` and `track` run one over a film, `run` both, so that the
detector may heed what the tracker believes; `settle` turns
the reports, whose identities may have been decided late, into one row per (frame, id).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from perdure.interpret import Interpreter, Placing
from perdure.types import Dropped, Event, Frame, Regions, Renamed, Report, Scene, Tracks

S = TypeVar("S")
D = TypeVar("D")
T = TypeVar("T")
V = TypeVar("V")


class Detector(Protocol[S]):
    """Pixels to regions: a frozen dataclass of parameters with a state of its own.

    A detector may also have `prepare(frames) -> Detector`, a first look over frames spread over a file, and
    `heed(state, report) -> state`: it is told, between two steps, what the tracker said of the last frame (a background
    model, for one, does not learn where a target is believed).
    `needs_pixels` says whether it can work on frames without a picture.
    """

    needs_pixels: bool

    def start(self, scene: Scene) -> S:
        """Return the state before the first frame."""
        ...

    def step(self, state: S, frame: Frame) -> tuple[S, Regions]:
        """Consume a state, return the next one and what is seen in the frame."""
        ...


class Tracker(Protocol[S]):
    """Regions to reports: a frozen dataclass of parameters; it prints, compares, is its own configuration.

    One may have `heed(state, advice) -> state`: it is told, between two steps, for how many times as long interpretation
    wants targets kept that are not seen (`perdure.scene.advice`).

    `step` changes neither `frame` nor `regions` and depends on nothing else. The state passed in is
    consumed: its buffers may be reused; `perdure.states.save` gives an independent copy.
    A tracker that goes on from what the user marked (`regions.data["mark"]`), with no detector after that frame, has
    `follows_marks = True`, and a field `reserved`: ids up to it are the marks', and what it finds itself gets others.
    """

    needs_pixels: bool

    def start(self, scene: Scene) -> S:
        """Return the state before the first frame."""
        ...

    def step(self, state: S, frame: Frame, regions: Regions) -> tuple[S, Report]:
        """Consume a state, return the next one and what was learnt."""
        ...

    def finish(self, state: S) -> Report:
        """Return what is left to say when no frame will come any more."""
        ...


class Step(NamedTuple):
    """One step of a run; `frame` is None for the last, in which the tracker finishes."""

    frame: Frame | None
    regions: Regions
    report: Report


@dataclass(frozen=True, eq=False)
class Standing(Generic[D, T, V]):
    """Where a run stands between two frames: all that it goes on from."""

    detector: D
    tracker: T
    views: V  # of interpretation, or of places on the ground; None where there is neither


def detect(frames: Iterable[Frame], detector: Detector[Any], scene: Scene) -> Iterator[tuple[Frame, Regions]]:
    """Yield every frame with the regions that are seen in it."""
    state = detector.start(scene)
    for frame in frames:
        state, regions = detector.step(state, frame)
        yield frame, regions


def track(seen: Iterable[tuple[Frame, Regions]], tracker: Tracker[Any], scene: Scene) -> Iterator[Step]:
    """Yield a step for every frame, and one more in which the tracker finishes."""
    state = tracker.start(scene)
    for frame, regions in seen:
        state, report = tracker.step(state, frame, regions)
        yield Step(frame, regions, _with_events(regions, report))
    yield Step(None, Regions.empty(), tracker.finish(state))


def run(
    frames: Iterable[Frame],
    detector: Detector[Any],
    tracker: Tracker[Any],
    scene: Scene,
    wanted: Callable[[Regions], Regions] | None = None,
    interpreter: Interpreter | Placing | None = None,
    begin: Standing[Any, Any, Any] | None = None,
    between: Callable[[Standing[Any, Any, Any]], None] | None = None,
) -> Iterator[Step]:
    """Yield a step for every frame, and one more in which the tracker finishes; the detector heeds the tracker.

    `wanted` leaves the regions that the tracker shall see; an `interpreter` adds to what the tracker says and takes back
    from it, the tracker heeds its advice, and the detector heeds what is left.
    A run `begin`s where an earlier one stood, with the frames that come then. `between` is told after every frame, when
    its step has been taken up, where the run stands; what it is told is consumed by the next frame.
    """
    now = begin or _beginning(detector, tracker, scene, interpreter)
    state, beliefs, views = now.detector, now.tracker, now.views
    heed, advised = getattr(detector, "heed", None), getattr(tracker, "heed", None)
    for frame in frames:
        state, regions = detector.step(state, frame)
        if wanted is not None:
            regions = wanted(regions)
        beliefs, report = tracker.step(beliefs, frame, regions)
        if interpreter is not None:
            views, report, advice = interpreter.step(views, frame.index, frame.time, report)
            beliefs = beliefs if advised is None else advised(beliefs, advice)
        if heed is not None:
            state = heed(state, report)
        yield Step(frame, regions, _with_events(regions, report))
        if between is not None:
            between(Standing(state, beliefs, views))
    last = tracker.finish(beliefs)
    if interpreter is not None:
        last = interpreter.finish(views, last)
    yield Step(None, Regions.empty(), last)


def _beginning(
    detector: Detector[Any], tracker: Tracker[Any], scene: Scene, interpreter: Interpreter | Placing | None
) -> Standing[Any, Any, Any]:
    """Where a run stands before its first frame."""
    views = None if interpreter is None else interpreter.start()
    return Standing(detector.start(scene), tracker.start(scene), views)


def _with_events(regions: Regions, report: Report) -> Report:
    """A report with what the detector noticed before it."""
    return replace(report, events=(*regions.events, *report.events)) if regions.events else report


def settle(reports: Iterable[Report]) -> Tracks:
    """Return one row per (frame, id), sorted, with every correction applied.

    >>> row = Tracks.of(frames=0, times=0.0, ids=[2], boxes=[[0, 0, 9, 9]])
    >>> settle([Report(row), Report(renamed=(Renamed(old=2, new=1, begin=0, end=0),))]).ids.tolist()
    [1]
    """
    reports = list(reports)
    return Tracks.join(rows for _, rows in settle_by_frame(lambda: reports))


def settle_by_frame(read: Callable[[], Iterable[Report]]) -> Iterator[tuple[int, Tracks]]:
    """Yield (frame, settled rows) in order of frames, for every frame that has a row.

    `read` is called twice: once for the corrections and the rows said late, once for the rows. Only those
    are held in memory, so that a log of any length can be settled.
    """
    return settle_with(Corrections.of(read()), read())


def settle_with(corrections: Corrections, reports: Iterable[Report]) -> Iterator[tuple[int, Tracks]]:
    """Yield (frame, settled rows) of the reports whose corrections these are."""
    late = deque(sorted(corrections.late.items()))
    for number, rows in _punctual(reports):
        frame = int(rows.frames[0])
        while late and late[0][0] < frame:
            yield from corrections.settled(*late.popleft())
        also = late.popleft()[1] if late and late[0][0] == frame else []
        yield from corrections.settled(frame, [(number, rows), *also])
    for frame, said in late:
        yield from corrections.settled(frame, said)


@dataclass(frozen=True)
class Corrections:
    """All corrections of a run, each with the number of its report, and the rows that were said late.

    A correction holds for rows of earlier reports; those of its own report were said in its knowledge.
    """

    by_id: dict[int, list[tuple[int, Renamed | Dropped]]]
    late: dict[int, list[tuple[int, Tracks]]]  # frame -> (number of the report, its late rows of any frame)

    @staticmethod
    def of(reports: Iterable[Report]) -> Corrections:
        """Read all corrections and late rows."""
        by_id: dict[int, list[tuple[int, Renamed | Dropped]]] = {}
        late: dict[int, list[tuple[int, Tracks]]] = {}
        newest = -1
        for number, report in enumerate(reports):
            for renamed in report.renamed:
                by_id.setdefault(renamed.old, []).append((number, renamed))
            for dropped in report.dropped:
                by_id.setdefault(dropped.id, []).append((number, dropped))
            newest, _, behind = _split_late(report.rows, newest)
            for frame in np.unique(behind.frames):
                late.setdefault(int(frame), []).append((number, behind))
        return Corrections(by_id, late)

    def identity(self, said: int, frame: int, number: int) -> int:
        """Return the settled id of what report `number` called `said`; 0 if it was dropped."""
        while True:
            for later, one in self.by_id.get(said, ()):
                if later > number and one.begin <= frame <= one.end:
                    break
            else:
                return said
            if isinstance(one, Dropped):
                return 0
            said, number = one.new, later

    def event(self, event: Event, number: int) -> Event:
        """Return an event of report `number` with its settled ids; none where it was of several, who are one or gone."""
        if not self.by_id:
            return event
        ids = dict.fromkeys(self.identity(one, event.begin, number) for one in event.ids)
        left = tuple(one for one in ids if one)
        alone = len(left) < 2 <= len(set(event.ids))  # of several, of whom one is left, nothing has happened
        return replace(event, ids=() if alone else left)

    def settled(self, frame: int, said: list[tuple[int, Tracks]]) -> Iterator[tuple[int, Tracks]]:
        """Yield (frame, rows), one per id: of two, the one seen before the one inferred, then the surer, then the later."""
        parts = []
        for number, part in said:
            part = part if (part.frames == frame).all() else part.in_frame(frame)
            if self.by_id:
                ids = [self.identity(int(one), frame, number) for one in part.ids]
                groups = [self.identity(int(one), frame, number) if one else 0 for one in part.groups]
                part = part.replace(ids=np.array(ids, np.int64), groups=np.array(groups, np.int64))
            parts.append(part.take(part.ids > 0))
        rows = Tracks.join(parts)
        order = np.lexsort((-np.arange(len(rows)), -rows.confidence, rows.inferred, rows.ids))
        best = np.append(True, np.diff(rows.ids[order]) != 0)[: len(order)]
        if len(rows):
            yield frame, rows.take(order[best])


def coherent(events: Iterable[Event], ids: Collection[int]) -> list[Event]:
    """Return settled events in the order in which they began, without those that corrections have made untrue.

    One whose identity turned out to be another's has not entered a second time, and of an identity without a row,
    which is not among `ids`, nothing is told.
    """
    entered: set[int] = set()
    told = []
    for event in sorted(events, key=lambda one: one.begin):
        if event.ids and not any(one in ids for one in event.ids):
            continue
        if event.kind == "entered" and event.ids:
            if entered.issuperset(event.ids):
                continue
            entered.update(event.ids)
        told.append(event)
    return told


def _punctual(reports: Iterable[Report]) -> Iterator[tuple[int, Tracks]]:
    """Yield (number of the report, its rows of a frame of which nothing was said before)."""
    newest = -1
    for number, report in enumerate(reports):
        newest, rows, _ = _split_late(report.rows, newest)
        if len(rows):
            yield number, rows


def _split_late(rows: Tracks, newest: int) -> tuple[int, Tracks, Tracks]:
    """Split rows into those of the newest frame and those said late; return that frame, both."""
    if not len(rows):
        return newest, rows, rows
    last = int(rows.frames.max())
    on_time = (rows.frames == last) & (last > newest)
    if on_time.all():
        return last, rows, Tracks.empty()
    return max(last, newest), rows.take(on_time), rows.take(~on_time)

"""The run of a long film out of the runs of its parts: their rows settled, each from its handover on, in one log.

What a part says is settled first, so that its late corrections are in its rows; who is whom over a border is then said
as corrections of the whole, in its last entry, each with the event that tells by what.
"""

from __future__ import annotations

import math
from array import array
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from perdure import states
from perdure.errors import FormatError, StateError
from perdure.features.feature import Feature
from perdure.files.log import Entry, RunLog
from perdure.files.runs import RunFolder
from perdure.files.whole import whole_binary_file
from perdure.fold import Corrections, settle_with
from perdure.looks import Portraits
from perdure.stitching import Join, Part, Stitched, names, stitch
from perdure.trackers.multifeature.explaining import RIVAL, restated
from perdure.types import Event, Explanation, Renamed, Report, Scene, Tracks

LOOKS = "looks.zip"
JOINED = "joined"
"""The kind of event that says by what an identity was known again behind a border."""


class Border(NamedTuple):
    """What became of one border between two parts."""

    frame: int  # from which the later part is told
    joined: int  # identities that go on by their places in the overlap
    found: int  # and by their looks, hidden there


@dataclass(frozen=True)
class Whole:
    """What became of the parts."""

    frames: int
    borders: tuple[Border, ...]


def write_looks(folder: Path, looks: Portraits) -> None:
    """Write how the identities of a part looked beside its log."""
    with whole_binary_file(folder / LOOKS) as file:
        states.write(looks, file)


def read_looks(folder: Path) -> Portraits:
    """Return how the identities of a part looked.

    Raises
    ------
    FormatError
        If there is no such file, or it is damaged.
    """
    try:
        return states.load((folder / LOOKS).read_bytes(), Portraits)
    except (OSError, StateError) as error:
        raise FormatError(
            f"{folder / LOOKS} cannot be read ({error}); --overwrite makes the parts anew"
        ) from error


def write_whole(
    into: RunFolder,
    parts: Sequence[tuple[RunFolder, tuple[int, int]]],
    scene: Scene,
    kinds: Sequence[Feature],
) -> Whole:
    """Write the log of a whole film from the runs of its parts, in order, each with the span of frames that it is of."""
    read = [_read_part(folder, number, [span for _, span in parts]) for number, (folder, _) in enumerate(parts)]
    known = [one.part for one in read]
    stitched = stitch(known, scene, kinds)
    spans = [stitched.span(known, number) for number in range(len(parts))]
    told = [_told(one.frames, span) for one, span in zip(read, spans, strict=True)]
    said, final = names(told, stitched.joins)
    events = _events([one.events for one in read], known, spans, told, final)
    frames, last = 0, 0.0
    with RunLog(into.log) as log:
        for number, (folder, _) in enumerate(parts):
            waiting = deque(_said_by(events[number], final[number], said[number]))
            first, behind = spans[number]
            for entry in settled_entries(folder):
                if not first <= entry.frame < behind:
                    continue
                report = replace(_named(entry.report, said[number]), events=tuple(_due(waiting, entry.frame)))
                log.append(entry.frame, entry.time, report)
                frames, last = frames + 1, entry.time
            left = tuple(event for _, event in waiting)
            if left:
                log.append(-1, last, Report(events=left))
        log.append(-1, last, _corrections(stitched, spans, said, final))
        log.sync()
    return Whole(frames, _borders(stitched))


def settled_entries(folder: RunFolder, *, with_masks: bool = True) -> Iterator[Entry]:
    """Yield an entry for every frame of a run, settled: rows, events and explanations have the ids they have in the end.

    What was said when the run finished comes last, as frame -1.
    """
    corrections = Corrections.of(entry.report for entry in folder.entries(with_masks=False))
    waiting: deque[Entry] = deque()

    def passing() -> Iterator[Report]:
        for number, entry in enumerate(folder.entries(with_masks=with_masks)):
            events = (corrections.event(one, number) for one in entry.report.events)
            kept = tuple(
                after
                for before, after in zip(entry.report.events, events, strict=True)
                if after.ids or not before.ids
            )
            reasons = _settled_reasons(entry, number, corrections)
            waiting.append(Entry(entry.frame, entry.time, Report(events=kept, explanations=reasons)))
            yield entry.report

    for frame, rows in settle_with(corrections, passing()):
        while waiting and 0 <= waiting[0].frame < frame:
            yield waiting.popleft()
        if waiting and waiting[0].frame == frame:
            entry = waiting.popleft()
            yield entry._replace(report=replace(entry.report, rows=rows))
        else:
            yield Entry(frame, float(rows.times[0]), Report(rows))
    yield from waiting


def _settled_reasons(entry: Entry, number: int, corrections: Corrections) -> tuple[Explanation, ...]:
    reasons = entry.report.explanations
    if not reasons:
        return ()
    ids = {one: corrections.identity(one, entry.frame, number) for one in _ids_in(reasons)}
    return restated(reasons, ids)


def _ids_in(reasons: Iterable[Explanation]) -> set[int]:
    rivals = (key.partition(":") for one in reasons for key in one.figures)
    return {one.id for one in reasons} | {int(which) for name, _, which in rivals if name == RIVAL}


@dataclass(frozen=True, eq=False)
class _Read:
    """What the run of a part tells, without its rows."""

    part: Part
    frames: Mapping[int, Sequence[int]]  # by identity, those that it has a row in
    events: Sequence[tuple[int, Event]]  # each with the frame in which it was told


def _read_part(folder: RunFolder, number: int, spans: Sequence[tuple[int, int]]) -> _Read:
    begin, end = spans[number]
    near = [spans[other] for other in (number - 1, number + 1) if 0 <= other < len(spans)]
    shared = [(max(begin, first), min(end, behind)) for first, behind in near]
    frames: dict[int, array[int]] = {}
    events: list[tuple[int, Event]] = []

    def rows() -> Iterator[Tracks]:
        for entry in settled_entries(folder, with_masks=False):
            events.extend((entry.frame if entry.frame >= 0 else end - 1, one) for one in entry.report.events)
            if len(entry.report.rows):
                for one in entry.report.rows.ids.tolist():
                    frames.setdefault(one, array("q")).append(entry.frame)
                yield entry.report.rows

    part = Part.of(begin, end, rows(), shared, read_looks(folder.path))
    return _Read(part, frames, events)


def _told(frames: Mapping[int, Sequence[int]], span: tuple[int, int]) -> dict[int, int]:
    """The identities of whom rows are told in a span, each with the first frame."""
    first, behind = span
    inside = {one: next((frame for frame in some if frame >= first), behind) for one, some in frames.items()}
    return {one: frame for one, frame in inside.items() if frame < behind}


def _events(
    every: Sequence[Sequence[tuple[int, Event]]],
    parts: Sequence[Part],
    spans: Sequence[tuple[int, int]],
    told: Sequence[Mapping[int, int]],
    final: Sequence[Mapping[int, int]],
) -> list[list[tuple[int, Event]]]:
    """The events of each part that are told, with the frames in which they are; what both parts tell, once."""
    kept: list[list[tuple[int, Event]]] = []
    known: dict[tuple[str, tuple[int, ...], str], list[tuple[int, int]]] = {}
    entered: set[int] = set()
    for number, events in enumerate(every):
        first, behind = spans[number]
        mine: list[tuple[int, Event]] = []
        for frame, event in events:
            own = _own(event, first, told[number])
            if own is None or own.begin >= behind or not _known(own, told[number]):
                continue
            ids = tuple(sorted(final[number].get(one, 0) for one in own.ids))
            if own.kind == "entered" and own.ids and entered.issuperset(ids):
                continue
            entered.update(ids if own.kind == "entered" else ())
            spans_of = known.setdefault((own.kind, ids, own.zone), [])
            doubled = number > 0 and own.begin < parts[number - 1].end
            if doubled and any(begin <= own.end and own.begin <= end for begin, end in spans_of):
                continue
            spans_of.append((own.begin, own.end))
            mine.append((min(max(frame, first), behind - 1), own))
        kept.append(sorted(mine, key=lambda one: one[0]))
    return kept


def _own(event: Event, first: int, told: Mapping[int, int]) -> Event | None:
    """An event as it is told from the first frame of a part on; None for what was over then."""
    if event.begin >= first:
        return event
    if event.kind == "entered" and event.ids:
        begin = min((told[one] for one in event.ids if one in told), default=first)
        return replace(event, begin=begin, end=begin)
    return replace(event, begin=first) if event.end >= first and event.begin < event.end else None


def _known(event: Event, told: Mapping[int, int]) -> bool:
    return not event.ids or any(one in told for one in event.ids)


def _said_by(
    events: Sequence[tuple[int, Event]], final: Mapping[int, int], said: Mapping[int, int]
) -> list[tuple[int, Event]]:
    """Events with the names by which the part's rows are said."""
    return [(frame, replace(one, ids=tuple(said[k] for k in one.ids if k in said))) for frame, one in events]


def _due(waiting: deque[tuple[int, Event]], frame: int) -> Iterator[Event]:
    while waiting and waiting[0][0] <= frame:
        yield waiting.popleft()[1]


def _named(report: Report, said: Mapping[int, int]) -> Report:
    """A settled report of a part with the names by which its rows are said."""
    rows = report.rows
    ids = np.array([said[one] for one in rows.ids.tolist()], np.int64)
    groups = np.array([said.get(one, 0) for one in rows.groups.tolist()], np.int64)
    known = {one: said.get(one, 0) for one in _ids_in(report.explanations)}
    return Report(rows.replace(ids=ids, groups=groups), explanations=restated(report.explanations, known))


def _corrections(
    stitched: Stitched,
    spans: Sequence[tuple[int, int]],
    said: Sequence[Mapping[int, int]],
    final: Sequence[Mapping[int, int]],
) -> Report:
    """Who of a part is who of an earlier one, and by what it was known."""
    renamed = [
        Renamed(name, final[number][one], spans[number][0], spans[number][1] - 1)
        for number, some in enumerate(said)
        for one, name in some.items()
        if name != final[number][one]
    ]
    events = []
    for join in stitched.joins:
        name = final[join.later[0]].get(join.later[1], final[join.earlier[0]].get(join.earlier[1], 0))
        if name:
            events.append(_event(join, name, stitched.handovers[join.later[0] - 1]))
    return Report(renamed=tuple(renamed), events=tuple(events))


def _event(join: Join, name: int, border: int) -> Event:
    looks = "" if math.isnan(join.odds) else f", looks {join.odds:.1f}"
    if math.isnan(join.score):
        why = f"hidden for {join.gap:.1f} s over the border at frame {border}"
    else:
        why = (
            f"by its places in {join.frames} frames that both parts at the border of frame {border} saw: "
            f"global similarity {join.score:.2f}"
        )
    why += f"; log odds {join.sure:.1f}{looks}"
    confidence = round(1.0 / (1.0 + math.exp(-join.sure)), 6)
    return Event(JOINED, join.begin, join.end, (name,), confidence=confidence, why=why)


def _borders(stitched: Stitched) -> tuple[Border, ...]:
    found = []
    for number, frame in enumerate(stitched.handovers, 1):
        here = [one for one in stitched.joins if one.later[0] == number]
        hidden = sum(math.isnan(one.score) for one in here)
        found.append(Border(frame, len(here) - hidden, hidden))
    return tuple(found)

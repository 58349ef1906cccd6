"""Why a row of a run has its id: the figures of its link as the tracker put them down, and the events about it.

Ids are the settled ones, as results have them, whatever they were called when a reason was put down.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from perdure.errors import ParameterError
from perdure.files.log import Entry
from perdure.fold import Corrections, coherent, settle_with
from perdure.types import Event, Explanation, Renamed, Report, Status, Tracks

DECIDING = ("exchanged", "found_again", "joined", "mended", "resolved")  # kinds of events that say whose an id is


class Share(NamedTuple):
    """What one feature says of a link, and how much of the score is its."""

    feature: str
    link: float  # similarity to the last object (eq. 10)
    whole: float  # with the long-term similarity (eq. 17)
    weight: float
    counts: float  # its share of the global similarity (eq. 16)


@dataclass(frozen=True)
class Reason:
    """Why a target has got an object in one frame."""

    frame: int
    why: str
    score: float
    shares: tuple[Share, ...]
    runner_up: tuple[int, float] | None  # the other id that the object fits best, and its score
    other_region: tuple[int, float] | None  # the other region that the target fits best, and its score

    @property
    def margin(self) -> float | None:
        """By how much the score is above the best rival's; None where there is none."""
        rivals = [one[1] for one in (self.runner_up, self.other_region) if one is not None]
        return self.score - max(rivals) if rivals else None

    @property
    def doubt(self) -> tuple[float, int]:
        """What sorts the most doubtful first: the margin, or without a rival the score."""
        return (self.score if self.margin is None else min(self.margin, self.score), self.frame)

    @property
    def waned(self) -> float:
        """What was taken off since the target had not been seen for a while."""
        return sum(one.counts for one in self.shares) - self.score


@dataclass(frozen=True)
class Told:
    """What a run tells of one id."""

    id: int
    rows: Tracks  # all settled ones, by frame
    reasons: dict[int, Reason]  # by frame
    events: tuple[Event, ...]  # in the order of their beginnings
    any_reasons: bool  # whether the run has any, of whatever id

    def row(self, frame: int) -> int:
        """Return which row is that of a frame.

        Raises
        ------
        ParameterError
            If there is none, with the nearest ones.
        """
        place = int(np.searchsorted(self.rows.frames, frame))
        if place < len(self.rows) and self.rows.frames[place] == frame:
            return place
        near = " and ".join(str(int(one)) for one in self.rows.frames[max(place - 1, 0) : place + 1])
        raise ParameterError(f"id {self.id} has no row in frame {frame}; the nearest is in {near} (frames from 0)")

    def around(self, frame: int) -> tuple[int | None, int | None]:
        """Return the frames before and after one in which the target was seen; None where there is none."""
        seen = self.rows.frames[~self.rows.inferred]
        before, after = seen[seen < frame], seen[seen > frame]
        return int(before[-1]) if len(before) else None, int(after[0]) if len(after) else None

    def doubtful(self, most: int) -> list[Reason]:
        """Return the links of least margin, the most doubtful first."""
        return sorted(self.reasons.values(), key=lambda one: one.doubt)[:most]

    def about(self, frame: int) -> list[Event]:
        """Return the events that a frame lies in, and before them the last one that decided whose the id is."""
        earlier = [one for one in self.events if one.kind in DECIDING and one.end < frame]
        return earlier[-1:] + [one for one in self.events if one.begin <= frame <= one.end]

    def remark(self, frame: int) -> str:
        """Return what there is to say of a row without a reason; nothing where the tracker puts none down."""
        row, (before, after) = self.row(frame), self.around(frame)
        if self.rows.inferred[row]:
            return _unseen(int(self.rows.status[row]), before, after)
        if not self.any_reasons:
            return ""
        if any(one.kind == "found_again" and one.begin <= frame <= one.end for one in self.events):
            return "a newcomer's, who had no id yet and was then found to be this one"
        first = min(self.reasons, default=None)
        if first is None or frame < first:
            begin = "no link of it was" if first is None else f"from frame {first} on its links are"
            return f"it had no id yet when this was seen, and was told late: {begin} explained"
        return "the link was made by no score, but by what the zones let expect, or by hand"


def told(read: Callable[[], Iterable[Entry]], identity: int) -> Told:
    """Return what a log tells of one id; `read` is called twice.

    Raises
    ------
    ParameterError
        If there is no such id; with what has become of it, if it was another's.
    """
    corrections = Corrections.of(entry.report for entry in read())
    reasons: dict[int, Reason] = {}
    events: list[Event] = []
    numbers: set[int] = set()
    parts: list[Tracks] = []
    any_reasons = False

    def passing() -> Iterator[Report]:
        nonlocal any_reasons
        for number, entry in enumerate(read()):
            any_reasons = any_reasons or bool(entry.report.explanations)
            for one in entry.report.explanations:
                if corrections.identity(one.id, entry.frame, number) == identity:
                    reasons[entry.frame] = reason_of(one, entry.frame, number, corrections)
            settled = (corrections.event(one, number) for one in entry.report.events)
            events.extend(one for one in settled if identity in one.ids)
            yield entry.report

    for _, rows in settle_with(corrections, passing()):
        numbers.update(rows.ids.tolist())
        if identity in rows.ids:
            parts.append(rows.take(rows.ids == identity))
    if not parts:
        raise ParameterError(_unknown(identity, numbers, corrections))
    return Told(identity, Tracks.join(parts), reasons, tuple(coherent(events, numbers)), any_reasons)


def most_doubtful(read: Callable[[], Iterable[Entry]], most: int) -> list[tuple[int, Reason]]:
    """Return the settled ids and reasons of the most doubtful links of a run, the worst first; `read` is called twice."""
    corrections = Corrections.of(entry.report for entry in read())

    def every() -> Iterator[tuple[int, Reason]]:
        for number, entry in enumerate(read()):
            for one in entry.report.explanations:
                identity = corrections.identity(one.id, entry.frame, number)
                if identity:
                    yield identity, reason_of(one, entry.frame, number, corrections)

    return heapq.nsmallest(most, every(), key=lambda one: (one[1].doubt, one[0]))


def reason_of(one: Explanation, frame: int, number: int, corrections: Corrections) -> Reason:
    """Return the reason that an explanation of report `number` gives, with settled ids."""
    figures: dict[str, dict[str, float]] = {}
    for key, value in one.figures.items():
        kind, _, name = key.partition(":")
        figures.setdefault(kind, {})[name] = float(value)
    weights, whole, link = (figures.get(kind, {}) for kind in ("weight", "global", "link"))
    total = sum(weights.values()) or 1.0
    shares = [
        Share(name, link.get(name, 0.0), whole.get(name, 0.0), weight, whole.get(name, 0.0) * weight / total)
        for name, weight in weights.items()
    ]
    rivals = {
        kind: next(((int(name), score) for name, score in figures.get(kind, {}).items()), None)
        for kind in ("runner_up", "other_region")
    }
    rival = rivals["runner_up"]
    if rival is not None:
        rival = (corrections.identity(rival[0], frame, number), rival[1])
    score = figures.get("score", {}).get("", 0.0)
    shares.sort(key=lambda part: -part.weight)
    return Reason(frame, one.why, score, tuple(shares), rival, rivals["other_region"])


def as_value(one: Reason) -> dict[str, Any]:
    """Return the reason of a link as plain values."""
    rivals = (("runner_up", "id", one.runner_up), ("other_region", "region", one.other_region))
    return {
        "frame": one.frame,
        "why": one.why,
        "score": one.score,
        "margin": None if one.margin is None else round(one.margin, 4),
        "waned": round(one.waned, 4),
        "features": {
            part.feature: {
                "link": part.link,
                "global": part.whole,
                "weight": part.weight,
                "counts": round(part.counts, 4),
            }
            for part in one.shares
        },
        **{name: None if rival is None else {key: rival[0], "score": rival[1]} for name, key, rival in rivals},
    }


def _unseen(status: int, before: int | None, after: int | None) -> str:
    """Where a row comes from that rests on nothing seen."""
    if status == Status.LOST:
        where = "not seen: it is where its last speed would bring it"
    elif before is not None and after is not None:
        return f"not seen: filled in between frames {before} and {after}, in which it was seen"
    else:
        where = "not seen: it is believed there"
    known = [f"seen last in frame {before}"] if before is not None else []
    known += [f"again in frame {after}"] if after is not None else []
    return "; ".join([where, *known])


def _unknown(identity: int, numbers: set[int], corrections: Corrections) -> str:
    """Say that there is no such id, and what has become of it."""
    changed = next((one for _, one in corrections.by_id.get(identity, ()) if isinstance(one, Renamed)), None)
    now = 0 if changed is None else corrections.identity(identity, changed.begin, -1)
    if now:
        return f"there is no id {identity} any more: it turned out to be {now}; ask for --id {now}"
    if identity in corrections.by_id:
        return f"there is no id {identity} any more: its rows were taken back"
    if not numbers:
        return f"there is no id {identity}: the run has no tracks"
    near = sorted(sorted(numbers), key=lambda one: abs(one - identity))[:3]
    return f"there is no id {identity} in the run; it has {len(numbers)}, the nearest {', '.join(map(str, near))}"

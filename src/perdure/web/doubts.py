"""What may be wrong in a run, the most doubtful first: decisions on identities, narrow links, loose ends.

=====================  =================================================================================
kind                   doubt
=====================  =================================================================================
resolved, found_again, 1 - the confidence with which it was decided
joined
mended, exchanged,     these carry no figure: `PLAIN`
approximated, lost
narrow                 a stretch of links that another id would have had nearly as well: by their least margin
appeared               an id that begins in the midst of the picture, after the first second: `PLAIN`
=====================  =================================================================================

Doubtful is what has a doubt of `LIMIT` or more: what was decided on log odds of 2, as for the last of several who meet,
when all others are known, is not.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.fold import Corrections, coherent
from perdure.reasons import DECIDING
from perdure.types import Event
from perdure.web.ledger import Ledger
from perdure.web.settled import Settled

LIMIT = 0.12  # of 1: log odds of 2 leave 0.119
PLAIN = {"mended": 0.5, "exchanged": 0.5, "approximated": 0.6, "lost": 0.4, "appeared": 0.3}
_LOOSE = ("narrow", "appeared")
_MET = re.compile(r"\(met ([0-9, ]+)\)")
_EDGE = 0.03  # of the picture's longer side: who is nearer to its border came over it
_WAIT = 10.0  # s between the end of one and the beginning of another who may be the same
_REACH = 0.35  # of the picture's longer side, so far apart the two may be
_APART = 10  # frames between two narrow links of one stretch
_MOST_PARTNERS = 4

Key = tuple[int, int]
Float = NDArray[np.floating]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Doubt:
    """An event that may be looked at.

    Parameters
    ----------
    key : (int, int)
        The number of its report in the log and its number there; for a loose end, which no report names, -1 less the
        number of its frame, and its id as first said.
    partners : tuple of int
        Who else it might have been, the likeliest first.
    """

    key: Key
    kind: str
    begin: int
    end: int
    ids: tuple[int, ...]
    partners: tuple[int, ...]
    doubt: float
    why: str
    zone: str = ""


@dataclass(frozen=True)
class Ends:
    """Where each settled id begins and ends: (N,) and boxes (N, 4), sorted by id."""

    ids: Index
    begins: Index
    ends: Index
    first: Float
    last: Float

    @staticmethod
    def of(settled: Settled) -> Ends:
        """Read them off the rows, those without groups."""
        rows = settled.rows
        order = np.lexsort((rows.frames, rows.ids))
        order = order[~np.isin(rows.ids[order], settled.group_ids())]
        ids = rows.ids[order]
        names, begins, counts = np.unique(ids, return_index=True, return_counts=True)
        first, last = order[begins], order[begins + counts - 1]
        return Ends(names, rows.frames[first], rows.frames[last], rows.boxes[first], rows.boxes[last])


def doubts(ledger: Ledger, known: Corrections, settled: Settled, size: tuple[int, int], fps: float) -> list[Doubt]:
    """Return every decision on identities and every loose end, the most doubtful first.

    `known` are the run's own corrections and those by hand, `settled` the rows with all of them applied, `size` the width
    and height of the picture.
    """
    ends = Ends.of(settled)
    found = [
        *_decisions(ledger.events, known, ends, size, fps),
        *_narrow_links(ledger, known),
        *_appeared(ledger, known, ends, size, fps),
    ]
    return sorted(found, key=lambda one: (-one.doubt, one.begin, one.key))


def settled_events(ledger: Ledger, known: Corrections, ids: Collection[int]) -> list[tuple[Key, Event]]:
    """Return all events that are still true with their settled ids, in the order in which they began.

    `ids` are those that have rows.
    """
    settled = [known.event(event, number) for number, _, event in ledger.events]
    keys = {
        id(after): (number, place)
        for after, (number, place, before) in zip(settled, ledger.events, strict=True)
        if after.ids or not before.ids
    }
    return [(keys[id(one)], one) for one in coherent(settled, ids) if id(one) in keys]


def _decisions(
    events: Sequence[tuple[int, int, Event]], known: Corrections, ends: Ends, size: tuple[int, int], fps: float
) -> Iterable[Doubt]:
    for number, place, event in events:
        if event.kind not in DECIDING and event.kind not in PLAIN:
            continue
        after = known.event(event, number)
        if not after.ids:
            continue
        doubt = max(1.0 - event.confidence, PLAIN.get(event.kind, 0.0))
        met = [int(one) for words in _MET.findall(event.why) for one in words.replace(",", " ").split()]
        others = [*after.ids[1:], *(known.identity(one, event.begin, number) for one in met)]
        if event.kind == "lost":
            others += _followers(ends, after.ids[0], size, fps)
        partners = tuple(dict.fromkeys(one for one in others if one and one != after.ids[0]))
        key = (number, place)
        yield Doubt(
            key, event.kind, event.begin, event.end, after.ids, partners, round(doubt, 4), event.why, event.zone
        )


def _narrow_links(ledger: Ledger, known: Corrections) -> Iterable[Doubt]:
    """Stretches of links of one id that one other would have had nearly as well."""
    groups: dict[tuple[int, int], list[tuple[int, float, int]]] = {}
    for number, frame, said, rival, margin in ledger.narrow:
        both = known.identity(said, frame, number), known.identity(rival, frame, number)
        if all(both) and both[0] != both[1]:
            groups.setdefault((min(both), max(both)), []).append((frame, margin, said))
    for (one, other), links in groups.items():
        links.sort()
        frames = np.array([frame for frame, _, _ in links])
        for part in np.split(np.arange(len(links)), np.flatnonzero(np.diff(frames) > _APART) + 1):
            first, least = links[part[0]], min(links[k][1] for k in part)
            doubt = float(np.clip(0.5 - 4.0 * least, 0.0, 1.0))
            links_of = "a link" if len(part) == 1 else f"{len(part)} links"
            why = f"{links_of} that the other would have had nearly as well, by {least:+.2f} at the least"
            yield Doubt(
                (-1 - first[0], first[2]),
                "narrow",
                first[0],
                links[part[-1]][0],
                (one, other),
                (other,),
                round(doubt, 4),
                why,
            )


def _appeared(
    ledger: Ledger, known: Corrections, ends: Ends, size: tuple[int, int], fps: float
) -> Iterable[Doubt]:
    """Who begins in the midst of the picture, after the first second."""
    if not len(ledger.frames):
        return
    since = ledger.frames[0] + round(fps)
    inside = _from_border(ends.first, size) > _EDGE * max(size)
    for k in np.flatnonzero(inside & (ends.begins > since)):
        identity, frame = int(ends.ids[k]), int(ends.begins[k])
        why = "begins in the midst of the picture"
        partners = tuple(_predecessors(ends, int(k), size, fps))
        if partners:
            why += f"; {partners[0]} ended near, {(frame - int(ends.ends[ends.ids == partners[0]][0])) / fps:.1f} s before"
        yield Doubt(
            (-1 - frame, identity), "appeared", frame, frame, (identity,), partners, PLAIN["appeared"], why
        )


def _from_border(boxes: Float, size: tuple[int, int]) -> Float:
    """How far boxes (N, 4) are from the picture's border; 0 at it, and beyond it."""
    x1, y1, x2, y2 = boxes.T
    nearest = np.minimum.reduce([x1, y1, size[0] - x2, size[1] - y2])
    return np.asarray(np.maximum(0, nearest), np.float64)


def _predecessors(ends: Ends, k: int, size: tuple[int, int], fps: float) -> list[int]:
    """Ids that ended before the k-th began, near in place and time, the nearest first."""
    waited = (ends.begins[k] - ends.ends) / fps
    return _nearest(ends, ends.last, ends.first[k], waited, size)


def _followers(ends: Ends, identity: int, size: tuple[int, int], fps: float) -> list[int]:
    """Ids that began after one ended, near in place and time, the nearest first."""
    (place,) = np.nonzero(ends.ids == identity)
    if not len(place):
        return []
    waited = (ends.begins - ends.ends[place[0]]) / fps
    return _nearest(ends, ends.first, ends.last[place[0]], waited, size)


def _nearest(ends: Ends, boxes: Float, box: Float, waited: Float, size: tuple[int, int]) -> list[int]:
    middles = (boxes[:, :2] + boxes[:, 2:]) / 2
    away = np.hypot(*(middles - (box[:2] + box[2:]) / 2).T)
    near = (waited > 0) & (waited <= _WAIT) & (away <= _REACH * max(size))
    cost = away / max(size) + 0.02 * waited
    order = np.flatnonzero(near)[np.argsort(cost[near], kind="stable")]
    return [int(one) for one in ends.ids[order[:_MOST_PARTNERS]]]

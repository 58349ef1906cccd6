"""Two who met and parted: each must look as it did before (ours).

Links compare with what was just seen, which is least sure where two touch: a box may then hold both. Who has met
somebody is therefore compared once more, when both are seen by themselves again, with how each looked before; where
the exchange is likelier, the two change identities from the moment at which they were nearest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import areas, intersections
from perdure.features.feature import Feature
from perdure.maths.discriminant import log_odds
from perdure.trackers.multifeature.recalling import Telling, alike
from perdure.trackers.multifeature.targets import NEVER, Targets
from perdure.types import Boxes, Event, Frame, Renamed

Index = NDArray[np.intp]
_TOUCH = 0.1  # share of a box in another from which two meet
_NEEDED, _ENOUGH = 2, 4  # looks after the meeting from which it is judged, and after which it is settled
_LONGEST = 12.0  # s after which a meeting is forgotten
OWN = ("keys", "ids", "born", "first", "named", "entry")  # what belongs to the identity, not to the body


@dataclass(frozen=True, eq=False)
class Meetings:
    """Who has met whom, a row each, until it is settled who is who."""

    keys: NDArray[np.int64]  # (C, 2) of the two
    begin: NDArray[np.float64]  # (C,) s
    last: NDArray[np.float64]  # (C,) s when they last touched
    nearest: NDArray[np.int64]  # (C,) frame in which they overlapped most
    overlap: NDArray[np.float64]  # (C,) and how much: intersection over the smaller area

    @staticmethod
    def none() -> Meetings:
        """Return that nobody has met."""
        nothing = np.zeros(0)
        whole = nothing.astype(np.int64)
        return Meetings(whole.reshape(0, 2), nothing, nothing, whole, nothing)

    def take(self, index: NDArray[np.bool_]) -> Meetings:
        """Return some of them."""
        return Meetings(*(getattr(self, one.name)[index] for one in fields(self)))


class Exchanged(NamedTuple):
    """Who has changed identities with whom."""

    targets: Targets
    meetings: Meetings
    renamed: tuple[Renamed, ...]
    events: tuple[Event, ...]


def met(meetings: Meetings, targets: Targets, where: Boxes, active: NDArray[np.bool_], frame: Frame) -> Meetings:
    """Return the meetings after a frame in which targets are at boxes `where` (N, 4); `active` (N,) may meet."""
    rows = np.flatnonzero(active)
    boxes = where[rows]
    least = np.minimum(areas(boxes)[:, None], areas(boxes)[None])
    share = np.triu(intersections(boxes, boxes) / np.maximum(least, 1e-6), 1)
    one, other = np.nonzero(share > _TOUCH)
    pairs = np.sort(np.stack([targets.keys[rows[one]], targets.keys[rows[other]]], axis=1), axis=1)
    known = {tuple(both): number for number, both in enumerate(meetings.keys.tolist())}
    columns = {name.name: getattr(meetings, name.name).copy() for name in fields(meetings)}
    fresh: list[tuple[int, int, float]] = []
    for both, overlap in zip(pairs.tolist(), share[one, other].tolist(), strict=True):
        number = known.get(tuple(both))
        if number is None:
            fresh.append((both[0], both[1], overlap))
            continue
        columns["last"][number] = frame.time
        if overlap >= columns["overlap"][number]:
            columns["overlap"][number], columns["nearest"][number] = overlap, frame.index
    now = np.full(len(fresh), frame.time)
    new = Meetings(
        np.array([row[:2] for row in fresh], np.int64).reshape(-1, 2),
        now,
        now,
        np.full(len(fresh), frame.index, np.int64),
        np.array([row[2] for row in fresh], np.float64),
    )
    joined = (np.concatenate([columns[one.name], getattr(new, one.name)]) for one in fields(meetings))
    return Meetings(*joined)


def exchange(
    kinds: Sequence[Feature],
    telling: Telling,
    targets: Targets,
    meetings: Meetings,
    fresh: Index,
    frame: Frame,
    sure: float,
) -> Exchanged:
    """Judge the meetings of those of whom there is a `fresh` look; `sure` is the least log odds of an exchange."""
    rows = {key: row for row, key in enumerate(targets.keys.tolist())}
    new = set(targets.keys[fresh].tolist())
    kept = frame.time - meetings.last <= _LONGEST
    renamed: list[Renamed] = []
    events: list[Event] = []
    for number, (one, other) in enumerate(meetings.keys.tolist()):
        if one not in rows or other not in rows:
            kept[number] = False
            continue
        if not kept[number] or not ({one, other} & new) or not kinds:
            continue
        pair = np.array([rows[one], rows[other]])
        odds, count = _odds(
            kinds, telling, targets, pair, float(meetings.begin[number]), float(meetings.last[number])
        )
        if count >= _ENOUGH:
            kept[number] = False
        if odds < sure or not (targets.ids[pair] > 0).all():
            continue
        begin = int(meetings.nearest[number])
        ids = [int(one) for one in targets.ids[pair]]
        renamed += [Renamed(ids[0], ids[1], begin, frame.index), Renamed(ids[1], ids[0], begin, frame.index)]
        events.append(
            Event(
                "exchanged",
                begin,
                frame.index,
                tuple(ids),
                why=f"by their looks before and after they met: log odds {odds:.1f}",
            )
        )
        targets = _changed(targets, pair, float(meetings.begin[number]))
        kept[number] = False
    return Exchanged(targets, meetings.take(kept), tuple(renamed), tuple(events))


def _odds(
    kinds: Sequence[Feature], telling: Telling, targets: Targets, pair: Index, begin: float, end: float
) -> tuple[float, int]:
    """How much likelier it is that two have changed identities, in nats, and how many looks there are of it.

    One of them may be lost: the other alone is then compared with both. -inf where too little was seen.
    """
    when = targets.looked[pair]  # (2, E)
    before, after = (when > NEVER) & (when < begin), when > end
    counts = after.sum(axis=1)
    lost = targets.missed[pair] > 0
    if not before.any(axis=1).all() or (counts[~lost] < _NEEDED).any() or lost.all():
        return -np.inf, 0
    body, identity = (part.ravel() for part in np.meshgrid([0, 1], [0, 1], indexing="ij"))
    seen = counts[body] > 0
    body, identity = body[seen], identity[seen]
    mine = {kind.name: targets.looks[kind.name][pair[identity]] for kind in kinds}
    theirs = {kind.name: targets.looks[kind.name][pair[body]] for kind in kinds}
    numbers = alike(kinds, mine, before[identity], theirs, after[body]).astype(np.float64)
    odds = log_odds(telling.same, telling.other, numbers)
    return float(odds[body != identity].sum() - odds[body == identity].sum()), int(counts[~lost].min())


def _changed(targets: Targets, pair: Index, begin: float) -> Targets:
    """The targets, of which two have changed identities: looks since `begin` stay with the bodies."""
    back = pair[::-1]
    columns: dict[str, NDArray[Any]] = {}
    for name in OWN:
        columns[name] = getattr(targets, name).copy()
        columns[name][pair] = columns[name][back]
    before = targets.looked[pair] < begin  # (2, E)
    looked, looks = targets.looked.copy(), {name: some.copy() for name, some in targets.looks.items()}
    size = looked.shape[1]
    for one, other in ((0, 1), (1, 0)):
        order = np.concatenate([np.flatnonzero(before[other]), size + np.flatnonzero(~before[one])])[-size:]
        places: list[tuple[NDArray[Any], NDArray[Any], float]] = [(looked, targets.looked, NEVER)]
        places += [(looks[name], targets.looks[name], 0.0) for name in looks]
        for column, source, nothing in places:
            both = np.concatenate(
                [source[pair[other]], source[pair[one]]]
            )  # the other's old ones, its own new ones
            column[pair[one]] = nothing
            column[pair[one], size - len(order) :] = both[order]
    return targets.replace(**columns, looked=looked, looks=looks)

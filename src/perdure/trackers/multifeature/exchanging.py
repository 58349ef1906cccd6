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
_MORE = 2.0  # nats by which an exchange must be likelier for each more that takes part
_BORN = 0.3  # s before the meeting, from which one seen first may be who was lost in it
_NEVER = 1e3  # nats against what cannot be
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
    keys: dict[int, int]  # of who has turned out to be whom
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
    """Judge the meetings of those of whom there is a `fresh` look; `sure` is the least log odds of an exchange.

    All who met, one by another, are judged together: three may have changed places in a ring. One of them may be lost,
    and one may have been seen first when they parted: then it may be who was lost.
    """
    rows = {key: row for row, key in enumerate(targets.keys.tolist())}
    there = np.array([one in rows and other in rows for one, other in meetings.keys.tolist()], np.bool_)
    meetings = meetings.take(there & (frame.time - meetings.last <= _LONGEST)) if len(there) else meetings
    found = Exchanged(targets, meetings, {}, (), ())
    if not kinds or not len(meetings.keys):
        return found
    new = set(targets.keys[fresh].tolist())
    for company in _companies(meetings.keys):
        if new & set(company):
            members = np.array([rows[key] for key in company])
            found = _judged(kinds, telling, found, members, frame, sure)
    return found._replace(meetings=_unsettled(found.targets, found.meetings))


class _Company(NamedTuple):
    """Who may have changed places."""

    bodies: Index  # (B,) rows of targets that are seen, and were by themselves since
    identities: Index  # (I,) rows of targets whose looks are known from before
    newborn: frozenset[int]  # rows of bodies that were seen first when they parted
    odds: NDArray[np.float64]  # (I, B) how likely each is each, in nats; -inf where it cannot be
    own: NDArray[np.float64]  # (B,) the same of each body and its present identity


def _judged(
    kinds: Sequence[Feature], telling: Telling, found: Exchanged, members: Index, frame: Frame, sure: float
) -> Exchanged:
    """Give the identities of a company to the bodies which they fit best, if that is likelier by far than as it is."""
    targets = found.targets
    spans = _spans(targets, found.meetings, members)
    company = _likely(kinds, telling, targets, members, spans)
    if len(company.bodies) == 0 or len(members) < 2:
        return found
    from scipy.optimize import linear_sum_assignment  # half a second to load

    identity, body = linear_sum_assignment(
        np.where(np.isfinite(company.odds), company.odds, -_NEVER), maximize=True
    )
    chosen = dict(zip(company.bodies[body].tolist(), company.identities[identity].tolist(), strict=True))
    changed = {one: other for one, other in chosen.items() if one != other}
    gain = float(company.odds[identity, body].sum() - company.own.sum())
    if len(chosen) < len(company.bodies) or not changed or gain < sure + _MORE * (len(changed) - 1):
        return found
    return _given(found, changed, company, spans, members, frame, gain)


def _likely(
    kinds: Sequence[Feature], telling: Telling, targets: Targets, members: Index, spans: _Spans
) -> _Company:
    """How likely each identity is each body, by looks before and after."""
    when = targets.looked[members]  # (M, E)
    before = (when > NEVER) & (when < spans.begin[:, None])
    after = when > spans.end[:, None]
    seen = targets.missed[members] == 0
    ready = seen & (after.sum(axis=1) >= _NEEDED)
    newborn = ready & ~before.any(axis=1) & (targets.born[members] >= spans.begin - _BORN)
    known = before.any(axis=1) & (ready | ~seen)
    ready &= known | newborn
    bodies, identities = np.flatnonzero(ready), np.flatnonzero(known | newborn)
    odds = np.full((len(identities), len(bodies)), -np.inf)
    odds[identities[:, None] == bodies] = 0.0  # of one seen first when they parted nothing is known
    one, other = (
        part.ravel()
        for part in np.meshgrid(np.flatnonzero(known[identities]), np.arange(len(bodies)), indexing="ij")
    )
    if len(one):
        mine, theirs = identities[one], bodies[other]
        looks = [{kind.name: targets.looks[kind.name][members[part]] for kind in kinds} for part in (mine, theirs)]
        numbers = alike(kinds, looks[0], before[mine], looks[1], after[theirs]).astype(np.float64)
        odds[one, other] = log_odds(telling.same, telling.other, numbers)
    own = np.array([odds[identities == body, number].sum() for number, body in enumerate(bodies.tolist())])
    return _Company(members[bodies], members[identities], frozenset(members[newborn].tolist()), odds, own)


class _Spans(NamedTuple):
    """When each member (M,) of a company was not by itself."""

    begin: NDArray[np.float64]  # s
    end: NDArray[np.float64]  # s
    nearest: NDArray[np.int64]  # the last frame in which it was nearest to another


def _spans(targets: Targets, meetings: Meetings, members: Index) -> _Spans:
    mine = (meetings.keys[:, :, None] == targets.keys[members]).any(axis=1)  # (C, M)
    begin = np.where(mine, meetings.begin[:, None], np.inf).min(axis=0)
    end = np.where(mine, meetings.last[:, None], -np.inf).max(axis=0)
    latest = np.where(mine, meetings.nearest[:, None], -1).max(axis=0)
    return _Spans(begin, end, latest)


def _given(
    found: Exchanged,
    changed: dict[int, int],
    company: _Company,
    spans: _Spans,
    members: Index,
    frame: Frame,
    gain: float,
) -> Exchanged:
    """The targets, whose bodies have the identities `changed` gives them, body to identity.

    All change in one frame, so that no two are one in any; where one without a name would have to take part in
    that otherwise than by becoming somebody, the exchange waits until it has one.
    """
    targets, keys = found.targets, found.targets.keys.tolist()
    at = {row: number for number, row in enumerate(members.tolist())}
    freed = sorted(set(changed) - set(changed.values()))  # identities without a body: they go to who is lost
    sources = {**changed, **dict(zip(sorted(set(changed.values()) - set(changed)), freed, strict=True))}
    born = [row for row in freed if row in company.newborn]
    begin = _moment(found, changed, born, spans, at)
    over = {row for row in sources if row not in changed and targets.latest[row] < begin}  # needs no identity
    renamed, renewed = list(found.renamed), dict(found.keys)
    for row, source in sources.items():
        old, new = int(targets.ids[row]), int(targets.ids[source])
        renewed[keys[row]] = keys[source]
        if row in over or (row in born and old == 0 and new > 0):
            continue  # nothing was said of it since
        if not (old > 0 and new > 0):
            return found
        renamed.append(Renamed(old, new, begin, frame.index))
    ids = tuple(sorted({int(targets.ids[row]) for row in sources if targets.ids[row] > 0}))
    why = f"by their looks before and after they met: log odds {gain:.1f}"
    events = (*found.events, Event("exchanged", begin, frame.index, ids, why=why))
    after = _moved(targets, sources, {row: float(spans.begin[at[row]]) for row in sources})
    nobody = [row for row in over if sources[row] in born]
    ids_after = after.ids.copy()
    ids_after[nobody] = 0
    return Exchanged(after.replace(ids=ids_after), found.meetings, renewed, tuple(renamed), events)


def _moment(
    found: Exchanged, changed: dict[int, int], born: Sequence[int], spans: _Spans, at: dict[int, int]
) -> int:
    """The frame from which identities are exchanged: when one of them was seen first, else when the last two met."""
    targets, meetings = found.targets, found.meetings
    if born:
        return int(targets.first[born].min())
    moments = []
    for body, identity in changed.items():
        one, other = targets.keys[[body, identity]]
        both = ((meetings.keys == one) | (meetings.keys == other)).all(axis=1)
        moments.append(int(meetings.nearest[both][-1] if both.any() else spans.nearest[at[body]]))
    return max(moments)


def _moved(targets: Targets, sources: dict[int, int], begin: dict[int, float]) -> Targets:
    """The targets, each row of `sources` with the identity of another: looks since `begin` stay with the bodies."""
    columns: dict[str, NDArray[Any]] = {name: getattr(targets, name).copy() for name in OWN}
    looked, looks = targets.looked.copy(), {name: some.copy() for name, some in targets.looks.items()}
    size = looked.shape[1]
    for row, source in sources.items():
        for name in OWN:
            columns[name][row] = getattr(targets, name)[source]
        old = np.flatnonzero(targets.looked[source] < begin[source])
        order = np.concatenate([old, size + np.flatnonzero(targets.looked[row] >= begin[row])])[-size:]
        places: list[tuple[NDArray[Any], NDArray[Any], float]] = [(looked, targets.looked, NEVER)]
        places += [(looks[name], targets.looks[name], 0.0) for name in looks]
        for column, before, nothing in places:
            both = np.concatenate([before[source], before[row]])  # the other's old ones, its own new ones
            column[row] = nothing
            column[row, size - len(order) :] = both[order]
    return targets.replace(**columns, looked=looked, looks=looks)


def _companies(keys: NDArray[np.int64]) -> list[tuple[int, ...]]:
    """Who met whom, one by another: sets of keys (C, 2), each in order."""
    company: dict[int, set[int]] = {}
    for one, other in keys.tolist():
        both = company.get(one, {one}) | company.get(other, {other})
        for key in both:
            company[key] = both
    return sorted({tuple(sorted(both)) for both in company.values()})


def in_doubt(targets: Targets, meetings: Meetings) -> NDArray[np.float64]:
    """Return since when (N,) each has been with others, so that it is not settled who it is; inf for who has not."""
    since = np.full(len(targets), np.inf)
    rows = {key: row for row, key in enumerate(targets.keys.tolist())}
    for pair, begin in zip(meetings.keys.tolist(), meetings.begin.tolist(), strict=True):
        for key in pair:
            if key in rows:
                since[rows[key]] = min(since[rows[key]], begin)
    return since


def _unsettled(targets: Targets, meetings: Meetings) -> Meetings:
    """The meetings of companies of which too little has been seen since to leave it at that."""
    rows = {key: row for row, key in enumerate(targets.keys.tolist())}
    settled: set[int] = set()
    for company in _companies(meetings.keys):
        members = np.array([rows[key] for key in company if key in rows], np.intp)
        end = _spans(targets, meetings, members).end
        looks = (targets.looked[members] > end[:, None]).sum(axis=1)
        if (looks[targets.missed[members] == 0] >= _ENOUGH).all():
            settled |= set(company)
    return meetings.take(np.array([one not in settled for one, _ in meetings.keys.tolist()], np.bool_))

"""Tracks of the parts of a long film made one: who of one part is who of the next, and from which frame the next is told.

Neighbouring parts overlap. Who was seen in the same places of the overlap by both is one: the score is the multi-feature
tracker's global similarity of places and sizes (eq. 10, eq. 16), nearest the frame of the handover first, and the log
odds of looks. Who was hidden there is known again by looks alone, where they leave no doubt. Two identities whom one part
has seen in one frame at two places are never one, by whatever chain of parts.

The handover is where both parts agree best on who is where, about the middle: before it the later part has not seen
enough, behind it the earlier one has not seen what follows.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import areas, intersections
from perdure.features.feature import Feature
from perdure.features.pool import made
from perdure.looks import Portraits, telling
from perdure.maths.discriminant import log_odds
from perdure.trackers.multifeature.fathers import optimal
from perdure.trackers.multifeature.links import weighted
from perdure.trackers.multifeature.recalling import FARTHEST, SLACK, alike, inside
from perdure.trackers.multifeature.targets import NEVER
from perdure.trackers.multifeature.weights import DEFAULT, GATE
from perdure.types import Boxes, Frame, Regions, Scene, Status, Tracks

Index = NDArray[np.intp]
_PLACES = ("displacement_2d", "shape_ratio", "area", "overlap")  # of the pool: what two rows of one frame tell
_SAME_PLACE = 0.5  # intersection over union from which two are at one place
_POSITION = 10.0  # nats that places tell at most
_NEAR = 1.0  # s about the handover within which places count most
_AGREED = 0.6  # global similarity from which both parts agree
_BEYOND = 0.25  # share of the overlap at its begin and end in which nothing is handed over


@dataclass(frozen=True)
class Recall:
    """When who was hidden over a border is known again by looks.

    Parameters
    ----------
    longest : float
        Seconds for which nobody saw it, at most.
    least : float
        Log odds of looks and way that are beyond doubt, in nats.
    margin : float
        Nats by which they must be above those of anybody else.
    """

    longest: float = 10.0
    least: float = 2.0
    margin: float = 2.0


class Life(NamedTuple):
    """Where and when one identity of a part was seen first and last."""

    first: int  # frame
    begin: float  # s
    origin: tuple[float, ...]  # box
    last: int  # frame
    end: float  # s
    place: tuple[float, ...]  # box
    kind: str  # class
    group: bool


@dataclass(frozen=True, eq=False)
class Part:
    """What stitching must know of the tracks of one part.

    Parameters
    ----------
    begin, end : int
        Its first frame, and the one behind its last.
    lives : mapping of identity to Life
    rows : Tracks
        Those of the frames that it has in common with a neighbour, without silhouettes.
    together : set of pairs of identities, the smaller first
        Whom it saw in one frame at two places.
    looks : Portraits
    """

    begin: int
    end: int
    lives: Mapping[int, Life]
    rows: Tracks
    together: frozenset[tuple[int, int]]
    looks: Portraits = field(default_factory=Portraits.none)

    @staticmethod
    def of(
        begin: int,
        end: int,
        settled: Iterable[Tracks],
        shared: Sequence[tuple[int, int]],
        looks: Portraits | None = None,
    ) -> Part:
        """Gather it from settled rows, frame by frame; `shared` are the spans in common with neighbours, end excluded."""
        lives: dict[int, Life] = {}
        kept: list[Tracks] = []
        together: set[tuple[int, int]] = set()
        for rows in settled:
            frame = int(rows.frames[0])
            if any(first <= frame < last for first, last in shared):
                kept.append(rows)
            seen = rows.take(_seen(rows))
            _note(lives, seen, set(rows.groups.tolist()))
            together |= _apart(seen.take(~np.isin(seen.ids, rows.groups)))
        return Part(begin, end, lives, Tracks.join(kept), frozenset(together), looks or Portraits.none())


class Join(NamedTuple):
    """Two identities of different parts that are one, and why.

    `earlier` and `later` are (number of the part, identity in it); `begin` and `end` the frames of the overlap in which
    both were seen, or between which nobody saw it; `score` is the global similarity there, NaN for who was hidden;
    `odds` the log odds of looks, NaN where nothing is known of them.
    """

    earlier: tuple[int, int]
    later: tuple[int, int]
    begin: int
    end: int
    frames: int
    score: float
    odds: float
    gap: float  # s for which nobody saw it


@dataclass(frozen=True)
class Stitched:
    """How parts become one.

    `handovers` are the frames from which each part but the first is told; `joins` who is who, in order of parts.
    """

    handovers: tuple[int, ...]
    joins: tuple[Join, ...]

    def span(self, parts: Sequence[Part], number: int) -> tuple[int, int]:
        """Return the first frame that is told of a part, and the one behind the last."""
        begin = parts[number].begin if number == 0 else self.handovers[number - 1]
        return begin, self.handovers[number] if number < len(self.handovers) else parts[number].end


def stitch(parts: Sequence[Part], scene: Scene, kinds: Sequence[Feature], recall: Recall = Recall()) -> Stitched:
    """Return which identities of the parts, given in order, are one; `kinds` are the features of their looks."""
    likeness = _Likeness(kinds, parts)
    chains = _Chains(parts)
    handovers = []
    for number in range(len(parts) - 1):
        border = _Border.of(parts[number], parts[number + 1], scene)
        handovers.append(border.handover)
        for join in _at_border(border, number, likeness):
            chains.join(join)
    for join in _hidden(parts, chains, likeness, scene, recall):
        chains.join(join)
    joins = sorted(chains.joins, key=lambda one: (one.later, one.earlier))
    return Stitched(tuple(handovers), tuple(joins))


def names(
    told: Sequence[Mapping[int, int]], joins: Sequence[Join]
) -> tuple[list[dict[int, int]], list[dict[int, int]]]:
    """Return by part for each identity the name it is said by, and the one that it has in the end.

    `told` are the identities of whom rows are told, by part, each with the first frame. Names count from 1 in the order
    in which they appear; what is said of who turns out to be another has a name behind all of these.
    """
    leader: dict[tuple[int, int], tuple[int, int]] = {}

    def first(one: tuple[int, int]) -> tuple[int, int]:
        while one in leader:
            one = leader[one]
        return one

    for join in joins:
        one, other = sorted((first(join.earlier), first(join.later)))
        if one != other:
            leader[other] = one
    order = sorted((frame, part, own) for part, some in enumerate(told) for own, frame in some.items())
    final: dict[tuple[int, int], int] = {}
    for _, part, own in order:
        final.setdefault(first((part, own)), len(final) + 1)
    said: list[dict[int, int]] = [{} for _ in told]
    after: list[dict[int, int]] = [{} for _ in told]
    used: set[int] = set()
    upcoming = len(final) + 1
    for _, part, own in order:
        name = final[first((part, own))]
        after[part][own] = name
        said[part][own] = upcoming if name in used else name
        upcoming += name in used
        used.add(name)
    return said, after


@dataclass(frozen=True, eq=False)
class _Border:
    """What two neighbouring parts say of the frames that both have seen."""

    earlier: Sequence[int]  # (A,) identities
    later: Sequence[int]  # (B,)
    similar: NDArray[np.float32]  # (F, A, B) global similarity in each frame; NaN where not both are seen
    frames: Sequence[int]  # (F,)
    times: NDArray[np.float64]  # (F,)
    handover: int

    @staticmethod
    def of(one: Part, other: Part, scene: Scene) -> _Border:
        first, behind = other.begin, min(one.end, other.end)
        mine, theirs = (_within(part.rows, first, behind) for part in (one, other))
        earlier, later = np.unique(mine.ids), np.unique(theirs.ids)
        frames = np.unique(np.concatenate([mine.frames, theirs.frames])).tolist()
        similar = np.full((len(frames), len(earlier), len(later)), np.nan, np.float32)
        times = np.zeros(len(frames))
        apart = np.zeros(len(frames))  # how far the two parts disagree
        for place, frame in enumerate(frames):
            here, there = (rows.take(rows.frames == frame) for rows in (mine, theirs))
            times[place] = (*here.times.tolist(), *there.times.tolist())[0]
            table = _similarity(here.boxes, there.boxes, scene)
            rows, columns = np.searchsorted(earlier, here.ids), np.searchsorted(later, there.ids)
            similar[place][np.ix_(rows, columns)] = table
            agreed = int((table >= _AGREED).any(axis=1).sum() + (table >= _AGREED).any(axis=0).sum())
            unsure = int((here.status != Status.VISIBLE).sum() + (there.status != Status.VISIBLE).sum())
            apart[place] = len(here) + len(there) - agreed + 0.5 * unsure
        handover = _handover(first, behind, dict(zip(frames, apart.tolist(), strict=True)))
        return _Border(earlier.tolist(), later.tolist(), similar, frames, times, handover)


def _handover(first: int, behind: int, apart: Mapping[int, float]) -> int:
    """The frame from which the later part is told: where both disagree least, of equals the nearest to the middle."""
    middle, margin = (first + behind) // 2, int(_BEYOND * (behind - first))
    known = range(min(first + margin, middle), max(behind - margin, middle + 1))

    def doubt(frame: int) -> tuple[float, int]:
        return apart.get(frame - 1, 0.0) + apart.get(frame, 0.0), abs(frame - middle)

    return min(known, key=doubt)


def _similarity(one: Boxes, other: Boxes, scene: Scene) -> NDArray[np.float32]:
    """The global similarity (A, B) of boxes of one frame, by their places and sizes; 0 for those that are too far apart."""
    rows, columns = (part.ravel() for part in np.indices((len(one), len(other))))
    here, there = Regions.of(boxes=one), Regions.of(boxes=other)
    blank, soon = Frame(0, 0.0), np.full(len(rows), 1.0 / max(scene.fps, 1e-3))
    values = {}
    for name, feature in made(_PLACES, scene).items():
        mine, theirs = (feature.describe({}, blank, some)[1] for some in (here, there))
        values[name] = feature.similarity(mine[rows], theirs[columns], soon)
    known = dict.fromkeys(values, np.ones(len(rows), np.bool_))
    score = np.where(values[GATE] > 0, weighted(values, known, DEFAULT.weights), 0.0)
    return np.asarray(score.reshape(len(one), len(other)), np.float32)


def _at_border(border: _Border, number: int, likeness: _Likeness) -> list[Join]:
    """Who of a part is who of the next, the surest first: those of the highest total of places and looks."""
    if not border.earlier or not border.later:
        return []
    place = np.searchsorted(border.frames, border.handover)
    middle = float(border.times[min(int(place), len(border.times) - 1)])
    weight = np.exp(-np.abs(border.times - middle) / _NEAR)[:, None, None]  # (F, 1, 1)
    both = ~np.isnan(border.similar)  # (F, A, B)
    total = (weight * both).sum(axis=0)
    above = (weight * np.where(both, border.similar - DEFAULT.similar, 0.0)).sum(axis=0)
    mean = np.divide(above, total, out=np.full_like(total, -1.0), where=total > 0)  # (A, B)
    rows, columns = np.nonzero(mean > 0)
    earlier = [border.earlier[row] for row in rows.tolist()]
    later = [border.later[column] for column in columns.tolist()]
    odds = likeness.odds((number, earlier), (number + 1, later))
    score = np.full(mean.shape, -np.inf, np.float32)
    score[rows, columns] = _POSITION * mean[rows, columns] / (1 - DEFAULT.similar) + np.nan_to_num(odds)
    score[score <= 0] = -np.inf
    told = dict(zip(zip(rows.tolist(), columns.tolist(), strict=True), odds.tolist(), strict=True))
    pairs = sorted(map(tuple, optimal(score).tolist()), key=lambda both: (-score[both], both))
    joins = []
    for row, column in pairs:
        seen = np.flatnonzero(both[:, row, column])
        joins.append(
            Join(
                (number, border.earlier[row]),
                (number + 1, border.later[column]),
                border.frames[int(seen[0])],
                border.frames[int(seen[-1])],
                len(seen),
                float(np.mean(border.similar[seen, row, column])),
                told[row, column],
                0.0,
            )
        )
    return joins


def _hidden(
    parts: Sequence[Part], chains: _Chains, likeness: _Likeness, scene: Scene, recall: Recall
) -> list[Join]:
    """Who was not seen about a border and is found again behind it by looks, the surest first."""
    size = (scene.height, scene.width)
    lost = [one for one in chains.ends() if inside(_box(parts, one, "place"), size)]
    found = chains.begins()
    pairs = [
        (one, other)
        for one, other in itertools.product(lost, found)
        if one[0] < other[0] and _reachable(parts, one, other, recall.longest)
    ]
    odds = np.full((len(lost), len(found)), -np.inf)
    for (p, q), group in itertools.groupby(sorted(pairs, key=_of_parts), key=_of_parts):
        some = list(group)
        values = likeness.odds((p, [one[1] for one, _ in some]), (q, [other[1] for _, other in some]))
        for (one, other), value in zip(some, values.tolist(), strict=True):
            if not np.isnan(value):
                odds[lost.index(one), found.index(other)] = value - _way(parts, one, other)
    joins = []
    for row, column in optimal(np.where(odds >= recall.least, odds + 1.0, -np.inf).astype(np.float32)).tolist():
        rivals = max(
            np.delete(odds[row], column).max(initial=-np.inf), np.delete(odds[:, column], row).max(initial=-np.inf)
        )
        if odds[row, column] < rivals + recall.margin:
            continue
        one, other = lost[row], found[column]
        life, next_life = parts[one[0]].lives[one[1]], parts[other[0]].lives[other[1]]
        gap = next_life.begin - life.end
        joins.append(Join(one, other, life.last, next_life.first, 0, float("nan"), float(odds[row, column]), gap))
    return sorted(joins, key=lambda join: (-join.odds, join.earlier, join.later))


def _of_parts(pair: tuple[tuple[int, int], tuple[int, int]]) -> tuple[int, int]:
    return pair[0][0], pair[1][0]


def _reachable(parts: Sequence[Part], one: tuple[int, int], other: tuple[int, int], longest: float) -> bool:
    """Whether one may have gone unseen from where it was last to where the other was first, in no more than that time."""
    life, later = parts[one[0]].lives[one[1]], parts[other[0]].lives[other[1]]
    gap = later.begin - life.end
    alike_in_kind = life.kind == later.kind or not life.kind or not later.kind
    return (
        0 < gap <= longest and alike_in_kind and not (life.group or later.group) and _way(parts, one, other) <= 1
    )


def _way(parts: Sequence[Part], one: tuple[int, int], other: tuple[int, int]) -> float:
    """How far it is between the two, as a share of how far anybody may have gone meanwhile."""
    life, later = parts[one[0]].lives[one[1]], parts[other[0]].lives[other[1]]
    (x1, y1, x2, y2), (u1, v1, u2, v2) = life.place, later.origin
    way = np.hypot((x1 + x2 - u1 - u2) / 2, (y1 + y2 - v1 - v2) / 2)
    height = max(y2 - y1, v2 - v1, 1.0)
    return float(way / (height * (SLACK + FARTHEST * max(later.begin - life.end, 0.0))))


def _box(parts: Sequence[Part], one: tuple[int, int], which: str) -> Boxes:
    return np.array([getattr(parts[one[0]].lives[one[1]], which)], np.float32)


class _Likeness:
    """How likely looks of identities of two parts are of one, as far as anything is known of them."""

    def __init__(self, kinds: Sequence[Feature], parts: Sequence[Part]) -> None:
        self._kinds, self._parts = kinds, parts
        self._telling = telling(kinds, [part.looks for part in parts])

    def odds(self, one: tuple[int, Sequence[int]], other: tuple[int, Sequence[int]]) -> NDArray[np.float64]:
        """Return the log odds (P,) that identities of one part are those of another; NaN where a look is missing."""
        found = np.full(len(one[1]), np.nan)
        sides = [self._parts[part].looks.of(ids) for part, ids in (one, other)]
        if not len(found) or not self._kinds or not all(rows for _, rows in sides):
            return found
        there, here = (times > NEVER for times, _ in sides)
        some = np.flatnonzero(there.any(axis=1) & here.any(axis=1))
        mine, theirs = ({name: rows[some] for name, rows in side.items()} for _, side in sides)
        numbers = alike(self._kinds, mine, there[some], theirs, here[some]).astype(np.float64)
        if len(some):
            found[some] = log_odds(self._telling.same, self._telling.other, numbers)
        return found


class _Chains:
    """Who is one so far: identities of parts in sets, of which no two were seen together."""

    def __init__(self, parts: Sequence[Part]) -> None:
        self._parts = parts
        self._of = {(number, one): {(number, one)} for number, part in enumerate(parts) for one in part.lives}
        self.joins: list[Join] = []

    def join(self, join: Join) -> bool:
        """Make two one, unless they cannot be; return whether they are now."""
        if join.earlier not in self._of or join.later not in self._of:
            return False
        one, other = self._of[join.earlier], self._of[join.later]
        if one is other or any(self._apart(a, b) for a in one for b in other):
            return False
        one |= other
        for member in other:
            self._of[member] = one
        self.joins.append(join)
        return True

    def ends(self) -> list[tuple[int, int]]:
        """Return of each set the identity that was seen last."""
        return self._extremes(lambda one: (-self._life(one).end, -one[0]))

    def begins(self) -> list[tuple[int, int]]:
        """Return of each set the identity that was seen first."""
        return self._extremes(lambda one: (self._life(one).begin, one[0]))

    def _extremes(self, key: Callable[[tuple[int, int]], Any]) -> list[tuple[int, int]]:
        sets = {id(some): some for some in self._of.values()}
        return sorted(min(some, key=key) for some in sets.values())

    def _life(self, one: tuple[int, int]) -> Life:
        return self._parts[one[0]].lives[one[1]]

    def _apart(self, one: tuple[int, int], other: tuple[int, int]) -> bool:
        """Whether a part saw both in one frame at two places, or one is a group and the other is not."""
        if self._life(one).group != self._life(other).group:
            return True
        return (
            one[0] == other[0] and (min(one[1], other[1]), max(one[1], other[1])) in self._parts[one[0]].together
        )


def _seen(rows: Tracks) -> NDArray[np.bool_]:
    """Which rows rest on something seen."""
    return np.asarray(~rows.inferred & (rows.status != Status.LOST) & (rows.status != Status.OCCLUDED))


def _within(rows: Tracks, first: int, behind: int) -> Tracks:
    return rows.take((rows.frames >= first) & (rows.frames < behind) & (rows.status != Status.LOST))


def _note(lives: dict[int, Life], seen: Tracks, groups: set[int]) -> None:
    """Note where everybody is who is seen in a frame."""
    for row, one in enumerate(seen.ids.tolist()):
        frame, time, box = int(seen.frames[row]), float(seen.times[row]), tuple(seen.boxes[row].tolist())
        known = lives.get(one)
        if known is None:
            known = Life(frame, time, box, frame, time, box, str(seen.classes[row]), one in groups)
        kind = known.kind or str(seen.classes[row])
        lives[one] = known._replace(last=frame, end=time, place=box, kind=kind, group=known.group or one in groups)


def _apart(seen: Tracks) -> set[tuple[int, int]]:
    """Pairs of identities that are seen at two places of one frame."""
    shared = intersections(seen.boxes, seen.boxes)
    area = areas(seen.boxes)
    union = area[:, None] + area[None] - shared
    one, other = np.nonzero(np.triu(shared < _SAME_PLACE * np.maximum(union, 1e-6), 1))
    ids = np.sort(np.stack([seen.ids[one], seen.ids[other]], axis=1), axis=1)
    return set(map(tuple, ids.tolist()))

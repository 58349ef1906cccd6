"""Who was lost in the picture is found again by looks, long after the window (ours; the paper lets go of them).

How alike two looks of one thing are, and of two things, is learnt from the film itself: what is followed without doubt
gives pairs of one thing, what is seen in one frame gives pairs of two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import areas, intersections
from perdure.features.feature import Feature, Float
from perdure.features.pool import known
from perdure.maths.assign import assign
from perdure.maths.discriminant import Moments, log_odds
from perdure.scene.zones import Zones
from perdure.trackers.multifeature.targets import NEVER, Rows, Targets
from perdure.types import Boxes, Event, Frame, Regions, Renamed

Index = NDArray[np.intp]
SPACING = 0.4  # s between looks
_SOON = 1.0  # s, about which looks are all as near to each other as they come
_KEPT = 6  # looks from before a doubt that are kept through it
_ALONE = 0.1  # share of a box in another up to which it is seen by itself
_MEMORY = 3000.0  # pairs of looks
_BEFORE = 20.0  # pairs that what is thought before counts for
_SAME, _OTHER, _SPREAD, _TOGETHER = (
    0.8,
    0.6,
    0.12,
    0.5,
)  # similarities before anything was seen, and how they go together
RIVALS = 3  # others that each new look is compared with
FARTHEST, SLACK = 1.5, 1.0  # heights a second, heights: how far one may go while nobody sees it
_MOST = 10.0  # nats, more than log odds can be
_BORDER = 0.15  # heights from the border of the picture, within which one is not inside it
_DOUBT = 2.0  # s for which one that has an id may still turn out to be another


@dataclass(frozen=True, eq=False)
class Telling:
    """How alike looks of one thing are, and looks of two: moments of the similarities by feature."""

    same: Moments
    other: Moments

    @staticmethod
    def unknown(kinds: Sequence[Feature]) -> Telling:
        """Return what is thought before anything was seen."""
        count = len(kinds)
        spread = np.full(count, _SPREAD)
        moments = (Moments.assumed(np.full(count, mean), spread, _TOGETHER, _BEFORE) for mean in (_SAME, _OTHER))
        return Telling(*moments)


class Recalled(NamedTuple):
    """What has been found again."""

    kept: NDArray[np.bool_]  # (N,) targets that remain; lost ones go on in who was found to be they
    targets: Targets  # all (N,) of them
    keys: dict[int, int]  # of who has turned out to be whom
    renamed: tuple[Renamed, ...]
    events: tuple[Event, ...]

    @staticmethod
    def nobody(targets: Targets) -> Recalled:
        """Return that nobody has been found again."""
        return Recalled(np.ones(len(targets), np.bool_), targets, {}, (), ())


def looked(
    kinds: Sequence[Feature],
    targets: Targets,
    region: Index,
    telling: Telling,
    frame: Frame,
    regions: Regions,
    size: tuple[int, int],
    doubt: NDArray[np.float64],
) -> tuple[Targets, Telling, Index]:
    """Remember how targets look that are seen by themselves, and learn how looks differ; return whose are new.

    Only they are described, by `kinds`, the features of looks. Who is in `doubt` since some time (N,) keeps looks from
    before it.
    """
    alone = by_themselves(regions.boxes, size)
    due = frame.time - targets.looked[:, -1] >= SPACING - 1e-9
    fresh = np.flatnonzero((region >= 0) & due & alone[region])
    if not len(fresh):
        return targets, telling, fresh
    shown = regions.take(region[fresh])
    new = {one.name: one.describe({}, frame, shown)[1] for one in kinds}
    there = (
        np.logical_and.reduce([known(some) for some in new.values()]) if kinds else np.zeros(len(fresh), np.bool_)
    )
    fresh, new = fresh[there], {name: some[there] for name, some in new.items()}
    telling = _learnt(kinds, targets, fresh, new, telling, frame.time)
    order = slots(targets.looked[fresh], doubt[fresh], frame.time)
    looks = {name: old.copy() for name, old in targets.looks.items()}
    for name, old in looks.items():
        old[fresh] = np.concatenate([old[fresh], new[name][:, None]], axis=1)[
            np.arange(len(fresh))[:, None], order
        ]
    when = targets.looked.copy()
    now = np.full((len(fresh), 1), frame.time)
    when[fresh] = np.take_along_axis(np.concatenate([when[fresh], now], axis=1), order, axis=1)
    return targets.replace(looks=looks, looked=when), telling, fresh


def slots(when: NDArray[np.float64], doubt: NDArray[np.float64], time: float) -> Index:
    """Which of the looks (F, E) of some times and a new one are kept (F, E): many of late, few of long ago.

    The one goes that is nearest to its neighbours in time for its age: things look different from every side, and one
    that was seen from many is known again sooner. Of one in doubt none goes from before, unless there are more than
    enough.
    """
    count = when.shape[1]
    whole = np.concatenate([when, np.full((len(when), 1), time)], axis=1)  # (F, E + 1)
    between = np.full_like(when, np.inf)
    between[:, 1:] = whole[:, 2:] - whole[:, :-2]
    crowded = between / (time - when + _SOON)
    before = when < doubt[:, None]
    enough = (before & (when > NEVER)).sum(axis=1) > _KEPT
    crowded[np.isfinite(doubt)[:, None] & before & ~enough[:, None]] = np.inf
    crowded[when <= NEVER] = -np.inf  # what is empty goes first
    gone = crowded.argmin(axis=1)[:, None]
    slots = np.arange(count)
    return np.asarray(slots + (slots >= gone), np.intp)


def alike(
    kinds: Sequence[Feature], one: Rows, there: NDArray[np.bool_], other: Rows, here: NDArray[np.bool_]
) -> Float:
    """Return how alike (P, K) looks (P, E, …) and looks (P, F, …) are by feature: the mean of the better half of pairs.

    `there` (P, E) and `here` (P, F) say which looks there are; 0 where there is none.
    """
    both = there[:, :, None] & here[:, None, :]  # (P, E, F)
    pair, mine, theirs = np.nonzero(both)
    found = np.zeros((len(there), len(kinds)), np.float32)
    if not len(pair):
        return found
    count = both.sum(axis=(1, 2))
    half = np.maximum((count + 1) // 2, 1)
    second = np.ones(len(pair), np.float32)
    for column, kind in enumerate(kinds):
        value = kind.similarity(one[kind.name][pair, mine], other[kind.name][pair, theirs], second)
        order = np.lexsort((-value, pair))
        rank = np.arange(len(pair)) - np.repeat(np.cumsum(count) - count, count)
        best = order[rank < np.repeat(half, count)]
        np.add.at(found[:, column], pair[best], value[best])
        found[:, column] /= half
    return found


def recall(
    kinds: Sequence[Feature],
    telling: Telling,
    targets: Targets,
    region: Index,
    fresh: Index,
    frame: Frame,
    size: tuple[int, int],
    zones: Zones,
    limits: tuple[NDArray[np.float64], float],
) -> Recalled:
    """Find lost targets again among newcomers of whom there is a new look.

    A newcomer is one without an id, or who got one of late; a lost one was lost inside the picture before the newcomer
    was seen first, and near enough to have got there. `limits` are the longest time (N,) in seconds for which each is
    remembered, and the least log odds.
    """
    longest, likeness = limits
    newcomers = fresh[
        ((targets.ids[fresh] == 0) | (frame.time - targets.named[fresh] <= _DOUBT)) & ~targets.recalled[fresh]
    ]
    lost = np.flatnonzero(
        (targets.ids > 0)
        & (region < 0)
        & (targets.missed <= longest)
        & (targets.looked[:, -1] > NEVER)
        & within(targets, size)
    )
    if not kinds or not len(newcomers) or not len(lost):
        return Recalled.nobody(targets)
    one, other = (part.ravel() for part in np.meshgrid(lost, newcomers, indexing="ij"))
    gap = targets.born[other] - targets.seen[one]
    way = np.hypot(*(_middle(targets.boxes[one, -1]) - _middle(targets.origin[other])).T)
    height = np.maximum(
        targets.last[one, 3] - targets.last[one, 1], targets.last[other, 3] - targets.last[other, 1]
    )
    possible = (gap > 0) & (way <= height * (SLACK + FARTHEST * gap))
    odds = np.full(len(one), -np.inf)
    some = np.flatnonzero(possible)
    if len(some):
        there, here = targets.looked[one[some]] > NEVER, targets.looked[other[some]] > NEVER
        mine = {kind.name: targets.looks[kind.name][one[some]] for kind in kinds}
        theirs = {kind.name: targets.looks[kind.name][other[some]] for kind in kinds}
        numbers = alike(kinds, mine, there, theirs, here).astype(np.float64)
        odds[some] = log_odds(telling.same, telling.other, numbers) - way[some] / (
            height[some] * (SLACK + FARTHEST * gap[some])
        )
    table = odds.reshape(len(lost), len(newcomers))
    pairs = assign(np.where(table >= likeness, _MOST - table, np.inf)).pairs
    found = [(int(lost[a]), int(newcomers[b]), float(table[a, b])) for a, b in pairs]
    return _joined(targets, found, frame, zones)


def _joined(targets: Targets, pairs: list[tuple[int, int, float]], frame: Frame, zones: Zones) -> Recalled:
    """Let each newcomer go on as the lost one it is."""
    kept = np.ones(len(targets), np.bool_)
    keys, renamed, events = {}, [], []
    columns = {
        name: getattr(targets, name).copy()
        for name in ("keys", "ids", "born", "first", "named", "entry", "recalled", "origin")
    }
    for old, new, odds in pairs:
        kept[old] = False
        if targets.ids[new] > 0:
            renamed.append(
                Renamed(int(targets.ids[new]), int(targets.ids[old]), int(targets.first[new]), frame.index)
            )
        keys[int(targets.keys[new])] = int(targets.keys[old])
        gap = targets.born[new] - targets.seen[old]
        why = f"by its looks, after {gap:.1f} s: log odds {odds:.1f}"
        events.append(
            Event(
                "found_again",
                int(targets.first[new]),
                frame.index,
                (int(targets.ids[old]),),
                zones.name(int(targets.behind[old])),
                why=why,
            )
        )
        for name in ("keys", "ids", "born", "first", "named", "entry"):
            columns[name][new] = columns[name][old]
        columns["recalled"][new] = True
    return Recalled(kept, targets.replace(**columns), keys, tuple(renamed), tuple(events))


def _learnt(
    kinds: Sequence[Feature], targets: Targets, fresh: Index, new: Rows, telling: Telling, time: float
) -> Telling:
    """What is known of looks after new ones: each against its own older ones, and against those of others now seen."""
    there = targets.looked > NEVER
    mine = np.flatnonzero(there[fresh].any(axis=1))
    if not len(mine):
        return telling
    own = _against(kinds, targets, fresh[mine], {name: some[mine] for name, some in new.items()}, there)
    same = telling.same.seen(own, _MEMORY)
    seen = np.flatnonzero((targets.missed == 0) & there.any(axis=1))
    apart = _middle(targets.last[fresh])[:, None] - _middle(targets.last[seen])[None]
    far = np.where(fresh[:, None] == seen, np.inf, np.hypot(apart[..., 0], apart[..., 1]))
    near = np.argsort(far, axis=1, kind="stable")[:, :RIVALS]
    row, column = np.nonzero(np.isfinite(np.take_along_axis(far, near, axis=1)))
    other = telling.other
    if len(row):
        rival = seen[near[row, column]]
        numbers = _against(kinds, targets, rival, {name: some[row] for name, some in new.items()}, there)
        other = other.seen(numbers, _MEMORY)
    return Telling(same, other)


def _against(
    kinds: Sequence[Feature], targets: Targets, which: Index, new: Rows, there: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """How alike (P, K) new looks (P, …) are to those of targets `which` (P,)."""
    looks = {kind.name: targets.looks[kind.name][which] for kind in kinds}
    one = {name: some[:, None] for name, some in new.items()}
    return alike(kinds, looks, there[which], one, np.ones((len(which), 1), np.bool_)).astype(np.float64)


def by_themselves(boxes: Boxes, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Which regions (N,) are seen by themselves and whole; one more, False, for no region."""
    shared = intersections(boxes, boxes)
    np.fill_diagonal(shared, 0.0)
    least = np.minimum(areas(boxes)[:, None], areas(boxes)[None])
    covered = (shared > _ALONE * np.maximum(least, 1e-6)).any(axis=1) if len(boxes) else np.zeros(0, np.bool_)
    height, width = size
    whole = (boxes[:, :2] >= 0).all(axis=1) & (boxes[:, 2] <= width) & (boxes[:, 3] <= height)
    return np.append(~covered & whole, False)


def within(targets: Targets, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Which targets (N,) were not at the border when they were seen last, nor going over it."""
    return inside(targets.last, size)


def inside(boxes: Boxes, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Which boxes (N, 4) are not at the border of a picture (height, width), nor go over it."""
    height, width = size
    margin = _BORDER * (boxes[:, 3] - boxes[:, 1])
    return np.asarray(
        (boxes[:, 0] > margin)
        & (boxes[:, 1] > margin)
        & (boxes[:, 2] < width - margin)
        & (boxes[:, 3] < height - margin)
    )


def _middle(boxes: Boxes) -> Float:
    return np.asarray((boxes[:, :2] + boxes[:, 2:]) / 2, np.float32)

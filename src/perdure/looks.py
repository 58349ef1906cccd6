"""How identities looked when they were seen by themselves: gathered beside any tracker, to know them again elsewhere.

What is followed gives pairs of looks of one thing, what is seen beside it in one frame pairs of two: from these it is
learnt how alike looks of one and of two are, as in the multi-feature tracker, whose features these are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Feature
from perdure.features.pool import known
from perdure.maths.discriminant import Moments
from perdure.trackers.multifeature.recalling import RIVALS, SPACING, Telling, alike, by_themselves, slots
from perdure.trackers.multifeature.targets import LOOKS, NEVER, Rows
from perdure.types import Frame, Regions, Status, Tracks

_MEMORY = 3000.0  # pairs of looks


@dataclass(frozen=True, eq=False)
class Portraits:
    """The looks of some identities, a row each; and how alike looks are.

    `same` and `other` are what was seen of pairs of looks of one identity and of two, with nothing assumed before.
    """

    ids: NDArray[np.int64]  # (N,)
    times: NDArray[np.float64]  # (N, E) s; NEVER for none
    rows: Rows  # (N, E, …) by feature
    same: Moments
    other: Moments

    @staticmethod
    def none(kinds: Sequence[Feature] = ()) -> Portraits:
        """Return that nobody has been looked at."""
        nothing = _nothing(len(kinds))
        return Portraits(np.zeros(0, np.int64), np.zeros((0, LOOKS)), {}, nothing, nothing)

    def of(self, wanted: Sequence[int]) -> tuple[NDArray[np.float64], Rows]:
        """Return times (K, E) and looks (K, E, …) of identities; of who is not known there are none."""
        order = {one: row for row, one in enumerate(self.ids.tolist())}
        rows = np.array([order.get(int(one), -1) for one in wanted], np.intp)
        times = np.concatenate([self.times, np.full((1, self.times.shape[1]), NEVER)])[rows]
        return times, {name: np.concatenate([some, some[:1] * 0])[rows] for name, some in self.rows.items()}


@dataclass(frozen=True, eq=False)
class _Look:
    """What one identity looked like in one frame."""

    time: float
    frame: int
    report: int  # which said it
    rows: Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Album:
    """Looks while they are gathered, by the identity as it was said; consumed by `looked_at`."""

    kinds: Sequence[Feature]
    looks: dict[int, list[_Look]] = field(default_factory=dict)
    same: Moments = field(default_factory=lambda: _nothing(0))
    other: Moments = field(default_factory=lambda: _nothing(0))

    @staticmethod
    def empty(kinds: Sequence[Feature]) -> Album:
        """Return one without a look, of features of looks."""
        return Album(kinds, {}, _nothing(len(kinds)), _nothing(len(kinds)))


def looked_at(album: Album, frame: Frame, report: int, said: Tracks) -> Album:
    """Return the album with the looks of who is seen by itself in a frame, at times, as report number `report` said.

    Without a picture there are none.
    """
    if frame.image is None or not album.kinds or not len(said):
        return album
    rows = said.in_frame(frame.index)
    rows = rows.take(~rows.inferred & ~rows.is_group & (rows.status != Status.LOST))
    alone = by_themselves(rows.boxes, frame.image.shape[:2])[:-1] & (rows.status == Status.VISIBLE)
    last = [album.looks[one][-1].time if one in album.looks else NEVER for one in rows.ids.tolist()]
    shown = rows.take(alone & (frame.time - np.array(last) >= SPACING - 1e-9))
    if not len(shown):
        return album
    regions = Regions.of(boxes=shown.boxes, masks=shown.masks)
    new = {one.name: one.describe({}, frame, regions)[1] for one in album.kinds}
    there = np.logical_and.reduce([known(some) for some in new.values()])
    shown, new = shown.take(there), {name: some[there] for name, some in new.items()}
    ids = shown.ids.tolist()
    same = album.same.seen(_against(album, [(k, one) for k, one in enumerate(ids)], new), _MEMORY)
    other = album.other.seen(_against(album, _rivals(album, shown, rows), new), _MEMORY)
    for row, one in enumerate(ids):
        look = _Look(frame.time, frame.index, report, {name: some[row] for name, some in new.items()})
        album.looks[one] = _kept([*album.looks.get(one, ()), look])
    return Album(album.kinds, album.looks, same, other)


def portraits(album: Album, identity: Callable[[int, int, int], int]) -> Portraits:
    """Return the looks by settled identity; `identity` tells it of (id said, frame, number of the report), 0 for none."""
    found: dict[int, list[_Look]] = {}
    for said, looks in album.looks.items():
        for one in looks:
            found.setdefault(identity(said, one.frame, one.report), []).append(one)
    found.pop(0, None)
    ids = sorted(found)
    kept = [sorted(found[one], key=lambda look: look.time) for one in ids]
    for some in kept:
        while len(some) > LOOKS:
            some[:] = _kept(some)
    times = np.full((len(ids), LOOKS), NEVER)
    rows = {one.name: _room(kept, one.name) for one in album.kinds} if ids else {}
    for row, some in enumerate(kept):
        times[row, LOOKS - len(some) :] = [look.time for look in some]
        for name, column in rows.items():
            column[row, LOOKS - len(some) :] = [look.rows[name] for look in some]
    return Portraits(np.array(ids, np.int64), times, rows, album.same, album.other)


def telling(kinds: Sequence[Feature], parts: Sequence[Portraits]) -> Telling:
    """Return how alike looks of one thing and of two are, by all that was seen and by what is thought before."""
    unknown = Telling.unknown(kinds)
    of_one = [part.same for part in parts if len(part.same.total) == len(kinds)]
    of_two = [part.other for part in parts if len(part.other.total) == len(kinds)]
    return Telling(_together([unknown.same, *of_one]), _together([unknown.other, *of_two]))


def _nothing(count: int) -> Moments:
    """What is known of `count` numbers of which none was seen."""
    return Moments(0.0, np.zeros(count), np.zeros((count, count)))


def _together(parts: Sequence[Moments]) -> Moments:
    first, *others = parts
    for one in others:
        first = Moments(first.count + one.count, first.total + one.total, first.products + one.products)
    return first


def _rivals(album: Album, shown: Tracks, rows: Tracks) -> list[tuple[int, int]]:
    """Pairs of a new look's row and the identity of another who is seen near it, and is known."""
    others = rows.take(np.array([one in album.looks for one in rows.ids.tolist()], np.bool_))
    centres = (others.boxes[:, :2] + others.boxes[:, 2:]) / 2
    pairs = []
    for row, (one, box) in enumerate(zip(shown.ids.tolist(), shown.boxes, strict=True)):
        far = np.hypot(*(centres - (box[:2] + box[2:]) / 2).T)
        order = [int(k) for k in np.argsort(far, kind="stable") if others.ids[k] != one]
        pairs += [(row, int(others.ids[k])) for k in order[:RIVALS]]
    return pairs


def _against(album: Album, pairs: Sequence[tuple[int, int]], new: Rows) -> NDArray[np.float64]:
    """How alike (P, K) new looks are to those that identities had; only of those who had any."""
    pairs = [both for both in pairs if both[1] in album.looks]
    if not pairs:
        return np.zeros((0, len(album.kinds)))
    looks = [album.looks[one] for _, one in pairs]
    there = np.array([[k < len(some) for k in range(LOOKS)] for some in looks])
    old = {name: np.zeros((len(pairs), LOOKS, *some.shape[1:]), np.float32) for name, some in new.items()}
    for row, some in enumerate(looks):
        for name, column in old.items():
            column[row, : len(some)] = [look.rows[name] for look in some]
    rows = [row for row, _ in pairs]
    mine = {name: some[rows][:, None] for name, some in new.items()}
    return alike(album.kinds, old, there, mine, np.ones((len(pairs), 1), np.bool_)).astype(np.float64)


def _kept(looks: list[_Look]) -> list[_Look]:
    """Looks, without the one that tells least where they are too many."""
    if len(looks) <= LOOKS:
        return looks
    times = np.array([one.time for one in looks])
    places = slots(times[None, :-1], np.full(1, np.inf), float(times[-1]))[0]
    return [looks[place] for place in places.tolist()]


def _room(looks: Sequence[Sequence[_Look]], name: str) -> NDArray[np.float32]:
    shape = looks[0][0].rows[name].shape
    return np.zeros((len(looks), LOOKS, *shape), np.float32)

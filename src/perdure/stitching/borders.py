"""Who of a part is who of the next, by the frames that both have seen; and the frame of the handover."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.stitching.likeness import LEAST, Likeness, nats, similarity
from perdure.stitching.parts import Join, Part
from perdure.trackers.multifeature.fathers import optimal
from perdure.types import Scene, Status, Tracks

_NEAR = 1.0  # s about the handover within which places count most
_AGREED = 0.6  # global similarity from which both parts agree
# Shares of the overlap: from where, where as a rule, and up to where it is handed over.
_HANDOVER = (0.5, 0.75, 0.9)


@dataclass(frozen=True, eq=False)
class Border:
    """What two neighbouring parts say of the frames that both have seen."""

    earlier: Sequence[int]  # (A,) identities
    later: Sequence[int]  # (B,)
    similar: NDArray[np.float32]  # (F, A, B) global similarity in each frame; NaN where not both are seen
    frames: Sequence[int]  # (F,)
    times: NDArray[np.float64]  # (F,)
    handover: int

    @staticmethod
    def of(one: Part, other: Part, scene: Scene) -> Border:
        """Compare two neighbours, frame by frame."""
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
            table = similarity(here.boxes, there.boxes, 1.0 / scene.fps, scene)
            rows, columns = np.searchsorted(earlier, here.ids), np.searchsorted(later, there.ids)
            similar[place][np.ix_(rows, columns)] = table
            agreed = int((table >= _AGREED).any(axis=1).sum() + (table >= _AGREED).any(axis=0).sum())
            unsure = int((here.status != Status.VISIBLE).sum() + (there.status != Status.VISIBLE).sum())
            apart[place] = len(here) + len(there) - agreed + 0.5 * unsure
        handover = _handover(first, behind, dict(zip(frames, apart.tolist(), strict=True)))
        return Border(earlier.tolist(), later.tolist(), similar, frames, times, handover)


def _handover(first: int, behind: int, apart: Mapping[int, float]) -> int:
    """The frame from which the later part is told: where both disagree least, of equals the nearest to the usual."""
    low, usual, high = (first + round(share * (behind - first)) for share in _HANDOVER)

    def doubt(frame: int) -> tuple[float, int]:
        return apart.get(frame - 1, 0.0) + apart.get(frame, 0.0), abs(frame - usual)

    return min(range(min(low, usual), max(high, usual + 1)), key=doubt)


def joins_at(border: Border, number: int, parts: Sequence[Part], likeness: Likeness) -> list[Join]:
    """Return who of part `number` is who of the next, the surest first: the highest total of places and looks.

    What places tell is the mean over the frames that both see, the nearest to the handover first, less for those in
    which only one of the two is there.
    """
    if not border.earlier or not border.later:
        return []
    place = int(np.searchsorted(border.frames, border.handover))
    middle = float(border.times[min(place, len(border.times) - 1)])
    weight = np.exp(-np.abs(border.times - middle) / _NEAR)[:, None, None]  # (F, 1, 1)
    both = ~np.isnan(border.similar)  # (F, A, B)
    either = both.any(axis=2, keepdims=True) | both.any(axis=1, keepdims=True)
    above = (weight * np.where(both, border.similar - LEAST, 0.0)).sum(axis=0)  # (A, B)
    mean = above / np.maximum((weight * either).sum(axis=0), 1e-9)
    rows, columns = np.nonzero((mean > 0) & _of_one_kind(border, number, parts))
    earlier = [border.earlier[row] for row in rows.tolist()]
    later = [border.later[column] for column in columns.tolist()]
    odds = likeness.odds((number, earlier), (number + 1, later))
    score = np.full(mean.shape, -np.inf, np.float32)
    score[rows, columns] = nats(mean[rows, columns] + LEAST) + np.nan_to_num(odds)
    score[score <= 0] = -np.inf
    told = dict(zip(zip(rows.tolist(), columns.tolist(), strict=True), odds.tolist(), strict=True))
    best = [(row, column) for row, column in optimal(score).tolist()]
    pairs = sorted(best, key=lambda pair: (-float(score[pair]), pair))
    return [_join(border, number, pair, told[pair], float(score[pair])) for pair in pairs]


def _of_one_kind(border: Border, number: int, parts: Sequence[Part]) -> NDArray[np.bool_]:
    """Which pairs (A, B) are both groups, or both none, and were seen."""
    sides = [
        np.array([-1 if one not in part.lives else int(part.lives[one].group) for one in ids])
        for part, ids in zip(parts[number : number + 2], (border.earlier, border.later), strict=True)
    ]
    return np.asarray((sides[0][:, None] == sides[1]) & (sides[0][:, None] >= 0))


def _join(border: Border, number: int, pair: tuple[int, int], odds: float, sure: float) -> Join:
    row, column = pair
    seen = np.flatnonzero(~np.isnan(border.similar[:, row, column]))
    return Join(
        (number, border.earlier[row]),
        (number + 1, border.later[column]),
        border.frames[int(seen[0])],
        border.frames[int(seen[-1])],
        len(seen),
        float(np.mean(border.similar[seen, row, column])),
        odds,
        0.0,
        sure,
    )


def _within(rows: Tracks, first: int, behind: int) -> Tracks:
    return rows.take((rows.frames >= first) & (rows.frames < behind) & (rows.status != Status.LOST))

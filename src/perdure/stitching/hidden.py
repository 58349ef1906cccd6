"""Who was not seen about a border, and is known again behind it by looks and by where it was."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from perdure.stitching.likeness import Likeness, nats, similarity
from perdure.stitching.parts import Join, Life, Part
from perdure.trackers.multifeature.fathers import optimal
from perdure.trackers.multifeature.recalling import FARTHEST, SLACK, inside
from perdure.types import Boxes, Scene

Who = tuple[int, int]
"""Number of the part, identity in it."""
_STILL = 1.0  # s in which what the place tells falls to a third


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


RECALL = Recall()


def joins_of_hidden(
    parts: Sequence[Part],
    ends: Sequence[Who],
    begins: Sequence[Who],
    likeness: Likeness,
    scene: Scene,
    recall: Recall,
) -> list[Join]:
    """Return who of those that were seen last (`ends`) is who of those seen first (`begins`) in a later part.

    The surest come first. Only who was lost inside the picture is found again.
    """
    boxes = np.array([_life(parts, one).place for one in ends], np.float32).reshape(-1, 4)
    whole = inside(boxes, (scene.height, scene.width))
    lost = [one for one, within in zip(ends, whole.tolist(), strict=True) if within]
    pairs = list(_possible(parts, lost, begins, recall.longest))
    rows, columns = sorted({one for one, _ in pairs}), sorted({other for _, other in pairs})
    row_of, column_of = ({one: k for k, one in enumerate(some)} for some in (rows, columns))
    places = {both: (row_of[both[0]], column_of[both[1]]) for both in pairs}
    odds = np.full((len(rows), len(columns)), -np.inf)
    alike = np.full(odds.shape, np.nan)
    for (p, q), group in groupby(sorted(pairs, key=_parts_of), key=_parts_of):
        some = list(group)
        looks = likeness.odds((p, [one[1] for one, _ in some]), (q, [other[1] for _, other in some]))
        for both, value in zip(some, looks.tolist(), strict=True):
            alike[places[both]], odds[places[both]] = value, _odds(parts, *both, value, scene)
    sure = optimal(np.where(odds >= recall.least, odds + 1.0, -np.inf).astype(np.float32)).tolist()
    found = [
        _join(parts, rows[row], columns[column], float(alike[row, column]), float(odds[row, column]))
        for row, column in sure
        if odds[row, column] >= _rival(odds, row, column) + recall.margin
    ]
    return sorted(found, key=lambda join: (-join.sure, join.earlier, join.later))


def _possible(
    parts: Sequence[Part], lost: Sequence[Who], begins: Sequence[Who], longest: float
) -> Iterator[tuple[Who, Who]]:
    """Pairs of which the second may be the first, seen again in a later part and within the longest time."""
    order = sorted(begins, key=lambda other: (_life(parts, other).begin, other))
    times = [_life(parts, other).begin for other in order]
    for one in lost:
        life = _life(parts, one)
        for other in order[bisect_right(times, life.end) : bisect_right(times, life.end + longest)]:
            later = _life(parts, other)
            alike = life.kind == later.kind or not life.kind or not later.kind
            if one[0] < other[0] and alike and not (life.group or later.group) and _way(life, later) <= 1:
                yield one, other


def _odds(parts: Sequence[Part], one: Who, other: Who, looks: float, scene: Scene) -> float:
    """How likely both are one, in nats: by looks, by how near it is, and soon after by its place and size."""
    life, later = _life(parts, one), _life(parts, other)
    gap = later.begin - life.end
    boxes: list[Boxes] = [np.array([box], np.float32) for box in (life.place, later.origin)]
    place = float(nats(similarity(boxes[0], boxes[1], gap, scene))[0, 0]) * float(np.exp(-gap / _STILL))
    return (0.0 if np.isnan(looks) else looks) - _way(life, later) + max(place, 0.0)


def _way(life: Life, later: Life) -> float:
    """How far it is between the two, as a share of how far anybody may have gone meanwhile."""
    (x1, y1, x2, y2), (u1, v1, u2, v2) = life.place, later.origin
    way = np.hypot((x1 + x2 - u1 - u2) / 2, (y1 + y2 - v1 - v2) / 2)
    height = max(y2 - y1, v2 - v1, 1.0)
    return float(way / (height * (SLACK + FARTHEST * (later.begin - life.end))))


def _rival(odds: NDArray[np.float64], row: int, column: int) -> float:
    """The best odds of anybody else for either of the two."""
    others = np.append(np.delete(odds[row], column), np.delete(odds[:, column], row))
    return float(others.max(initial=-np.inf))


def _join(parts: Sequence[Part], one: Who, other: Who, looks: float, sure: float) -> Join:
    life, later = _life(parts, one), _life(parts, other)
    return Join(one, other, life.last, later.first, 0, float("nan"), looks, later.begin - life.end, sure)


def _parts_of(pair: tuple[Who, Who]) -> tuple[int, int]:
    return pair[0][0], pair[1][0]


def _life(parts: Sequence[Part], one: Who) -> Life:
    return parts[one[0]].lives[one[1]]

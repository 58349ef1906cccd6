"""What went wrong, one by one: exchanged and switched identities, lost objects, invented tracks, wrong resolutions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.metrics.clear import Pairs, switches
from perdure.metrics.compared import Compared
from perdure.metrics.events import Identities, Merge, names_around
from perdure.metrics.scoring import LEAST_OVERLAP
from perdure.types import Rows

TOGETHER = 25  # frames within which two switches make one exchange
Index = NDArray[np.intp]


@dataclass(frozen=True)
class Mistake:
    """One fault: what, where, and how many rows it spoils.

    Parameters
    ----------
    kind : str
        'exchange', 'switch', 'lost', 'invented' or 'resolution'.
    begin, end : int
        First and last frame, counted from 0.
    true_ids, said_ids : tuple of int
        The objects of the truth, and what was said: of a switch the id before and after.
    box : (x1, y1, x2, y2)
        Where it begins, pixels.
    cost : int
        Rows spoilt; of a switch the shorter of the two runs, before and after it.
    text : str
        The fault in words.
    """

    kind: str
    begin: int
    end: int
    true_ids: tuple[int, ...]
    said_ids: tuple[int, ...]
    box: tuple[float, float, float, float]
    cost: int
    text: str


def mistakes(compared: Compared, pairs: Pairs, merges: Sequence[Merge] = ()) -> list[Mistake]:
    """Return every fault, worst first.

    Parameters
    ----------
    compared : Compared
        The two sides.
    pairs : Pairs
        CLEAR's matching of the two sides.
    merges : sequence of Merge
        Those of the truth, where they are known: a wrong resolution is one after which somebody has not the id
        that she had before.
    """
    near = _nearest(compared)
    found = [
        *_exchanges([_switch(compared, pairs, place) for place in switches(compared, pairs)]),
        *_resolutions(compared, pairs, merges),
        *_stretches(
            "lost", compared.truth, _without(len(compared.truth), pairs.truth), near[0], compared.said.ids
        ),
        *_stretches(
            "invented", compared.said, _without(len(compared.said), pairs.said), near[1], compared.truth.ids
        ),
    ]
    return sorted(found, key=lambda one: (-one.cost, one.begin, one.kind, one.true_ids, one.said_ids))


def _switch(compared: Compared, pairs: Pairs, place: np.intp) -> Mistake:
    """The change of id at a place of the pairs."""
    true, said = compared.truth.ids[pairs.truth], compared.said.ids[pairs.said]
    identity, new = int(true[place]), int(said[place])
    mine = np.flatnonzero(true == identity)
    here = int(np.searchsorted(mine, place))
    before, after = said[mine[:here]][::-1], said[mine[here:]]
    old = int(before[0])
    runs = [int(np.argmin(np.append(run == run[0], False))) for run in (before, after)]
    row = pairs.truth[place]
    frame = int(compared.truth.frames[row])
    return Mistake(
        "switch",
        frame,
        frame,
        (identity,),
        (old, new),
        _box(compared.truth, row),
        min(runs),
        f"object {identity} was {old} for {runs[0]} frames, then {new} for {runs[1]}",
    )


def _exchanges(found: Sequence[Mistake]) -> Iterator[Mistake]:
    """The switches, two that swap a pair of ids within a second or so as one."""
    left = list(found)
    while left:
        one = left.pop(0)
        swapped = one.said_ids[::-1]
        others = [other for other in left if other.said_ids == swapped and other.begin - one.begin <= TOGETHER]
        others = [other for other in others if other.true_ids != one.true_ids]
        if not others:
            yield one
            continue
        other = others[0]
        left.remove(other)
        yield Mistake(
            "exchange",
            one.begin,
            other.begin,
            one.true_ids + other.true_ids,
            one.said_ids,
            one.box,
            one.cost + other.cost,
            f"objects {one.true_ids[0]} and {other.true_ids[0]} exchanged ids {one.said_ids[0]} and {one.said_ids[1]}",
        )


def _resolutions(compared: Compared, pairs: Pairs, merges: Sequence[Merge]) -> Iterator[Mistake]:
    """Merges of the truth after which not everybody has her id back."""
    identities = Identities(compared, pairs)
    for merge in merges:
        names = names_around(merge, merges, identities)
        wrong = [one for one in names if one[1] is None or one[1] != one[2]]
        rows = np.flatnonzero(
            (compared.truth.frames >= merge.end) & np.isin(compared.truth.ids, [true for true, _, _ in wrong])
        )
        if wrong and len(rows):
            told = ", ".join(
                f"{true} was {before or 'nobody'} and is {after or 'nobody'}" for true, before, after in wrong
            )
            yield Mistake(
                "resolution",
                merge.begin,
                merge.end,
                merge.ids,
                tuple(name for _, before, after in wrong for name in (before, after) if name is not None),
                _box(compared.truth, rows[0]),
                min(int(np.count_nonzero(compared.truth.ids[rows] == true)) for true, _, _ in wrong),
                f"after the merge of {' and '.join(map(str, merge.ids))} up to frame {merge.end}: {told}",
            )


def _stretches(
    kind: str, rows: Rows, alone: Index, near: tuple[NDArray[np.float64], Index], others: NDArray[np.int64]
) -> Iterator[Mistake]:
    """Unbroken stretches of an identity's own rows that have no counterpart."""
    overlap, which = near
    bare = np.zeros(len(rows), np.bool_)
    bare[alone] = True
    for identity in np.unique(rows.ids[alone]).tolist():
        mine = np.flatnonzero(rows.ids == identity)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], bare[mine].astype(np.int8), [0]])))
        for begin, end in edges.reshape(-1, 2):
            stretch = mine[begin:end]
            best = stretch[np.argmax(overlap[stretch])]
            other = int(others[which[best]]) if overlap[best] > 0 else 0
            first, last = int(rows.frames[stretch[0]]), int(rows.frames[stretch[-1]])
            whole = len(stretch) == len(mine)
            yield Mistake(
                kind,
                first,
                last,
                (identity,) if kind == "lost" else ((other,) if other else ()),
                (identity,) if kind == "invented" else ((other,) if other else ()),
                _box(rows, stretch[0]),
                len(stretch),
                _words(kind, identity, len(stretch), whole, other, float(overlap[best])),
            )


def _words(kind: str, identity: int, frames: int, whole: bool, other: int, overlap: float) -> str:
    whose, others = ("id", "object") if kind == "lost" else ("object", "id")
    close = f"; at best {overlap:.2f} overlap with {whose} {other}" if other else ""
    if overlap >= LEAST_OVERLAP:
        close = f"; {whose} {other} overlaps it by {overlap:.2f}, but belongs to another {others}"
    many = f"{frames} frames" if frames > 1 else "a frame"
    if kind == "lost":
        return (
            f"object {identity} was never found" if whole else f"object {identity} was lost for {many}"
        ) + close
    return (
        f"id {identity} matches nothing in all its {many}"
        if whole
        else f"id {identity} matches nothing for {many}"
    ) + (close or "; nothing is there")


def _nearest(compared: Compared) -> list[tuple[NDArray[np.float64], Index]]:
    """For the rows of the truth and of the said: the greatest overlap in the frame, and the row it is with."""
    sides = [(np.zeros(len(side)), np.zeros(len(side), np.intp)) for side in (compared.truth, compared.said)]
    for moment in compared.moments:
        if moment.overlap.size:
            for (overlap, which), rows, others, table in (
                (sides[0], moment.truth, moment.said, moment.overlap),
                (sides[1], moment.said, moment.truth, moment.overlap.T),
            ):
                best = table.argmax(axis=1)
                overlap[rows], which[rows] = table[np.arange(len(rows)), best], others[best]
    return sides


def _without(count: int, matched: Index) -> Index:
    """The rows that are not matched."""
    return np.setdiff1d(np.arange(count), matched)


def _box(rows: Rows, row: np.intp) -> tuple[float, float, float, float]:
    x1, y1, x2, y2 = (round(float(side), 2) for side in rows.boxes[row])
    return x1, y1, x2, y2

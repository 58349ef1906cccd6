"""Rows of a run or a truth, settled, as columns in the order of frames: `fold.settle` for many rows at once.

`settle_columns` says what `fold.settle` says (a test holds the two together), over all rows in a few array operations,
so that a run of half a million rows is settled anew within a second when somebody has corrected it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.types import Dropped, Renamed, Rows, Use
from perdure.web.ledger import Columns

Change = tuple[int, Renamed | Dropped]  # number of its report
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Settled:
    """Settled rows, sorted by frame and id."""

    rows: Columns

    @staticmethod
    def of_truth(rows: Rows) -> Settled:
        """Return the rows of a truth that must be followed, as if they had been said."""
        kept = rows.take(np.isin(rows.use, (Use.SCORED, Use.IGNORED)))
        count = len(kept)
        plain = Columns(
            frames=kept.frames,
            ids=kept.ids,
            groups=np.zeros(count, np.int64),
            boxes=kept.boxes.astype(np.float32),
            status=np.zeros(count, np.int8),
            confidence=np.where(kept.use == Use.SCORED, 1.0, 0.5).astype(np.float32),
            inferred=np.zeros(count, np.bool_),
            hidden=np.zeros(count, np.uint8),
            numbers=np.zeros(count, np.int64),
            places=np.zeros(count, np.int64),
        )
        return Settled(_taken(plain, np.lexsort((plain.ids, plain.frames))))

    def __len__(self) -> int:
        return len(self.rows.ids)

    def between(self, begin: int, end: int) -> Settled:
        """Return the rows of frames `begin` to `end`, the end not included."""
        low, high = np.searchsorted(self.rows.frames, (begin, end))
        return Settled(_taken(self.rows, slice(low, high)))

    def packed(self) -> bytes:
        """Return the rows as bytes for a browser.

        A count (uint32), then columns one after the other, little-endian: frames, ids, groups (int32), boxes
        (float32, 4 a row), confidence (float32), status, inferred, hidden sides (uint8).
        """
        one = self.rows
        columns: tuple[tuple[NDArray[Any], str], ...] = (
            (one.frames, "<i4"),
            (one.ids, "<i4"),
            (one.groups, "<i4"),
            (one.boxes, "<f4"),
            (one.confidence, "<f4"),
            (one.status, "u1"),
            (one.inferred, "u1"),
            (one.hidden, "u1"),
        )
        return struct.pack("<I", len(self)) + b"".join(
            np.ascontiguousarray(values, kind).tobytes() for values, kind in columns
        )

    def spans(self, step: int = 1) -> dict[str, list[int]]:
        """Return where each id is, as stretches of one status in frames that follow one another by `step`.

        Columns of equal length: `id`, `begin`, `end` (included), `status`, `grouped` (0 or 1), sorted by id and frame.
        """
        order = np.lexsort((self.rows.frames, self.rows.ids))
        ids, frames, status = (one[order] for one in (self.rows.ids, self.rows.frames, self.rows.status))
        grouped = self.rows.groups[order] > 0
        if not len(ids):
            return {"id": [], "begin": [], "end": [], "status": [], "grouped": []}
        breaks = (np.diff(ids) != 0) | (np.diff(status) != 0) | (np.diff(frames) > step)
        breaks |= np.diff(grouped.astype(np.int8)) != 0
        first = np.flatnonzero(np.append(True, breaks))
        last = np.append(first[1:] - 1, len(ids) - 1)
        return {
            "id": ids[first].tolist(),
            "begin": frames[first].tolist(),
            "end": frames[last].tolist(),
            "status": status[first].tolist(),
            "grouped": grouped[first].astype(int).tolist(),
        }

    def group_ids(self) -> list[int]:
        """Return the ids that are groups' own."""
        named = np.unique(self.rows.groups[self.rows.groups > 0])
        return np.intersect1d(named, self.rows.ids).tolist()  # type: ignore[no-any-return]


def settle_columns(said: Columns, changes: Sequence[Change]) -> Settled:
    """Return the rows with every change applied, one per (frame, id).

    Of two the one seen goes before the one inferred, then the surer, then the later, as in `Corrections.settled`.
    """
    ids = _renamed(said.ids, said.frames, said.numbers, changes)
    groups = np.where(said.groups > 0, _renamed(said.groups, said.frames, said.numbers, changes), 0)
    rows = said._replace(ids=ids, groups=groups)
    order = np.lexsort((-np.arange(len(ids)), -rows.confidence, rows.inferred, rows.ids, rows.frames))
    order = order[ids[order] > 0]
    ids, frames = rows.ids[order], rows.frames[order]
    first = np.append(True, (np.diff(ids) != 0) | (np.diff(frames) != 0))[: len(order)]
    return Settled(_taken(rows, order[first]))


def _renamed(said: Index, frames: Index, numbers: Index, changes: Sequence[Change]) -> Index:
    """The settled ids of what was called `said` in some frames by reports of some numbers; 0 for what was dropped."""
    ids = said.copy()
    if not changes:
        return ids
    order = np.argsort(said, kind="stable")
    names, begins = np.unique(said[order], return_index=True)
    called = dict(zip(names.tolist(), np.split(order, begins[1:]), strict=True))  # id -> rows that have it now
    since = numbers.copy()  # the report that gave each row its present id
    for number, one in changes:
        old, new = (one.id, 0) if isinstance(one, Dropped) else (one.old, one.new)
        mine = called.get(old)
        if mine is None or not len(mine):
            continue
        met = (since[mine] < number) & (frames[mine] >= one.begin) & (frames[mine] <= one.end)
        if met.any():
            moved, called[old] = mine[met], mine[~met]
            ids[moved], since[moved] = new, number
            if new:
                called[new] = np.concatenate([called.get(new, moved[:0]), moved])
    return ids


def _taken(rows: Columns, index: Any) -> Columns:
    return Columns(*(column[index] for column in rows))

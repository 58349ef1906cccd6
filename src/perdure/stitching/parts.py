"""What stitching must know of the tracks of one part of a film."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import areas, intersections
from perdure.looks import Portraits
from perdure.types import Status, Tracks

_SAME_PLACE = 0.5  # intersection over union from which two are at one place


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
    `odds` the log odds of looks, NaN where nothing is known of them; `sure` what all that tells, in nats.
    """

    earlier: tuple[int, int]
    later: tuple[int, int]
    begin: int
    end: int
    frames: int
    score: float
    odds: float
    gap: float  # s for which nobody saw it
    sure: float


def _seen(rows: Tracks) -> NDArray[np.bool_]:
    """Which rows rest on something seen."""
    return np.asarray(~rows.inferred & (rows.status != Status.LOST) & (rows.status != Status.OCCLUDED))


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

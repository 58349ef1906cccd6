"""Where people come in and go out: at the border of the picture, and at doors inside it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.scene.learning.occluders import Broken
from perdure.scene.learning.paths import Paths, feet_of, linked, linked_along, side_of
from perdure.scene.learning.proposals import (
    AROUND,
    LEAST,
    Proposal,
    around,
    numbered,
    proposed,
    touch_any,
    touches,
)
from perdure.scene.zones import Polygon, rectangle

Float = NDArray[np.float64]
Bools = NDArray[np.bool_]
Index = NDArray[np.intp]
SIDES = ("left", "right", "top", "bottom")
_LEAST_AT_BORDER = 2  # and at its border; of those who come and those who go together, `LEAST` do
_STOOD = 0.5  # s after the film's begin and before its end, in which who is seen stood there
_SHALLOW, _DEEP = 0.04, 0.15  # of the picture, that a zone at the border reaches in
_CORNER = 0.05  # of the picture's side: what is so near to a corner reaches it


class _Ends(NamedTuple):
    """Begins, or ends, of walks (N,)."""

    kind: str
    verb: str
    boxes: Float  # (N, 4)
    side: Index  # (N,) of the picture, at whose border; -1 for none
    inside: Bools  # (N,) not at the border, and with nobody near

    def why_none(self, most: int) -> str:
        return f"who {self.verb} at one place: {most} at most, needed are {_LEAST_AT_BORDER}"


def gates_of(
    walks: Paths,
    broken: Broken,
    span: tuple[float, float],
    hidden: Sequence[Proposal],
    size: tuple[int, int],
) -> tuple[list[Proposal], list[Proposal], dict[str, str]]:
    """The zones where walks begin, those where they end, and why there are none of a kind."""
    torn = np.zeros((2, len(walks)), np.bool_)  # begins, ends
    torn[0, broken.begins] = torn[1, broken.ends] = True
    both = [
        ("entry", "came in", walks.first, walks.begin > span[0] + _STOOD, torn[0] | walks.parted),
        ("exit", "went out", walks.last, walks.end < span[1] - _STOOD, torn[1] | walks.met),
    ]
    ends = []
    for kind, verb, boxes, telling, not_alone in both:
        side = np.where(telling, side_of(boxes, walks, size), -1)
        inside = telling & (side < 0) & ~not_alone & ~touch_any(boxes, hidden)
        ends.append(_Ends(kind, verb, boxes, side, inside))
    found: dict[str, list[Proposal]] = {one.kind: [] for one in ends}
    most = dict.fromkeys(found, 0)
    for number, name in enumerate(SIDES):
        for place, counts in _at_side(number, ends, walks, size):
            for one, count in zip(ends, counts, strict=True):
                most[one.kind] = max(most[one.kind], count)
                if count >= _LEAST_AT_BORDER or (count and sum(counts) >= LEAST):
                    why = f"{count} {one.verb} here"
                    found[one.kind].append(proposed(one.kind, f"{one.kind} {name}", place, count, why))
    why_none = {}
    for one in ends:
        doors, many = _doors(one, walks, size)
        found[one.kind] += [door for door in doors if not touches(door, found[one.kind])]
        why_none[one.kind] = one.why_none(max(most[one.kind], many))
    return numbered(found["entry"]), numbered(found["exit"]), why_none


def _at_side(
    number: int, ends: Sequence[_Ends], walks: Paths, size: tuple[int, int]
) -> Iterator[tuple[tuple[Polygon, ...], list[int]]]:
    """The places along a side of the picture where walks begin or end, and how many do each."""
    axis = 1 if number < 2 else 0
    mine = [np.flatnonzero(one.side == number) for one in ends]
    boxes = np.concatenate([one.boxes[rows] for one, rows in zip(ends, mine, strict=True)])
    kinds = np.repeat(np.arange(len(ends)), [len(rows) for rows in mine])
    owners = np.concatenate(mine)
    for cluster in linked_along(boxes[:, axis], boxes[:, axis + 2], walks.side[owners]):
        across = (walks.wide if number < 2 else walks.tall)[owners[cluster]]
        place = _band(boxes[cluster], float(np.median(across)), number, size)
        yield place, np.bincount(kinds[cluster], minlength=len(ends)).tolist()


def _band(boxes: Float, across: float, side: int, size: tuple[int, int]) -> tuple[Polygon, ...]:
    """A rectangle along a side round boxes (N, 4) there, as deep as things that are so long `across` it."""
    height, width = size
    axis, inwards = (1, 0) if side < 2 else (0, 1)
    long, deep = (height, width) if side < 2 else (width, height)
    low, high = float(boxes[:, axis].min()), float(boxes[:, axis + 2].max())
    margin = AROUND * float(np.median(boxes[:, axis + 2] - boxes[:, axis]))
    reach = boxes[:, inwards + 2] if side in (0, 2) else deep - boxes[:, inwards]
    wanted = (1 + AROUND) * max(float(np.quantile(reach, 0.9)), across)
    depth = float(np.clip(wanted, _SHALLOW * deep, _DEEP * deep))
    low, high = _snapped(low - margin, high + margin, long)
    near, far = (0.0, float(round(depth))) if side in (0, 2) else (float(deep - round(depth)), float(deep))
    return rectangle(near, low, far, high) if side < 2 else rectangle(low, near, high, far)


def _snapped(low: float, high: float, long: int) -> tuple[float, float]:
    """An interval in whole pixels in the picture; to its corner, where little is left."""
    low, high = max(0, round(low)), min(long, round(high))
    return (
        float(0 if low < _CORNER * long else low),
        float(long if high > (1 - _CORNER) * long else high),
    )


def _doors(ends: _Ends, walks: Paths, size: tuple[int, int]) -> tuple[list[Proposal], int]:
    """Zones inside the picture, and how many paths the largest cluster has."""
    mine, found, most = np.flatnonzero(ends.inside), [], 0
    for cluster in linked(feet_of(ends.boxes[mine]), walks.side[mine]):
        members = mine[cluster]
        most = max(most, len(members))
        if len(members) >= LEAST:
            margin = float(np.median(walks.side[members])) / 2
            place = around(feet_of(ends.boxes[members]), margin, size)
            why = f"{len(members)} {ends.verb} here, inside the picture"
            found.append(proposed(ends.kind, f"{ends.kind} door", place, len(members), why))
    return found, most

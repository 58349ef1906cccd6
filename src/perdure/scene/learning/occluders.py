"""What hides people: what the background model found in front, and where they are lost and found again."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.scene.learning.paths import Paths, feet_of, linked, seen_rows, share_covered, side_of
from perdure.scene.learning.proposals import LEAST, Proposal, numbered, proposed, rectangle_in, touch_any, touching
from perdure.scene.zones import Polygon
from perdure.types import Tracks

Float = NDArray[np.float64]
Index = NDArray[np.intp]
_LEAST_HIDDEN = 2  # things that went behind what stands in the background
_PAUSE = 0.3  # s without being seen, from which somebody is lost
_SOON = 3.0  # s after which a walk that broke goes on
_HIDES = 0.3  # of their size, that what hides them is wide at least
_LEAP = 3.0  # own sides, over which one who was lost is found again
_IN_FRONT = 0.2  # share of a box under another's, from which that one hides it
_SEAM = 2.0  # px by which a bridge overlaps what it joins
_ROUND = 0.004  # of the picture's shorter side, by which an outline may be simpler
_CORNERS = 12  # that an occluder has at most


class Standing(NamedTuple):
    """Something that the background model found to stand in front."""

    outline: NDArray[np.float32]  # (K, 2) xy, px
    ended: float  # things that were hidden by it
    confidence: float


class _Lost(NamedTuple):
    """Where N walks were lost and found again."""

    ids: NDArray[np.int64]  # (N,)
    before: Float  # (N, 4) the last box seen
    after: Float  # (N, 4) the next one
    side: Float  # (N,) of what was lost


class Broken(NamedTuple):
    """Pairs (P,) of walks of which the second goes on where the first broke off."""

    ends: Index
    begins: Index


def broken_walks(walks: Paths, size: tuple[int, int]) -> Broken:
    """Which walks end inside the picture where another begins soon after; of several the nearest."""
    pairs: list[tuple[int, int]] = []
    one, other = feet_of(walks.last), feet_of(walks.first)
    last_inside, first_inside = side_of(walks.last, walks, size) < 0, side_of(walks.first, walks, size) < 0
    order = np.argsort(walks.begin, kind="stable")
    after = np.searchsorted(walks.begin[order], walks.end, side="right")
    until = np.searchsorted(walks.begin[order], walks.end + _SOON, side="right")
    for number in np.flatnonzero(last_inside):
        soon = order[after[number] : until[number]]
        soon = soon[first_inside[soon]]
        apart = np.hypot(*(other[soon] - one[number]).T)
        if apart.size and apart.min() <= _LEAP * walks.side[number]:
            pairs.append((int(number), int(soon[apart.argmin()])))
    ends, begins = np.array(pairs, np.intp).reshape(-1, 2).T
    return Broken(ends, begins)


def lost_walks(rows: Tracks, walks: Paths, broken: Broken) -> _Lost:
    """Where walks were not seen for a while, with nobody in front of them and on their way."""
    seen = seen_rows(rows)
    boxes = np.asarray(seen.boxes, np.float64)
    gone = np.flatnonzero((np.diff(seen.ids) == 0) & (np.diff(seen.times) > _PAUSE))
    gone = gone[np.isin(seen.ids[gone], walks.ids)]
    order = np.argsort(seen.frames, kind="stable")
    frames, free = seen.frames[order], np.ones(len(gone), np.bool_)
    for number, row in enumerate(gone):
        for end in (row, row + 1):
            start, stop = np.searchsorted(frames, [seen.frames[end], seen.frames[end] + 1])
            others = order[start:stop]
            others = others[seen.ids[others] != seen.ids[end]]
            free[number] &= not (share_covered(boxes[end], boxes[others]) >= _IN_FRONT).any()
    gone = gone[free]
    side = walks.side[np.searchsorted(walks.ids, seen.ids[gone])]
    moved = np.hypot(*(feet_of(boxes[gone + 1]) - feet_of(boxes[gone])).T)
    on_way = moved <= _LEAP * side
    gone, side = gone[on_way], side[on_way]
    alone = ~(walks.met[broken.ends] | walks.parted[broken.begins])
    ends, begins = broken.ends[alone], broken.begins[alone]
    return _Lost(
        np.append(seen.ids[gone], walks.ids[ends]),
        np.concatenate([boxes[gone], walks.last[ends]]),
        np.concatenate([boxes[gone + 1], walks.first[begins]]),
        np.append(side, walks.side[ends]),
    )


def occluders_of(
    lost: _Lost, standing: Sequence[Standing], walks: Paths, size: tuple[int, int]
) -> tuple[list[Proposal], str]:
    """The zones of what hides walks, and why there are none."""
    places = _hidden_parts(lost)
    middle = (places[:, :2] + places[:, 2:]) / 2
    found = []
    for shape, ended in _joined(standing, float(np.median(walks.side)) / 2 if len(walks) else 0.0):
        again = int(touching(places, shape).sum())
        why = f"about {ended} went behind what stands here in the background"
        more = f"; {again} {'was' if again == 1 else 'were'} lost and found again" if again else ""
        found.append(proposed("occlusion", "occluder", _simple(shape, size), ended, f"{why}{more}"))
    most, explained = 0, touch_any(places, found)
    left = np.flatnonzero(~explained)
    for cluster in linked(middle[left], lost.side[left]):
        members = left[cluster]
        people = len(np.unique(lost.ids[members]))
        most = max(most, people)
        if people >= LEAST:
            x1, _, x2, _ = np.median(places[members], axis=0)
            y1, y2 = places[members, 1].min(), places[members, 3].max()
            thin = max(0.0, _HIDES * float(np.median(lost.side[members])) - (x2 - x1)) / 2
            x1, x2 = x1 - thin, x2 + thin
            place = rectangle_in(x1, y1, x2, y2, size)
            why = f"{people} were lost and found again here"
            found.append(proposed("occlusion", "occluder", place, people, why))
    why = f"who were lost and found again at one place: {most} at most, needed are {LEAST}"
    return numbered(found), why


def _hidden_parts(lost: _Lost) -> Float:
    """Boxes (N, 4) of what hid walks: between where they were seen last and next, and where both are, their middle."""
    low = np.minimum(lost.before[:, 2:], lost.after[:, 2:])  # the nearer ends
    high = np.maximum(lost.before[:, :2], lost.after[:, :2])
    one, other = np.minimum(low, high), np.maximum(low, high)
    tops = np.minimum(lost.before[:, 1], lost.after[:, 1])
    bottoms = np.maximum(lost.before[:, 3], lost.after[:, 3])
    aside = np.abs(lost.after - lost.before)
    upright = aside[:, 1] + aside[:, 3] > aside[:, 0] + aside[:, 2]  # they went up or down
    lefts, rights = (
        np.minimum(lost.before[:, 0], lost.after[:, 0]),
        np.maximum(lost.before[:, 2], lost.after[:, 2]),
    )
    return np.where(
        upright[:, None],
        np.column_stack([lefts, one[:, 1], rights, other[:, 1]]),
        np.column_stack([one[:, 0], tops, other[:, 0], bottoms]),
    )


def _shape(outline: NDArray[Any]) -> Any:
    """An outline (K, 2) as a geometry of shapely; None if it has no area."""
    import shapely

    if len(outline) < 3:
        return None
    shape = shapely.make_valid(shapely.Polygon(np.asarray(outline, np.float64)))
    largest = _largest(shape)
    return largest if largest.geom_type == "Polygon" and largest.area > 0 else None


def _joined(standing: Sequence[Standing], gap: float) -> list[tuple[Any, int]]:
    """What stands in front as shapes, and how many went behind it; parts above one another, or beside, are one thing."""
    import shapely

    shapes = [(_shape(one.outline), one.ended) for one in standing]
    parts = [(shape, ended) for shape, ended in shapes if shape is not None]
    joined = True
    while joined:
        joined = False
        for i, j in combinations(range(len(parts)), 2):
            bridge = _bridge(parts[i][0], parts[j][0], gap)
            if bridge is not None:
                whole = shapely.union_all([parts[i][0], parts[j][0], bridge])
                parts[i] = (_largest(whole), max(parts[i][1], parts[j][1]))
                parts.pop(j)
                joined = True
                break
    return [(shape, round(ended)) for shape, ended in parts if round(ended) >= _LEAST_HIDDEN]


def _bridge(one: Any, other: Any, gap: float) -> Any:
    """What lies between two shapes of one thing; None if they are not nearer than the gap, or not in one line."""
    import shapely

    if one.distance(other) > gap:
        return None
    a, b = np.array(one.bounds), np.array(other.bounds)
    low, high = np.maximum(a[:2], b[:2]), np.minimum(a[2:], b[2:])  # x, y of what they share; turned where apart
    if (low < high).sum() < 1:
        return None
    return shapely.box(*np.minimum(low, high) - _SEAM, *np.maximum(low, high) + _SEAM)


def _largest(shape: Any) -> Any:
    import shapely

    return max(shapely.get_parts(shape), key=lambda part: float(part.area))


def _simple(shape: Any, size: tuple[int, int]) -> tuple[Polygon, ...]:
    """A shape with few corners, in whole pixels, in the picture, and a little larger than it was."""
    import shapely

    height, width = size
    wide = shapely.buffer(shape, _ROUND * min(size), join_style="mitre")
    for tolerance in (_ROUND, 2 * _ROUND, 4 * _ROUND):
        kept = shapely.simplify(wide, tolerance * min(size))
        if len(kept.exterior.coords) - 1 <= _CORNERS:
            break
    else:
        kept = shapely.convex_hull(kept)
    kept = shapely.intersection(kept, shapely.box(0, 0, width, height))
    points = np.rint(np.asarray(kept.exterior.coords)[:-1]) if kept.geom_type == "Polygon" else np.zeros((0, 2))
    ring = tuple((float(x), float(y)) for x, y in points)
    if len(set(ring)) < 3 or not shapely.is_valid(shapely.Polygon(ring)):
        x1, y1, x2, y2 = shape.bounds
        return rectangle_in(x1, y1, x2, y2, size)
    return ((ring,),)

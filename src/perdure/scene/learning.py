"""Zones proposed from the tracks of a run: where people come in and go out, what hides them, what only flickers.

A *path* is what one id was seen to do. It is a *walk* if it lasts for a second and leaves its place by half its own side;
it is a *flicker* if it lasts for less than a second and goes no farther than its own side, or for less than three and
stays where it is. Only walks tell of entries, exits and occluders, only flickers of noise.

=========  ==================================================================================================
entry,     begins and ends of walks at the picture's border, a rectangle along it for each cluster of both; and
exit       begins or ends inside (a door), if nobody was near with whom they parted or met, if they are not the
           two ends of one walk that broke, and if they are not at a zone of the kind along the border
occlusion  what the background model found to stand in front; and where walks were lost and found again while
           nobody was in front of them
noise      where flickers are, unless more walks begin there than flickers
=========  ==================================================================================================

Clusters are single linkage: two places belong together if they are nearer to one another than the mean size of their
things, and so does all that hangs together by such pairs. They depend on no order and on no random number. Who stood
there when the film began, or when it ended, tells neither an entry nor an exit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.scene.zones import Polygon, Zone, rectangle, shape_of
from perdure.types import Status, Tracks

Float = NDArray[np.float64]
Bools = NDArray[np.bool_]
Index = NDArray[np.intp]

LEARNT = ("entry", "exit", "occlusion", "noise")  # kinds that can be proposed
SIDES = ("left", "right", "top", "bottom")


class Standing(NamedTuple):
    """Something that the background model found to stand in front."""

    outline: NDArray[np.float32]  # (K, 2) xy, px
    ended: float  # things that were hidden by it
    confidence: float


@dataclass(frozen=True)
class Proposal:
    """A zone, and what speaks for it."""

    zone: Zone
    count: int  # paths, or things hidden
    reason: str


@dataclass(frozen=True)
class Learnt:
    """What the tracks of a run tell of its place."""

    proposals: tuple[Proposal, ...]
    missing: Mapping[str, str]  # kinds of which no zone is proposed, and why
    walks: int  # paths that told anything


def learn_zones(
    rows: Tracks, size: tuple[int, int], span: tuple[float, float], standing: Sequence[Standing] = ()
) -> Learnt:
    """Propose zones from settled tracks.

    Parameters
    ----------
    rows : Tracks
        All of them, of all statuses; silhouettes are not needed.
    size : (int, int)
        Height and width of the picture.
    span : (float, float)
        Times of the first and last frame, in seconds.
    standing : sequence of Standing
        What the background model found to stand in front.

    Returns
    -------
    Learnt
        Entries first, then exits, occluders, noise; each kind from left to right.
    """
    paths = _paths(rows, size)
    walks = paths.take(paths.walks)
    broken = _broken(walks, size)
    hidden, no_occluder = _occluders(_lost(rows, walks, broken), standing, walks, size)
    ins, outs, no_gate = _gates(walks, broken, span, hidden, size)
    noise, no_noise = _noise(paths, walks, size)
    found = (*ins, *outs, *hidden, *noise)
    few = f"tracks that went anywhere: {len(walks)}, needed are {_LEAST}" if len(walks) < _LEAST else ""
    why = {**no_gate, "occlusion": no_occluder, "noise": no_noise}
    kinds = {one.zone.kind for one in found}
    missing = {kind: (few if few and kind != "noise" else why[kind]) for kind in LEARNT if kind not in kinds}
    return Learnt(found, missing, len(walks))


@dataclass(frozen=True, eq=False)
class _Paths:
    """What N ids were seen to do."""

    ids: NDArray[np.int64]  # (N,)
    begin: Float  # (N,) s
    end: Float  # (N,) s
    first: Float  # (N, 4) the first box, in the picture
    last: Float  # (N, 4)
    side: Float  # (N,) root of the median area, px
    wide: Float  # (N,) median width, px
    tall: Float  # (N,) median height, px
    far: Float  # (N,) farthest from where it began, in its own sides
    parted: Bools  # (N,) somebody who was there before was near where it began
    met: Bools  # (N,) somebody who stayed was near where it ended

    def __len__(self) -> int:
        return int(self.ids.size)

    def take(self, chosen: Bools) -> _Paths:
        return _Paths(**{name: column[chosen] for name, column in vars(self).items()})

    @property
    def lives(self) -> Float:
        return self.end - self.begin

    @property
    def walks(self) -> Bools:
        return np.asarray((self.lives >= _WALK) & (self.far >= _FAR))

    @property
    def flickers(self) -> Bools:
        brief = (self.lives < _WALK) & (self.far < 1.0)
        return np.asarray(brief | ((self.lives < _FLICKER) & (self.far < _FAR)))


def _seen(rows: Tracks) -> Tracks:
    """The rows of what is seen, by id and frame; no groups, nothing that was filled in."""
    status = np.isin(rows.status, (Status.VISIBLE, Status.PARTLY_OCCLUDED, Status.AMBIGUOUS))
    seen = rows.take(status & ~rows.is_group & ~rows.inferred)
    return seen.take(np.lexsort((seen.frames, seen.ids)))


def _inside(boxes: NDArray[Any], size: tuple[int, int]) -> Float:
    height, width = size
    return np.clip(np.asarray(boxes, np.float64).reshape(-1, 4), 0.0, [width, height, width, height])


def _paths(rows: Tracks, size: tuple[int, int]) -> _Paths:
    """What each id was seen to do."""
    seen = _seen(rows)
    boxes = _inside(seen.boxes, size)
    ids, starts = np.unique(seen.ids, return_index=True)
    stops = np.append(starts, len(seen))[1:]
    feet = _feet(boxes)
    side, wide, tall, far = np.zeros((4, len(ids)))
    for number, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        own = boxes[start:stop]
        across, high = (own[:, 2:] - own[:, :2]).T
        side[number] = max(1.0, float(np.median(np.sqrt(across * high))))
        wide[number], tall[number] = np.median(across), np.median(high)
        far[number] = np.hypot(*(feet[start:stop] - feet[start]).T).max() / side[number]
    begins, ends = seen.frames[starts], seen.frames[stops - 1]
    near = _Near(seen.frames, seen.ids, boxes, begins, ends, ids)
    return _Paths(
        ids,
        seen.times[starts],
        seen.times[stops - 1],
        boxes[starts],
        boxes[stops - 1],
        side,
        wide,
        tall,
        far,
        np.array([near.with_another(row, before=True) for row in starts], np.bool_),
        np.array([near.with_another(row, before=False) for row in stops - 1], np.bool_),
    )


class _Near:
    """Who else is seen where a path begins or ends."""

    def __init__(
        self,
        frames: NDArray[np.int64],
        ids: NDArray[np.int64],
        boxes: Float,
        begins: NDArray[np.int64],
        ends: NDArray[np.int64],
        names: NDArray[np.int64],
    ) -> None:
        order = np.argsort(frames, kind="stable")
        self._frames, self._rows = frames[order], order
        self._own, self._ids, self._boxes = frames, ids, boxes
        place = np.searchsorted(names, ids)
        self._begins, self._ends = begins[place], ends[place]

    def with_another(self, row: int, *, before: bool, share: float = 0.2) -> bool:
        """Whether another, who was there before (or stayed after), covers this share of a row's box."""
        frame = self._own[row]
        start, stop = np.searchsorted(self._frames, [frame, frame + 1])
        others = self._rows[start:stop]
        lasting = self._begins[others] < frame if before else self._ends[others] > frame
        others = others[lasting & (self._ids[others] != self._ids[row])]
        return bool((_covered(self._boxes[row], self._boxes[others]) >= share).any())


def _covered(box: Float, others: Float) -> Float:
    """The share (N,) of a box (4,) under others (N, 4)."""
    wide, high = (np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])).clip(0).T
    return np.asarray(wide * high / max(1e-9, float(np.prod(box[2:] - box[:2]))))


def _feet(boxes: Float) -> Float:
    return np.column_stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]])


def _linked(points: Float, reach: Float) -> list[Index]:
    """Clusters (single linkage) of points (N, 2) nearer to one another than the mean of their reaches (N,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if not len(points):
        return []
    one, other = cKDTree(points).query_pairs(float(reach.max()), output_type="ndarray").T
    near = np.hypot(*(points[one] - points[other]).T) <= (reach[one] + reach[other]) / 2
    graph = coo_array((np.ones(near.sum()), (one[near], other[near])), (len(points), len(points)))
    count, names = connected_components(graph, directed=False)
    return [np.flatnonzero(names == number) for number in range(count)]


def _along(low: Float, high: Float, reach: Float) -> list[Index]:
    """Clusters (single linkage) of intervals (N,) nearer to one another than the mean of their reaches (N,)."""
    low, high = low - reach / 2, high + reach / 2
    order = np.lexsort((high, low))
    apart = low[order][1:] > np.maximum.accumulate(high[order])[:-1]
    return [np.sort(part) for part in np.split(order, np.flatnonzero(apart) + 1) if len(part)]


# Entries and exits -----------------------------------------------------------------------------------------


class _Ends(NamedTuple):
    """Begins, or ends, of walks (N,)."""

    kind: str
    verb: str
    boxes: Float  # (N, 4)
    side: Index  # (N,) of the picture, at whose border; -1 for none
    inside: Bools  # (N,) not at the border, and with nobody near

    def why_none(self, most: int) -> str:
        return f"who {self.verb} at one place: {most} at most, needed are {_LEAST_AT_BORDER}"


def _gates(
    walks: _Paths,
    broken: _Broken,
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
        side = np.where(telling, _side(boxes, walks, size), -1)
        inside = telling & (side < 0) & ~not_alone & ~_behind(boxes, hidden)
        ends.append(_Ends(kind, verb, boxes, side, inside))
    found: dict[str, list[Proposal]] = {one.kind: [] for one in ends}
    most = dict.fromkeys(found, 0)
    for number, name in enumerate(SIDES):
        for place, counts in _at_side(number, ends, walks, size):
            for one, count in zip(ends, counts, strict=True):
                most[one.kind] = max(most[one.kind], count)
                if count >= _LEAST_AT_BORDER or (count and sum(counts) >= _LEAST):
                    why = f"{count} {one.verb} here"
                    found[one.kind].append(_proposal(one.kind, f"{one.kind} {name}", place, count, why))
    why_none = {}
    for one in ends:
        doors, many = _doors(one, walks, size)
        found[one.kind] += [door for door in doors if not _touches(door, found[one.kind])]
        why_none[one.kind] = one.why_none(max(most[one.kind], many))
    return _numbered(found["entry"]), _numbered(found["exit"]), why_none


def _at_side(
    number: int, ends: Sequence[_Ends], walks: _Paths, size: tuple[int, int]
) -> Iterator[tuple[tuple[Polygon, ...], list[int]]]:
    """The places along a side of the picture where walks begin or end, and how many do each."""
    axis = 1 if number < 2 else 0
    mine = [np.flatnonzero(one.side == number) for one in ends]
    boxes = np.concatenate([one.boxes[rows] for one, rows in zip(ends, mine, strict=True)])
    kinds = np.repeat(np.arange(len(ends)), [len(rows) for rows in mine])
    owners = np.concatenate(mine)
    for cluster in _along(boxes[:, axis], boxes[:, axis + 2], walks.side[owners]):
        across = (walks.wide if number < 2 else walks.tall)[owners[cluster]]
        place = _band(boxes[cluster], float(np.median(across)), number, size)
        yield place, np.bincount(kinds[cluster], minlength=len(ends)).tolist()


def _side(boxes: Float, walks: _Paths, size: tuple[int, int]) -> Index:
    """At which side of the picture boxes (N, 4) are, the nearest; -1 for none."""
    height, width = size
    gaps = np.stack([boxes[:, 0], width - boxes[:, 2], boxes[:, 1], height - boxes[:, 3]], axis=1)  # (N, 4)
    margin = np.maximum(_MARGIN * min(size), _OWN_MARGIN * walks.side)
    nearest = gaps.argmin(axis=1)
    return np.where(gaps.min(axis=1, initial=np.inf) <= margin, nearest, -1)


def _band(boxes: Float, across: float, side: int, size: tuple[int, int]) -> tuple[Polygon, ...]:
    """A rectangle along a side round boxes (N, 4) there, as deep as things that are so long `across` it."""
    height, width = size
    axis, inwards = (1, 0) if side < 2 else (0, 1)
    long, deep = (height, width) if side < 2 else (width, height)
    low, high = float(boxes[:, axis].min()), float(boxes[:, axis + 2].max())
    margin = _AROUND * float(np.median(boxes[:, axis + 2] - boxes[:, axis]))
    reach = boxes[:, inwards + 2] if side in (0, 2) else deep - boxes[:, inwards]
    wanted = (1 + _AROUND) * max(float(np.quantile(reach, 0.9)), across)
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


def _doors(ends: _Ends, walks: _Paths, size: tuple[int, int]) -> tuple[list[Proposal], int]:
    """Zones inside the picture, and how many paths the largest cluster has."""
    mine, found, most = np.flatnonzero(ends.inside), [], 0
    for cluster in _linked(_feet(ends.boxes[mine]), walks.side[mine]):
        members = mine[cluster]
        most = max(most, len(members))
        if len(members) >= _LEAST:
            margin = float(np.median(walks.side[members])) / 2
            place = _around(_feet(ends.boxes[members]), margin, size)
            why = f"{len(members)} {ends.verb} here, inside the picture"
            found.append(_proposal(ends.kind, f"{ends.kind} door", place, len(members), why))
    return found, most


def _around(points: Float, margin: float, size: tuple[int, int]) -> tuple[Polygon, ...]:
    """A rectangle round points (N, 2), in the picture."""
    (x1, y1), (x2, y2) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return _rectangle(x1, y1, x2, y2, size)


def _rectangle(x1: float, y1: float, x2: float, y2: float, size: tuple[int, int]) -> tuple[Polygon, ...]:
    """A rectangle in whole pixels in the picture, at least a pixel wide and high."""
    height, width = size
    left, top = min(max(0, round(x1)), width - 1), min(max(0, round(y1)), height - 1)
    right, bottom = min(width, max(round(x2), left + 1)), min(height, max(round(y2), top + 1))
    return rectangle(float(left), float(top), float(right), float(bottom))


# Occluders -------------------------------------------------------------------------------------------------


class _Lost(NamedTuple):
    """Where N walks were lost and found again."""

    ids: NDArray[np.int64]  # (N,)
    before: Float  # (N, 4) the last box seen
    after: Float  # (N, 4) the next one
    side: Float  # (N,) of what was lost


class _Broken(NamedTuple):
    """Pairs (P,) of walks of which the second goes on where the first broke off."""

    ends: Index
    begins: Index


def _broken(walks: _Paths, size: tuple[int, int]) -> _Broken:
    """Which walks end inside the picture where another begins soon after; of several the nearest."""
    pairs: list[tuple[int, int]] = []
    one, other = _feet(walks.last), _feet(walks.first)
    last_inside, first_inside = _side(walks.last, walks, size) < 0, _side(walks.first, walks, size) < 0
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
    return _Broken(ends, begins)


def _lost(rows: Tracks, walks: _Paths, broken: _Broken) -> _Lost:
    """Where walks were not seen for a while, with nobody in front of them and on their way."""
    seen = _seen(rows)
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
            free[number] &= not (_covered(boxes[end], boxes[others]) >= _IN_FRONT).any()
    gone = gone[free]
    side = walks.side[np.searchsorted(walks.ids, seen.ids[gone])]
    moved = np.hypot(*(_feet(boxes[gone + 1]) - _feet(boxes[gone])).T)
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


def _occluders(
    lost: _Lost, standing: Sequence[Standing], walks: _Paths, size: tuple[int, int]
) -> tuple[list[Proposal], str]:
    """The zones of what hides walks, and why there are none."""
    places = _hidden_parts(lost)
    middle = (places[:, :2] + places[:, 2:]) / 2
    found = []
    for shape, ended in _joined(standing, float(np.median(walks.side)) / 2 if len(walks) else 0.0):
        again = int(_touching(places, shape).sum())
        why = f"about {ended} went behind what stands here in the background"
        more = f"; {again} {'was' if again == 1 else 'were'} lost and found again" if again else ""
        found.append(_proposal("occlusion", "occluder", _simple(shape, size), ended, f"{why}{more}"))
    most, explained = 0, _behind(places, found)
    left = np.flatnonzero(~explained)
    for cluster in _linked(middle[left], lost.side[left]):
        members = left[cluster]
        people = len(np.unique(lost.ids[members]))
        most = max(most, people)
        if people >= _LEAST:
            x1, _, x2, _ = np.median(places[members], axis=0)
            y1, y2 = places[members, 1].min(), places[members, 3].max()
            thin = max(0.0, _HIDES * float(np.median(lost.side[members])) - (x2 - x1)) / 2
            x1, x2 = x1 - thin, x2 + thin
            place = _rectangle(x1, y1, x2, y2, size)
            why = f"{people} were lost and found again here"
            found.append(_proposal("occlusion", "occluder", place, people, why))
    why = f"who were lost and found again at one place: {most} at most, needed are {_LEAST}"
    return _numbered(found), why


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
        return _rectangle(x1, y1, x2, y2, size)
    return ((ring,),)


def _touching(boxes: Float, shape: Any) -> Bools:
    import shapely

    if shape is None or not len(boxes):
        return np.zeros(len(boxes), np.bool_)
    return np.asarray(shapely.intersects(shape, shapely.box(*boxes.T)), np.bool_)


def _behind(boxes: Float, proposals: Sequence[Proposal]) -> Bools:
    """Which boxes (N, 4) touch a zone that is proposed."""
    behind = np.zeros(len(boxes), np.bool_)
    for one in proposals:
        behind |= _touching(boxes, shape_of(one.zone.polygons))
    return behind


# Noise -----------------------------------------------------------------------------------------------------


def _noise(paths: _Paths, walks: _Paths, size: tuple[int, int]) -> tuple[list[Proposal], str]:
    """Where hardly anything but flickers begins, and why there is no such place."""
    brief = paths.take(paths.flickers & ~paths.parted)
    middle, most, found = (brief.first[:, :2] + brief.first[:, 2:]) / 2, 0, []
    for cluster in _linked(middle, brief.side):
        most = max(most, len(cluster))
        if len(cluster) < _LEAST:
            continue
        boxes = np.concatenate([brief.first[cluster], brief.last[cluster]])
        margin = _AROUND * float(np.median(brief.side[cluster]))
        corners = np.concatenate([boxes[:, :2].min(axis=0) - margin, boxes[:, 2:].max(axis=0) + margin])
        x1, y1, x2, y2 = corners.tolist()
        feet = _feet(walks.first)
        begun = int(((feet >= corners[:2]) & (feet <= corners[2:])).all(axis=1).sum())
        if begun < len(cluster):
            why = f"{len(cluster)} were seen here for a moment and went nowhere"
            place = _rectangle(x1, y1, x2, y2, size)
            found.append(_proposal("noise", "flicker", place, len(cluster), why))
    why = f"what flickered at one place: {most} at most, needed are {_LEAST}"
    return _numbered(found), why if most < _LEAST else "where things flicker as many walks begin"


# Words -----------------------------------------------------------------------------------------------------


def _proposal(kind: str, name: str, place: tuple[Polygon, ...], count: int, reason: str) -> Proposal:
    return Proposal(Zone(kind, name, place), count, reason)


def _touches(one: Proposal, others: Iterable[Proposal]) -> bool:
    """Whether a zone shares a place with another."""
    own = shape_of(one.zone.polygons)
    return any(own.intersection(shape_of(other.zone.polygons)).area > 0 for other in others)


def _numbered(proposals: Sequence[Proposal]) -> list[Proposal]:
    """From left to right, top to bottom; where several have one name, with a number."""
    ordered = sorted(proposals, key=lambda one: (one.zone.name, min(one.zone.polygons[0][0])))
    told = []
    names = [one.zone.name for one in ordered]
    for number, one in enumerate(ordered):
        name = one.zone.name
        if names.count(name) > 1:
            name = f"{name} {names[: number + 1].count(name)}"
        told.append(Proposal(Zone(one.zone.kind, name, one.zone.polygons), one.count, one.reason))
    return told


_LEAST = 3  # paths that make a zone inside the picture
_LEAST_AT_BORDER = 2  # and at its border; of those who come and those who go together, `_LEAST` do
_LEAST_HIDDEN = 2  # things that went behind what stands in the background
_WALK = 1.0  # s that a walk lasts
_FAR = 0.5  # of its own side, that it goes
_FLICKER = 3.0  # s that somebody may stand before he is more than a flicker
_STOOD = 0.5  # s after the film's begin and before its end, in which who is seen stood there
_MARGIN = 0.02  # of the shorter side of the picture: who is so near to the border crosses it
_OWN_MARGIN = 0.3  # of the own side: the same
_AROUND = 0.25  # of things' size, that is left round them
_SHALLOW, _DEEP = 0.04, 0.15  # of the picture, that a zone at the border reaches in
_CORNER = 0.05  # of the picture's side: what is so near to a corner reaches it
_PAUSE = 0.3  # s without being seen, from which somebody is lost
_SOON = 3.0  # s after which a walk that broke goes on
_HIDES = 0.3  # of their size, that what hides them is wide at least
_LEAP = 3.0  # own sides, over which one who was lost is found again
_IN_FRONT = 0.2  # share of a box under another's, from which that one hides it
_SEAM = 2.0  # px by which a bridge overlaps what it joins
_ROUND = 0.004  # of the picture's shorter side, by which an outline may be simpler
_CORNERS = 12  # that an occluder has at most

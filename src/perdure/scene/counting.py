"""Who crosses a line, which way and how fast; who is in a zone, how many at once and for how long.

A target is where its foot is, the middle of the lower edge of its box, or the middle of the box. Between two rows it
goes straight, also where it was not seen for a while: who is lost on one side of a line and found on the other crossed
it once.

*In* is from the left of a line to its right, seen by who goes from its first point to its last; *out* is the other
way. Boxes jitter, therefore what happens near an edge is settled only when the target has got `away` pixels from it: a
line was crossed as often as its crossings there do not cancel out, which is once or not at all, at the time of the
last one; somebody was in a zone if he got so deep into it, and he left it if he got so far out.

Two who come as one region are two when they part. A new target, no mere piece, that was part of another's box just before, while that
other goes on, has come with it: for the last second before they parted it went as the other did, at the place beside
it where it was seen first, and what both crossed in that second both crossed.

>>> right = Tracks.of(frames=[0, 1, 2], times=[0, 1, 2], ids=[1, 1, 1], boxes=[[x, 0, x + 2, 9] for x in (0, 10, 20)])
>>> [(one.frame, one.time, one.direction) for one in crossings(right, [Line("door", ((9, 20), (9, 0)))], away=2)]
[(1, 0.8, 'in')]
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.errors import ParameterError
from perdure.params import unknown_name
from perdure.scene.zones import Polygon, Zone, shape_of
from perdure.types import Tracks

Float = NDArray[np.float64]
POINTS = ("foot", "centre")
IN, OUT = "in", "out"
_WITH = 1.0  # s for which who parts from another is thought to have come with it
_JUST = 0.25  # s, in which the other was seen before they parted, and for which both must be seen after it
_INSIDE = 0.7  # share of the new one's box in the other's before
_PIECE = 0.25  # of the other's area when they have parted; what is smaller is a piece of it
_SPAN = 0.25  # s before and after, over which a speed in pixels is measured


@dataclass(frozen=True)
class Line:
    """A line of two points or more, (x, y) in pixels; its direction is from the first to the last."""

    name: str
    points: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        if not any(one != self.points[0] for one in self.points):
            raise ParameterError(f"line {self.name!r} has no length; give it two different points x,y")


@dataclass(frozen=True)
class Crossing:
    """One target over one line."""

    frame: int  # the first at which it is beyond
    time: float  # s, between frames
    id: int
    label: str  # class, or empty
    line: str
    direction: str  # IN or OUT
    x: float  # px, where it crossed
    y: float
    speed: float | None  # px/s; None of a single row
    ground_speed: float | None  # m/s, where the ground is known


@dataclass(frozen=True)
class Visit:
    """One target in one zone."""

    id: int
    label: str  # class, or empty
    zone: str
    enter: float  # s, between frames
    leave: float
    entered: bool  # else it was there when it was first seen
    left: bool  # else it was there when it was last seen
    speed: float | None  # px/s, the median
    ground_speed: float | None  # m/s, where the ground is known

    @property
    def seconds(self) -> float:
        """How long it was there."""
        return self.leave - self.enter


@dataclass(frozen=True, eq=False)
class Counts:
    """All that was counted.

    Parameters
    ----------
    lines, zones : names
        What was counted, also where nobody came.
    crossings : tuple of Crossing
        In the order of time.
    visits : tuple of Visit
        In the order in which they began.
    frames, times : (F,) int64, float64
        The frames of the film.
    """

    lines: tuple[str, ...]
    zones: tuple[str, ...]
    crossings: tuple[Crossing, ...]
    visits: tuple[Visit, ...]
    frames: NDArray[np.int64]
    times: Float

    def of_line(self, name: str, direction: str) -> list[Crossing]:
        """Return the crossings of a line in one direction."""
        return [one for one in self.crossings if (one.line, one.direction) == (name, direction)]

    def of_zone(self, name: str) -> list[Visit]:
        """Return the visits of a zone."""
        return [one for one in self.visits if one.zone == name]

    def of_classes(self, labels: Sequence[str]) -> Counts:
        """Return what was counted of targets of these classes; a target's is the one that most of its rows have."""
        return dataclasses.replace(
            self,
            crossings=tuple(one for one in self.crossings if one.label in labels),
            visits=tuple(one for one in self.visits if one.label in labels),
        )

    @cached_property
    def occupancy(self) -> dict[str, NDArray[np.int64]]:
        """How many are in each zone at each frame, (F,); enter and leave included."""
        found = {}
        for zone in self.zones:
            visits = self.of_zone(zone)
            begun = np.searchsorted(np.sort([one.enter for one in visits]), self.times + _MOMENT, side="right")
            over = np.searchsorted(np.sort([one.leave for one in visits]), self.times - _MOMENT, side="left")
            found[zone] = np.asarray(begun - over, np.int64)
        return found


def count(
    tracks: Tracks,
    *,
    lines: Sequence[Line] = (),
    zones: Sequence[Zone] = (),
    size: tuple[int, int] | None = None,
    point: str = "foot",
    away: float | None = None,
    frames: ArrayLike | None = None,
    times: ArrayLike | None = None,
) -> Counts:
    """Count who crosses lines and who is in zones.

    Parameters
    ----------
    tracks : Tracks
        The rows that count: `tracks.counted()`.
    lines, zones : sequences
        What to count at, each with its own name.
    size : (int, int) or None
        Height and width of the picture, if known: boxes are taken as far as they lie in it.
    point : 'foot' or 'centre'
        Where a target is.
    away : float or None
        Pixels from a line or edge, from which what happened there is settled; None for `usual_away` of the size.
    frames, times : (F,) or None
        All frames of the film and their times, for the occupancy; None for those of the rows.

    Raises
    ------
    ParameterError
        For an unknown `point`, an `away` that is none, or two lines or zones of one name.
    """
    away = usual_away(size) if away is None else away
    if not (math.isfinite(away) and away >= 0):
        raise ParameterError(f"away = {away:g} is out of range: it must be 0 pixels or more")
    for what, names in (("line", [one.name for one in lines]), ("zone", [one.name for one in zones])):
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ParameterError(f"two {what}s have one name, {twice!r}; give each its own")
    if frames is None or times is None:
        frames, first = np.unique(tracks.frames, return_index=True)
        times = tracks.times[first]
    return Counts(
        tuple(one.name for one in lines),
        tuple(one.name for one in zones),
        tuple(crossings(tracks, lines, away=away, point=point, size=size)),
        tuple(visits(tracks, zones, away=away, point=point, size=size)),
        np.asarray(frames, np.int64),
        np.asarray(times, np.float64),
    )


def usual_away(size: tuple[int, int] | None) -> float:
    """Return how far one must get from a line of a picture (height, width): 2 % of its height; 5 px of an unknown one."""
    return 5.0 if size is None else 0.02 * size[0]


def crossings(
    tracks: Tracks,
    lines: Sequence[Line],
    *,
    away: float,
    point: str = "foot",
    size: tuple[int, int] | None = None,
) -> list[Crossing]:
    """Return who crossed which line, in the order of time; arguments are those of `count`."""
    paths = _with_their_past(list(_paths(tracks, point, size)))
    found = [one for path in paths for line in lines for one in _crossings(path, line, away)]
    return sorted(found, key=lambda one: (one.time, one.id))


def visits(
    tracks: Tracks,
    zones: Sequence[Zone],
    *,
    away: float,
    point: str = "foot",
    size: tuple[int, int] | None = None,
) -> list[Visit]:
    """Return who was in which zone, in the order in which they began; arguments are those of `count`."""
    shapes = [(zone.name, shape_of(zone.polygons), _edges(zone.polygons)) for zone in zones]
    margins = [_margin(shape, away) for _, shape, _ in shapes]
    found = [
        one
        for path in _paths(tracks, point, size)
        for (name, shape, edges), margin in zip(shapes, margins, strict=True)
        for one in _visits(path, name, shape, edges, margin)
    ]
    return sorted(found, key=lambda one: (one.enter, one.id))


# Where targets go -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Path:
    """Where one target was, row by row in the order of frames."""

    id: int
    label: str
    frames: NDArray[np.int64]
    times: Float
    points: Float  # (N, 2)
    boxes: Float  # (N, 4)
    ground_speeds: Float  # (N,) m/s; nan where not known

    def at(self, time: float) -> Float:
        """The place at a time, straight between rows."""
        return np.array([np.interp(time, self.times, self.points[:, axis]) for axis in (0, 1)])

    def speed(self, time: float) -> float | None:
        """Pixels a second around a time; None of a single moment."""
        begin, end = max(self.times[0], time - _SPAN), min(self.times[-1], time + _SPAN)
        if end <= begin:
            return None
        return float(np.hypot(*(self.at(end) - self.at(begin))) / (end - begin))

    def ground_speed(self, begin: float, end: float) -> float | None:
        """The median of the metres a second that are known in a time, and just before and after it."""
        here = (self.times >= begin - _SPAN) & (self.times <= end + _SPAN) & ~np.isnan(self.ground_speeds)
        return float(np.median(self.ground_speeds[here])) if here.any() else None


def _paths(tracks: Tracks, point: str, size: tuple[int, int] | None) -> Iterator[_Path]:
    if point not in POINTS:
        raise ParameterError(unknown_name("point of a box", point, POINTS))
    places = _places(tracks, point, size)
    speeds = [np.nan if one is None or one.speed is None else one.speed for one in tracks.ground]
    order = np.lexsort((tracks.frames, tracks.ids))
    for rows in np.split(order, np.flatnonzero(np.diff(tracks.ids[order])) + 1):
        if len(rows):
            labels, often = np.unique(tracks.classes[rows], return_counts=True)
            yield _Path(
                int(tracks.ids[rows[0]]),
                str(labels[often.argmax()]),
                tracks.frames[rows],
                tracks.times[rows],
                places[rows],
                np.asarray(tracks.boxes[rows], np.float64),
                np.array(speeds, np.float64)[rows],
            )


def _with_their_past(paths: Sequence[_Path]) -> list[_Path]:
    """The paths, those of who parted from another beginning up to `_WITH` seconds earlier, as the other's went."""
    spans = np.array([(one.times[0], one.times[-1]) for one in paths]).reshape(-1, 2)
    found = []
    for one in paths:
        begin = one.times[0]
        there = np.flatnonzero((spans[:, 0] < begin - _MOMENT) & (spans[:, 1] >= begin + _JUST - _MOMENT))
        other = _parted_from(one, [paths[number] for number in there.tolist()])
        found.append(one if other is None else _led_by(one, other))
    return found


def _parted_from(one: _Path, others: Sequence[_Path]) -> _Path | None:
    """Of whom, of those seen before and after it begins, the first box of a path was a part; None if of nobody."""
    begin = float(one.times[0])
    if one.times[-1] - begin < _JUST - _MOMENT:
        return None
    best, share = None, _INSIDE
    for other in others:
        row = int(np.searchsorted(other.times, begin - _MOMENT)) - 1  # his last before
        if begin - other.times[row] > _JUST:
            continue
        corners = (
            np.maximum(one.boxes[0, :2], other.boxes[row, :2]),
            np.minimum(one.boxes[0, 2:], other.boxes[row, 2:]),
        )
        shared = float(np.maximum(corners[1] - corners[0], 0.0).prod())
        after = min(row + 1, len(other.times) - 1)
        mine, his = (float((box[2:] - box[:2]).prod()) for box in (one.boxes[0], other.boxes[after]))
        if mine >= _PIECE * his and shared >= share * max(mine, _MOMENT):
            best, share = other, shared / max(mine, _MOMENT)
    return best


def _led_by(one: _Path, other: _Path) -> _Path:
    """A path that begins earlier, beside that of another."""
    begin = one.times[0]
    rows = np.flatnonzero((other.times < begin - _MOMENT) & (other.times >= begin - _WITH - _MOMENT))
    beside = one.points[0] - other.points[rows[-1]]
    return dataclasses.replace(
        one,
        frames=np.concatenate([other.frames[rows], one.frames]),
        times=np.concatenate([other.times[rows], one.times]),
        points=np.concatenate([other.points[rows] + beside, one.points]),
        boxes=np.concatenate([other.boxes[rows], one.boxes]),
        ground_speeds=np.concatenate([other.ground_speeds[rows], one.ground_speeds]),
    )


def _places(tracks: Tracks, point: str, size: tuple[int, int] | None) -> Float:
    """Where each row is, (N, 2)."""
    boxes = np.asarray(tracks.boxes, np.float64)
    if size is not None:
        height, width = size
        boxes = np.clip(boxes, 0.0, [width, height, width, height])
    middle = (boxes[:, :2] + boxes[:, 2:]) / 2
    return np.column_stack([middle[:, 0], boxes[:, 3] if point == "foot" else middle[:, 1]])


def steps_over(begin: Float, end: Float, edges: Float) -> list[tuple[float, int]]:
    """Where a step from one point to another meets edges (E, 4): its share in [0, 1], and +1 to their right, else -1.

    Where a point is exactly on an edge, or a corner exactly on the step, all points of paths are thought to lie a trifle
    farther to the right in the picture, and still less farther down; then who passes a corner passes one edge of it.
    """
    first, along, step = edges[:, :2], edges[:, 2:] - edges[:, :2], end - begin
    before, after = _right(begin - first, along), _right(end - first, along)  # (E,) times the edges' lengths
    tie = np.where(along[:, 1] != 0, -along[:, 1], along[:, 0])
    beyond = np.where(after != 0, after, tie) > 0
    passed = (np.where(before != 0, before, tie) > 0) != beyond
    corners = _right(edges.reshape(-1, 2, 2) - begin, step)  # (E, 2)
    sides = np.where(corners != 0, corners, step[1] if step[1] else -step[0]) > 0
    met = np.flatnonzero(passed & (sides[:, 0] != sides[:, 1]))
    shares = before[met] / (before[met] - after[met])
    return sorted(zip(shares.tolist(), np.where(beyond[met], 1, -1).tolist(), strict=True))


def _right(offsets: Float, along: Float) -> Float:
    """How far to the right of a direction offsets (..., 2) reach, times its length; y goes down."""
    return np.asarray(along[..., 0] * offsets[..., 1] - along[..., 1] * offsets[..., 0])


# Lines ------------------------------------------------------------------------------------------------------


def _crossings(path: _Path, line: Line, away: float) -> Iterator[Crossing]:
    """The crossings of one target: those that do not cancel out until it has got away from the line."""
    import shapely

    points = np.array(line.points, np.float64)
    edges = np.hstack([points[:-1], points[1:]])
    edges = edges[(edges[:, :2] != edges[:, 2:]).any(axis=1)]
    far = shapely.distance(shapely.LineString(points), shapely.points(path.points)) >= away  # (N,)
    pending: list[tuple[float, float, int]] = []  # frame, time, +1 or -1
    for i in range(1, len(path.points)):
        for share, sign in steps_over(path.points[i - 1], path.points[i], edges):
            frame, time = (_between(column, i, share) for column in (path.frames, path.times))
            pending.append((frame, time, sign))
        if far[i]:
            yield from _settled(path, line, pending)
            pending = []


def _settled(path: _Path, line: Line, pending: Sequence[tuple[float, float, int]]) -> Iterator[Crossing]:
    net = sum(sign for _, _, sign in pending)
    way = 1 if net > 0 else -1
    of_way = [(frame, time) for frame, time, sign in pending if sign == way]
    for frame, time in of_way[len(of_way) - abs(net) :]:
        x, y = path.at(time).tolist()
        direction = IN if way > 0 else OUT
        speed, ground_speed = path.speed(time), path.ground_speed(time, time)
        beyond = math.ceil(frame - _MOMENT)
        yield Crossing(beyond, time, path.id, path.label, line.name, direction, x, y, speed, ground_speed)


def _between(column: NDArray[Any], i: int, share: float) -> float:
    return float(column[i - 1] + share * (column[i] - column[i - 1]))


# Zones ------------------------------------------------------------------------------------------------------


def _edges(polygons: Sequence[Polygon]) -> Float:
    """The edges of all rings, (E, 4)."""
    rings = [np.array(ring, np.float64) for rings in polygons for ring in rings]
    edges = np.concatenate([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in rings])
    return np.asarray(edges[(edges[:, :2] != edges[:, 2:]).any(axis=1)])


def _margin(shape: Any, away: float) -> float:
    """How deep in a zone one must get: `away`, but less where it is so narrow that few would."""
    import shapely

    while away > _MOMENT and shapely.is_empty(shapely.buffer(shape, -2 * away)):
        away /= 2
    return away


def _visits(path: _Path, name: str, shape: Any, edges: Float, away: float) -> Iterator[Visit]:
    """The visits of one target: stays that got deep enough, joined where it did not get away between them."""
    times, places, inside = _pieces(path, shape, edges)
    if not inside.any():
        return
    import shapely

    distances = shapely.distance(shapely.boundary(shape), shapely.points(places))  # (2 P + 1,)
    state, begun = False, 0.0
    changed = times[0]  # when it last came to the side where it is
    for k, (here, distance) in enumerate(zip(inside, distances, strict=True)):
        if k and here != inside[k - 1]:
            changed = times[k] if k % 2 == 0 else times[k - 1]
        if here != state and (distance >= away or k == 0):
            if state:
                yield _visit(path, name, begun, changed)
            state, begun = bool(here), changed
    if state:
        yield _visit(path, name, begun, times[-1] if inside[-1] else changed)


def _pieces(path: _Path, shape: Any, edges: Float) -> tuple[Float, Float, NDArray[np.bool_]]:
    """A path cut at the edges of a zone: its cuts and rows with the middles between them, (2 P + 1,), and if inside."""
    import shapely

    cuts = [path.times[0]]
    for i in range(1, len(path.times)):
        shares = [share for share, _ in steps_over(path.points[i - 1], path.points[i], edges)]
        cuts += [_between(path.times, i, share) for share in shares if 0 < share < 1]
        cuts.append(path.times[i])
    knots = np.array(cuts)
    times = np.empty(2 * len(knots) - 1)
    times[::2], times[1::2] = knots, (knots[1:] + knots[:-1]) / 2
    places = np.column_stack([np.interp(times, path.times, path.points[:, axis]) for axis in (0, 1)])
    inside = np.asarray(shapely.intersects_xy(shape, places[:, 0], places[:, 1]))
    inside[2:-1:2] = inside[1:-2:2] & inside[3::2]  # a cut is inside where both of its sides are
    if len(knots) > 1:
        inside[0], inside[-1] = inside[1], inside[-2]
    return times, places, inside


def _visit(path: _Path, name: str, enter: float, leave: float) -> Visit:
    middle = [time for time in path.times if enter <= time <= leave] or [(enter + leave) / 2]
    speeds = [speed for speed in map(path.speed, middle) if speed is not None]
    return Visit(
        path.id,
        path.label,
        name,
        float(enter),
        float(leave),
        bool(enter > path.times[0]),
        bool(leave < path.times[-1]),
        float(np.median(speeds)) if speeds else None,
        path.ground_speed(enter, leave),
    )


_MOMENT = 1e-6  # s, and of a frame: what rounding may leave

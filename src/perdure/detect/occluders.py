"""Static occluders, found from how things pass: what stands in front of them is never covered, and things end at it.

Idea: a thing that goes through a place goes on to the next place. Where things arrive at a pixel, leave it on the
other side, and yet are not seen a little further (or come from there, out of nothing), something hides them.
For each pixel a visit begins when a silhouette first covers it and ends when it has been free for a while. How a visit's
begin and end shift from pixel to pixel tells how the thing moved (the time surface of motion history pictures;
Davis & Bobick 1997): both shift the same way only where it went *through*. A man who walks up to a wall and back, a
head's upper line and the outer edge of a lane are all ends of silhouettes, and none is gone through.
Such ends are rare by chance (of a hundred visits one to four); where they pile up on two sides of a place in which
hardly anything is seen, and at edges of the model's picture, an occluder stands. One thing that went behind it and came
out again may be enough; who wants several asks for `Occluder.ended`.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.types import Bits, Mask, Regions

Single = NDArray[np.float32]
Counts = NDArray[np.uint16]
Places = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Passages:
    """How silhouettes passed each cell of a grid over the picture; `note` writes into it.

    Cells are squares of `cell` pixels; cell (r, c) stands for pixel (cell · r, cell · c).
    The four ways are right, left, down, up.
    """

    cell: int
    since: NDArray[np.float64]  # (h, w) s, when the last visit began; long ago before the first
    until: NDArray[np.float64]  # (h, w) s, when a silhouette last covered the cell; long ago before the first
    present: Bits  # (h, w) whether the last visit is still open
    visits: Counts  # (h, w) closed visits
    through: Counts  # (4, h, w) of these: the thing went through, this way or back
    ended: Counts  # (4, h, w) of those: it was not seen a little further this way
    clock: NDArray[np.float64]  # (2,) s since the first frame, when visits are closed next
    sizes: NDArray[np.float64]  # (2,) silhouettes noted (at most _SIZES), their mean side (root of area) in pixels


@dataclass(frozen=True, eq=False)
class Occluder:
    """A part of the background that stands in front of what passes."""

    mask: Mask  # the pixels in front: where things pass behind, and where its borders go on from there unseen
    polygon: Single  # (K, 2) xy, px: the simplified outline
    confidence: float  # in [0, 1]: probability that what ends here is hidden, rather than all by chance
    passages: float  # visits that went through beside it, of the side with more
    ended: float  # visits that ended at it, of the side with fewer
    edges: float  # share of its border with an edge of the model's picture


def no_passages(height: int, width: int) -> Passages:
    """Return the state before the first frame of pictures of this size."""
    cell = max(1, round(min(height, width) / _GRID))
    shape = -(-height // cell), -(-width // cell)
    return Passages(
        cell,
        np.full(shape, _NEVER),
        np.full(shape, _NEVER),
        np.zeros(shape, np.bool_),
        np.zeros(shape, np.uint16),
        np.zeros((4, *shape), np.uint16),
        np.zeros((4, *shape), np.uint16),
        np.zeros(2),
        np.zeros(2),
    )


def note(passages: Passages, regions: Regions, elapsed: float) -> None:
    """Take in the silhouettes of one frame, `elapsed` seconds after the frame before; in place.

    Regions without masks say nothing. One pass over the masks on the grid; the work on what ended is done for
    a quarter of a second at once.
    """
    passages.clock[0] += elapsed
    now, cell = float(passages.clock[0]), passages.cell
    for mask in regions.masks:
        part, bits = _on_grid(mask, cell, passages.present.shape)
        if bits.size:
            present = passages.present[part]
            np.copyto(passages.since[part], now, where=bits > present)
            np.copyto(passages.until[part], now, where=bits)
            np.logical_or(present, bits, out=present)
            _note_size(passages, math.sqrt(np.count_nonzero(bits)) * cell)
    if now >= passages.clock[1]:
        passages.clock[1] = now + _PERIOD
        _close_visits(passages, now - _FREE)


def _on_grid(mask: Mask, cell: int, shape: tuple[int, ...]) -> tuple[tuple[slice, slice], Bits]:
    """The cells of a mask inside the grid, as a part of it and their bits."""
    top, left = (-(-max(corner, 0) // cell) for corner in (mask.y, mask.x))
    bits = mask.bits[top * cell - mask.y :: cell, left * cell - mask.x :: cell][
        : shape[0] - top, : shape[1] - left
    ]
    return np.s_[top : top + bits.shape[0], left : left + bits.shape[1]], bits


def _note_size(passages: Passages, side: float) -> None:
    count = passages.sizes[0] = min(passages.sizes[0] + 1.0, _SIZES)
    passages.sizes[1] += (side - passages.sizes[1]) / count


def _close_visits(passages: Passages, before: float) -> None:
    """Close the visits of cells that have been free since `before`, and count how they ended."""
    rows, columns = passages.present.shape
    over = np.flatnonzero(passages.present & (passages.until < before))
    if not over.size:
        return
    passages.present.ravel()[over] = False
    passages.visits.ravel()[over] += 1
    y, x = np.divmod(over, columns)
    whole = (np.minimum(y, x) >= _DEPTH) & (y < rows - _DEPTH) & (x < columns - _DEPTH)
    places = over[whole]
    if places.size:
        here = _Visits(passages.since.ravel()[places], passages.until.ravel()[places])
        for number, (forward, aside) in enumerate(((1, columns), (-1, columns), (columns, 1), (-columns, 1))):
            through = _gone_through(passages, places, here, forward, aside)
            ended = places[through]
            further = _at(passages, ended + _BEYOND * forward)
            hidden = ended[~_same_time(_Visits(here.since[through], here.until[through]), further)]
            passages.through[number].ravel()[ended] += 1
            passages.ended[number].ravel()[hidden] += 1
    if passages.visits.ravel()[over].max() >= _MOST_VISITS:
        for counts in (passages.visits, passages.through, passages.ended):
            counts //= 2  # what was long ago counts ever less


class _Visits(NamedTuple):
    """Visits of N cells."""

    since: NDArray[np.float64]  # (N,) s
    until: NDArray[np.float64]  # (N,) s


def _at(passages: Passages, places: Places) -> _Visits:
    return _Visits(passages.since.ravel()[places], passages.until.ravel()[places])


def _same_time(some: _Visits, others: _Visits) -> Bits:
    """Whether visits overlap in time, or nearly."""
    return (others.since <= some.until + _FREE) & (others.until >= some.since - _FREE)


def _gone_through(passages: Passages, places: Places, here: _Visits, forward: int, aside: int) -> Bits:
    """Whether things went through the cells (N,) bool, along `forward` or against it: arrived and left in one direction.

    Begin and end of the visit shift alike from some way behind the cell to the cell, neither at once nor very slowly, and
    the begin shifts less aside than forward.
    """
    behind = _at(passages, places - _DEPTH * forward)
    arrives, leaves = here.since - behind.since, here.until - behind.until  # > 0: forward, < 0: back
    slow, fast = np.maximum(np.abs(arrives), np.abs(leaves)), np.minimum(np.abs(arrives), np.abs(leaves))
    through = (arrives * leaves > 0) & (slow < _SLOWEST) & (slow < _UNLIKE * fast) & _same_time(here, behind)
    one, other = _at(passages, places - _DEPTH * aside), _at(passages, places + _DEPTH * aside)
    beside, beyond = _same_time(here, one), _same_time(here, other)
    tilt = np.where(
        beside & beyond,
        np.abs(other.since - one.since) / 2.0,
        np.where(beside, np.abs(here.since - one.since), np.abs(other.since - here.since)),
    )
    return through & (beside | beyond) & (tilt <= np.abs(arrives))


def occluders(passages: Passages, mean: Single, least_confidence: float = 0.5) -> tuple[Occluder, ...]:
    """Return the occluders believed in, the surest first.

    Parameters
    ----------
    passages : Passages
        Of pictures of this size; stays as it is. Visits that are not over yet do not count.
    mean : (H, W, 3) float32
        The model's mean picture, grey levels.
    least_confidence : float
        Only occluders at least as sure.

    Raises
    ------
    ValueError
        If the picture is not of the passages' size.
    """
    cell = passages.cell
    if (-(-mean.shape[0] // cell), -(-mean.shape[1] // cell)) != passages.visits.shape:
        raise ValueError(f"the mean picture is {mean.shape[1]}x{mean.shape[0]} pixels, not that of these passages")
    least = max(_THIN, _LEAST_LENGTH * float(passages.sizes[1]) / cell)
    turn = (0, 2, 1)
    visits, through, ended = passages.visits, passages.through, passages.ended
    across = _valleys(visits, through[:2], ended[:2], least)
    along = _valleys(np.ascontiguousarray(visits.T), through[2:].transpose(turn), ended[2:].transpose(turn), least)
    found: list[Occluder] = []
    for valleys, picture, turned in ((across, mean, False), (along, mean.transpose(1, 0, 2), True)):
        if valleys:
            ground = _Ground.of(picture, cell)
            some = [_occluder(valley, ground, least_confidence) for valley in valleys]
            found += [_turned(one) if turned else one for one in some if one is not None]
    return _without_twins(found)


class _Runs(NamedTuple):
    """Runs of cells, or of pixels, in N rows."""

    rows: Places  # (N,)
    starts: Places  # (N,)
    stops: Places  # (N,) half-open

    def take(self, chosen: Bits) -> _Runs:
        return _Runs(self.rows[chosen], self.starts[chosen], self.stops[chosen])


class _Valley(NamedTuple):
    """Cells that are hardly covered, between two sides that are and at which things end."""

    runs: _Runs
    passed: tuple[float, float]  # visits on its two sides that went through
    ended: tuple[float, float]  # of these
    chance: float  # share of visits that end elsewhere
    around: _Box  # its neighbourhood
    seen: Bits  # (h, w) cells where things are seen too often for an occluder


class _Box(NamedTuple):
    """Half-open, cells."""

    x1: int
    y1: int
    x2: int
    y2: int


def _valleys(visits: Counts, through: Counts, ended: Counts, least: float) -> list[_Valley]:
    """Return where things that go through along the rows, right (0) or left (1), are hidden over `least` rows."""
    free = visits.astype(np.float32)
    runs, names = _low_runs(free, least)
    passed, gone = np.empty((2, len(names)), np.float32), np.empty((2, len(names)), np.float32)
    for side, column in ((0, runs.starts), (1, runs.stops - 1)):
        passed[side], gone[side] = (_before(counts[side], side)[runs.rows, column] for counts in (through, ended))
    telling = (gone >= _LEAST_PILE) & (gone >= _SURE_SHARE * passed)  # (2, N)
    chains, either = _chains(runs, names), telling.any(axis=0)
    found = []
    for chain in np.unique(chains[either]):
        mine = chains == chain
        if np.count_nonzero(telling & mine, axis=1).max() >= least:
            sure = runs.rows[mine & either]
            mine &= (runs.rows >= sure.min()) & (runs.rows <= sure.max())
            left, right = (_share(passed[side][mine], gone[side][mine]) for side in (0, 1))
            own = _box(runs.take(mine), 0, visits.shape)
            around = _box(runs.take(mine), round(_AROUND * least), visits.shape)
            chance = _chance(through, ended, own, around)
            seen = free > _SEEN_SHARE * max(left[1], right[1])
            found.append(_Valley(runs.take(mine), (left[0], right[0]), (left[1], right[1]), chance, around, seen))
    return found


def _low_runs(free: Single, least: float) -> tuple[_Runs, NDArray[np.int32]]:
    """Runs of cells that are covered far less often than cells on both sides of them, and their component's number."""
    level = cv2.morphologyEx(free, cv2.MORPH_CLOSE, np.ones((1, round(_WIDEST * free.shape[1]) | 1), np.uint8))
    low: NDArray[Any] = ((level > 0) & (free <= _SEEN_SHARE * level)).view(np.uint8)
    low = cv2.morphologyEx(low, cv2.MORPH_OPEN, np.ones((round(max(_THIN, least / 2)), 1), np.uint8))
    _, labels = cv2.connectedComponents(low, connectivity=8)
    steps = np.diff(np.pad(low.view(np.int8), ((0, 0), (1, 1))), axis=1)
    (rows, starts), (_, stops) = np.nonzero(steps > 0), np.nonzero(steps < 0)
    return _Runs(rows, starts, stops), np.asarray(labels[rows, starts], np.int32)


def _before(counts: Counts, side: int) -> Single:
    """The most counts of some cells left (side 0) or right (1) of each cell, (h, w), a mean over some rows.

    The ends of visits to `_BEYOND` cells lie in the same border, which trembles by less.
    """
    reach = _BEYOND
    near = np.zeros((1, reach + 1), np.uint8)
    near[0, slice(1, None) if side else slice(0, reach)] = 1
    most = cv2.dilate(
        counts.astype(np.float32),
        near,
        anchor=(0 if side else reach, 0),
        borderType=cv2.BORDER_CONSTANT,
        borderValue=0.0,
    )
    return np.asarray(cv2.blur(most, (1, 2 * _ASIDE + 1), borderType=cv2.BORDER_REPLICATE), np.float32)


def _chains(runs: _Runs, names: NDArray[np.int32]) -> Places:
    """Number the chains of runs, (N,): of one name, in rows one below the other, without a leap of their ends."""
    order = np.lexsort((runs.rows, names))
    rows, starts, stops, name = (np.diff(column[order]) for column in (*runs, names))
    breaks = (name != 0) | (rows > _LEAP) | (rows == 0) | (np.abs(starts) > _LEAP) | (np.abs(stops) > _LEAP)
    chains = np.zeros(len(order), np.intp)
    chains[order[1:]] = np.cumsum(breaks)
    return chains


def _share(passed: Single, gone: Single) -> tuple[float, float]:
    """How many visits passed along a border, (N,) cells of it, and how many of these ended; few reach all its cells."""
    counted = passed >= _LEAST_PILE
    if not counted.any():
        return 0.0, 0.0
    most = float(np.quantile(passed[counted], 0.75))
    return most, most * float(gone[counted].sum() / passed[counted].sum())


def _box(runs: _Runs, wider: int, shape: tuple[int, ...]) -> _Box:
    """The box of runs and of the cells where things end at them, widened, inside the grid."""
    aside = 2 * _BEYOND + wider
    return _Box(
        max(int(runs.starts.min()) - aside, 0),
        max(int(runs.rows.min()) - wider, 0),
        min(int(runs.stops.max()) + aside, shape[1]),
        min(int(runs.rows.max()) + 1 + wider, shape[0]),
    )


def _chance(through: Counts, ended: Counts, own: _Box, around: _Box) -> float:
    """The share of visits gone through that end elsewhere, by chance: near by, and all over where these are few."""
    inner, outer = (np.s_[:, one.y1 : one.y2, one.x1 : one.x2] for one in (own, around))
    (ends, near_ends), (all_told, near) = (
        [float(counts[part].sum(dtype=np.int64) - counts[inner].sum(dtype=np.int64)) for part in (np.s_[:], outer)]
        for counts in (ended, through)
    )
    share = (ends + 1.0) / (all_told + 1.0 / _LEAST_CHANCE)
    return min(max((near_ends + share * _FEW) / (near + _FEW), _LEAST_CHANCE), 0.5)  # cells are not independent


class _Ground(NamedTuple):
    """The model's picture and its edges across the rows."""

    mean: Single  # (H, W, 3)
    slope: Single  # (H, W) grey levels a pixel along the rows, of the channel that changes most
    strong: float  # what slope is an edge
    cell: int  # pixels

    @staticmethod
    def of(mean: Single, cell: int) -> _Ground:
        levels = np.ascontiguousarray(mean, np.float32)
        red, green, blue = cv2.split(np.abs(cv2.Sobel(levels, cv2.CV_32F, 1, 0, scale=0.125)))
        slope = np.asarray(np.maximum(np.maximum(red, green), blue), np.float32)
        return _Ground(levels, slope, max(float(np.quantile(slope[::2, ::2], _STRONG)), _LEAST_SLOPE), cell)


def _occluder(valley: _Valley, ground: _Ground, least_confidence: float) -> Occluder | None:
    """The occluder of a valley, in pixels, its borders moved to edges and continued along them; None if not sure."""
    runs, edges = _moved_to_edges(valley.runs, ground)
    confidence = _confidence(valley, edges, _edges_by_chance(valley.around, ground))
    if confidence < least_confidence:
        return None
    picture = np.zeros(ground.slope.shape, np.bool_)
    for part in (runs, _continued(runs, -1, valley.seen, ground), _continued(runs, 1, valley.seen, ground)):
        for row, start, stop in zip(*part, strict=True):
            picture[row, start:stop] = True
    mask = Mask.of_image(picture)
    return Occluder(mask, _outline(mask, ground.cell), confidence, max(valley.passed), min(valley.ended), edges)


def _moved_to_edges(runs: _Runs, ground: _Ground) -> tuple[_Runs, float]:
    """Runs of pixels for runs of cells, whose ends lie on edges where there are any, and the share of ends that do."""
    cell, (height, width) = ground.cell, ground.slope.shape
    rows = (runs.rows[:, None] * cell + np.arange(cell)).ravel()
    inside = rows < height
    ends, on_edge = [], []
    for places in (runs.starts, runs.stops):
        columns = np.repeat(places * cell - cell // 2, cell)[inside]
        nearest, steep = _nearest_edges(ground.slope, rows[inside], columns, _reach(cell))
        ends.append(np.clip(columns + _running_median(nearest - columns, 4 * cell + 1), 0, width))
        on_edge.append(float((steep >= ground.strong).mean()))
    return _Runs(rows[inside], ends[0], ends[1]), sum(on_edge) / 2.0


def _reach(cell: int) -> int:
    """How far from a silhouette's end the edge may lie that it ends at, pixels."""
    return round(1.5 * cell)


def _nearest_edges(slope: Single, rows: Places, columns: Places, reach: int) -> tuple[Places, Single]:
    """Move borders (N,), each left of a column, to the steepest place in reach; return them and how steep it is."""
    offsets = np.arange(-reach, reach + 1)
    around = columns[:, None] + offsets  # (N, 2 reach + 1)
    last = slope.shape[1] - 1
    left, right = (slope[rows[:, None], np.clip(around - one, 0, last)] for one in (1, 0))
    nearer = 1.0 - 0.1 * np.abs(offsets) / reach  # of two alike
    best = np.argmax((left + right) * nearer, axis=1)[:, None]
    steep = np.take_along_axis(np.maximum(left, right), best, 1)[:, 0]
    return np.take_along_axis(around, best, 1)[:, 0], steep


def _running_median(shifts: NDArray[Any], window: int) -> Places:
    padded = np.pad(shifts, window // 2, mode="edge")
    medians = np.median(np.lib.stride_tricks.sliding_window_view(padded, window), axis=1)
    return np.asarray(medians, np.intp)


def _edges_by_chance(around: _Box, ground: _Ground) -> float:
    """The share of places in a neighbourhood that have an edge within reach."""
    x1, y1, x2, y2 = (ground.cell * one for one in around)
    strong = (ground.slope[y1:y2, x1:x2] >= ground.strong).view(np.uint8)
    near = cv2.dilate(strong, np.ones((1, 2 * _reach(ground.cell) + 1), np.uint8))
    return float(np.clip(near.mean(), 0.05, 0.85))


def _confidence(valley: _Valley, edges: float, by_chance: float) -> float:
    """The probability of an occluder: so many visits ended, and its border lies on edges; else both are by chance.

    What is hidden on one side comes out on the other: the weaker side counts, twice. A whole border on edges counts
    as much as `_PIECES` independent pieces of it.
    """
    sides = zip(valley.ended, valley.passed, strict=True)
    odds = math.log(_PRIOR) + 2.0 * min(_weight(k, n, _HIDDEN, valley.chance) for k, n in sides)
    odds += 2.0 * _weight(edges * _PIECES, _PIECES, _HIDDEN, by_chance)
    return 1.0 / (1.0 + math.exp(-max(min(odds, 50.0), -50.0)))


def _weight(hits: float, trials: float, likely: float, by_chance: float) -> float:
    """The log of the likelihood ratio of so many hits."""
    return hits * math.log(likely / by_chance) + (trials - hits) * math.log((1.0 - likely) / (1.0 - by_chance))


def _continued(runs: _Runs, step: int, seen: Bits, ground: _Ground) -> _Runs:
    """The rows above (step -1) or below (1) where both borders go on straight, as edges, the colours are known from
    the runs, and nothing is seen.
    """
    cell, (height, width) = ground.cell, ground.slope.shape
    colours = np.array([ground.mean[y, x1:x2].mean(axis=0) for y, x1, x2 in zip(*runs, strict=True) if x1 < x2])
    place, drift = _line(runs, step)
    row = int(runs.rows.min() if step < 0 else runs.rows.max()) + step
    missed, kept, found = 0, 0, []
    while 0 <= row < height and missed <= 2 * cell and colours.size:
        place = place + drift
        first, behind = (int(one) for one in np.rint(place))
        middle = (first + behind) // (2 * cell)
        if not 0 <= first < behind <= width:
            break
        if seen[row // cell, min(first // cell + 1, middle) : max(behind // cell, middle + 1)].any():
            break
        nearest, steep = _nearest_edges(ground.slope, np.array([row, row]), np.array([first, behind]), 1)
        place = np.where(steep >= ground.strong, 0.5 * (place + nearest), place)
        unlike = np.abs(colours - ground.mean[row, first:behind].mean(axis=0)).max(axis=1).min()
        missed = 0 if (steep >= ground.strong).all() and unlike <= _LIKE else missed + 1
        found.append((row, first, behind))
        kept = kept if missed else len(found)
        row += step
    return _Runs(*np.array(found[:kept], np.intp).reshape(-1, 3).T)


def _line(runs: _Runs, step: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where both borders are at the first or last row and how far they drift a step, (2,) each: of a straight line."""
    end = runs.rows.min() if step < 0 else runs.rows.max()
    last = np.abs(runs.rows - end) <= _STRAIGHT * len(runs.rows)
    away = ((runs.rows[last] - end) * step).astype(np.float64)  # <= 0
    ends = np.stack([runs.starts[last], runs.stops[last]]).astype(np.float64)  # (2, M)
    centred = away - away.mean()
    drift = (ends @ centred) / max(float(centred @ centred), 1.0)
    return ends.mean(axis=1) - drift * away.mean(), drift


def _outline(mask: Mask, cell: int) -> Single:
    """The simplified outer border of a mask's largest part, (K, 2) xy."""
    outlines, _ = cv2.findContours(
        mask.bits.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE, offset=(mask.x, mask.y)
    )
    if not outlines:
        return np.zeros((0, 2), np.float32)
    outline = cv2.approxPolyDP(max(outlines, key=cv2.contourArea), cell, closed=True)
    return outline[:, 0].astype(np.float32)


def _turned(occluder: Occluder) -> Occluder:
    """The occluder with x and y exchanged."""
    mask = Mask(occluder.mask.x, occluder.mask.y, np.ascontiguousarray(occluder.mask.bits.T))
    return dataclasses.replace(occluder, mask=mask, polygon=np.ascontiguousarray(occluder.polygon[:, ::-1]))


def _without_twins(found: list[Occluder]) -> tuple[Occluder, ...]:
    """The occluders, the surest first, without those of which most is part of a surer one."""
    kept: list[Occluder] = []
    for one in sorted(found, key=lambda occluder: (-occluder.confidence, occluder.mask.box)):
        x1, y1, x2, y2 = one.mask.box
        shared = np.zeros(one.mask.bits.shape, np.bool_)
        for other in kept:
            shared |= other.mask.to_image(y2, x2)[y1:, x1:]
        if one.mask.area and np.count_nonzero(shared & one.mask.bits) <= one.mask.area / 2:
            kept.append(one)
    return tuple(kept)


_GRID = 288  # cells along the shorter side of the picture
_NEVER = -1e9  # s
_FREE = 0.5  # s that a cell is free before a visit is over
_PERIOD = 0.25  # s between two closings
_DEPTH = 10  # cells over which a visit's begin and end must shift
_BEYOND = 4  # cells further, where a thing that goes on is seen; the border of a silhouette trembles by less
_SLOWEST = 3.0  # s for `_DEPTH` cells
_UNLIKE = 4.0  # how much faster one end of a thing may go than the other
_MOST_VISITS = 1000  # of a cell, before all are halved
_SIZES = 1000.0  # silhouettes over which their size is averaged
_LEAST_PILE = 0.4  # visits that ended, a mean over `2 _ASIDE + 1` rows: one of them in nearly half of the rows
_ASIDE = 4  # cells
_SURE_SHARE = 0.5  # of visits that ended, where an end tells
_SEEN_SHARE = 0.25  # of the visits beside it: what is covered more often is no occluder
_WIDEST = 0.33  # of the picture's width: things may go elsewhere on a longer way
_LEAP = 3  # cells that an occluder's border may go aside from row to row
_THIN = 3  # cells: lower valleys are rough borders of silhouettes
_LEAST_LENGTH = 0.33  # of a silhouette's side, along which things end
_AROUND = 2.0  # neighbourhood, in such lengths
_FEW = 100.0  # visits of cells near by that count as much as those all over
_LEAST_CHANCE = 0.01  # share of visits that end by chance, however few were seen
_PRIOR = 0.003  # odds of an occluder before anything is seen of it
_HIDDEN = 0.9  # share of visits that end at an occluder, and of its border that is an edge
_PIECES = 1.0
_STRONG = 0.8  # quantile of the picture's slopes above which one is an edge
_LEAST_SLOPE = 1.0  # grey levels a pixel
_STRAIGHT = 0.33  # of the rows that tell how the borders go on
_LIKE = 15.0  # grey levels by which the mean colours of rows of one thing may differ

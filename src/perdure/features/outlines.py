"""Contours of silhouettes: at the edges of pixels, with fewer points, as polygons with holes, and how much of one is seen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.types import Mask, Outline

Ring = NDArray[np.float64]  # (n, 2) x, y

_NEAR = 3.0  # pixels from what is seen, within which a contour is seen
_LARGEST = 1 << 28  # pixels of a drawing
_SHORTEST = 12.0  # pixels of a contour, below which a piece is as those beside it


class Polygon(NamedTuple):
    """An outer line and the holes in it."""

    outer: Ring
    holes: tuple[Ring, ...]


class Lines(NamedTuple):
    """A contour cut into open lines and closed ones, which end where they begin."""

    seen: list[Ring]
    hidden: list[Ring]


def outline_of(mask: Mask) -> Outline:
    """Return the outline of a mask along the edges of its pixels: its area is the number of pixels.

    Pixels that touch by corners only are parts of their own, so that no line touches itself.

    >>> [ring.tolist() for ring in outline_of(Mask(2, 5, np.ones((1, 3), bool))).rings]
    [[[5.0, 2.0], [8.0, 2.0], [8.0, 3.0], [5.0, 3.0]]]
    """
    begins, ends = _edges(mask)
    if not len(begins):
        return Outline(())
    rings = [part for ring in _followed(begins, ends) for part in _parted(ring)]
    corner = np.array([mask.x, mask.y], np.float64)
    return Outline(tuple(_corners(ring) + corner for ring in rings))


def mask_of(outline: Outline) -> Mask:
    """Return the pixels whose middle is inside an outline, an odd number of its lines to the left of it.

    Of what `outline_of` returned, it is the mask again.

    Raises
    ------
    ValueError
        For an outline too large to be drawn.

    >>> mask_of(Outline.of([[[5, 2], [8, 2], [8, 3], [5, 3]]])) == Mask(2, 5, np.ones((1, 3), bool))
    True
    """
    if not outline.rings:
        return Mask.empty()
    points = np.concatenate(outline.rings)
    left, top = np.floor(points.min(axis=0)).astype(int).tolist()
    width, height = (np.ceil(points.max(axis=0)).astype(int) - (left, top)).tolist()
    begins = points - (left, top)
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in outline.rings]) - (left, top)
    low, high = np.minimum(begins[:, 1], ends[:, 1]), np.maximum(begins[:, 1], ends[:, 1])
    first, last = (
        np.ceil(low - 0.5).astype(int),
        np.ceil(high - 0.5).astype(int),
    )  # rows whose middle an edge passes
    counts = last - first
    if max(width * height, int(counts.sum())) > _LARGEST:
        raise ValueError(f"an outline of {width}x{height} pixels is too large to be drawn")
    edge = np.repeat(np.arange(len(begins)), counts)
    rows = first[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
    slope = (ends[edge, 0] - begins[edge, 0]) / (ends[edge, 1] - begins[edge, 1])
    x = begins[edge, 0] + (rows + 0.5 - begins[edge, 1]) * slope
    crossed = np.zeros((height, width + 1), np.bool_)
    np.logical_xor.at(crossed, (rows, np.ceil(x - 0.5).astype(int)), True)
    return Mask.of_image(np.logical_xor.accumulate(crossed, axis=1)[:, :-1], top, left)


def outline_of_box(box: ArrayLike) -> Outline:
    """Return the outline of a box x1, y1, x2, y2; one without lines where it has no area."""
    x1, y1, x2, y2 = np.asarray(box, np.float64).tolist()
    return Outline.of([[[x1, y1], [x2, y1], [x2, y2], [x1, y2]]] if x1 < x2 and y1 < y2 else [])


def thinned(ring: ArrayLike, within: float) -> Ring:
    """Return a closed line (n, 2) with fewer points, none of which is farther than `within` pixels from the rest.

    By Ramer, Douglas & Peucker; a line of no more than three points is left as it is.
    """
    import cv2

    places = np.asarray(ring, np.float64)
    if len(places) <= 3:
        return places
    middle = np.rint(places.mean(axis=0))  # single precision has more to give near 0
    kept = cv2.approxPolyDP((places - middle).astype(np.float32)[:, None], within, True)
    return places if len(kept) < 3 else kept[:, 0].astype(np.float64) + middle


def polygons(outline: Outline) -> list[Polygon]:
    """Return the parts of an outline, the holes with the part that they are in.

    A hole that lies in none is left out.
    """
    areas = [Outline((ring,)).area for ring in outline.rings]
    outer = sorted((k for k, area in enumerate(areas) if area > 0), key=areas.__getitem__)
    holes: dict[int, list[Ring]] = {k: [] for k in outer}
    for k, area in enumerate(areas):
        if area < 0:
            around = next(
                (j for j in outer if areas[j] > -area and _holds(outline.rings[j], outline.rings[k])), None
            )
            if around is not None:
                holes[around].append(outline.rings[k])
    return [Polygon(outline.rings[k], tuple(holes[k])) for k in sorted(outer)]


def seen_and_hidden(outline: Outline, seen: Mask) -> Lines:
    """Return which lines of an outline run along pixels that are seen, within some pixels, and which do not.

    Short pieces are as those beside them. What is between two points is as the middle of them.
    """
    found = Lines([], [])
    for ring in outline.rings:
        closed = _dense(ring)  # (m + 1, 2)
        if not seen.area:
            found.hidden.append(closed)
            continue
        near = _smoothed(_near(seen, (closed[1:] + closed[:-1]) / 2), closed)  # (m,)
        if near.all() or not near.any():
            (found.seen if near[0] else found.hidden).append(closed)
            continue
        for begin, end in _runs(near):
            line = closed[np.arange(begin, end + 1) % len(near)]
            (found.seen if near[begin] else found.hidden).append(line)
    return found


# The edges of pixels --------------------------------------------------------------------------------------------


def _edges(mask: Mask) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Ends (N, 2) of the edges between pixels that are inside and others, the inside to the right of each."""
    bits = np.pad(mask.bits, 1)
    begins, ends = [], []
    for down, right, begin, end in (  # the neighbour outside, and the edge's ends as corners of the pixel
        (-1, 0, (0, 0), (1, 0)),
        (0, 1, (1, 0), (1, 1)),
        (1, 0, (1, 1), (0, 1)),
        (0, -1, (0, 1), (0, 0)),
    ):
        outside = ~np.roll(bits, (-down, -right), axis=(0, 1))
        y, x = np.nonzero(bits & outside)
        place = np.stack([x - 1, y - 1], axis=1)
        begins.append(place + begin)
        ends.append(place + end)
    return np.concatenate(begins), np.concatenate(ends)


def _followed(begins: NDArray[np.int64], ends: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Closed lines (n, 2) of edges; where two meet two, each goes on round the same pixel, which is a turn to the right."""
    after: dict[tuple[int, int], list[int]] = {}
    starts, stops = [(x, y) for x, y in begins.tolist()], [(x, y) for x, y in ends.tolist()]
    for number, start in enumerate(starts):
        after.setdefault(start, []).append(number)
    free, rings = [True] * len(starts), []
    for first in range(len(starts)):
        row, ring = first, []
        while free[row]:
            free[row] = False
            ring.append(starts[row])
            choices = after[stops[row]]
            row = choices[0] if len(choices) == 1 else next(k for k in choices if _is_right(row, k, starts, stops))
        if ring:
            rings.append(np.array(ring, np.int64))
    return rings


def _is_right(row: int, other: int, starts: Sequence[tuple[int, int]], stops: Sequence[tuple[int, int]]) -> bool:
    """Whether an edge turns to the right of another, y downwards."""
    dx, dy = stops[row][0] - starts[row][0], stops[row][1] - starts[row][1]
    return (stops[other][0] - starts[other][0], stops[other][1] - starts[other][1]) == (-dy, dx)


def _parted(ring: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Closed lines (n, 2) that touch themselves nowhere, from one that may do so."""
    parts: list[NDArray[np.int64]] = []
    path: list[tuple[int, int]] = []
    where: dict[tuple[int, int], int] = {}
    for x, y in ring.tolist():
        place = x, y
        if place in where:
            at = where[place]
            parts.append(np.array(path[at:], np.int64))
            for gone in path[at + 1 :]:
                del where[gone]
            del path[at + 1 :]
        else:
            where[place] = len(path)
            path.append(place)
    return [*parts, np.array(path, np.int64)]


def _corners(ring: NDArray[np.int64]) -> NDArray[np.int64]:
    """The points of a closed line (n, 2) at which it turns."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return np.asarray(ring[(before != after).any(axis=1)])


# Parts and pieces -----------------------------------------------------------------------------------------------


def _holds(outer: Ring, hole: Ring) -> bool:
    """Whether a line lies in another, or along it."""
    import cv2

    around = outer.astype(np.float32)[:, None]
    return all(cv2.pointPolygonTest(around, (x, y), True) > -0.05 for x, y in hole.tolist())


def _dense(ring: Ring) -> Ring:
    """A closed line with a point a pixel at least, the first one again at the end."""
    following = np.roll(ring, -1, axis=0)
    counts = np.maximum(np.ceil(np.hypot(*(following - ring).T)).astype(int), 1)
    which = np.repeat(np.arange(len(ring)), counts)
    share = (np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[which]
    points = ring[which] + share[:, None] * (following - ring)[which]
    return np.concatenate([points, points[:1]])


def _near(seen: Mask, points: Ring) -> NDArray[np.bool_]:
    """Which points (n, 2) lie within some pixels of what is seen."""
    import cv2

    room = int(_NEAR) + 2
    away = cv2.distanceTransform(np.pad(~seen.bits, room, constant_values=True).view(np.uint8), cv2.DIST_L2, 5)
    x, y = np.floor(points).astype(int).T - np.array([[seen.x - room], [seen.y - room]])
    inside = (x >= 0) & (y >= 0) & (x < away.shape[1]) & (y < away.shape[0])
    near = np.zeros(len(points), np.bool_)
    near[inside] = away[y[inside], x[inside]] <= _NEAR
    return near


def _smoothed(near: NDArray[np.bool_], closed: Ring) -> NDArray[np.bool_]:
    """The same, the shortest run turned over until none is too short."""
    lengths = np.hypot(*np.diff(closed, axis=0).T)
    near = near.copy()
    while True:
        runs = _runs(near)
        sizes = [float(lengths[np.arange(begin, end) % len(near)].sum()) for begin, end in runs]
        if len(runs) < 2 or min(sizes) >= _SHORTEST:
            return near
        begin, end = runs[int(np.argmin(sizes))]
        near[np.arange(begin, end) % len(near)] ^= True


def _runs(near: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Where equal values begin and end, round the line; the last may go beyond its end. None if all are equal."""
    begins = np.flatnonzero(near != np.roll(near, 1)).tolist()
    if not begins:
        return []
    return list(zip(begins, [*begins[1:], begins[0] + len(near)], strict=True))

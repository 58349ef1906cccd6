"""What each id of a run was seen to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.types import Status, Tracks

Float = NDArray[np.float64]
Bools = NDArray[np.bool_]
Index = NDArray[np.intp]
_WALK = 1.0  # s that a walk lasts
_FAR = 0.5  # of its own side, that it goes
_FLICKER = 3.0  # s that somebody may stand before he is more than a flicker
_MARGIN = 0.02  # of the shorter side of the picture: who is so near to the border crosses it
_OWN_MARGIN = 0.3  # of the own side: the same


@dataclass(frozen=True, eq=False)
class Paths:
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

    def take(self, chosen: Bools) -> Paths:
        """Return some of them."""
        return Paths(**{name: column[chosen] for name, column in vars(self).items()})

    @property
    def lives(self) -> Float:
        """Seconds (N,) for which they last."""
        return self.end - self.begin

    @property
    def walks(self) -> Bools:
        """Which (N,) go somewhere."""
        return np.asarray((self.lives >= _WALK) & (self.far >= _FAR))

    @property
    def flickers(self) -> Bools:
        """Which (N,) are there for a moment only."""
        brief = (self.lives < _WALK) & (self.far < 1.0)
        return np.asarray(brief | ((self.lives < _FLICKER) & (self.far < _FAR)))


def paths_of(rows: Tracks, size: tuple[int, int]) -> Paths:
    """What each id was seen to do."""
    seen = seen_rows(rows)
    boxes = _inside(seen.boxes, size)
    ids, starts = np.unique(seen.ids, return_index=True)
    stops = np.append(starts, len(seen))[1:]
    feet = feet_of(boxes)
    side, wide, tall, far = np.zeros((4, len(ids)))
    for number, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        own = boxes[start:stop]
        across, high = (own[:, 2:] - own[:, :2]).T
        side[number] = max(1.0, float(np.median(np.sqrt(across * high))))
        wide[number], tall[number] = np.median(across), np.median(high)
        far[number] = np.hypot(*(feet[start:stop] - feet[start]).T).max() / side[number]
    begins, ends = seen.frames[starts], seen.frames[stops - 1]
    near = _Near(seen.frames, seen.ids, boxes, begins, ends, ids)
    return Paths(
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


def seen_rows(rows: Tracks) -> Tracks:
    """The rows of what is seen, by id and frame; no groups, nothing that was filled in."""
    status = np.isin(rows.status, (Status.VISIBLE, Status.PARTLY_OCCLUDED, Status.AMBIGUOUS))
    seen = rows.take(status & ~rows.is_group & ~rows.inferred)
    return seen.take(np.lexsort((seen.frames, seen.ids)))


def _inside(boxes: NDArray[Any], size: tuple[int, int]) -> Float:
    height, width = size
    return np.clip(np.asarray(boxes, np.float64).reshape(-1, 4), 0.0, [width, height, width, height])


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
        return bool((share_covered(self._boxes[row], self._boxes[others]) >= share).any())


def share_covered(box: Float, others: Float) -> Float:
    """The share (N,) of a box (4,) under others (N, 4)."""
    wide, high = (np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])).clip(0).T
    return np.asarray(wide * high / max(1e-9, float(np.prod(box[2:] - box[:2]))))


def feet_of(boxes: Float) -> Float:
    """The middles (N, 2) of the lower sides of boxes (N, 4)."""
    return np.column_stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]])


def side_of(boxes: Float, walks: Paths, size: tuple[int, int]) -> Index:
    """At which side of the picture boxes (N, 4) are, the nearest; -1 for none."""
    height, width = size
    gaps = np.stack([boxes[:, 0], width - boxes[:, 2], boxes[:, 1], height - boxes[:, 3]], axis=1)  # (N, 4)
    margin = np.maximum(_MARGIN * min(size), _OWN_MARGIN * walks.side)
    nearest = gaps.argmin(axis=1)
    return np.where(gaps.min(axis=1, initial=np.inf) <= margin, nearest, -1)


def linked(points: Float, reach: Float) -> list[Index]:
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


def linked_along(low: Float, high: Float, reach: Float) -> list[Index]:
    """Clusters (single linkage) of intervals (N,) nearer to one another than the mean of their reaches (N,)."""
    low, high = low - reach / 2, high + reach / 2
    order = np.lexsort((high, low))
    apart = low[order][1:] > np.maximum.accumulate(high[order])[:-1]
    return [np.sort(part) for part in np.split(order, np.flatnonzero(apart) + 1) if len(part)]

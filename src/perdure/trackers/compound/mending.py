"""Two who came in as one region: what was said of them is said anew when they part."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import areas, centres, hull, intersections, overlaps, sizes
from perdure.features.masks import disjoint, holding
from perdure.trackers.compound.bodies import Bodies
from perdure.trackers.compound.gathering import Held
from perdure.trackers.compound.targets import Targets, generic_points
from perdure.types import Boxes, Dropped, Event, Frame, Mask, Regions, Status, Tracks

Index = NDArray[np.intp]
_INSIDE = 0.7  # share of a newcomer's first box in the region before, of which she was a part
_SAME = 0.6  # overlap of both together with the region before
_LEAST = 0.4  # area of the smaller of two, in areas of the larger
_JUMP = 2.0  # ratio of widths or heights from frame to frame, above which a region has become another
_MORE = 1.25  # widths or heights of one, from which a region holds more than one
_ALONE = 0.7  # s without that, after which it was one
_SURE = 0.5  # confidence of what is said anew
_CUT = 1  # px from the border, within which a region is cut by it


class Mended(NamedTuple):
    """What is believed and said anew."""

    targets: Targets
    rows: Tracks
    dropped: tuple[Dropped, ...]
    events: tuple[Event, ...]


def remember(
    early: Tracks,
    targets: Targets,
    region: Index,
    held: Held,
    seen: tuple[Frame, Regions],
    bodies: Bodies,
    longest: float,
) -> Tracks:
    """Return the regions of young targets since each came in, as rows; their ids are the targets' keys.

    Silhouettes are kept where a region may hold two.

    Parameters
    ----------
    early : Tracks
        Those of the frames before.
    targets : Targets
        N.
    region : (N,) int
        Of each; -1 for none.
    held : Held
        Which regions are pieces.
    seen : (Frame, Regions)
        What is seen.
    bodies : Bodies
        How large somebody is.
    longest : float
        Seconds since somebody came in, for which she is young.
    """
    frame, regions = seen
    young = ~targets.temporary & (frame.time - targets.born <= longest)
    if not young.any():
        return Tracks.empty()
    rows = np.flatnonzero(young & (region >= 0) & (targets.compound == 0))
    parts = [(int(region[row]), *held.pieces.get(int(row), ())) for row in rows]
    boxes = np.array([hull(regions.boxes[list(part)]) for part in parts], np.float32).reshape(-1, 4)
    large = _larger_than_one(bodies, boxes)
    now = Tracks.of(
        frames=frame.index,
        times=frame.time,
        ids=targets.keys[rows],
        boxes=boxes,
        masks=[regions.masks[part[0]] if keep else Mask.empty() for part, keep in zip(parts, large, strict=True)],
        links=parts,
    )
    return Tracks.join([early.take(np.isin(early.ids, targets.keys[young])), now])


def _larger_than_one(bodies: Bodies, boxes: Boxes) -> list[bool]:
    """Whether boxes (N, 4) are larger than a body, as far as that is known."""
    if not bodies.known:
        return [True] * len(boxes)
    width, height = (sizes(boxes) > _MORE * bodies.expected(boxes[:, 3])[0]).T  # (N,) each
    return [bool(one) for one in width | height]


def mend(early: Tracks, targets: Targets, newly: Index, bodies: Bodies, size: tuple[int, int]) -> Mended:
    """Say anew what was said of one region, where a part of it has turned out to be somebody.

    Parameters
    ----------
    early : Tracks
        As `remember` returns it.
    targets : Targets
        N.
    newly : (K,) int
        Those that have just got a name.
    bodies : Bodies
        How large somebody is.
    size : (int, int)
        Height and width of the picture.
    """
    rows, dropped, events = [], [], []
    for row in newly.tolist():
        parting = _parting(early, targets, row)
        if parting is None:
            continue
        past = _together(early, parting, bodies, size)
        if not len(past):
            continue
        names = (int(targets.ids[parting.other]), int(targets.ids[row]))
        rows.append(_anew(past, parting, names, bodies, size))
        begin, end = int(past.frames[0]), int(past.frames[-1])
        dropped.append(Dropped(names[0], begin, end))
        events.append(Event("mended", begin, end, names, why="came as one region, of which both were parts"))
        targets = _resized(targets, parting.other, early)
    return Mended(targets, Tracks.join(rows), tuple(dropped), tuple(events))


class _Parting(NamedTuple):
    """The frame in which one region became two."""

    other: int  # row of who had the region before
    frame: int
    time: float  # s
    boxes: Boxes  # (2, 4) of the other, of the newcomer
    whole: Boxes  # (4,) both
    own: NDArray[np.float32]  # (2, 2) width and height of each, now
    key: int  # of the other


def _parting(early: Tracks, targets: Targets, row: int) -> _Parting | None:
    """Of whose region a newcomer was a part just before she came; None if of nobody's."""
    mine = early.of_id(int(targets.keys[row]))
    before = early.take(early.frames < mine.frames[0]) if len(mine) else mine
    if not len(before):
        return None
    before = before.in_frame(int(before.frames.max()))
    box, first = mine.boxes[:1], int(mine.frames[0])
    inside = intersections(box, before.boxes)[0] / max(float(areas(box)[0]), 1e-6)
    key = int(before.ids[inside.argmax()])
    now = early.in_frame(first).of_id(key)
    other = np.flatnonzero((targets.keys == key) & (targets.compound == 0) & (targets.ids > 0))
    if inside.max() < _INSIDE or not len(now) or not len(other):
        return None
    both = np.concatenate([now.boxes, box])
    small, large = sorted(areas(both).tolist())
    whole = hull(both)
    same = overlaps(whole[None], before.boxes[[inside.argmax()]])[0, 0]
    if small < _LEAST * large or same < _SAME:
        return None
    own = np.stack([sizes(early.of_id(one).boxes[-1:])[0] for one in (key, int(targets.keys[row]))])
    return _Parting(int(other[0]), first, float(mine.times[0]), both, whole, own, key)


def _together(early: Tracks, parting: _Parting, bodies: Bodies, size: tuple[int, int]) -> Tracks:
    """The rows, oldest first, in which the region held both; their boxes are those of both, beyond the border too.

    Going back until the region was no larger than one of them for a while, or jumps.
    """
    past = early.of_id(parting.key)
    past = past.take(past.frames < parting.frame)
    full, border = sizes(parting.whole[None])[0], np.array(size[::-1]) - _CUT
    boxes: list[NDArray[np.float32]] = []
    many, last = 0, parting.time  # rows up to the one that shows more than one, its time
    for time, box in zip(past.times[::-1].tolist(), past.boxes[::-1], strict=True):
        low, high = box[:2] <= _CUT, box[2:] >= border
        seen = np.maximum(sizes(box[None])[0], 1.0)
        whole = np.where((low | high) & (seen < full), full, seen)
        if (np.maximum(whole / full, full / whole) > _JUMP).any():
            break
        if (whole / _alone(parting, box, bodies).mean(axis=0)).max() > _MORE:
            many, last = len(boxes) + 1, time
        elif last - time > _ALONE:
            break
        full = whole
        first = np.where(low & ~high, box[2:] - full, box[:2])
        boxes.append(np.concatenate([first, first + full]).astype(np.float32))
    kept = past.take(np.arange(len(past) - many, len(past)))
    return kept.replace(boxes=np.array(boxes[:many][::-1], np.float32).reshape(-1, 4))


def _alone(parting: _Parting, box: NDArray[np.float32], bodies: Bodies) -> NDArray[np.float32]:
    """Width and height (2, 2) that each of two would have where a region's box (4,) is."""
    if not bodies.known:
        return parting.own
    feet = np.array([box[3], parting.whole[3]])
    here, there = bodies.expected(feet)[0]  # (2,) each
    return np.asarray(parting.own * here / there, np.float32)


def _anew(
    past: Tracks, parting: _Parting, names: tuple[int, int], bodies: Bodies, size: tuple[int, int]
) -> Tracks:
    """Two rows for every one of the past: each as large as when they had parted, on her side of the region."""
    place = (centres(parting.boxes) - parting.whole[:2]) / sizes(parting.whole[None])  # (2, 2) in [0, 1]
    rows = []
    for index in range(len(past)):
        corner, full = past.boxes[index, :2], sizes(past.boxes[[index]])[0]
        alone = _alone(parting, past.boxes[index], bodies)
        axis = int((full / alone.mean(axis=0)).argmax())  # along which they are side by side
        extent = np.minimum(alone, full)
        spot = place.copy()
        spot[:, axis] = place[:, axis] > place[::-1, axis]  # at the two ends of the region
        first = corner + spot * (full - extent)
        boxes = np.concatenate([first, first + extent], axis=1).astype(np.float32)
        masks = disjoint(_halves(past.masks[index], boxes), *size)
        rows.append(
            Tracks.of(
                frames=int(past.frames[index]),
                times=float(past.times[index]),
                ids=names,
                boxes=holding(boxes, masks),
                status=int(Status.AMBIGUOUS),
                confidence=_SURE,
                masks=masks,
                links=[past.links[index]] * 2,
            )
        )
    return Tracks.join(rows)


def _halves(mask: Mask, boxes: Boxes) -> list[Mask]:
    """The pixels of a silhouette that are nearer, in sizes, to the one and to the other of two boxes."""
    y, x = np.mgrid[: mask.bits.shape[0], : mask.bits.shape[1]]
    away = [
        ((x + mask.x + 0.5 - middle[0]) / extent[0]) ** 2 + ((y + mask.y + 0.5 - middle[1]) / extent[1]) ** 2
        for middle, extent in zip(centres(boxes), sizes(boxes), strict=True)
    ]
    first = away[0] <= away[1]
    return [Mask.of_image(mask.bits & first, mask.y, mask.x), Mask.of_image(mask.bits & ~first, mask.y, mask.x)]


def _resized(targets: Targets, row: int, early: Tracks) -> Targets:
    """The targets, of which one is no longer as large as both were."""
    box = early.of_id(int(targets.keys[row])).boxes[-1:]
    return targets.with_(row, points=generic_points(box)[0], size=sizes(box)[0], hidden=0, partly=0.0)

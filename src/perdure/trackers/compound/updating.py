"""Targets brought up to date with their regions, each kind in its way (III.B, IV.D)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.features.appearance import blended, look
from perdure.features.boxes import areas, centres, hull, intersections, sizes
from perdure.trackers.compound.bodies import Bodies, learnt
from perdure.trackers.compound.gathering import HIDDEN, Held
from perdure.trackers.compound.meetings import company
from perdure.trackers.compound.targets import CENTRE, Targets, extended, extent, generic_points
from perdure.types import Boxes, Image, Regions

Index = NDArray[np.intp]
_ENTERING = 0.5  # s in which a new target may still be coming into view
_LEARNING = 0.15  # share of a new look
_BORDER = 2  # px from the border of the picture, within which a box may be cut
_TWICE = 0.7  # share of a region in a visible target, that makes it a piece and nothing new


def update(
    targets: Targets,
    region: Index,
    held: Held,
    expected: Boxes,
    regions: Regions,
    time: float,
    size: tuple[int, int],
    partial: float,
    inertia: float,
    gain: NDArray[np.float64],
) -> Targets:
    """Bring all targets that have a region up to date.

    Parameters
    ----------
    targets : Targets
        N; the first of them stand in `held` and `expected`, later ones are new.
    region : (N,) int
        The region of each; -1 for none.
    held : Held
        Where the members of knots are believed.
    expected : Boxes
        Predicted boxes.
    regions : Regions
        What is seen.
    time : float
        Seconds.
    size : (int, int)
        Height and width of the picture.
    partial : float
        Mismatch of a point, target sizes, that signals a partial occlusion.
    inertia : float
        Seconds over which the mean size is averaged.
    gain : (2,)
        Share of the way from where a target was expected to where it is seen, in x and y, that its trajectory goes.
    """
    targets = targets.replace(surprise=np.full((len(targets), 2), np.nan))
    together = company(targets, region)[: len(held.region)]
    single, shared = (together == 1).nonzero()[0], (together > 1).nonzero()[0]
    if len(single):
        boxes = _own_boxes(single, region, held, regions)
        start = np.where(targets.frozen[single][:, None], held.boxes[single], expected[single])
        moment = (time, size)
        targets = _visible(targets, single, start, boxes, region[single], regions, moment, partial, inertia, gain)
    if len(shared):
        targets = _believed(targets, shared, held, time)
    temporary = ((region >= 0) & targets.temporary & (targets.lines.last[:, 0] < time)).nonzero()[0]
    if len(temporary):
        boxes = regions.boxes[region[temporary]]
        whole = np.maximum(sizes(boxes), 1.0)
        targets = targets.with_(temporary, points=generic_points(boxes), size=whole, seen=time)
        targets = extended(targets, temporary, time, centres(boxes), whole)
    torn = np.isin(np.arange(len(targets)), list(held.pieces))
    targets = targets.replace(whole=np.where(torn, targets.whole, time))
    parted = np.array(sorted(held.parted), np.intp)
    if len(parted):  # no longer as large as all were
        boxes = regions.boxes[region[parted]]
        targets = targets.with_(parted, points=generic_points(boxes), size=sizes(boxes), hidden=0, partly=0.0)
    return targets


def _own_boxes(rows: Index, region: Index, held: Held, regions: Regions) -> Boxes:
    """The box (K, 4) of each target's region, pieces included."""
    boxes = regions.boxes[region[rows]]
    for place, row in enumerate(rows.tolist() if held.pieces else ()):
        if row in held.pieces:
            boxes[place] = hull(regions.boxes[[int(region[row]), *held.pieces[row]]])
    return boxes


def _visible(
    targets: Targets,
    rows: Index,
    expected: Boxes,
    boxes: Boxes,
    region: Index,
    regions: Regions,
    moment: tuple[float, tuple[int, int]],
    partial: float,
    inertia: float,
    gain: NDArray[np.float64],
) -> Targets:
    """Locate targets (K,), expected at boxes (K, 4), by their regions' boxes; extend trajectories, average sizes."""
    from perdure.maths.kernels.follow import follow

    time, (height, width) = moment
    elapsed = time - targets.seen[rows]
    pace = np.minimum(1.0, np.maximum(1.0 / (targets.hits[rows] + 1), elapsed / max(inertia, 1e-6)))
    entering, picture = time - targets.born[rows] < _ENTERING, np.array([width, height], np.float32)
    points, hidden, size = follow(expected, boxes, entering, pace.astype(np.float32), picture, partial)
    off = points[:, CENTRE] - centres(expected)
    surprise = (off - (targets.points[rows, CENTRE] - targets.lines.last[rows, 1:])) / extent(size)[:, None]
    surprise[(targets.missed[rows] > 0) | targets.frozen[rows]] = np.nan
    targets = extended(targets, rows, time, (centres(expected) + gain * off).astype(np.float32), size)
    return targets.with_(
        rows,
        points=points,
        size=size,
        seen=time,
        hits=targets.hits[rows] + 1,
        hidden=hidden,
        surprise=surprise,
        partly=np.where(hidden > 0, targets.partly[rows] + elapsed, 0.0),
        scores=regions.scores[region],
        classes=regions.classes[region],
    )


def _believed(targets: Targets, rows: Index, held: Held, time: float) -> Targets:
    """Put ambiguous targets where they are believed; who is hidden keeps the motion she was last seen with."""
    points = generic_points(held.boxes[rows])
    clear = held.share[rows] >= HIDDEN
    targets = targets.with_(rows, points=points, hidden=0, partly=0.0, shared=time)
    return extended(targets, rows[clear], time, points[clear, CENTRE], targets.size[rows[clear]])


def looked(targets: Targets, region: Index, image: Image, regions: Regions) -> Targets:
    """Return targets with the looks of those that are seen whole and alone brought up to date."""
    rows = np.flatnonzero((region >= 0) & ~targets.temporary & (targets.compound == 0) & (targets.hidden == 0))
    if not len(rows):
        return targets
    boxes = targets.boxes[rows].astype(float)
    new = np.stack(
        [
            look(image, regions.masks[number], (box[0], box[1], box[2], box[3]))
            for number, box in zip(region[rows].tolist(), boxes.tolist(), strict=True)
        ]
    )
    return targets.with_(rows, looks=blended(targets.looks[rows], new, _LEARNING))


def learn(
    bodies: Bodies, targets: Targets, region: Index, seconds: float, size: tuple[int, int], memory: float
) -> Bodies:
    """Return what is known of whole bodies after those that were seen alone, whole and inside the picture."""
    boxes = targets.boxes
    inside = (boxes[:, :2] > _BORDER).all(axis=1) & (boxes[:, 2:] < np.array([size[1], size[0]]) - _BORDER).all(
        axis=1
    )
    alone = (
        (region >= 0) & ~targets.temporary & (targets.compound == 0) & (targets.ids > 0) & (targets.hidden == 0)
    )
    alone &= inside & (targets.whole >= targets.seen)  # in one piece
    return learnt(bodies, boxes[alone], max(seconds, 0.0), memory) if alone.any() else bodies


def unclaimed(targets: Targets, region: Index, held: Held, regions: Regions, least: float) -> Index:
    """Return the regions that found a new target: nobody's, of a sufficient score, and no piece of a visible target."""
    claimed = np.zeros(len(regions), np.bool_)
    claimed[region[region >= 0]] = True
    for numbers in held.pieces.values():
        claimed[list(numbers)] = True
    new = (~claimed & (regions.scores >= least)).nonzero()[0]
    seen = region >= 0
    if not len(new) or not seen.any() or not any(regions.masks[number].bits.size for number in new):
        return new
    part = (
        intersections(regions.boxes[new], targets.boxes[seen]) / np.maximum(areas(regions.boxes[new]), 1)[:, None]
    )
    return new[~(part > _TWICE).any(axis=1)]

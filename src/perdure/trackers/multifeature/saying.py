"""What is said of a frame: rows of those that have passed the filter (section 4.4), and what filled their gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.masks import disjoint, holding
from perdure.scene.zones import Zones
from perdure.trackers.multifeature.targets import Targets
from perdure.types import Boxes, Event, Frame, Mask, Regions, Status, Tracks

Index = NDArray[np.intp]
_UNSEEN = 0.3  # confidence, at most, of one that is not seen


class Moment(NamedTuple):
    """What is to be said of."""

    frame: Frame
    regions: Regions
    region: Index  # (N,) of each target; -1 for none
    where: Boxes  # (N, 4) where each should be
    line: Boxes  # (N, 4) where its line has each now
    smooth: float  # how far what is said goes from the region to the line
    size: tuple[int, int]  # height, width of the picture
    zones: Zones


class Said(NamedTuple):
    """What was said, and the targets that now have ids."""

    targets: Targets
    next_id: int
    unsaid: Tracks  # rows of targets without an id; their ids are the targets' keys
    rows: Tracks
    events: tuple[Event, ...]


def say(
    targets: Targets,
    next_id: int,
    unsaid: Tracks,
    gaps: Tracks,
    moment: Moment,
    confirm: float,
    way: float,
    window: float,
) -> Said:
    """Name who has passed the filter; say the rows of all that have an id, and what fills their `gaps`.

    `unsaid` and `gaps` call targets by their keys.
    """
    targets, named = _named(targets, next_id, moment, confirm, way)
    rows = Tracks.join([unsaid, gaps, _rows(targets, moment, window)])
    names = dict(zip(targets.keys.tolist(), targets.ids.tolist(), strict=True))
    found = np.array([names.get(key, -1) for key in rows.ids.tolist()], np.int64)
    told = rows.take(found > 0).replace(ids=found[found > 0])
    events = tuple(
        Event("entered", begin, begin, (one,), moment.zones.name(at))
        for begin, one, at in zip(
            targets.first[named].tolist(), targets.ids[named].tolist(), targets.entry[named].tolist(), strict=True
        )
    )
    return Said(targets, next_id + len(named), rows.take(found == 0), told, events)


def between(before: Targets, now: Targets, which: Index, frame: Frame, fill: float) -> Tracks:
    """Return rows for the frames in which the targets `which` were not seen, on the line between; ids are keys."""
    parts = []
    for row in which.tolist():
        begin, end = int(before.latest[row]), frame.index
        if end - begin < 2:
            continue
        frames = np.arange(begin + 1, end)
        share = ((frames - begin) / (end - begin))[:, None]
        gap = frame.time - before.seen[row]
        parts.append(
            Tracks.of(
                frames=frames,
                times=before.seen[row] + share[:, 0] * gap,
                ids=now.keys[row],
                boxes=(1 - share) * before.last[row] + share * now.last[row],
                status=int(Status.OCCLUDED),
                confidence=float(np.clip(1.0 - 0.5 * gap / max(fill, 1e-9), _UNSEEN, 1.0)),
                classes=str(now.classes[row]),
                inferred=True,
            )
        )
    return Tracks.join(parts)


def passes(targets: Targets, time: float, confirm: float, way: float) -> NDArray[np.bool_]:
    """Return which trajectories (N,) are no noise: long enough in time (Th5) and space (Th6)."""
    height = targets.last[:, 3] - targets.last[:, 1]
    come = np.hypot(*(targets.extent[:, 2:] - targets.extent[:, :2]).T)
    needed = np.maximum(targets.evidence, confirm) - 1e-9
    return np.asarray((time - targets.born >= needed) & (come >= way * height - 1e-6))


def _named(targets: Targets, next_id: int, moment: Moment, confirm: float, way: float) -> tuple[Targets, Index]:
    """Give ids, in the order of the rows; return who has got one."""
    time = moment.frame.time
    new = (targets.ids == 0) & (moment.region >= 0) & passes(targets, time, confirm, way)
    named = np.flatnonzero(new)
    ids, when = targets.ids.copy(), targets.named.copy()
    ids[named], when[named] = next_id + np.arange(len(named)), time
    return targets.replace(ids=ids, named=when), named


def _rows(targets: Targets, moment: Moment, window: float) -> Tracks:
    """A row for every target, called by its key; one that is not seen is LOST, where it is expected."""
    spoken = np.flatnonzero(
        (moment.region >= 0) | ((targets.ids > 0) & ((targets.missed <= window + 1e-9) | (targets.behind >= 0)))
    )
    region, regions = moment.region[spoken], moment.regions
    seen = region >= 0
    masks = disjoint([(*regions.masks, Mask.empty())[j] for j in region.tolist()], *moment.size)
    boxes = moment.zones.held(moment.where, targets.behind)[spoken]
    raw = regions.boxes[region[seen]]
    boxes[seen] = raw + moment.smooth * (moment.line[spoken][seen] - raw)
    away = np.where(targets.behind[spoken] >= 0, int(Status.OCCLUDED), int(Status.LOST))
    hope = _UNSEEN * np.clip(1.0 - targets.missed[spoken] / max(window, 1e-6), 0.0, 1.0)
    return Tracks.of(
        frames=moment.frame.index,
        times=moment.frame.time,
        ids=targets.keys[spoken],
        boxes=holding(boxes.astype(np.float32), masks),
        status=np.where(seen, int(Status.VISIBLE), away),
        confidence=np.where(seen, np.append(regions.scores, 0)[region], hope),
        classes=targets.classes[spoken],
        inferred=~seen,
        masks=masks,
        links=[(int(j),) if j >= 0 else () for j in region],
    )


def rekeyed(unsaid: Tracks, keys: dict[int, int]) -> Tracks:
    """Return rows of targets without an id, some of which have turned out to be others."""
    return unsaid.replace(ids=[keys.get(one, one) for one in unsaid.ids.tolist()]) if keys else unsaid


def event(kind: str, frame: Frame, identity: int, zone: str) -> Event:
    """Return what has happened to one target in a frame."""
    return Event(kind, frame.index, frame.index, (identity,), zone)

"""What is said of a frame: rows, names for those that have earned one, and what has happened to whom."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import hull
from perdure.features.masks import disjoint, holding, union
from perdure.scene.zones import Zones
from perdure.trackers.compound.gathering import HIDDEN, Held
from perdure.trackers.compound.meetings import company
from perdure.trackers.compound.targets import CENTRE, Targets, around, side_words
from perdure.types import Boxes, Event, Frame, Mask, Regions, Status, Tracks

Index = NDArray[np.intp]
_SEEN = 0.35  # share of its form, from which a member of a compound is said to be seen
_UNSEEN = 0.45  # confidence, at most, of one that is not
_TOLD = 0.3  # s for which somebody must be hidden before it is told


class Moment(NamedTuple):
    """What is to be said of."""

    frame: Frame
    regions: Regions
    region: Index  # (N,) of each target; -1 for none
    held: Held
    expected: Boxes  # (N, 4) where each should be
    silhouettes: bool  # whether regions have masks
    size: tuple[int, int]  # height, width of the picture
    zones: Zones


class Said(NamedTuple):
    """What was said, and the targets that now have names."""

    targets: Targets
    next_id: int
    unsaid: Tracks  # rows of targets without a name; their ids are the targets' keys
    rows: Tracks
    events: tuple[Event, ...]


def say(targets: Targets, next_id: int, unsaid: Tracks, moment: Moment, confirm: float, patience: float) -> Said:
    """Name who has been seen for `confirm` seconds and every group; say the rows of all that have a name."""
    group = is_group(targets)
    targets, named = _named(targets, next_id, group, moment, confirm)
    spoken, rows = _rows(targets, group, moment, patience)
    late, unsaid = _late(targets, unsaid)
    things = named[~targets.temporary[named]]
    begins = zip(*(column[things].tolist() for column in (targets.first, targets.ids, targets.entry)), strict=True)
    events = tuple(Event("entered", begin, begin, (one,), moment.zones.name(at)) for begin, one, at in begins)
    mute = rows.ids == 0
    if mute.any():
        unsaid = Tracks.join([unsaid, rows.take(mute).replace(ids=targets.keys[spoken[mute]])])
        rows = rows.take(~mute)
    return Said(targets, next_id + len(named), unsaid, Tracks.join([late, rows]), events)


def _late(targets: Targets, unsaid: Tracks) -> tuple[Tracks, Tracks]:
    """The rows of those that have a name by now, and of those that still have none; nobody else's."""
    if not len(unsaid):
        return unsaid, unsaid
    names = dict(zip(targets.keys.tolist(), targets.ids.tolist(), strict=True))
    found = np.array([names.get(key, -1) for key in unsaid.ids.tolist()])
    late = unsaid.take(found > 0).replace(ids=found[found > 0])
    return late, Tracks.join([unsaid.take(found == 0)])


def is_group(targets: Targets) -> NDArray[np.bool_]:
    """Return which targets (N,) are temporary ones that hold several."""
    if not targets.temporary.any():
        return np.zeros(len(targets), np.bool_)
    keys, counts = np.unique(targets.within[targets.within > 0], return_counts=True)
    return np.asarray(targets.temporary & np.isin(targets.keys, keys[counts > 1]))


def _named(
    targets: Targets, next_id: int, group: NDArray[np.bool_], moment: Moment, confirm: float
) -> tuple[Targets, Index]:
    """Give ids, in the order of the rows; return who has got one."""
    named = ((targets.ids == 0) & (moment.region >= 0)).nonzero()[0]
    if len(named):
        needed = np.maximum(targets.evidence[named], confirm)
        lasted = moment.frame.time - targets.born[named] >= needed - 1e-9
        named = named[np.where(targets.temporary[named], group[named], lasted)]
        targets = targets.with_(named, ids=next_id + np.arange(len(named)))
    return targets, named


def _spoken(targets: Targets, group: NDArray[np.bool_], moment: Moment, patience: float) -> Index:
    """The rows of targets that are spoken of: all but temporary ones without a company, and those long unseen."""
    lately = (moment.region >= 0) | (targets.missed <= patience + 1e-9) | (targets.behind >= 0)
    return (lately & (group | ~targets.temporary)).nonzero()[0]


def _rows(targets: Targets, group: NDArray[np.bool_], moment: Moment, patience: float) -> tuple[Index, Tracks]:
    """The targets that are spoken of, and a row for each."""
    rows = _spoken(targets, group, moment, patience)
    region, regions, held = moment.region[rows], moment.regions, moment.held
    seen = region >= 0
    shared = company(targets, moment.region)[rows] > 1
    boxes = moment.expected[rows]
    boxes[seen] = _seen_boxes(targets, rows[seen], region[seen], shared[seen], moment)
    away = np.where(targets.behind[rows] >= 0, int(Status.OCCLUDED), int(Status.LOST))
    status = np.where(seen, targets.hidden[rows] > 0, away)  # VISIBLE 0, PARTLY_OCCLUDED 1
    sure = np.maximum(1.0 - targets.missed[rows] / max(patience, 1e-6), 0.0)
    sure[seen] = regions.scores[region[seen]]
    inferred = ~seen
    if shared.any():
        share = np.append(held.share, np.ones(len(targets) - len(held.share), np.float32))[rows]
        clear = share >= _SEEN
        status = np.where(shared, np.where(clear, int(Status.AMBIGUOUS), int(Status.OCCLUDED)), status)
        sure = np.where(shared, np.where(clear, share, np.minimum(share, _UNSEEN)), sure)
        inferred = inferred | (shared & (share < HIDDEN))
    masks = _masks(rows, region, shared, group, moment)
    names = {}
    if group.any():
        told = group & (moment.region >= 0)
        names = dict(zip(targets.keys[told].tolist(), targets.ids[told].tolist(), strict=True))
    return rows, Tracks.of(
        frames=moment.frame.index,
        times=moment.frame.time,
        ids=targets.ids[rows],
        boxes=holding(boxes.astype(np.float32), masks) if moment.silhouettes else boxes,
        status=status,
        confidence=sure,
        classes=targets.classes[rows],
        groups=[names.get(key, 0) for key in targets.within[rows].tolist()] if names else 0,
        inferred=inferred,
        masks=masks,
        hidden_side=side_words(targets.hidden[rows]) if targets.hidden.any() else "",
        links=_links(rows, region, held),
    )


def _links(rows: Index, region: Index, held: Held) -> list[tuple[int, ...]]:
    """The regions that each row rests on, pieces included."""
    links: list[tuple[int, ...]] = [(one,) if one >= 0 else () for one in region.tolist()]
    if held.pieces:
        for place, row in enumerate(rows.tolist()):
            links[place] += held.pieces.get(row, ()) if links[place] else ()
    return links


def _seen_boxes(targets: Targets, rows: Index, region: Index, shared: NDArray[np.bool_], moment: Moment) -> Boxes:
    """The boxes (K, 4) said of targets that have a region: between what is believed and what is seen.

    A group is where its region is; of a partly hidden target, and of one that shares its region, the believed box
    stands.
    """
    seen, pieces = moment.regions.boxes[region], moment.held.pieces
    for place, row in enumerate(rows.tolist() if pieces else ()):
        if row in pieces:
            seen[place] = hull(moment.regions.boxes[[int(region[place]), *pieces[row]]])
    believed = around(targets.points[rows, CENTRE], targets.size[rows])
    stands = shared | (targets.hidden[rows] > 0)
    weight = np.where(targets.temporary[rows], 1.0, np.where(stands, 0.0, 0.5))[:, None]
    return np.asarray(believed + weight * (seen - believed), np.float32)


def _masks(
    rows: Index, region: Index, shared: NDArray[np.bool_], group: NDArray[np.bool_], moment: Moment
) -> tuple[Mask, ...]:
    """The pixels seen of each: its regions', or its own part of a common one; none of a group."""
    if not moment.silhouettes:
        return (Mask.empty(),) * len(rows)
    known, found = moment.regions.masks, []
    for row, number, common, several in zip(
        rows.tolist(), region.tolist(), shared.tolist(), group[rows].tolist(), strict=True
    ):
        if number < 0 or several:
            found.append(Mask.empty())
        elif common:
            found.append(moment.held.masks.get(row, Mask.empty()))
        else:
            found.append(union([known[one] for one in (number, *moment.held.pieces.get(row, ()))]))
    return disjoint(found, *moment.size)


def happenings(before: Targets, targets: Targets, moment: Moment) -> list[Event]:
    """Return what has happened to single targets: partly occluded, hidden by others, suspended, found again."""
    frame, region = moment.frame, moment.region
    count = len(before)
    partly, missed = targets.partly[:count] >= _TOLD, targets.missed[:count] >= _TOLD
    away = before.missed >= _TOLD
    if not (partly | missed | away).any():
        return []
    same = (targets.keys[:count] == before.keys) & (targets.ids[:count] > 0) & ~targets.temporary[:count]
    partly &= same & (before.partly < _TOLD)
    unseen = same & ~away & missed & np.isfinite(targets.missed[:count])
    back = same & away & (targets.missed[:count] == 0)
    shared = company(targets, region) > 1
    events = []
    for row in np.flatnonzero(partly).tolist():
        side = side_words(targets.hidden[[row]])[0]
        why = f"the {side} does not match, the opposite side does"
        events.append(_event("partly_occluded", targets, row, float(targets.partly[row]), frame, why))
    for row in np.flatnonzero(unseen).tolist():
        zone = moment.zones.name(int(targets.behind[row]))
        kind = "occluded" if shared[row] or zone else "suspended"
        why = "hidden by the others in its region" if shared[row] else "no region where it should be"
        why = f"hidden behind {zone}" if zone else why
        events.append(_event(kind, targets, row, float(targets.missed[row]), frame, why, zone))
    for row in np.flatnonzero(back).tolist():
        zone = moment.zones.name(int(before.behind[row]))
        why = f"where its trajectory led, after {before.missed[row]:.1f} s"
        events.append(Event("found_again", frame.index, frame.index, (int(targets.ids[row]),), zone, why=why))
    return events


def _event(kind: str, targets: Targets, row: int, lasted: float, frame: Frame, why: str, zone: str = "") -> Event:
    return Event(kind, frame.index, frame.index, (int(targets.ids[row]),), zone, why=f"{why}, for {lasted:.1f} s")

"""Births: objects on regions that are nobody's, and on marks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.masks import mask_overlaps, mask_shares, silhouettes
from perdure.maths.mixture import log_density
from perdure.scene.whereabouts import Waiting, awaited
from perdure.scene.zones import Zones
from perdure.trackers.contour import observer
from perdure.trackers.contour.correcting import evident
from perdure.trackers.contour.looking import silhouette_of
from perdure.trackers.contour.rules import RESTLESS, Rules
from perdure.trackers.contour.seeing import fitted, learnt_layer, window_round
from perdure.trackers.contour.targets import Looks, Target
from perdure.types import Event, Frame, Mask, Regions

_COVERED = 0.2  # share of a region that is somebody's, from which it founds nobody
_SAME = 0.3  # IoU from which a region is one that is waited for
_MARKED = 0.5  # share of a mark in a silhouette, from which that object is meant


class Nursery(NamedTuple):
    """What births go by, beside the rules."""

    waiting: tuple[Waiting, ...]
    next_key: int
    next_id: int
    size: tuple[int, int]  # height, width
    zones: Zones
    first: bool  # whether this is the first frame: what is there is believed at once


class Born(NamedTuple):
    """What became of the regions that were nobody's."""

    targets: list[Target]  # all: those of before, then the new ones
    new: list[Target]
    waiting: tuple[Waiting, ...]
    events: list[Event]


def births(
    by: Rules,
    nursery: Nursery,
    targets: list[Target],
    frame: Frame,
    lab: NDArray[np.uint8],
    regions: Regions,
) -> Born:
    """Found objects on regions that are nobody's, and on marks."""
    marks = regions.data.get("mark")
    if marks is None and regions.blind:
        return Born(targets, [], nursery.waiting, [])
    targets, masks = list(targets), silhouettes(regions, *nursery.size)
    born: list[Target] = []
    waiting: list[Waiting] = []
    events: list[Event] = []
    next_id = max([nursery.next_id, *(one.id + 1 for one in targets)])
    held = [silhouette_of(one, by.group) for one in targets]
    for number, mask in enumerate(masks):
        identity, entry = int(marks[number]) if marks is not None else 0, -1
        if not identity:
            new = _awaited(by, nursery, mask, held, frame.time)
            if new is None:
                continue
            if not (nursery.first or (new.due and new.waited.is_due(frame.time))):
                waiting.append(new.waited)
                continue
            entry = new.waited.entry
        elif mask.area < 1:
            continue
        lost = _marked_before(targets, held, mask, identity) if identity else None
        if lost is not None:
            was = targets[lost]
            targets[lost] = _newborn(by, mask, lab, regions, number, frame.time, was.key, identity)
            if identity != was.id:
                events.append(Event("entered", frame.index, frame.index, (identity,)))
            continue
        identity = identity or next_id
        next_id = max(next_id, identity + 1)
        key = nursery.next_key + len(born)
        born.append(_newborn(by, mask, lab, regions, number, frame.time, key, identity))
        held.append(mask)
        events.append(Event("entered", frame.index, frame.index, (identity,), nursery.zones.name(entry)))
    return Born([*targets, *born], born, tuple(waiting) if masks else nursery.waiting, events)


class _Known(NamedTuple):
    """A region that is nobody's, and whether it was one before."""

    waited: Waiting
    due: bool


def _awaited(by: Rules, nursery: Nursery, mask: Mask, held: list[Mask], time: float) -> _Known | None:
    """Return what is waited for where a region is, or that it begins; None where it can be nobody."""
    least = max(by.smallest * nursery.size[0] * nursery.size[1], 1)
    if mask_shares([mask], held).sum() >= _COVERED or mask.area < least:
        return None
    known = awaited(mask, nursery.waiting, _SAME)
    new = known or Waiting.first(nursery.zones, mask, time)
    return _Known(new, known is not None) if np.isfinite(new.evidence) else None


def _newborn(
    by: Rules,
    mask: Mask,
    lab: NDArray[np.uint8],
    regions: Regions,
    row: int,
    time: float,
    key: int,
    identity: int,
) -> Target:
    """Return an object that is a region (§III: the initialisation phase)."""
    height, width = mask.bits.shape
    cell = float(_cell_of(width, height, by.ring, by.cells))
    state, group = observer.initial(mask.bits, mask.x, mask.y, by.group, cell), by.group
    pose = observer.pose_of(state, group)
    window = window_round(state.shape, pose, by.ring, by.cells)
    colours = window.cut(lab).astype(np.float32)
    depth = window.drawn(state.shape, pose)
    within = window.inside((lab.shape[0], lab.shape[1]))
    own, other = colours[(depth < 0) & within], colours[(depth > 2) & within]
    inner, outer = fitted(own, by.components, None), fitted(other, by.components, None)
    if not regions.masks[row].area:  # a box: what is in it, by its colours (§III, the initialisation phase)
        likely = np.clip(log_density(inner, colours) - log_density(outer, colours), -by.bound, by.bound)
        state = observer.settled_shape(state, evident(by, window, likely, within), by.curvature, group)
        pose = observer.pose_of(state, group)
        depth = window.drawn(state.shape, pose)
    layer = learnt_layer(None, window, colours, (depth < -0.5) & within, pose, 1.0)
    return Target(
        key, identity, state, Looks(inner, outer, inner, outer, layer), mask, 1.0, float(mask.area),
        np.zeros(group.dimension), (), -1, 2 * RESTLESS, np.zeros(2), np.zeros(2), 0, 1, 0.0, time,
        float(regions.scores[row]), str(regions.classes[row]), (row,),
        bool(regions.data["mark"][row]) if "mark" in regions.data else False,
    )  # fmt: skip


def _cell_of(width: int, height: int, ring: float, cells: int) -> int:
    """Return how many pixels a cell is across, for an object of so many pixels."""
    step = 1
    while (width + 2 * ring) * (height + 2 * ring) > cells * step * step:
        step *= 2
    return step


def _marked_before(targets: list[Target], held: list[Mask], mask: Mask, identity: int) -> int | None:
    """Which object a mark means, if any: the one of that id, or one of no mark that is where the mark is."""
    same = [number for number, one in enumerate(targets) if one.id == identity]
    if same or not targets:
        return same[0] if same else None
    common = mask_overlaps([mask], held[: len(targets)])[0]
    free = [number for number, one in enumerate(targets) if not one.marked and common[number] >= _MARKED]
    return max(free, key=common.__getitem__, default=None)

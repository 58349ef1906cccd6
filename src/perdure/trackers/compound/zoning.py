"""What zones change for targets: who is hidden behind something, who may come in, who is found again by a rule (III.C)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.features.appearance import alike, signature
from perdure.features.boxes import areas, intersections
from perdure.maths.assign import assign
from perdure.scene.zones import ANYWHERE, FORBIDDEN, Zones
from perdure.trackers.compound.matrix import Place
from perdure.trackers.compound.recalling import Found, came_in, given
from perdure.trackers.compound.targets import Targets
from perdure.types import Boxes, Event, Frame, Regions, Renamed, Tracks

Index = NDArray[np.intp]
_COMPARED = 1.0  # s of age, up to which a new target is compared
_PARTED = 0.7  # share of a newcomer in the box that somebody had before, from which he has parted from him
_LESS = 0.8  # of the likeness that is asked for elsewhere


def place_of(
    zones: Zones, targets: Targets, active: Index, expected: Boxes, frame: Frame, regions: Regions
) -> Place | None:
    """Return what zones change in the ambiguity matrix of the active targets (T,); None where they change nothing."""
    if not zones.has("low-contrast") and not zones.rules:
        return None
    forbidden = np.zeros((len(active), len(regions)), np.bool_)
    lost = np.flatnonzero((targets.missed[active] > 0) & ~targets.temporary[active])
    if zones.rules and len(lost) and len(regions):
        rows = active[lost]
        gaps = np.repeat((frame.time - targets.seen[rows])[:, None], len(regions), axis=1)
        verdicts = zones.verdicts(targets.boxes[rows], targets.behind[rows], regions.boxes, gaps)
        forbidden[lost] = verdicts == FORBIDDEN
    return Place(zones.reach(expected[active]), forbidden)


def hidden(zones: Zones, targets: Targets, region: Index, expected: Boxes) -> Targets:
    """Return targets that know behind which occluder they are, from when they get lost until they are seen."""
    if not zones.has("occlusion"):
        return targets
    away = (region < 0) & (targets.missed > 0) & np.isfinite(targets.missed) & ~targets.temporary
    fresh = np.flatnonzero(away & (targets.behind < 0))
    behind = np.where(away, targets.behind, -1)
    behind[fresh] = zones.behind(targets.boxes[fresh], expected[fresh])
    return targets.replace(behind=behind)


def coming_in(zones: Zones, births: Index, regions: Regions) -> Index:
    """Return those of the regions (K,) that found a target at all: where anybody may come in."""
    return births[np.isfinite(zones.evidence(regions.boxes[births]))] if zones and len(births) else births


def placed(zones: Zones, newcomers: Targets, boxes: Boxes, before: Targets, early: Tracks) -> Targets:
    """Return new targets that know by which entry they came in, and for how long they must be seen.

    Who parts from somebody came in with him, and needs no entry of his own: part of him was in somebody's box the frame
    before, or in the regions, pieces included, of a young target (`remember`).
    """
    if not zones or not len(newcomers):
        return newcomers
    named = before.boxes[(before.ids > 0) & (before.missed == 0)]
    regions = early.boxes[early.frames == early.frames.max(initial=-1)]
    shared = (
        intersections(boxes, np.concatenate([named, regions])) / np.maximum(areas(boxes), 1.0)[:, None]
    )  # (N, M)
    parted = (shared >= _PARTED).any(axis=1) & ~zones.within(boxes, ("noise",)).any(axis=1)
    evidence = np.where(parted, 0.0, zones.evidence(boxes))
    return newcomers.replace(evidence=evidence, entry=zones.first(boxes, "entry").astype(np.int64))


def returned(zones: Zones, targets: Targets, region: Index, frame: Frame, confirm: float, least: float) -> Found:
    """Give new targets the identities of lost ones whom an occluder or a rule lets expect there.

    Those pairs are taken that are of similar size, and look alike as far as looks are known; of several, the most
    alike, and who was lost first.

    Parameters
    ----------
    zones : Zones
        Occluders, and rules from zone to zone.
    targets : Targets
        N.
    region : (N,) int
        The region of each; -1 for none.
    frame : Frame
        Its time and number.
    confirm : float
        Seconds for which a target must have been seen before it is compared.
    least : float
        Similarity of looks that is asked for elsewhere, in [0, 1].
    """
    nothing = Found(targets, region, {}, (), ())
    if not zones.has("occlusion") and not zones.rules:
        return nothing
    age = frame.time - targets.born
    free = ~targets.temporary & (targets.compound == 0)
    compared = np.maximum(_COMPARED, targets.evidence) + 1e-9
    new = np.flatnonzero(free & (region >= 0) & (age >= confirm - 1e-9) & (age <= compared))
    old = np.flatnonzero(
        free & (region < 0) & (targets.ids > 0) & (targets.missed > 0) & np.isfinite(targets.missed)
    )
    if not len(new) or not len(old):
        return nothing
    gaps = targets.born[new][None] - targets.seen[old][:, None]  # (O, N)
    first = came_in(targets, new.tolist())
    cost = zones.returning(targets.boxes[old], targets.behind[old], first, gaps)
    cost = _looked_at(cost, targets, old, new, _LESS * least)
    found, _, _ = assign(cost)
    region, keys, events, renamed = region.copy(), {}, [], []
    for one, other in found.tolist():
        row, lost = int(new[other]), int(old[one])
        if targets.ids[row]:
            renamed.append(Renamed(int(targets.ids[row]), int(targets.ids[lost]), 0, frame.index - 1))
        events.append(_event(zones, targets, row, lost, first[other], float(gaps[one, other]), frame))
        keys[int(targets.keys[row])] = int(targets.keys[lost])
        targets = given(targets, row, lost)
        region[lost] = -1
    return Found(targets, region, keys, tuple(events), tuple(renamed))


def _looked_at(
    cost: NDArray[np.float64], targets: Targets, old: Index, new: Index, least: float
) -> NDArray[np.float64]:
    """How unlike (O, N) lost and new targets are, by their looks where those are known; inf where they are not one."""
    known = np.asarray(targets.looks[..., 3].any(axis=(1, 2)))  # (N,)
    cost = cost.copy()
    for one, other in np.argwhere(np.isfinite(cost) & known[old][:, None] & known[new][None]).tolist():
        like = alike(signature(targets.looks[old[one]]), signature(targets.looks[new[other]]))
        cost[one, other] = 1.0 - like if like >= least else np.inf
    return cost


def _event(
    zones: Zones, targets: Targets, new: int, old: int, first: NDArray[np.float32], gap: float, frame: Frame
) -> Event:
    """What is told of who is found again by an occluder or a rule."""
    rule = zones.rule(targets.boxes[old], first)
    zone = zones.name(int(targets.behind[old]))
    if rule is not None:
        zone = rule.found_in if rule.found_in != ANYWHERE else ""
        why = f"by the rule from {rule.lost_in} to {rule.found_in}, after {gap:.1f} s"
    else:
        why = f"out from behind {zone}, after {gap:.1f} s"
    return Event("found_again", int(targets.first[new]), frame.index, (int(targets.ids[old]),), zone, why=why)

"""What zones let expect of those who are not seen: who comes out from behind, who is found elsewhere by a rule."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.assign import assign
from perdure.scene.zones import Zones
from perdure.trackers.multifeature.saying import event
from perdure.trackers.multifeature.targets import Targets
from perdure.types import Boxes, Event, Frame, Regions

Index = NDArray[np.intp]


def by_zones(zones: Zones, targets: Targets, pairs: Index, regions: Regions, frame: Frame) -> Index:
    """Return links (K, 2) of lost targets to what an occluder or a rule lets expect, of what is left over."""
    lost = np.setdiff1d(np.flatnonzero((targets.missed > 0) & (targets.ids > 0)), pairs[:, 0])
    free = np.setdiff1d(np.arange(len(regions)), pairs[:, 1])
    if not zones or not len(lost) or not len(free):
        return np.zeros((0, 2), np.intp)
    gaps = np.repeat(frame.time - targets.seen[lost][:, None], len(free), axis=1)
    cost = zones.returning(targets.last[lost], targets.behind[lost], regions.boxes[free], gaps)
    found = assign(cost).pairs
    return np.column_stack([lost[found[:, 0]], free[found[:, 1]]])


def hidden_behind(
    zones: Zones, targets: Targets, region: Index, where: Boxes, frame: Frame
) -> tuple[Targets, list[Event]]:
    """Return the targets with who has got behind an occluder noted, and what is told of it and of who is seen again."""
    if not zones.has("occlusion") and not zones.rules:
        return targets, []
    away = region < 0
    lost = np.flatnonzero(away & (targets.behind < 0))
    behind = np.where(away, targets.behind, -1)
    behind[lost] = zones.behind(targets.last[lost], where[lost])
    changes = (("occluded", behind, targets.behind), ("found_again", targets.behind, behind))
    events = [
        event(kind, frame, int(targets.ids[row]), zones.name(int(one[row])))
        for kind, one, other in changes
        for row in np.flatnonzero((one >= 0) & (other < 0) & (targets.ids > 0))
    ]
    return targets.replace(behind=behind), events

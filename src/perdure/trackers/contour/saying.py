"""What is said of a frame: a row for every object, and what has happened to whom."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from perdure.features.masks import disjoint, holding
from perdure.features.outlines import thinned
from perdure.maths import levelset, lie
from perdure.scene.zones import Zones
from perdure.trackers.contour import observer
from perdure.trackers.contour.targets import Target
from perdure.types import Event, Frame, Mask, Outline, Status, Tracks

PARTLY = 0.75  # share of a silhouette that is seen, below which it is partly occluded
UNSEEN = 0.45  # confidence, at most, of an object that is not seen
_OFF = 0.05  # pixels from the contour, at most, of one with fewer points
_MIDDLE = 0.5  # of a pixel, which reaches from 0 to 1 in what is said


def rows_of(
    targets: Sequence[Target],
    believed: Sequence[Mask],
    frame: Frame,
    size: tuple[int, int],
    patience: float,
    group: lie.Group,
) -> Tracks:
    """Return the rows of a frame; believed are whole silhouettes, which may leave the picture (height, width)."""
    if not targets:
        return Tracks.empty()
    masks = disjoint([one.seen for one in targets], *size)
    status = [_status(one, mask) for one, mask in zip(targets, masks, strict=True)]
    hidden = [one == Status.OCCLUDED for one in status]
    hope = [
        UNSEEN * max(0.0, 1 - one.missed / max(patience, 1e-6)) if gone else max(one.visible, 0.5)
        for one, gone in zip(targets, hidden, strict=True)
    ]
    boxes = [
        mask.box if state == Status.VISIBLE else whole.box
        for whole, mask, state in zip(believed, masks, status, strict=True)
    ]
    return Tracks.of(
        frames=frame.index,
        times=frame.time,
        ids=[one.id for one in targets],
        boxes=holding(np.array(boxes, np.float32).reshape(-1, 4), masks),
        status=[int(one) for one in status],
        confidence=hope,
        classes=[one.class_ for one in targets],
        inferred=hidden,
        masks=masks,
        believed=believed,
        outlines=[outline_of(one.state, group) for one in targets],
        links=[one.links for one in targets],
    )


def outline_of(state: observer.State, group: lie.Group) -> Outline:
    """Return the contour g ∂μ between pixels: marching squares on μ, carried by g."""
    pose = observer.pose_of(state, group)
    middle = (np.array(state.shape.shape[::-1]) - 1) / 2  # (2,) x, y of μ's origin
    lines = [lie.act(pose, line - middle) + _MIDDLE for line in levelset.contour(state.shape)]
    return Outline.of(thinned(line, _OFF) for line in lines)


def _status(target: Target, mask: Mask) -> Status:
    if target.missed > 0 or not mask.area:
        return Status.OCCLUDED
    return Status.VISIBLE if target.visible >= PARTLY else Status.PARTLY_OCCLUDED


def has_left(box: tuple[int, int, int, int], size: tuple[int, int]) -> bool:
    """Return whether the middle of a box lies outside a picture (height, width)."""
    x, y = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    return not (0 <= x < size[1] and 0 <= y < size[0])


def gone(target: Target, frame: Frame, left: bool, zones: Zones) -> Event:
    """Return what is told of an object that is let go."""
    by = target.last_seen.exit(zones)
    kind = "left" if left or by >= 0 else "lost"
    why = "over the border" if left else "through an exit" if by >= 0 else "not seen again inside the picture"
    zone = zones.name(by if kind == "left" else target.last_seen.behind)
    return Event(kind, frame.index, frame.index, (target.id,), zone, why=why)


def happenings(before: Sequence[Target], now: Sequence[Target], frame: Frame, zones: Zones) -> list[Event]:
    """Return who has become hidden, and who is seen again."""
    old = {one.key: one for one in before}
    events = []
    for one in now:
        was = old.get(one.key)
        if was is None:
            continue
        share = f"{one.visible:.0%} of the silhouette is seen"
        if was.missed == 0 < one.missed:
            zone = zones.name(one.last_seen.behind)
            events.append(Event("occluded", frame.index, frame.index, (one.id,), zone, why=share))
        elif was.missed > 0 == one.missed:
            zone = zones.name(was.last_seen.behind)
            events.append(Event("found_again", frame.index, frame.index, (one.id,), zone, why=share))
        elif one.visible < PARTLY <= was.visible and not one.missed:
            events.append(Event("partly_occluded", frame.index, frame.index, (one.id,), why=share))
    return events

"""What is said of a frame: a row for every object, and what has happened to whom."""

from __future__ import annotations

import numpy as np

from perdure.features.masks import disjoint, holding
from perdure.scene.zones import Zones
from perdure.trackers.trackcut.targets import Target
from perdure.types import Event, Frame, Status, Tracks

_UNSEEN = 0.45  # confidence, at most, of an object that is not seen


def has_left(target: Target, size: tuple[int, int]) -> bool:
    """Whether an object that is not seen should be outside the picture."""
    x1, y1, x2, y2 = target.shape.box
    x, y = (x1 + x2) / 2, (y1 + y2) / 2
    return target.missed > 0 and not (0 <= x < size[1] and 0 <= y < size[0])


def gone(target: Target, frame: Frame, size: tuple[int, int], zones: Zones) -> Event:
    """Return what is told of an object that is let go."""
    out, by = has_left(target, size), target.last_seen.exit(zones)
    kind = "left" if out or by >= 0 else "lost"
    why = "over the border" if out else "through an exit" if by >= 0 else "not seen again inside the picture"
    zone = zones.name(by if kind == "left" else target.last_seen.behind)
    return Event(kind, frame.index, frame.index, (target.id,), zone, why=why)


def happenings(before: tuple[Target, ...], now: list[Target], frame: Frame, zones: Zones) -> list[Event]:
    """Return who has become hidden, and who is seen again."""
    old = {one.key: one for one in before}
    events = []
    for one in now:
        was = old.get(one.key)
        if was is None:
            continue
        if was.missed == 0 < one.missed:
            zone, why = zones.name(one.last_seen.behind), "no pixel of it is seen"
            events.append(Event("occluded", frame.index, frame.index, (one.id,), zone, why=why))
        elif was.missed > 0 == one.missed:
            zone, why = zones.name(was.last_seen.behind), "it is seen where it should be"
            events.append(Event("found_again", frame.index, frame.index, (one.id,), zone, why=why))
        elif one.partly and not was.partly:
            events.append(
                Event("partly_occluded", frame.index, frame.index, (one.id,), why="smaller by more than 3 σ")
            )
    return events


def rows_of(targets: list[Target], frame: Frame, size: tuple[int, int], patience: float) -> Tracks:
    """The rows of a frame."""
    if not targets:
        return Tracks.empty()
    masks = disjoint([one.mask for one in targets], *size)
    seen = [one.missed == 0 for one in targets]
    boxes = [
        one.shape.box if one.partly or not there else tuple(map(float, mask.box))
        for one, there, mask in zip(targets, seen, masks, strict=True)
    ]
    status = [
        (Status.PARTLY_OCCLUDED if one.partly else Status.VISIBLE) if there else Status.OCCLUDED
        for one, there in zip(targets, seen, strict=True)
    ]
    hope = [
        1.0 if there else _UNSEEN * max(0.0, 1 - one.missed / max(patience, 1e-6))
        for one, there in zip(targets, seen, strict=True)
    ]
    return Tracks.of(
        frames=frame.index,
        times=frame.time,
        ids=[one.id for one in targets],
        boxes=holding(np.array(boxes, np.float32).reshape(-1, 4), masks),
        status=[int(one) for one in status],
        confidence=hope,
        classes=[one.class_ for one in targets],
        inferred=[not there for there in seen],
        masks=masks,
        believed=[one.shape.to_mask() for one in targets],
        links=[one.links for one in targets],
    )

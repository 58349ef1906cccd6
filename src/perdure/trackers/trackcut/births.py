"""Births: objects that are found on observations, and lost ones that are found again (§3.4)."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from perdure.features.masks import mask_overlaps, mask_shares
from perdure.scene.backdrop import Backdrop
from perdure.scene.whereabouts import Waiting, awaited
from perdure.scene.zones import EXPECTED, FORBIDDEN, Zones
from perdure.trackers.trackcut.likelihoods import learn_colours, of_backdrop, of_colours, unlike
from perdure.trackers.trackcut.seeing import Sight, colours_of
from perdure.trackers.trackcut.shapes import over, recent_motion, to_shape
from perdure.trackers.trackcut.targets import RECENT, Target
from perdure.trackers.trackcut.windows import around
from perdure.types import Event, Frame, Mask, Regions

_NEW_COVERED = 0.2  # share of an observation that objects may hold, for it to be a new one
_SAME = 0.3  # share of an observation that one of the frame before held, for both to be one
_ALIKE = 0.5  # nats a pixel by which what is found must look more like the object than like its surroundings
_WHOLE = 0.5  # of its mean size, from which what is found again of an object is its silhouette, not a piece
_PIECE = 0.25  # of the smallest object: the smallest piece of one that is found again
_REACH, _ASTRAY = 0.7, 0.7  # of its side, and of its way since it was seen, that it may be from where it should be
_SIMILAR = 2.5  # times its size, that one which is found again may have
_MARKED = 0.5  # IoU from which an object is what is marked there


class Nursery(NamedTuple):
    """What births go by."""

    smallest: float  # pixels
    ring: float  # px round a new object
    cells: int  # in which it is looked at, at most
    components: int  # of a mixture
    trust: float  # in first looks
    bound: float  # nats
    backdrop: Backdrop
    zones: Zones = Zones()


class Born(NamedTuple):
    """What became of the observations that were nobody's."""

    targets: list[Target]  # all: those of before, then the new ones
    new: int  # how many are
    waiting: tuple[Waiting, ...]
    events: list[Event]


def births(
    nursery: Nursery,
    targets: list[Target],
    waiting: tuple[Waiting, ...] | None,
    keys: tuple[int, int],
    frame: Frame,
    sight: Sight,
    regions: Regions,
    observations: list[Mask],
) -> Born:
    """Found objects on observations that are nobody's (§3.4); lost ones are looked for in them first.

    Parameters
    ----------
    nursery : Nursery
        What births go by.
    targets : list of Target
        As they are in this frame.
    waiting : Waiting, or None
        Observations that were nobody's in the frame before; None in the first frame, when nobody waits.
    keys : (int, int)
        The next key, and the next id.
    frame, sight, regions, observations
        The frame, and what a detector saw in it.
    """
    marks = regions.data.get("mark")
    before, zones = waiting or (), nursery.zones
    if marks is None and regions.blind:
        return Born(targets, 0, before, [])
    targets, next_key, next_id = list(targets), keys[0], max([keys[1], *(one.id + 1 for one in targets)])
    taken = {number for one in targets for number in one.links}
    born: list[Target] = []
    wait: list[Waiting] = []
    events: list[Event] = []
    for number, mask in enumerate(observations):
        identity = int(marks[number]) if marks is not None else 0
        if not identity:
            held = [one.mask for one in (*targets, *(one for one in born if one.marked))]
            covered = mask_shares([mask], held).sum()
            if number in taken or covered >= _NEW_COVERED or mask.area < max(_PIECE * nursery.smallest, 1):
                continue
        lost = _found_again(nursery, targets, mask, sight, identity, frame.time)
        if lost is not None:
            was = targets[lost]
            new = _newborn(nursery, mask, sight, regions, number, frame, was.key, identity or was.id)
            targets[lost] = new if identity else _again(was, new)
            if identity and identity != was.id:
                events.append(Event("entered", frame.index, frame.index, (identity,)))
            continue
        known = awaited(mask, before, _SAME)
        comer = known or Waiting.first(zones, mask, frame.time)
        if not identity:
            if mask.area < nursery.smallest or not np.isfinite(comer.evidence):
                continue
            if waiting is not None and not (known and comer.is_due(frame.time)):
                wait.append(comer)
                continue
        identity = identity or next_id
        next_id = max(next_id, identity + 1)
        born.append(_newborn(nursery, mask, sight, regions, number, frame, next_key + len(born), identity))
        events.append(Event("entered", frame.index, frame.index, (identity,), zones.name(comer.entry)))
    if not observations:  # a frame in which nothing was looked for: who waits goes on waiting
        wait = list(before)
    return Born([*targets, *born], len(born), tuple(wait), events)


def _found_again(
    nursery: Nursery, targets: list[Target], mask: Mask, sight: Sight, identity: int, time: float
) -> int | None:
    """Return which object an observation is, if any: the one of that id, the one marked now, a lost one like it."""
    if identity:
        same = [number for number, one in enumerate(targets) if one.id == identity]
        return same[0] if same else _found_there(targets, mask)
    best, least = None, _ALIKE
    for number, one in enumerate(targets):
        if one.missed <= 0 or mask.area > _SIMILAR * one.mean:
            continue
        verdict = one.last_seen.verdict(nursery.zones, mask.box, one.missed)
        if verdict == FORBIDDEN or not (verdict == EXPECTED or _within_reach(one, mask)):
            continue
        points = colours_of(sight, mask)
        likeness = float(of_colours(points, one.first, one.last, nursery.trust, nursery.bound).mean())
        if likeness > least:
            best, least = number, likeness
    return best


def _newborn(
    nursery: Nursery, mask: Mask, sight: Sight, regions: Regions, row: int, frame: Frame, key: int, identity: int
) -> Target:
    """Return an object that is an observation."""
    height, width = sight.colours.shape[:2]
    window = around([mask.box], nursery.ring, nursery.cells, (height, width))
    cells = window.of_mask(mask)
    seen = window.cut(sight.colours).astype(np.float32)
    marked = bool(regions.data["mark"][row]) if "mark" in regions.data else False
    _, bare = of_backdrop(seen, window, nursery.backdrop)
    colours = learn_colours(
        seen,
        cells > 0.5 if marked else unlike(cells > 0.5, bare),
        np.ones(cells.shape, np.bool_),
        nursery.components,
    )
    return Target(
        key=key,
        id=identity,
        mask=mask,
        shape=to_shape(cells, window),
        first=colours,
        last=colours,
        motions=np.full((RECENT, 2), np.nan),
        mean=float(mask.area),
        variance=0.0,
        seen_frames=1,
        born=frame.time,
        missed=0.0,
        missing=0.0,
        unseen=0,
        doubted=0.0,
        partly=False,
        small=0.0,
        together=False,
        company=(),
        alone=0,
        pieces=0.0,
        squeezed=0,
        score=float(regions.scores[row]),
        class_=str(regions.classes[row]),
        links=(row,),
        marked=marked,
    )


def _found_there(targets: list[Target], mask: Mask) -> int | None:
    """Which object of no mark is where a mark is now, if any: half of both is common."""
    common = mask_overlaps([mask], [one.mask for one in targets])[0] if targets else np.zeros(0)  # (N,)
    free = [number for number, one in enumerate(targets) if not one.marked and common[number] >= _MARKED]
    return max(free, key=common.__getitem__, default=None)


def _again(was: Target, found: Target) -> Target:
    """Return an object that is found again: with its own silhouette where a piece of it is seen."""
    shape = over(was.shape, found.mask) if found.mask.area < _WHOLE * was.mean else found.shape
    return replace(
        was,
        mask=found.mask,
        shape=shape,
        missed=0.0,
        missing=0.0,
        unseen=0,
        doubted=0.0,
        together=False,
        links=found.links,
    )


def _within_reach(target: Target, mask: Mask) -> bool:
    """Whether an observation is where an object that is hidden may be by now."""
    x1, y1, x2, y2 = target.shape.box
    speed = float(np.hypot(*recent_motion(target)))
    reach = _REACH * np.sqrt(target.mean) + _ASTRAY * speed * target.unseen
    left, top, right, bottom = mask.box
    return bool(np.hypot(max(x1 - right, left - x2, 0), max(y1 - bottom, top - y2, 0)) <= reach)

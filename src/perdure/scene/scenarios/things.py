"""Things: left behind by somebody who goes, taken away by somebody who comes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from perdure.scene.lives import HEIGHT, Life, X, Y
from perdure.scene.scenarios.moment import Moment, between
from perdure.scene.scenarios.rules import Scenario
from perdure.types import Event

_SMALLER = 0.6  # of its owner's area, up to which it is a thing
_STILL = 0.5  # own sizes, which a thing may seem to move
_TAKEN = 1.0  # own sizes from where it stood, from which it has been moved
_ALIKE = 0.4  # of the faster one's speed, by which two who go together may differ
_GONE = 0.5  # s for which it must not be seen where it stood, when somebody is away from there again


@dataclass(frozen=True)
class Thing:
    """A target that stands still, and who was near it.

    `owner` is who was beside it when it was first seen, in `leaves-behind`; who was beside it last, in `takes-away`.
    """

    scenario: str
    id: int
    owner: int
    x: float
    y: float  # its middle, where it stands
    size: float  # the root of its area, px
    since: int  # frame and second since when it stands there
    stood: float
    last: int  # frame in which it was last seen there, and the second
    seen: float
    told: bool  # or it has turned out to be no thing


def watched(
    scenarios: Sequence[Scenario], before: Sequence[Thing], moment: Moment
) -> tuple[tuple[Thing, ...], list[Event]]:
    """Return which things stand where after a moment, and what was left behind or taken away."""
    things = {(one.scenario, one.id): one for one in before if one.id in moment.lives}
    present, events = set(moment.present), []
    for scenario in scenarios:
        for one in moment.present:
            key = (scenario.name, one)
            thing = things.get(key)
            if thing is None:
                thing = _new(scenario, moment.lives[one], moment)
                if thing is None:
                    continue
            things[key] = _followed(scenario, thing, moment.lives[one], moment)
        for key in [one for one in things if one[0] == scenario.name]:
            kept, event = _judged(scenario, things[key], moment, present)
            events += [event] if event is not None else []
            if kept is None:
                del things[key]
            else:
                things[key] = kept
    return tuple(things.values()), events


def _new(scenario: Scenario, life: Life, moment: Moment) -> Thing | None:
    """A thing that is seen for the first time; one to be left behind must be somebody's."""
    owner = 0
    if scenario.on == "leaves-behind":
        if len(life.path) > 1 and life.first < moment.frame - len(life.path):
            return None
        owner = _nearest(scenario, life, moment, scenario.near)
        if not owner or life.area_now > _SMALLER * moment.lives[owner].area_now:
            return None
    x, y = _middle(life)
    return Thing(
        scenario.name, life.id, owner, x, y, life.scale, life.first, life.born, moment.frame, moment.time, False
    )


def _followed(scenario: Scenario, thing: Thing, life: Life, moment: Moment) -> Thing:
    """A thing that is seen: still where it stood, or somewhere else, where it may stand from now on."""
    x, y = _middle(life)
    moved = math.hypot(x - thing.x, y - thing.y) / max(thing.size, 1.0)
    if moved <= _STILL:
        if thing.told:
            return thing
        near = _nearest(scenario, life, moment, scenario.near) if scenario.on == "takes-away" else thing.owner
        return replace(thing, last=moment.frame, seen=moment.time, owner=near)
    if scenario.on == "takes-away" and thing.seen - thing.stood >= scenario.lasts - 1e-9:
        return thing  # it is judged whether it was taken
    return replace(thing, told=True)  # it walks: no thing


def _judged(
    scenario: Scenario, thing: Thing, moment: Moment, present: set[int]
) -> tuple[Thing | None, Event | None]:
    """A thing, if it is still to be watched, and what is told of it."""
    life = moment.lives[thing.id]
    if scenario.on == "leaves-behind":
        return _left(scenario, thing, life, moment)
    if thing.told or not (thing.id in present or life.gone):
        return thing, None
    if thing.id in present:
        if math.dist(_middle(life), (thing.x, thing.y)) <= _TAKEN * thing.size:
            return thing, None
    elif moment.time - thing.seen < _GONE:
        return thing, None
    owner, over = moment.lives.get(thing.owner), replace(thing, told=True)
    stood = thing.seen - thing.stood >= scenario.lasts - 1e-9
    if not stood or owner is None or (thing.id in present and not _together(owner, life, scenario.near)):
        return over, None
    belief = round(moment.belief(thing.owner, scenario.partner), 3)
    why = f"stood for {thing.seen - thing.stood:.1f} s"
    return over, Event(scenario.name, thing.last, moment.frame, (thing.owner, thing.id), "", belief, why)


def _together(owner: Life, thing: Life, near: float) -> bool:
    """Whether a thing that has moved goes where its taker goes, as fast."""
    one, other = owner.moving, thing.moving
    fastest = max(float(np.hypot(*one)), float(np.hypot(*other)))
    return between(owner, thing) <= near and bool(np.hypot(*(one - other)) <= _ALIKE * fastest)


def _left(scenario: Scenario, thing: Thing, life: Life, moment: Moment) -> tuple[Thing | None, Event | None]:
    if life.gone or life.reach > _STILL * 2 * life.scale:
        return None, None  # it goes by itself
    if (
        thing.told
        or moment.time - thing.stood < scenario.lasts - 1e-9
        or not moment.is_one(thing.id, scenario.who)
    ):
        return thing, None
    owner = moment.lives.get(thing.owner)
    if (
        owner is not None
        and not owner.gone
        and thing.owner in moment.present
        and _apart(owner, life) < scenario.apart
    ):
        return thing, None
    belief = round(moment.belief(thing.owner, scenario.partner), 3) if owner is not None else 0.5
    why = f"first seen beside {thing.owner}, still for {moment.time - thing.stood:.1f} s"
    event = Event(scenario.name, thing.since, moment.frame, (thing.owner, thing.id), "", belief, why)
    return replace(thing, told=True), event


def _nearest(scenario: Scenario, life: Life, moment: Moment, near: float) -> int:
    """Who is nearest to a thing, of the classes that count and larger than it; 0 for nobody."""
    best, found = near, 0
    for one in moment.present:
        other = moment.lives[one]
        if one == life.id or life.area_now > _SMALLER * other.area_now or not moment.is_one(one, scenario.partner):
            continue
        distance = between(other, life)
        if distance <= best:
            best, found = distance, one
    return found


def _apart(owner: Life, thing: Life) -> float:
    return between(owner, thing)


def _middle(life: Life) -> tuple[float, float]:
    return float(life.last[X]), float(life.last[Y] - life.last[HEIGHT] / 2)

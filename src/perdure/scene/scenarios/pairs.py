"""Two who meet, are together, and part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from perdure.scene.scenarios.lasting import Hold
from perdure.scene.scenarios.moment import Moment
from perdure.scene.scenarios.rules import Scenario
from perdure.types import Event


@dataclass(frozen=True)
class Pair:
    """Two who are near each other, or have been since they were last apart, by a scenario's distances."""

    scenario: str
    ids: tuple[int, int]  # the smaller first
    came: bool  # they were apart before; else one was first seen beside the other
    near: int  # frame and second since when they are near each other; -1 while they are not
    since: float
    together: bool  # they have been near for long enough
    last: int  # frame and second in which both were last seen
    seen: float


def paired(
    scenarios: Sequence[Scenario], before: Sequence[Pair], moment: Moment
) -> tuple[tuple[Pair, ...], list[Hold], list[Event]]:
    """Return who is near whom after a moment, who has met and is still together, and who has parted.

    Two have met if they were apart, then near for `lasts`; they part when they were together and get apart, however they
    came. Between near and apart nothing changes.
    """
    pairs = {(one.scenario, one.ids): one for one in before if _alive(one, moment)}
    met: list[Hold] = []
    parted: list[Event] = []
    for scenario in scenarios:
        for ids, distance, belief in _beside(scenario, pairs, moment):
            key = (scenario.name, ids)
            one = pairs.get(key)
            if one is None:
                one = Pair(scenario.name, ids, _came(ids, moment), -1, 0.0, False, moment.frame, moment.time)
            if distance >= scenario.apart:
                pairs.pop(key, None)
                if one.together and scenario.on == "parts":
                    since = max(one.since, *(moment.lives[part].born for part in ids))
                    why = f"together for {moment.time - since:.1f} s"
                    parted.append(Event(scenario.name, moment.frame, moment.frame, ids, "", belief, why))
                continue
            if distance <= scenario.near and one.near < 0:
                one = replace(one, near=moment.frame, since=moment.time)
            elif distance > scenario.near and not one.together:
                one = replace(one, near=-1)
            long = one.near >= 0 and moment.time - one.since >= scenario.lasts - 1e-9
            one = replace(one, together=one.together or long, last=moment.frame, seen=moment.time)
            pairs[key] = one
            if scenario.on == "meets" and one.came and one.near >= 0:
                met.append(_hold(one, belief))
        if scenario.on == "meets":  # as long as one of them is not seen, they are as they were
            known = (one for one in pairs.values() if one.scenario == scenario.name and one.came and one.together)
            met += [_hold(one, 0.0) for one in known if not set(moment.present).issuperset(one.ids)]
    return tuple(pairs.values()), met, parted


def _hold(one: Pair, belief: float) -> Hold:
    return Hold(one.scenario, *one.ids, "", one.near, one.since, one.last, one.seen, False, False, belief)


def _beside(
    scenario: Scenario, pairs: dict[tuple[str, tuple[int, int]], Pair], moment: Moment
) -> list[tuple[tuple[int, int], float, float]]:
    """Pairs (ids, distance, belief) of whom a scenario may speak: near each other, or so before."""
    distances = np.triu(moment.distances, 1)
    near = np.argwhere((distances < scenario.apart) & np.triu(np.ones(distances.shape, np.bool_), 1))
    place = {one: number for number, one in enumerate(moment.present)}
    known = [key[1] for key in pairs if key[0] == scenario.name and all(one in place for one in key[1])]
    every = {(moment.present[a], moment.present[b]) for a, b in near.tolist()} | set(known)
    found = []
    for one, other in sorted(every):
        partner = scenario.partner or scenario.who
        either = moment.is_one(one, scenario.who) and moment.is_one(other, partner)
        if either or (moment.is_one(other, scenario.who) and moment.is_one(one, partner)):
            belief = min(moment.belief(one, ()), moment.belief(other, ()))
            found.append(((one, other), float(moment.distances[place[one], place[other]]), round(belief, 3)))
    return found


def _came(ids: tuple[int, int], moment: Moment) -> bool:
    """Whether two who are near each other for the first time were apart: both had been seen before."""
    return all(moment.lives[one].age > 0 for one in ids)


def _alive(one: Pair, moment: Moment) -> bool:
    return all(part in moment.lives and not moment.lives[part].gone for part in one.ids)

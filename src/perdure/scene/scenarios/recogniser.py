"""Scenarios recognised as a video goes on: a fold over moments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from perdure.scene.scenarios.lasting import Hold, ended, held
from perdure.scene.scenarios.moment import Moment
from perdure.scene.scenarios.pairs import Pair, paired
from perdure.scene.scenarios.places import Crossing, Side, crossed, sided
from perdure.scene.scenarios.rules import PAIRS, PLACES, THINGS, Rules
from perdure.scene.scenarios.things import Thing, watched
from perdure.types import Event


@dataclass(frozen=True, eq=False)
class Recognition:
    """What is going on."""

    holds: tuple[Hold, ...] = ()
    sides: tuple[Side, ...] = ()
    crossings: tuple[Crossing, ...] = ()
    pairs: tuple[Pair, ...] = ()
    things: tuple[Thing, ...] = ()

    def renamed(self, names: Mapping[int, int]) -> Recognition:
        """Return it with other ids: who was taken for one has turned out to be another."""

        def of(one: int) -> int:
            return names.get(one, one)

        def pair(ids: tuple[int, int]) -> tuple[int, int]:
            one, other = sorted(map(of, ids)) if all(ids) else map(of, ids)
            return one, other

        if not names:
            return self
        holds: dict[object, Hold] = {}
        for hold in sorted(
            self.holds, key=lambda one: one.begin
        ):  # of two that are one now, the one that began first
            ids = pair((hold.id, hold.other))
            if ids[0] != ids[1]:
                key = (hold.scenario, *ids, hold.zone, hold.over)
                holds.setdefault(key, replace(hold, id=ids[0], other=ids[1]))
        pairs: dict[object, Pair] = {}
        for two in sorted(self.pairs, key=lambda one: one.since):
            ids = pair(two.ids)
            if ids[0] != ids[1]:
                pairs.setdefault((two.scenario, ids), replace(two, ids=ids))
        return Recognition(
            tuple(holds.values()),
            tuple(replace(one, id=of(one.id)) for one in self.sides),
            tuple(replace(one, id=of(one.id)) for one in self.crossings),
            tuple(pairs.values()),
            tuple(replace(one, id=of(one.id), owner=of(one.owner)) for one in self.things),
        )


class Recognised(NamedTuple):
    """What is going on after a moment, what has begun, and what is over."""

    state: Recognition
    begun: tuple[Event, ...]
    over: tuple[Event, ...]


def recognise(rules: Rules, state: Recognition, moment: Moment) -> Recognised:
    """Return what a moment adds to what is known of a video.

    Parameters
    ----------
    rules : Rules
        What is to be recognised.
    state : Recognition
        After the moment before.
    moment : Moment
        A frame later.

    Returns
    -------
    Recognised
        Events of what lasts are told twice: when it is recognised, with the end as far as it has gone (`begun`), and
        when it is over. What happens in a moment is told in `over` alone.
    """
    named = {one.name: one for one in rules.scenarios}
    places = [one for one in rules.scenarios if one.on in PLACES]
    lines = [one for one in rules.scenarios if one.on == "crosses"]
    pairs = [one for one in rules.scenarios if one.on in PAIRS]
    things = [one for one in rules.scenarios if one.on in THINGS]
    sides, of_places = sided(places, state.sides, moment) if places else ((), [])
    crossings, of_lines = crossed(lines, rules.lines, state.crossings, moment) if lines else ((), [])
    couples, met, parted = paired(pairs, state.pairs, moment) if pairs else ((), [], [])
    objects, of_things = watched(things, state.things, moment) if things else ((), [])
    moments = [*of_places, *of_lines, *parted, *of_things]
    holds, begun, over = held(rules.scenarios, state.holds, moment, met, moments)
    told = [one for one in (*over, *moments) if not named[one.kind].quiet]
    after = Recognition(holds, sides, crossings, couples, objects)
    return Recognised(after, tuple(one for one in begun if not named[one.kind].quiet), tuple(told))


def finished(rules: Rules, state: Recognition) -> tuple[Event, ...]:
    """Return what is over because the video is."""
    named = {one.name: one for one in rules.scenarios}
    return tuple(one for one in ended(state.holds) if not named[one.kind].quiet)

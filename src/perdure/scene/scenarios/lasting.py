"""What lasts: conditions that hold on end, alone or of two, and what must have come before."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from perdure.scene.scenarios.moment import Moment
from perdure.scene.scenarios.rules import Scenario
from perdure.types import Event


@dataclass(frozen=True)
class Hold:
    """A scenario that holds of a target, or has just ceased to; of two, or of several in a zone, too."""

    scenario: str
    id: int  # 0 for all in a zone together
    other: int  # of a pair; else 0
    zone: str
    begin: int  # frames and seconds
    begun: float
    last: int
    lasted: float
    told: bool  # that it is recognised
    over: bool  # it is remembered for what may come after it
    belief: float


Key = tuple[str, int, int, str]


def held(
    scenarios: Sequence[Scenario],
    before: Sequence[Hold],
    moment: Moment,
    together: Iterable[Hold],
    moments: Sequence[Event],
) -> tuple[tuple[Hold, ...], list[Event], list[Event]]:
    """Return what holds after a moment, what is recognised in it, and what is over.

    `together` are pairs that have met, as long as they are together; `moments` what has just happened, which others may
    come after.
    """
    named = {one.name: one for one in scenarios}
    waited = {one.after for one in scenarios if one.after}
    known: dict[Key, Hold] = {(one.scenario, one.id, one.other, one.zone): one for one in before if not one.over}
    past = [one for one in before if one.over and moment.time - one.lasted <= _reach(scenarios, one.scenario)]
    now = {(one.scenario, one.id, one.other, one.zone): one for one in together}
    for scenario in scenarios:
        if scenario.on == "while":
            now |= {(one.scenario, one.id, one.other, one.zone): one for one in _holding(scenario, before, moment)}
    begun: list[Event] = []
    over: list[Event] = []
    holds: list[Hold] = []
    for key, one in now.items():
        old = known.pop(key, None)
        if old is not None:
            one = replace(one, begin=old.begin, begun=old.begun, told=old.told, belief=max(old.belief, one.belief))
        if not one.told and moment.time - one.begun >= named[one.scenario].lasts - 1e-9:
            one = replace(one, told=True)
            begun.append(_event(one))
        holds.append(one)
    for one in known.values():
        alive = all(
            part == 0 or (part in moment.lives and not moment.lives[part].gone) for part in (one.id, one.other)
        )
        if alive and moment.time - one.lasted <= named[one.scenario].forgives + 1e-9:
            holds.append(one)
            continue
        if one.told:
            over.append(_event(one))
            if one.scenario in waited:
                past.append(replace(one, over=True))
    for event in moments:
        if event.kind in waited:
            past += [
                Hold(
                    event.kind,
                    one,
                    0,
                    event.zone,
                    event.begin,
                    moment.time,
                    event.end,
                    moment.time,
                    True,
                    True,
                    1.0,
                )
                for one in event.ids
            ]
    return (*past, *holds), begun, over


def ended(holds: Iterable[Hold]) -> list[Event]:
    """Return what was still going on when the video ended."""
    return [_event(one) for one in holds if one.told and not one.over]


def _holding(scenario: Scenario, before: Sequence[Hold], moment: Moment) -> Iterator[Hold]:
    """Of whom a scenario holds in this moment, as if it had just begun."""
    found = []
    for place, one in enumerate(moment.present):
        if not moment.conditions(scenario, one) or not _came_after(scenario, one, before, moment):
            continue
        belief = moment.belief(one, scenario.who)
        for zone in moment.zones_of(scenario, place):
            found.append(_new(scenario, one, 0, zone, moment, belief))
    if scenario.count is None:
        yield from found
        return
    for zone in dict.fromkeys(one.zone for one in found):
        there = [one for one in found if one.zone == zone]
        if scenario.count.hold(len(there)):
            yield _new(scenario, 0, 0, zone, moment, min(one.belief for one in there))


def _new(scenario: Scenario, one: int, other: int, zone: str, moment: Moment, belief: float) -> Hold:
    return Hold(
        scenario.name, one, other, zone, moment.frame, moment.time, moment.frame, moment.time, False, False, belief
    )


def _came_after(scenario: Scenario, one: int, before: Sequence[Hold], moment: Moment) -> bool:
    """Whether what a scenario comes after has held of a target; once it has begun, that is enough."""
    if not scenario.after:
        return True
    for hold in before:
        if one in (hold.id, hold.other):
            if hold.scenario == scenario.name and not hold.over:
                return True
            if (
                hold.scenario == scenario.after
                and hold.told
                and moment.time - hold.lasted <= scenario.within + 1e-9
            ):
                return True
    return False


def _reach(scenarios: Sequence[Scenario], name: str) -> float:
    """For how long others may come after one."""
    return max((one.within for one in scenarios if one.after == name), default=0.0)


def _event(one: Hold) -> Event:
    ids = tuple(part for part in (one.id, one.other) if part)
    why = f"for {one.lasted - one.begun:.1f} s"
    return Event(one.scenario, one.begin, one.last, ids, one.zone, round(one.belief, 3), why)

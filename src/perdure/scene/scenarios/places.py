"""Coming into zones, going out of them, crossing lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from perdure.scene.counting import IN, OUT, Line, steps_over
from perdure.scene.lives import FRAME, X, Y
from perdure.scene.scenarios.moment import Moment
from perdure.scene.scenarios.rules import ANY, Scenario
from perdure.types import Event

_AWAY = 0.02  # of the picture's height, which one must get away from a line
_FORGOTTEN = 60.0  # s


@dataclass(frozen=True)
class Side:
    """On which side of a zone's edge a target is, by a scenario's patience."""

    scenario: str
    id: int
    zone: int
    inside: bool
    since: int  # frame of its first row on the other side; -1 while it is on this one
    turned: float  # s, of that row
    seen: float  # s, of the last row


@dataclass(frozen=True)
class Crossing:
    """What a target has crossed and not yet got away from."""

    line: str
    id: int
    x: float
    y: float
    frames: tuple[int, ...]
    signs: tuple[int, ...]
    seen: float  # s


def sided(
    scenarios: Sequence[Scenario], before: Sequence[Side], moment: Moment
) -> tuple[tuple[Side, ...], list[Event]]:
    """Return where everybody is after a moment, and who has come in or gone out.

    One is on the other side of a zone's edge when it has been for `lasts` seconds; it got there with its first row
    there. Who is seen first inside has not come in.
    """
    sides = {(one.scenario, one.id, one.zone): one for one in before if moment.time - one.seen <= _FORGOTTEN}
    events = []
    for scenario in scenarios:
        wanted = [
            number for number, zone in enumerate(moment.zones.zones) if {ANY, zone.name} & set(scenario.zone)
        ]
        for place, one in enumerate(moment.present):
            for zone in wanted:
                key, inside = (scenario.name, one, zone), bool(moment.within[place, zone])
                side = sides.get(key, Side(*key, inside, -1, 0.0, moment.time))
                if inside == side.inside:
                    sides[key] = replace(side, since=-1, seen=moment.time)
                    continue
                if side.since < 0:
                    side = replace(side, since=moment.frame, turned=moment.time)
                side = replace(side, seen=moment.time)
                if moment.time - side.turned >= scenario.lasts - 1e-9:
                    if inside == (scenario.on == "enters") and moment.conditions(scenario, one):
                        belief = round(moment.belief(one, scenario.who), 3)
                        events.append(
                            Event(scenario.name, side.since, side.since, (one,), moment.zones.name(zone), belief)
                        )
                    side = replace(side, inside=inside, since=-1)
                sides[key] = side
    return tuple(sides.values()), events


def crossed(
    scenarios: Sequence[Scenario], lines: Sequence[Line], before: Sequence[Crossing], moment: Moment
) -> tuple[tuple[Crossing, ...], list[Event]]:
    """Return what is being crossed after a moment, and who has crossed what: to and fro before it got away cancel out."""
    pending = {(one.line, one.id): one for one in before if moment.time - one.seen <= _FORGOTTEN}
    away = _AWAY * moment.zones.size[0]
    events: list[Event] = []
    for line in lines:
        edges = _edges(line)
        for one in moment.present:
            life = moment.lives[one]
            x, y = float(life.last[X]), float(life.last[Y])
            old = pending.get((line.name, one))
            if old is None:
                old = Crossing(line.name, one, *_first(life.path), (), (), moment.time)
            here = np.array([x, y])
            signs = [sign for _, sign in steps_over(np.array([old.x, old.y]), here, edges)]
            frames = (*old.frames, *([moment.frame] * len(signs)))
            now = Crossing(line.name, one, x, y, frames, (*old.signs, *signs), moment.time)
            if now.signs and _distance(here, edges) >= away:
                events += _told(scenarios, line, now, moment)
                now = replace(now, frames=(), signs=())
            pending[line.name, one] = now
    return tuple(pending.values()), events


def _told(scenarios: Sequence[Scenario], line: Line, now: Crossing, moment: Moment) -> list[Event]:
    net = sum(now.signs)
    if not net:
        return []
    way = 1 if net > 0 else -1
    frame = [at for at, sign in zip(now.frames, now.signs, strict=True) if sign == way][-abs(net)]
    direction = IN if way > 0 else OUT
    return [
        Event(one.name, frame, frame, (now.id,), line.name, round(moment.belief(now.id, one.who), 3), direction)
        for one in scenarios
        if {ANY, line.name} & set(one.line) and one.direction in ("", direction) and moment.conditions(one, now.id)
    ]


def _first(path: np.ndarray) -> tuple[float, float]:
    """Where a target was one row ago, or is now."""
    row = path[-2] if len(path) > 1 and path[-1, FRAME] - path[-2, FRAME] >= 1 else path[-1]
    return float(row[X]), float(row[Y])


def _edges(line: Line) -> np.ndarray:
    points = np.array(line.points, np.float64)
    edges = np.hstack([points[:-1], points[1:]])
    return np.asarray(edges[(edges[:, :2] != edges[:, 2:]).any(axis=1)])


def _distance(point: np.ndarray, edges: np.ndarray) -> float:
    """How far a point is from the nearest of edges (E, 4)."""
    along = edges[:, 2:] - edges[:, :2]
    share = np.clip(((point - edges[:, :2]) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    away = edges[:, :2] + share[:, None] * along - point
    return math.sqrt(float((away**2).sum(axis=1).min()))

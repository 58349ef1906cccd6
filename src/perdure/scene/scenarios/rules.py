"""Declarations of scenarios: what must hold, of whom, where, for how long; and what is told of it.

A scenario begins with a *trigger* (`on`), and holds of a target where every condition that it names holds:

=============  =================================================================================================
`while`        the conditions hold for `lasts` seconds on end; it ends when they have not held for `forgives`
`enters`       one comes into a zone from outside, and is in it for `lasts`
`leaves`       one comes out of it, and stays out for `lasts`
`crosses`      one crosses a line, and gets away from it
`meets`        two who were farther apart are `near` each other for `lasts`
`parts`        two who were together get `apart`
`leaves-behind`  a thing that came with somebody stays where it is, for `lasts`, and she is `apart` from it
`takes-away`   a thing that stood by itself for `lasts` is gone, or moves, with somebody `near` it
=============  =================================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from perdure.errors import ParameterError
from perdure.params import unknown_name
from perdure.scene.beliefs import USUAL, Kind
from perdure.scene.counting import IN, OUT, Line

TRIGGERS = ("while", "enters", "leaves", "crosses", "meets", "parts", "leaves-behind", "takes-away")
PAIRS = ("meets", "parts")
THINGS = ("leaves-behind", "takes-away")
PLACES = ("enters", "leaves")
ANY = "*"
RESERVED = ("entered", "left", "lost", "found_again", "noise", "believed", "gap", "exchanged", "merge", "split")
LONGEST = 60.0  # s: what may be asked of a life's past


@dataclass(frozen=True)
class Bounds:
    """A range of numbers, the ends left out."""

    above: float = -math.inf
    below: float = math.inf

    def __post_init__(self) -> None:
        """Refuse a range that holds nothing."""
        if not self.above < self.below:
            raise ParameterError(f"above = {self.above:g} must be less than below = {self.below:g}")

    def hold(self, value: float) -> bool:
        """Return whether a number is known and lies within."""
        return self.above < value < self.below


@dataclass(frozen=True)
class Scenario:
    """One scenario.

    Parameters
    ----------
    name : str
        The kind of its events.
    on : str
        One of `TRIGGERS`.
    who : tuple of str
        Classes, one of which it must be believed to be; empty for anybody who is not taken for noise.
    partner : tuple of str
        The same of the other one of a pair, or of who left a thing or took it (`with` in a file).
    zone : tuple of str
        Names of zones, in one of which it happens; '*' for each of them by itself; empty for anywhere.
    outside : tuple of str
        Names of zones, in none of which it may be.
    line : tuple of str
        Names of lines; '*' for each.
    direction : str
        'in', from a line's left to its right, seen by who goes from its first point to its last; 'out'; or '' for both.
    pace, speed, age : Bounds or None
        Own heights a second; m/s (never holds where the ground is not known); s since it was first seen.
    roams : Bounds or None
        Greatest distance from its mean place within the last `over` seconds, own heights.
    over : float
        s.
    near, apart : float
        Distances of feet in heights, the mean of both: up to which two are together, and from which they are apart.
    lasts, forgives : float
        s for which it must hold, and for which it may cease to.
    after : str
        Name of another scenario that must have held of the target, not longer than `within` seconds ago.
    within : float
        s.
    count : Bounds or None
        How many targets it holds of at once, in the zone: one event for all of them.
    interesting : bool
        Who takes part is protected: kept for longer when lost.
    quiet : bool
        It is recognised for others that come `after` it, and not told.
    """

    name: str
    on: str = "while"
    who: tuple[str, ...] = ()
    partner: tuple[str, ...] = ()
    zone: tuple[str, ...] = ()
    outside: tuple[str, ...] = ()
    line: tuple[str, ...] = ()
    direction: str = ""
    pace: Bounds | None = None
    speed: Bounds | None = None
    age: Bounds | None = None
    roams: Bounds | None = None
    over: float = 10.0
    near: float = 1.0
    apart: float = 2.0
    lasts: float = 0.0
    forgives: float = 0.5
    after: str = ""
    within: float = 5.0
    count: Bounds | None = None
    interesting: bool = False
    quiet: bool = False

    def __post_init__(self) -> None:
        """Refuse what cannot be meant."""
        if not self.name or not self.name.replace("_", "").replace("-", "").isalnum():
            raise ParameterError(f"name = {self.name!r} must be letters, digits, - and _")
        if self.name in RESERVED:
            raise ParameterError(f"name = {self.name!r} is what trackers call an event of theirs; take another")
        if self.after == self.name:
            raise ParameterError("after = its own name: a scenario cannot come after itself")
        if self.on not in TRIGGERS:
            raise ParameterError(unknown_name("trigger (on)", self.on, TRIGGERS))
        for name, low, high in (
            ("over", 0.1, LONGEST),
            ("near", 0.01, 100.0),
            ("apart", 0.01, 1000.0),
            ("lasts", 0.0, 3600.0),
            ("forgives", 0.0, 3600.0),
            ("within", 0.0, 3600.0),
        ):
            if not low <= getattr(self, name) <= high:
                raise ParameterError(
                    f"{name} = {getattr(self, name):g} is out of range: it must be {low:g} to {high:g}"
                )
        if self.apart < self.near:
            raise ParameterError(f"apart = {self.apart:g} must not be less than near = {self.near:g}")
        if self.direction not in ("", IN, OUT):
            raise ParameterError(f"direction = {self.direction!r} must be in or out, or left out for both")
        if self.on == "crosses" and not self.line:
            raise ParameterError("on = 'crosses' needs a line: its name, or '*' for each")
        if self.on in PLACES and not self.zone:
            raise ParameterError(f"on = '{self.on}' needs a zone: its name, or '*' for each")
        if self.line and self.on != "crosses":
            raise ParameterError("line goes with on = 'crosses'")
        if self.partner and self.on not in (*PAIRS, *THINGS):
            raise ParameterError(f"with goes with on = {', '.join(repr(one) for one in (*PAIRS, *THINGS))}")
        if self.count is not None and self.on != "while":
            raise ParameterError("count goes with on = 'while'")


@dataclass(frozen=True)
class Rules:
    """What a place's scenarios are, what its targets may be, and its lines."""

    scenarios: tuple[Scenario, ...] = ()
    kinds: Mapping[str, Kind] = field(default_factory=lambda: USUAL)
    lines: tuple[Line, ...] = ()

    def __post_init__(self) -> None:
        """Refuse names that nothing has."""
        known = [one.name for one in self.scenarios]
        for one in self.scenarios:
            if known.count(one.name) > 1:
                raise ParameterError(f"two scenarios are called {one.name!r}; change one name")
            if one.after and one.after not in known:
                raise ParameterError(f"{one.name}: {unknown_name('scenario (after)', one.after, known)}")
            for kind in (*one.who, *one.partner):
                if kind not in self.kinds:
                    raise ParameterError(f"{one.name}: {unknown_name('class', kind, self.kinds)}")
            names = [line.name for line in self.lines]
            for line in one.line:
                if line not in (ANY, *names):
                    raise ParameterError(f"{one.name}: {unknown_name('line', line, names)}")

    def outside(self, width: int, height: int) -> tuple[str, ...]:
        """Return in words what points of lines lie outside a picture of so many pixels, one of each line."""
        told = []
        for line in self.lines:
            out = [(x, y) for x, y in line.points if not (0 <= x <= width and 0 <= y <= height)]
            if out:
                x, y = out[0]
                told.append(
                    f"line {line.name}: its point {x:g},{y:g} lies outside the picture of {width}x{height}"
                )
        return tuple(told)

    def check_zones(self, zones: tuple[str, ...]) -> None:
        """Refuse zones that a place has not.

        Raises
        ------
        ParameterError
            Naming the scenario and the zone.
        """
        for one in self.scenarios:
            for zone in (*one.zone, *one.outside):
                if zone not in (ANY, *zones):
                    there = (
                        unknown_name("zone", zone, zones)
                        if zones
                        else f"there is no zone {zone!r}: no zones are given"
                    )
                    raise ParameterError(f"scenario {one.name}: {there} (zones are named with --zones)")

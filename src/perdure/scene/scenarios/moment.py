"""What scenarios ask of a frame: who is there, what each is believed to be, and where."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from perdure.scene.beliefs import NOISE, Belief
from perdure.scene.lives import HEIGHT, METRES_X, METRES_Y, WIDTH, Life, X, Y
from perdure.scene.scenarios.rules import ANY, Scenario
from perdure.scene.zones import Zones

BODY = 1.7  # m: a height, where distances are known in metres
SURE = 0.5  # belief from which a target is taken for one of a class
Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Moment:
    """One frame, as far as it is known.

    Parameters
    ----------
    frame, time : int, float
    lives : id → Life
        Of all that are remembered, who is gone too.
    present : tuple of int
        Ids of those who have a row in this frame, in order.
    beliefs : id → Belief
    zones : Zones
    """

    frame: int
    time: float
    lives: Mapping[int, Life]
    present: tuple[int, ...]
    beliefs: Mapping[int, Belief]
    zones: Zones

    @cached_property
    def boxes(self) -> Float:
        """Boxes (N, 4) of those who are there."""
        if not self.present:
            return np.zeros((0, 4))
        last = np.array([self.lives[one].last for one in self.present])
        half, foot = last[:, WIDTH] / 2, last[:, Y]
        return np.column_stack([last[:, X] - half, foot - last[:, HEIGHT], last[:, X] + half, foot])

    @cached_property
    def within(self) -> NDArray[np.bool_]:
        """Who of those there is in which zone, (N, Z)."""
        return self.zones.within(self.boxes.astype(np.float32))

    @cached_property
    def distances(self) -> Float:
        """How far (N, N) those who are there are from each other, feet from feet, in heights; on the ground where known."""
        if not self.present:
            return np.zeros((0, 0))
        last = np.array([self.lives[one].last for one in self.present])
        heights = np.array([self.lives[one].size[1] for one in self.present])
        pixels = np.hypot(*(last[:, None, (X, Y)] - last[None, :, (X, Y)]).transpose(2, 0, 1))
        found = pixels / ((heights[:, None] + heights[None]) / 2)
        metres = last[:, (METRES_X, METRES_Y)]
        known = np.isfinite(metres).all(axis=1)
        both = known[:, None] & known[None]
        if both.any():
            far = np.hypot(*(metres[:, None] - metres[None]).transpose(2, 0, 1)) / BODY
            found = np.where(both, far, found)
        return np.asarray(found)

    def belief(self, identity: int, classes: tuple[str, ...]) -> float:
        """Return how far one is believed to be of some classes, or anything real; 0 where noise is likelier."""
        belief = self.beliefs.get(identity)
        if belief is None or belief.of.get(NOISE, 0.0) > SURE:
            return 0.0
        return max((belief.of.get(one, 0.0) for one in classes), default=belief.coefficient)

    def is_one(self, identity: int, classes: tuple[str, ...]) -> bool:
        """Return whether one is taken for one of some classes; for anything but noise, where none is named."""
        if not classes:
            belief = self.beliefs.get(identity)
            return belief is not None and belief.of.get(NOISE, 0.0) <= SURE
        return self.belief(identity, classes) >= SURE

    def zones_of(self, scenario: Scenario, place: int) -> tuple[str, ...]:
        """Return the zones of a scenario in which one of those there is; ('',) where it asks for none."""
        names = (
            [self.zones.name(int(number)) for number in np.flatnonzero(self.within[place])] if self.zones else []
        )
        if any(one in scenario.outside for one in names):
            return ()
        if not scenario.zone:
            return ("",)
        if ANY in scenario.zone:
            return tuple(names)
        return tuple(one for one in names if one in scenario.zone)

    def conditions(self, scenario: Scenario, identity: int) -> bool:
        """Return whether what a scenario asks of the target alone holds: class, pace, speed, age, roaming."""
        life = self.lives[identity]
        return (
            (scenario.age is None or scenario.age.hold(life.age))
            and (scenario.pace is None or scenario.pace.hold(life.pace()))
            and (scenario.speed is None or scenario.speed.hold(life.speed()))
            and (scenario.roams is None or scenario.roams.hold(life.roamed(scenario.over)))
            and self.is_one(identity, scenario.who)
        )


def between(one: Life, other: Life) -> float:
    """Return how far the box of one is from the middle of another, in heights of the first; 0 inside."""
    x, y, width, height = (float(value) for value in one.last[[X, Y, WIDTH, HEIGHT]])
    middle_x, middle_y = float(other.last[X]), float(other.last[Y] - other.last[HEIGHT] / 2)
    aside = max(abs(middle_x - x) - width / 2, 0.0)
    over = max(y - height - middle_y, middle_y - y, 0.0)
    return math.hypot(aside, over) / max(height, 1.0)

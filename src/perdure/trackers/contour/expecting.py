"""What an object should be like in a frame, by its past."""

from __future__ import annotations

from typing import NamedTuple

from perdure.trackers.contour import observer, recalling
from perdure.trackers.contour.observer import Float
from perdure.trackers.contour.rules import AGO, RESTLESS, WHOLE, Rules
from perdure.trackers.contour.targets import Target


class Expected(NamedTuple):
    """What an object should be like in a frame, by its past."""

    shape: Float  # μ
    pose: Float  # (3, 3)
    recalled: int  # how old it was when it had that shape; -1: now


def expectation(by: Rules, target: Target) -> Expected | None:
    """Return which shape an object should have, and where it should be, by what is known of its past."""
    past = target.past
    if not by.automatic or len(past) < AGO or target.restless < RESTLESS:
        return None
    seen = target.visible >= WHOLE
    before = target.recalled
    if seen:
        again = recalling.recalled(past)
        before = -1 if again is None else past[again].age
    age = -1 if before < 0 else recalling.following(past, before)
    now = recalling.nearest(past, age) if age >= 0 else len(past) - 1
    shape = recalling.drawn(past[now]) if age >= 0 else target.state.shape
    pose = observer.pose_of(target.state, by.group).copy()
    if not by.own_motion:
        place = recalling.place(past, target.age + 1, age, by.degree)
    else:
        place = pose[:2, 2] + by.motion(target.state.velocities)[:2] - target.drift
    pose[:2, 2] = place + (0.0 if seen else target.drift)
    return Expected(shape, pose, age)

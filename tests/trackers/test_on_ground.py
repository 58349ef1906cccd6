"""Association on the ground plane, in the trackers that have a use for it; without it they are as they were."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from perdure import states
from perdure.fold import settle, track
from perdure.scene.ground import of_camera
from perdure.scene.lens import Lens
from perdure.trackers import TRACKERS
from perdure.types import Frame, Regions, Scene

SIZE = (1280, 720)
GROUND = of_camera(Lens(np.array([900.0, 900]), np.array([640.0, 360]), np.zeros(5)), 2.0, 0.1, 0.0, SIZE)
KNOWN, UNKNOWN = Scene(*SIZE, 10.0, ground=GROUND), Scene(*SIZE, 10.0)
ON_GROUND = ["compound", "overlap"]


def box(x, y):
    foot, head = GROUND.seen([[x, y]])[0], GROUND.seen([[x, y]], 1.7)[0]
    tall = foot[1] - head[1]
    return [foot[0] - tall / 6, head[1], foot[0] + tall / 6, foot[1]]


def swap():
    """She who stands in front is not seen any more; a moment later somebody is, 4 m behind her.

    frame   0 … 9    10 … 12   13 … 29
    in front   A
    behind                        B
    """
    for k in range(30):
        boxes = [box(0, 6)] if k < 10 else [box(0.2, 10)] if k >= 13 else []
        yield Frame(k, k / 10), Regions.of(np.array(boxes, np.float32).reshape(-1, 4))


def ids(name, scene, **parameters):
    tracks = settle(step.report for step in track(swap(), TRACKERS[name](**parameters), scene)).counted()
    return [set(tracks.ids[tracks.frames < 10].tolist()), set(tracks.ids[tracks.frames > 20].tolist())]


@pytest.mark.parametrize("name", ON_GROUND)
def test_somebody_far_behind_is_not_who_was_in_front_where_the_ground_is_known(name):
    assert ids(name, UNKNOWN) == [{1}, {1}]  # their boxes overlap by half
    before, after = ids(name, KNOWN)
    assert before == {1}
    assert after == {2}


@pytest.mark.parametrize("name", ON_GROUND)
def test_switched_off_the_ground_changes_nothing(name):
    assert ids(name, KNOWN, on_ground=False) == [{1}, {1}]
    plain, off = (
        settle(step.report for step in track(swap(), tracker, scene))
        for tracker, scene in ((TRACKERS[name](), UNKNOWN), (TRACKERS[name](on_ground=False), KNOWN))
    )
    assert plain.equals(off)


@pytest.mark.parametrize("name", ON_GROUND)
def test_a_state_with_a_ground_is_saved_and_goes_on_the_same(name):
    tracker, frames = TRACKERS[name](), list(swap())
    bent = replace(GROUND, lens=Lens(np.array([900.0, 900]), np.array([640.0, 360]), np.full(5, 0.001)))
    state = tracker.start(Scene(*SIZE, 10.0, ground=bent))
    for frame, regions in frames[:15]:
        state, _ = tracker.step(state, frame, regions)
    again = states.load(states.save(state), type(state))
    for frame, regions in frames[15:]:
        state, one = tracker.step(state, frame, regions)
        again, other = tracker.step(again, frame, regions)
        assert one.rows.equals(other.rows)

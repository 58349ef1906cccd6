"""Where a hidden object can be: not where nothing hides it, and at the speed that what is seen of it has."""

from dataclasses import replace

import numpy as np

from perdure.trackers.contour import Contour
from perdure.trackers.contour.hiding import covering, straying_of
from perdure.trackers.contour.targets import Target
from perdure.types import Frame, Mask, Regions, Scene

HEIGHT, WIDTH = 40, 60
Y, X = np.mgrid[:HEIGHT, :WIDTH]


def disc(x: int) -> np.ndarray:
    """Signed distances (h, w) of a disc."""
    return np.hypot(X - x, Y - 20) - 8


def found() -> Target:
    """Somebody marked in a picture."""
    inside = disc(30) < 0
    image = np.where(inside[..., None], 200, 40).astype(np.uint8) + np.zeros((1, 1, 3), np.uint8)
    mask = Mask.of_image(inside)
    regions = Regions.of([mask.box], masks=[mask], data={"mark": np.array([1])})
    tracker = Contour()
    state, _ = tracker.step(tracker.start(Scene(WIDTH, HEIGHT, 25.0)), Frame(0, 0.0, image), regions)
    return state.targets[0]


def test_who_is_not_seen_where_nothing_stands_is_behind_what_does():
    bare = X >= 33  # the place is seen there, and not the object
    pull = np.where(bare, 0.1, 0.0).astype(np.float32)
    somebody_was_there, nobody_was = np.ones_like(bare), np.zeros_like(bare)
    x, y = covering(disc(30), pull, 8, 8, somebody_was_there)
    assert -6 <= x <= -3  # it ends where the bare place begins
    assert y == 0
    assert abs(covering(disc(30), pull, 8, 8, nobody_was)[0]) <= 1  # what stands there may hide it


def test_what_is_seen_of_one_who_slows_down_tells_how_fast_she_goes_on():
    target = replace(found(), visible=0.4)
    expected, true = 0.0, 0.0
    for _ in range(30):
        true -= 2.0  # px/frame, slower than on her path
        drift, straying = straying_of(target, np.array([true - expected, 0.0]), 1.0)
        target = replace(target, drift=drift, straying=straying)
        expected = drift[0]
    np.testing.assert_allclose(straying, (-2.0, 0.0), atol=0.1)
    for _ in range(10):  # hidden
        true -= 2.0
        drift, straying = straying_of(target, np.zeros(2), 0.0)
        target = replace(target, drift=drift, straying=straying)
    assert abs(drift[0] - true) < 4


def test_a_path_is_believed_anew_by_who_was_seen_whole():
    target = replace(found(), visible=1.0, drift=np.full(2, 9.0), straying=np.full(2, 3.0))
    drift, straying = straying_of(target, np.zeros(2), 1.0)
    assert not drift.any()
    assert not straying.any()


def test_who_is_not_seen_is_held_where_she_can_be_at_the_speed_that_she_had():
    target = replace(found(), visible=0.0, drift=np.zeros(2), straying=np.array([-1.0, 0.0]))
    drift, straying = straying_of(target, np.array([-5.0, 0.0]), 0.0)
    assert drift[0] < -1  # farther off her path than her speed alone would have her
    np.testing.assert_array_equal(straying, target.straying)

"""Who can have got where on the ground."""

from __future__ import annotations

import numpy as np

from perdure.scene.ground import of_camera, of_homography
from perdure.scene.lens import Lens
from perdure.scene.reach import within_reach

SIZE = (1280, 720)
GROUND = of_camera(Lens(np.array([900.0, 900]), np.array([640.0, 360]), np.zeros(5)), 2.0, 0.1, 0.0, SIZE)


def person(x, y, tall=1.7):
    """The box of somebody on the ground."""
    foot, head = GROUND.seen([[x, y]])[0], GROUND.seen([[x, y]], tall)[0]
    pixels = foot[1] - head[1]
    return np.array([[foot[0] - pixels / 6, head[1], foot[0] + pixels / 6, foot[1]]], np.float32)


def possible(one, other, elapsed=0.1, wander=1.0, ground=GROUND):
    return bool(within_reach(ground, one, np.array([elapsed]), other, wander)[0])


def test_who_stands_far_behind_is_another_though_the_boxes_overlap():
    front, behind = person(0, 6), person(0.3, 10)
    assert possible(front, person(0.2, 6.2))
    assert not possible(front, behind)


def test_with_time_one_may_get_there():
    front, behind = person(0, 6), person(0.3, 10)
    assert [possible(front, behind, elapsed) for elapsed in (0.1, 0.5, 2.0)] == [False, False, True]
    assert not possible(front, behind, 2.0, wander=0.1)


def test_far_away_where_a_pixel_is_metres_nothing_is_ruled_out():
    assert possible(person(0, 40), person(0.3, 44))


def test_who_is_twice_as_high_is_another():
    assert not possible(person(0, 6, tall=1.7), person(0, 6, tall=0.7))
    assert possible(person(0, 6, tall=1.7), person(0, 6, tall=1.2))


def test_what_has_no_place_is_not_compared():
    sky = np.array([[600, 0, 640, 90]], np.float32)
    assert possible(sky, person(0, 6))
    assert possible(person(0, 6), sky)
    assert within_reach(GROUND, sky[:0], np.zeros(0), sky[:0], 1.0).shape == (0,)


def test_without_verticals_only_places_are_compared():
    flat = of_homography([[0.01, 0, 0], [0, -0.01, 0], [0, 0, 1]], SIZE)
    one, half = np.array([[100, 100, 140, 300]], np.float32), np.array([[100, 200, 140, 300]], np.float32)
    assert possible(one, half, ground=flat)
    assert not possible(one, half + 200, ground=flat)

"""The ground plane: pixels to metres and back, exact cameras as oracles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perdure.scene.ground import Unusable, of_camera, of_homography
from perdure.scene.lens import Lens

SIZE = (1280, 720)
BENT = np.array([-0.2, 0.05, 0.001, -0.002, 0.01])


def lens(focal: float = 1000.0, bend=(0, 0, 0, 0, 0)) -> Lens:
    return Lens(np.array([focal, focal]), np.array([640.0, 360.0]), np.array(bend, float))


@settings(max_examples=40)
@given(
    st.floats(500, 3000),
    st.floats(1, 30),
    st.floats(-0.1, 1.4),
    st.floats(-0.2, 0.2),
    st.booleans(),
    st.integers(0, 1000),
)
def test_a_point_goes_to_the_ground_and_back(focal, height, tilt, roll, bent, seed):
    ground = of_camera(lens(focal, BENT if bent else np.zeros(5)), height, tilt, roll, SIZE)
    points = np.random.default_rng(seed).uniform((0, 0), SIZE, (50, 2))
    places = ground.places(points)
    there = np.isfinite(places).all(axis=1)
    far = there & (np.abs(np.nan_to_num(places)).max(axis=1) > 1e5)  # nearly on the horizon: no digits left
    again = ground.seen(places)
    assert np.abs(again - points)[there & ~far].max(initial=0) < 1e-3


def test_a_camera_that_looks_ahead_sees_a_foot_where_the_rays_meet():
    ground = of_camera(lens(), 5.0, 0.0, 0.0, SIZE)
    # a row 100 px under the middle is 5 m / (100 / 1000) away
    assert ground.places([[640, 460], [740, 460]]) == pytest.approx(np.array([[0, 50.0], [5.0, 50.0]]))
    assert ground.horizon == pytest.approx([0, 1, -360])


def test_points_above_the_horizon_have_no_place_and_no_exception():
    ground = of_camera(lens(), 5.0, 0.1, 0.02, SIZE)
    row = 360 - 1000 * np.tan(0.1)
    points = [[640, row - 1], [640, -1e9], [640, row + 1], [np.nan, 3], [np.inf, 3]]
    places = ground.places(points)
    assert np.isfinite(places).all(axis=1).tolist() == [False, False, True, False, False]
    assert np.isnan(ground.spread(points)[0]).all()
    assert ground.places(np.zeros((0, 2))).shape == (0, 2)
    assert ground.heights(np.zeros((0, 4))).shape == (0,)


def test_straight_down_there_is_no_horizon():
    ground = of_camera(lens(), 10.0, np.pi / 2, 0.0, SIZE)
    assert ground.horizon.tolist() == [0, 0, 1]
    assert ground.places([[640, 360], [740, 360]]) == pytest.approx(np.array([[0, 0], [1.0, 0]]), abs=1e-9)


@pytest.mark.parametrize("roll", [0.0, 0.1, -0.1])
def test_heights_of_upright_sticks_are_right_wherever_they_stand(roll):
    ground = of_camera(lens(), 6.0, 0.4, roll, SIZE)
    places = np.array([[x, y] for x in (-3, 0, 3) for y in (8, 15, 30)], float)
    foot = ground.seen(places)
    for height in (0.5, 1.7, 3.0):
        head = ground.seen(places, height)
        # a stick leans in the picture away from its middle: its box is asked about the row of the head
        boxes = np.c_[foot[:, 0] - 9, head[:, 1], foot[:, 0] + 9, foot[:, 1]]
        assert ground.heights(boxes) == pytest.approx(np.full(9, height), rel=1e-9)


def test_the_covariance_is_the_noise_through_the_slopes():
    for bend in (np.zeros(5), BENT):
        ground = of_camera(lens(bend=bend), 5.0, 0.3, 0.05, SIZE)
        point = np.array([[500.0, 600.0]])
        off = (np.array([1e-3, 0]), np.array([0, 1e-3]))
        slopes = np.stack([(ground.places(point + d) - ground.places(point - d))[0] / 2e-3 for d in off], axis=1)
        assert ground.spread(point, 2.0)[0] == pytest.approx(4 * slopes @ slopes.T, rel=1e-5)
        wider = slopes @ np.diag([1.0, 9.0]) @ slopes.T
        assert ground.spread(point, [[1.0, 3.0]])[0] == pytest.approx(wider, rel=1e-5)


def test_the_covariance_of_the_camera_moves_places_as_much_as_the_camera_moved():
    known = np.diag([0.02, 0.004, 0.003, 0.03]) ** 2
    ground = of_camera(lens(), 5.0, 0.3, 0.05, SIZE, covariance=known)
    point, generator = np.array([[500.0, 600.0]]), np.random.default_rng(1)
    drawn = []
    for focal, tilt, roll, height in generator.multivariate_normal(np.zeros(4), known, 4000):
        other = of_camera(lens(1000 * np.exp(focal)), 5.0 * np.exp(height), 0.3 + tilt, 0.05 + roll, SIZE)
        drawn.append(other.places(point)[0])
    assert np.cov(np.array(drawn).T) == pytest.approx(ground.spread(point, 0.0)[0], rel=0.15, abs=1e-4)


@pytest.mark.parametrize("factor", [1.0, -3.0, 1e-6])
def test_a_homography_says_the_same_whatever_its_factor_and_sign(factor):
    ground = of_camera(lens(), 5.0, 0.3, 0.05, SIZE)
    other = of_homography(factor * ground.homography, SIZE)
    points = [[100, 500], [900, 650], [640, 10]]
    assert other.places(points) == pytest.approx(ground.places(points), nan_ok=True)
    assert other.has_heights
    boxes = [[600, 300, 640, 500], [100, 400, 140, 600]]
    assert other.heights(boxes) == pytest.approx(ground.heights(boxes))


def test_a_homography_from_above_gives_no_heights():
    ground = of_homography([[0.01, 0, 0], [0, -0.01, 0], [0, 0, 1]], SIZE)
    assert not ground.has_heights
    assert np.isnan(ground.heights([[0, 0, 9, 9]])).all()
    assert ground.places([[100, 100]]) == pytest.approx(np.array([[1.0, -1.0]]))


def test_matrices_that_no_camera_has_are_refused_with_the_remedy():
    with pytest.raises(Unusable, match=r"singular.*not on one line"):
        of_homography([[1, 2, 3], [2, 4, 6], [0, 0, 1]], SIZE)
    with pytest.raises(Unusable, match="finite"):
        of_homography([[1, 2, 3], [2, np.nan, 6], [0, 0, 1]], SIZE)
    with pytest.raises(Unusable, match="horizon"):
        of_homography([[1, 0, 0], [0, 1, 0], [0, 1, -720]], SIZE)
    with pytest.raises(Unusable, match="above 0"):
        of_camera(lens(), 0.0, 0.3, 0.0, SIZE)

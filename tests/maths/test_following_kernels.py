"""Kernels that follow boxes and extend paths, against their twins."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from perdure.maths.kernels.follow import follow, follow_twin
from perdure.maths.kernels.paths import extend, extend_twin, motion, motion_twin
from perdure.maths.polyline import Polylines

LEFT, TOP, RIGHT, BOTTOM = 1, 2, 4, 8
PICTURE = np.float32([640, 480])


def followed(expected, seen, *, entering=False, pace=0.5, partial=0.2):
    one = [np.float32([expected]), np.float32([seen]), np.array([entering]), np.float32([pace]), PICTURE, partial]
    points, hidden, size = follow(*one)
    return points[0], int(hidden[0]), size[0]


@given(st.integers(0, 2**32 - 1), st.integers(0, 12))
@settings(max_examples=60, deadline=None)
def test_following_is_what_whole_columns_say(seed: int, count: int):
    rng = np.random.default_rng(seed)
    corner, size = rng.uniform(-20, 600, (count, 2)), rng.uniform(0, 90, (count, 2))
    expected = np.hstack([corner, corner + size]).astype(np.float32)
    seen = expected + rng.normal(0, rng.choice([1, 8, 30]), (count, 4)).astype(np.float32)
    seen[:, 2:] = np.maximum(seen[:, 2:], seen[:, :2])
    given_ = (expected, seen, rng.random(count) < 0.3, rng.random(count).astype(np.float32), PICTURE, 0.2)
    points, hidden, mean = follow(*given_)
    points_twin, hidden_twin, mean_twin = follow_twin(*given_)
    assert np.allclose(points, points_twin, atol=1e-3)
    assert hidden.tolist() == hidden_twin.tolist()
    assert np.allclose(mean, mean_twin, atol=1e-3)


@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(1, 25))
@settings(max_examples=60, deadline=None)
def test_paths_are_what_whole_columns_say(seed: int, count: int, steps: int):
    rng = np.random.default_rng(seed)
    ours, twins = (Polylines.starting(0.0, np.zeros((count, 2))) for _ in range(2))
    ours, twins = (Polylines(one.knots.copy(), one.last.copy(), one.sums.copy()) for one in (ours, twins))
    time = 0.0
    for _ in range(steps):
        time += float(rng.uniform(0.02, 0.4))
        rows = np.flatnonzero(rng.random(count) < 0.7)
        points, tolerance = rng.normal(0, 20, (len(rows), 2)), rng.uniform(0.5, 40, len(rows))
        extend(ours.knots, ours.last, ours.sums, rows, time, points, tolerance, 1.0)
        extend_twin(twins.knots, twins.last, twins.sums, rows, time, points, tolerance, 1.0)
    for name in ("knots", "last", "sums"):
        assert np.allclose(getattr(ours, name), getattr(twins, name))
    tolerance = rng.uniform(0.5, 40, count)
    mine = motion(ours.knots, ours.last, ours.sums, tolerance, 0.4, 0.5)
    assert np.allclose(mine, motion_twin(twins.knots, twins.last, twins.sums, tolerance, 0.4, 0.5))


def test_a_box_where_it_was_expected_hides_nothing_and_keeps_its_size():
    points, hidden, size = followed((100, 100, 140, 200), (100, 100, 140, 200))
    assert hidden == 0
    assert size.tolist() == [40, 100]
    assert points.tolist() == [[120, 150], [120, 100], [120, 200], [100, 150], [140, 150]]


def test_each_side_that_is_hidden_is_told_and_the_centre_stays_where_it_was():
    whole = (100, 100, 140, 200)
    for part, side in (
        ((120, 100, 140, 200), LEFT),
        ((100, 150, 140, 200), TOP),
        ((100, 100, 120, 200), RIGHT),
        ((100, 100, 140, 150), BOTTOM),
    ):
        points, hidden, size = followed(whole, part)
        assert hidden == side
        assert np.allclose(points[0], (120, 150))
        assert (size > (36, 90)).all(), "a half-hidden person does not shrink"


def test_a_box_that_narrows_on_both_sides_has_turned_and_is_not_hidden():
    _, hidden, size = followed((100, 100, 140, 200), (110, 100, 130, 200))
    assert hidden == 0
    assert size.tolist() == [30, 100]


def test_who_comes_into_view_is_as_large_as_what_is_seen():
    assert followed((0, 100, 10, 200), (0, 100, 25, 200))[2].tolist() == [25, 100], "at the border"
    assert followed((300, 100, 310, 200), (300, 100, 325, 200), entering=True)[2].tolist() == [25, 100]

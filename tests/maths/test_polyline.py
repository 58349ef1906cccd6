"""Paths as segments of constant speed: each fit against plain least squares over points that were all kept."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.polyline import KNOTS, Polylines, extend, misfit, motion, reliable, velocity

STEP = 0.1  # s
FOREVER = 1e9


def followed(*paths: np.ndarray, tolerance: float = 1.0, longest: float = FOREVER) -> Polylines:
    """The polylines of paths (T, 2) side by side, a point every STEP seconds."""
    lines, rows = Polylines.starting(0.0, [path[0] for path in paths]), np.arange(len(paths))
    for number in range(1, len(paths[0])):
        points = [path[number] for path in paths]
        lines = extend(lines, rows, number * STEP, points, np.full(len(paths), tolerance), longest)
    return lines


def straight(begin: tuple[float, float], speed: tuple[float, float], steps: int) -> np.ndarray:
    return np.array(begin) + STEP * np.arange(steps + 1)[:, None] * speed  # (steps + 1, 2)


def turning(after: int) -> np.ndarray:
    """Ten steps to the right at 10 px/s, then `after` steps down at 20 px/s.

    o───────►┐ (10, 0)
             ▼
    """
    return np.concatenate([straight((0, 0), (10, 0), 10), straight((10, 0), (0, 20), after)[1:]])


def same(one: Polylines, other: Polylines) -> bool:
    return all(np.array_equal(getattr(one, part.name), getattr(other, part.name)) for part in fields(Polylines))


def wandering(seed: int, steps: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 2, (steps + 1, 2)).cumsum(axis=0)


def test_one_who_walks_straight_at_constant_speed_is_one_segment_with_her_velocity():
    lines = followed(straight((3, 4), (12, -5), 40))
    assert (lines.knots == [0, 3, 4]).all()
    np.testing.assert_allclose(velocity(lines), [[12, -5]], atol=1e-9)
    np.testing.assert_allclose(misfit(lines), 0, atol=1e-5)


def test_a_turn_starts_a_new_segment_at_the_corner():
    lines = followed(turning(4))
    np.testing.assert_allclose(lines.knots[0, -2:], [[0, 0, 0], [1, 10, 0]], atol=1e-9)
    np.testing.assert_allclose(velocity(lines), [[0, 20]], atol=1e-9)


def test_a_bend_within_the_tolerance_starts_none():
    lines = followed(turning(4), tolerance=20.0)
    assert (lines.knots == 0).all()


def test_one_who_stops_starts_a_new_segment_that_stands():
    lines = followed(np.concatenate([straight((0, 0), (10, 0), 10), np.tile([10.0, 0.0], (20, 1))]))
    assert lines.knots[0, -1, 0] == pytest.approx(1.1)  # a point that lies a pixel behind may still be noise
    assert np.abs(velocity(lines)).max() < 0.6


def test_a_segment_ends_when_it_has_lasted_long_enough_though_it_fits():
    lines = followed(straight((0, 0), (10, 0), 25), longest=1.0)
    np.testing.assert_allclose(lines.knots[0, -3:, 0], [0, 1, 2])
    np.testing.assert_allclose(velocity(lines), [[10, 0]])


def test_the_next_place_is_foretold_from_the_last_segment_where_that_is_reliable():
    lines = followed(turning(4))
    assert reliable(lines, [1.0], shortest=0.4).all()
    np.testing.assert_allclose(motion(lines, [1.0], shortest=0.4, horizon=1.0), [[0, 20]], atol=1e-9)


def test_it_is_foretold_from_more_segments_where_the_last_has_not_lasted():
    lines = followed(turning(2))
    assert not reliable(lines, [1.0], shortest=0.4).any()
    whole = np.array([[10, 4]]) / 1.2  # from where she set out
    np.testing.assert_allclose(motion(lines, [1.0], shortest=0.4, horizon=0.5), whole)
    np.testing.assert_allclose(motion(lines, [1.0], shortest=0.4, horizon=9.0), whole)  # there is no more
    np.testing.assert_allclose(motion(lines, [1.0], shortest=0.4, horizon=0.1), [[0, 20]])  # from the corner alone


def test_it_is_foretold_from_the_way_made_where_the_points_lie_off_their_line():
    zigzag = straight((0, 0), (10, 0), 10) + np.array([[0, 0.8 * (-1) ** number] for number in range(11)])
    zigzag[0, 1] = 0
    lines = followed(zigzag, tolerance=3.0)
    assert reliable(lines, [3.0], shortest=0.5).all()
    assert not reliable(lines, [1.0], shortest=0.5).any()  # 0.8 is more than half of it
    np.testing.assert_allclose(motion(lines, [1.0], shortest=0.5, horizon=0.5), [[10, 0.8]])


def test_a_path_takes_the_same_room_however_long_it_is():
    def room(lines: Polylines) -> int:
        return sum(getattr(lines, part.name).nbytes for part in fields(Polylines))

    long = followed(wandering(3, 400), tolerance=0.5)
    assert room(long) == room(followed(wandering(3, 2)))
    assert long.knots.shape == (1, KNOTS, 3)
    assert (np.diff(long.knots[0, :, 0]) > 0).all()  # it turned often: the oldest are forgotten
    assert long.knots[0, 0, 0] > 0


@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_paths_do_not_see_each_other(seed, count):
    paths = [wandering(seed + number, 12) for number in range(count)]
    together = followed(*paths, tolerance=2.0, longest=0.7)
    for number, path in enumerate(paths):
        assert same(together.take(np.array([number])), followed(path, tolerance=2.0, longest=0.7))


def test_a_path_without_a_new_point_stays_as_it_was():
    lines = followed(turning(3), straight((50, 50), (1, 1), 13))
    onward = extend(lines, np.array([1]), 1.4, [[51.4, 51.4]], np.array([1.0]), FOREVER)
    assert same(onward.take(np.array([0])), lines.take(np.array([0])))
    assert onward.last[1].tolist() == [1.4, 51.4, 51.4]


def test_a_path_that_goes_on_leaves_what_it_was_unchanged():
    before, again = followed(turning(0)), followed(turning(0))
    after = extend(before, np.array([0]), 1.1, [[10, 20]], np.array([1.0]), FOREVER)  # a new segment
    assert after.knots[0, -1, 0] == pytest.approx(1.0)
    assert same(before, again)


def test_paths_are_joined_and_taken_by_row_or_by_mask():
    one, other = followed(turning(3)), followed(wandering(5, 9), wandering(6, 9))
    joined = one.join(other)
    assert len(joined) == 3
    assert same(joined.take(np.array([True, False, False])), one)
    assert same(joined.take(np.array([1, 2])), other)


def test_no_paths_are_no_numbers():
    none = Polylines.starting(2.0, np.zeros((0, 2)))
    none = extend(none, np.zeros(0, np.intp), 3.0, np.zeros((0, 2)), np.zeros(0), FOREVER)
    assert len(none) == 0
    assert velocity(none).shape == motion(none, np.zeros(0), 0.4, 1.0).shape == (0, 2)
    assert misfit(none).shape == reliable(none, np.zeros(0), 0.4).shape == (0,)


def test_of_a_single_point_nothing_is_known_but_that_it_is_there():
    lines = Polylines.starting(2.0, [[7, 8]])
    assert velocity(lines).tolist() == motion(lines, [1.0], 0.0, 1.0).tolist() == [[0, 0]]
    assert misfit(lines).tolist() == [0]
    assert not reliable(lines, [1.0], 0.0).any()


@given(st.integers(0, 2**32 - 1), st.integers(1, 20))
def test_speed_and_misfit_are_those_of_least_squares_through_the_first_point(seed, steps):
    path = wandering(seed, steps)
    lines = followed(path, tolerance=np.inf)
    times, moved = STEP * np.arange(1, steps + 1), path[1:] - path[0]
    speed = np.linalg.lstsq(times[:, None], moved, rcond=None)[0]  # (1, 2)
    np.testing.assert_allclose(velocity(lines), speed, atol=1e-8)
    off = np.hypot(*(moved - times[:, None] * speed).T)
    np.testing.assert_allclose(misfit(lines), [np.sqrt((off**2).mean())], atol=1e-5)


def segmented(path: np.ndarray, tolerance: float, longest: float) -> tuple[np.ndarray, np.ndarray]:
    """The knots (M, 3) and the last segment's speed (2,), from all points of the last segment each time."""
    knots, mine = [np.array([0, *path[0]])], []

    def slope() -> np.ndarray:
        away = np.array(mine).reshape(-1, 3) - knots[-1]
        return np.linalg.lstsq(away[:, :1], away[:, 1:], rcond=None)[0][0] if mine else np.zeros(2)

    for number, place in enumerate(path[1:], 1):
        now = np.array([number * STEP, *place])
        foretold = knots[-1][1:] + slope() * (now[0] - knots[-1][0])
        too_far = np.hypot(*(place - foretold)) > tolerance
        if len(mine) > 1 and (too_far or now[0] - knots[-1][0] > longest):
            end = mine[-1][0]
            knots.append(np.array([end, *(knots[-1][1:] + slope() * (end - knots[-1][0]))]))
            mine = []
        mine.append(now)
    return np.array(knots), slope()


@given(
    st.integers(0, 2**32 - 1), st.integers(0, 25), st.sampled_from([0.5, 3.0]), st.sampled_from([0.55, FOREVER])
)
def test_segments_are_those_found_by_keeping_every_point(seed, steps, tolerance, longest):
    path = wandering(seed, steps)
    lines = followed(path, tolerance=tolerance, longest=longest)
    knots, speed = segmented(path, tolerance, longest)
    first_repeated = np.concatenate([np.repeat(knots[:1], KNOTS, axis=0), knots[1:]])
    np.testing.assert_allclose(lines.knots[0], first_repeated[-KNOTS:], atol=1e-7)
    np.testing.assert_allclose(velocity(lines)[0], speed, atol=1e-7)

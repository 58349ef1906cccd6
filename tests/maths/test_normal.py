"""Sizes along the picture, learnt as one goes: against plain least squares, with noise, strangers and drift."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.normal import NormalLine, expect, observe

FAR, NEAR = 100.0, 500.0  # rows of the picture: people are small far off and large near by
NOISE = 2.0


def heights(rows: np.ndarray) -> np.ndarray:
    return 20.0 + 0.2 * rows


def crowd(seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows (N,) and heights (N,) of people who stand there."""
    rng = np.random.default_rng(seed)
    rows = rng.uniform(FAR, NEAR, count)
    return rows, heights(rows) + rng.normal(0, NOISE, count)


def learnt(rows: np.ndarray, numbers: np.ndarray, *, keep: float = 1.0, stiffness: float = 0.0) -> NormalLine:
    """What is known after people passed one by one."""
    line = NormalLine.unknown(1)
    for row, number in zip(rows, numbers, strict=True):
        line = observe(line, [row], [[number]], [1.0], keep=keep, stiffness=stiffness)
    return line


def test_the_line_is_found_in_noise_and_so_is_the_noise():
    mean, deviation = expect(learnt(*crowd(1, 600), keep=0.99), [FAR, NEAR])  # how wrong it first was is forgotten
    np.testing.assert_allclose(mean[:, 0], [40, 120], atol=1.0)
    assert 0.6 * NOISE < deviation[0] < 1.1 * NOISE


def test_one_stranger_in_ten_bends_it_little():
    rows, found = crowd(2, 400)
    strangers = np.random.default_rng(3).random(len(rows)) < 0.1
    found[strangers] += 60.0  # cars
    found[:20] = np.where(strangers[:20], heights(rows[:20]), found[:20])  # people came first
    mean, deviation = expect(learnt(rows, found), [FAR, NEAR])
    np.testing.assert_allclose(mean[:, 0], [40, 120], atol=2.0)
    assert deviation[0] < 2 * NOISE
    slope, level = np.polyfit(rows, found, 1)
    assert np.abs(level + slope * np.array([FAR, NEAR]) - [40, 120]).max() > 4.0  # least squares is bent
    assert np.std(found - level - slope * rows) > 6 * NOISE


def test_what_lies_off_by_some_deviations_counts_less():
    line = NormalLine(4.0, 0.0, 0.0, np.array([40.0]), np.zeros(1), np.array([4.0]))  # 10 ± 1
    assert expect(line, [0.0])[1] == [1.0]
    for number, worth in ((10.0, 1.0), (12.0, 1 / 2), (14.0, 1 / 5), (4.0, 1 / 10)):
        assert observe(line, [0.0], [[number]], [1.0]).weight == pytest.approx(4 + worth)


def test_one_strange_of_two_numbers_makes_a_stranger():
    line = NormalLine(4.0, 0.0, 0.0, np.array([40.0, 80.0]), np.zeros(2), np.array([4.0, 4.0]))  # 10 ± 1, 20 ± 1
    assert observe(line, [0.0], [[14.0, 20.0]], [1.0]).weight == pytest.approx(4 + 1 / 3)  # the mean square is 8


def test_who_is_strange_is_judged_by_the_line_as_stiffness_holds_it():
    line = NormalLine(4.0, 0.0, 4.0, np.array([40.0]), np.array([4.0]), np.array([4.0]))  # 10 + x, ± 1
    assert observe(line, [10.0], [[10.0]], [1.0]).weight == pytest.approx(4 + 1 / 26)
    assert observe(line, [10.0], [[10.0]], [1.0], stiffness=1e9).weight == pytest.approx(4 + 1)


def test_what_is_forgotten_follows_a_drift_and_what_is_kept_does_not():
    rng = np.random.default_rng(4)
    rows = rng.uniform(FAR, NEAR, 900)
    zoomed = heights(rows) * np.linspace(1.0, 1.5, 900) + rng.normal(0, NOISE, 900)
    now = heights(np.array([FAR, NEAR])) * 1.5
    forgetful = expect(learnt(rows, zoomed, keep=0.98), [FAR, NEAR])[0][:, 0]
    faithful = expect(learnt(rows, zoomed), [FAR, NEAR])[0][:, 0]
    assert (np.abs(forgetful / now - 1) < 0.05).all()
    assert (np.abs(faithful / now - 1) > 0.1).all()


def test_before_anything_was_seen_all_is_finite():
    mean, deviation = expect(NormalLine.unknown(2), [0.0, NEAR])
    assert mean.tolist() == [[0, 0], [0, 0]]
    assert deviation.tolist() == [0, 0]


@pytest.mark.parametrize("times", [1, 2, 5])
def test_of_one_seen_again_and_again_the_mean_is_her_and_all_is_finite(times):
    line = learnt(np.full(times, 300.0), np.full(times, 80.0))
    mean, deviation = expect(line, [FAR, 300.0])
    np.testing.assert_allclose(mean[:, 0], 80)
    assert deviation.tolist() == [0]
    after = expect(observe(line, [301.0], [[90.0]], [1.0]), [FAR])
    assert np.isfinite(after[0]).all()
    assert np.isfinite(after[1]).all()


def test_it_is_level_while_all_stood_in_about_one_row():
    rng = np.random.default_rng(5)
    rows, found = rng.normal(300, 1.0, 40), rng.normal(80, NOISE, 40)
    held, free = (learnt(rows, found, stiffness=stiffness) for stiffness in (2000.0, 0.0))
    assert expect(held, [FAR, NEAR], stiffness=2000.0)[0] == pytest.approx(80, abs=3.0)
    assert np.abs(expect(free, [FAR, NEAR])[0] - 80).max() > 20  # one who is nearly as far as she looks


def test_stiffness_gives_way_once_they_stood_in_many_rows():
    line = learnt(*crowd(6, 400), stiffness=2000.0)
    np.testing.assert_allclose(expect(line, [FAR, NEAR], stiffness=2000.0)[0][:, 0], [40, 120], atol=1.0)


def test_nobody_seen_changes_nothing_and_time_only_the_weight():
    line = learnt(*crowd(7, 30))
    none = np.zeros((0, 1))
    assert expect(observe(line, [], none, []), [FAR]) == expect(line, [FAR])
    later = observe(line, [], none, [], keep=0.5)
    assert later.weight == line.weight / 2
    for after, before in zip(expect(later, [FAR]), expect(line, [FAR]), strict=True):
        np.testing.assert_allclose(after, before)
    assert observe(NormalLine.unknown(1), [], none, []).weight == 0


def test_one_without_weight_changes_nothing():
    line = learnt(*crowd(8, 30))
    assert expect(observe(line, [FAR], [[999.0]], [0.0]), [NEAR]) == expect(line, [NEAR])


@given(st.integers(0, 2**32 - 1), st.integers(2, 9), st.sampled_from([0.0, 3.0]))
def test_those_first_seen_give_their_weighted_least_squares_line(seed, count, stiffness):
    rng = np.random.default_rng(seed)
    rows, numbers, weights = (
        rng.permutation(10)[:count] + 0.5,
        rng.normal(0, 5, (count, 2)),
        rng.uniform(0.5, 2, count),
    )
    line = observe(NormalLine.unknown(2), rows, numbers, weights)
    assert line.weight == pytest.approx(weights.sum())
    # Least Σ w (y - a - b (x - c))² + stiffness b², the last as one equation more.
    from_centre = rows - weights @ rows / weights.sum()
    equations = np.column_stack([np.ones(count), from_centre]) * np.sqrt(weights)[:, None]
    equations = np.concatenate([equations, [[0.0, np.sqrt(stiffness)]]])
    right = np.concatenate([numbers * np.sqrt(weights)[:, None], np.zeros((1, 2))])
    level, slope = np.linalg.lstsq(equations, right, rcond=None)[0]
    np.testing.assert_allclose(expect(line, rows, stiffness)[0], level + from_centre[:, None] * slope, atol=1e-6)

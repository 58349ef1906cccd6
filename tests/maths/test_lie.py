"""The groups of motions: against SciPy's matrix functions, finite differences, and the laws of groups."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

from perdure.errors import ParameterError
from perdure.maths.lie import (
    AFFINE,
    GROUPS,
    SE2,
    SIMILARITY,
    Group,
    act,
    compose,
    determinant,
    identity,
    inverse,
)

every_group = pytest.mark.parametrize("group", GROUPS.values(), ids=GROUPS)
seeds = st.integers(0, 2**32 - 1)


def velocities(group: Group, seed: int, *shape: int) -> np.ndarray:
    """Shifts of some 20 px, turns within (-π, π), scales of e^±1 and stretches that reverse no direction."""
    rng = np.random.default_rng(seed)
    largest = np.array([20, 20, 3, 1, 0.8, 0.8])[: group.dimension]
    return rng.uniform(-largest, largest, (*shape, group.dimension)) * rng.choice([1e-9, 1e-4, 1, 1, 1])


@every_group
@given(seeds)
def test_exp_and_log_are_those_of_matrices(group: Group, seed: int):
    velocity = velocities(group, seed)
    motion = group.exp(velocity)
    np.testing.assert_allclose(motion, linalg.expm(group.hat(velocity)), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(group.hat(group.log(motion)), linalg.logm(motion), atol=1e-7)


@every_group
@given(seeds)
def test_log_undoes_exp_and_exp_log(group: Group, seed: int):
    velocity = velocities(group, seed, 3, 2)
    motion = group.exp(velocity)
    np.testing.assert_allclose(group.exp(group.log(motion)), motion, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(group.log(motion), velocity, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(group.vee(group.hat(velocity)), velocity, rtol=1e-12, atol=1e-14)


@every_group
@given(seeds)
def test_motions_are_a_group_that_acts_on_points(group: Group, seed: int):
    one, two, three = group.exp(velocities(group, seed, 3))
    points = np.random.default_rng(seed).uniform(-50, 50, (5, 2))
    np.testing.assert_allclose(compose(compose(one, two), three), compose(one, compose(two, three)), atol=1e-10)
    np.testing.assert_allclose(compose(one, inverse(one)), identity(), atol=1e-12)
    np.testing.assert_allclose(compose(inverse(one), one), identity(), atol=1e-10)
    np.testing.assert_allclose(act(compose(one, two), points), act(one, act(two, points)), atol=1e-9)
    np.testing.assert_allclose(determinant(compose(one, two)), determinant(one) * determinant(two), rtol=1e-12)
    if group is not AFFINE:  # of which some products reverse a direction
        group.log(compose(one, inverse(two), one, two))  # a motion of the group still, or it would be refused


@every_group
@given(seeds)
def test_the_adjoint_moves_velocities_to_where_the_motion_takes_them(group: Group, seed: int):
    one, other = velocities(group, seed, 2)
    motion = group.exp(one)
    moved = motion @ group.hat(other) @ inverse(motion)
    np.testing.assert_allclose(group.hat(group.adjoint(motion) @ other), moved, atol=1e-9)
    there = compose(motion, group.exp(other), inverse(motion))
    np.testing.assert_allclose(group.exp(group.adjoint(motion) @ other), there, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(group.adjoint(motion), linalg.expm(group.bracket(one)), rtol=1e-9, atol=1e-9)


@every_group
@given(seeds)
def test_jacobians_are_those_of_finite_differences(group: Group, seed: int):
    velocity = velocities(group, seed)
    points = np.random.default_rng(seed).uniform(-5, 5, (4, 2))
    steps = 1e-5 * np.eye(group.dimension)

    def slope(at: np.ndarray) -> np.ndarray:
        ways = [act(group.exp(at + step), points) - act(group.exp(at - step), points) for step in steps]
        return np.stack(ways, axis=-1) / 2e-5  # (4, 2, D)

    at_rest = slope(np.zeros(group.dimension))
    np.testing.assert_allclose(group.jacobian(points), at_rest, atol=1e-7)
    np.testing.assert_allclose(group.jacobian_at(velocity, points), slope(velocity), rtol=1e-6, atol=1e-6)


@every_group
@given(seeds)
def test_what_is_done_side_by_side_is_what_is_done_alone(group: Group, seed: int):
    many = velocities(group, seed, 2, 3)
    many[0, 0] *= 1e-3
    motions, points = group.exp(many), np.random.default_rng(seed).uniform(-5, 5, (2, 3, 4, 2))
    for place in np.ndindex(2, 3):
        np.testing.assert_array_equal(motions[place], group.exp(many[place]))
        np.testing.assert_allclose(inverse(motions)[place], inverse(motions[place]), rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(group.log(motions)[place], group.log(motions[place]), atol=1e-12)
        np.testing.assert_allclose(group.adjoint(motions)[place], group.adjoint(motions[place]), atol=1e-12)
        np.testing.assert_allclose(
            group.jacobian_at(many, points)[place], group.jacobian_at(many[place], points[place]), atol=1e-12
        )
    assert group.exp(np.zeros((0, group.dimension))).shape == (0, 3, 3)
    assert group.log(np.zeros((0, 3, 3))).shape == (0, group.dimension)


@given(seeds)
def test_a_smaller_group_lies_in_the_larger_ones(seed: int):
    velocity = velocities(SE2, seed)
    for larger in (SIMILARITY, AFFINE):
        wider = np.append(velocity, np.zeros(larger.dimension - 3))
        np.testing.assert_allclose(larger.exp(wider), SE2.exp(velocity), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(larger.log(SE2.exp(velocity)), wider, rtol=1e-9, atol=1e-9)


def test_a_quarter_turn_about_a_point_is_what_one_draws():
    """The velocity of a turn about (10, 0).

    . . o    (10, 0) stays, (12, 0) goes to (10, 2), y downwards
    """
    turn = SE2.exp([0, -10 * np.pi / 2, np.pi / 2])
    np.testing.assert_allclose(act(turn, [[10, 0], [12, 0]]), [[10, 0], [10, 2]], atol=1e-12)


@every_group
@pytest.mark.parametrize("size", [1e-300, 1e-160, 1e-17, 1e-9, 0.99e-8, 1.01e-8, 1e-7, 1e-4])
def test_motions_are_smooth_about_rest(group: Group, size: float):
    velocity = size * np.arange(1.0, group.dimension + 1)
    matrix = group.hat(velocity)
    second = np.eye(3) + matrix + matrix @ matrix / 2 + matrix @ matrix @ matrix / 6
    np.testing.assert_allclose(group.exp(velocity), second, rtol=1e-13, atol=10 * (6 * size) ** 4)
    back = group.log(group.exp(velocity))
    np.testing.assert_allclose(back, velocity, rtol=1e-9, atol=1e-15)
    assert not group.log(identity()).any()


@every_group
@pytest.mark.parametrize("short", [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("sign", [-1, 1])
def test_half_turns_have_a_logarithm(group: Group, short: float, sign: int):
    velocity = np.zeros(group.dimension)
    velocity[:3] = 3, -4, sign * (np.pi - short)
    motion = group.exp(velocity)
    back = group.log(motion)
    np.testing.assert_allclose(group.exp(back), motion, atol=1e-9)
    assert abs(back[2]) == pytest.approx(np.pi - short, abs=1e-9)


def test_a_turn_of_more_than_half_is_the_shorter_one_the_other_way():
    assert SE2.log(SE2.exp([0, 0, 2 * np.pi - 0.5]))[2] == pytest.approx(-0.5)


def test_an_affine_turn_that_nearly_reverses_all_directions_is_found_again():
    stretched = compose(np.diag([3.0, 1.0, 1.0]), AFFINE.exp([1, 2, 3.1, 0.2, 0, 0]), np.diag([1 / 3, 1.0, 1.0]))
    np.testing.assert_allclose(AFFINE.exp(AFFINE.log(stretched)), stretched, atol=1e-10)
    np.testing.assert_allclose(AFFINE.hat(AFFINE.log(stretched)), linalg.logm(stretched).real, atol=1e-8)


def test_a_long_road_of_small_steps_stays_in_the_group():
    for group in GROUPS.values():
        motion = identity()
        for step in range(1_000):
            motion = compose(group.exp(velocities(group, step) * 1e-3), motion)
        group.log(motion)


@pytest.mark.parametrize(
    ("group", "motion", "because"),
    [
        (SE2, np.diag([2.0, 2.0, 1.0]), "no rigid motion"),
        (SE2, np.diag([1.0, -1.0, 1.0]), "determinant is -1"),
        (SIMILARITY, np.diag([2.0, 1.0, 1.0]), "does not keep angles"),
        (SIMILARITY, np.diag([1.0, -1.0, 1.0]), "determinant is -1"),
        (AFFINE, np.diag([1.0, 0.0, 1.0]), "determinant is 0"),
        (AFFINE, np.diag([-1.0, -2.0, 1.0]), "no real logarithm"),
        (AFFINE, [[-1.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], "no real logarithm"),
        (AFFINE, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.1, 0.0, 1.0]], "last row"),
    ],
)
def test_what_has_no_logarithm_is_refused_with_the_reason(group: Group, motion: np.ndarray, because: str):
    with pytest.raises(ParameterError, match=because):
        group.log(motion)
    with pytest.raises(ParameterError, match=because):
        group.log(np.stack([np.eye(3), motion]))


def test_what_is_no_velocity_no_motion_or_no_point_is_refused():
    with pytest.raises(ParameterError, match=r"shape \(4,\); SE\(2\) has 3 coordinates: x, y, angle"):
        SE2.exp(np.zeros(4))
    with pytest.raises(ParameterError, match="velocity is not finite"):
        AFFINE.exp([0, 0, np.nan, 0, 0, 0])
    for group, velocity in ((SIMILARITY, [0, 0, 0, 1e4]), (AFFINE, [0, 0, 0, 1e4, 0, 0]), (AFFINE, [1e300] * 6)):
        with pytest.raises(ParameterError, match="the motion of this velocity is not finite"):
            group.exp(velocity)
    with pytest.raises(ParameterError, match=r"\(2, 3\); it must be"):
        act(np.eye(2, 3), [[0, 0]])
    with pytest.raises(ParameterError, match="points"):
        act(identity(), [[0, 0, 0]])
    with pytest.raises(ParameterError, match="determinant"):
        inverse(np.diag([0.0, 1.0, 1.0]))

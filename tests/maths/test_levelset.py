"""Level sets: discs and ellipses whose distances, motions and moments are known."""

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from perdure.errors import ParameterError
from perdure.maths import lie
from perdure.maths.levelset import (
    blend,
    carried,
    contour,
    curvature,
    energy,
    evolve,
    inside,
    length,
    moments,
    redistance,
    sample,
    signed_distance,
)

MIDDLE = 60.3, 59.8


def disc(radius: float, middle: tuple[float, float] = MIDDLE, size: tuple[int, int] = (120, 121)) -> np.ndarray:
    """Exact distances (H, W) of a disc about a point x, y."""
    y, x = np.indices(size)
    return np.hypot(x - middle[0], y - middle[1]) - radius


def ellipse(a: float, b: float, size: tuple[int, int] = (120, 121)) -> np.ndarray:
    """Something whose zero is an ellipse about MIDDLE, and which is no distance."""
    y, x = np.indices(size)
    return np.hypot((x - MIDDLE[0]) / a, (y - MIDDLE[1]) / b) - 1


def drawn(picture: str) -> np.ndarray:
    return np.array([[letter == "#" for letter in line] for line in picture.split()])


def off(phi: np.ndarray, radius: float, middle: tuple[float, float] = MIDDLE) -> np.ndarray:
    """By how much the vertices of phi's contour lie farther from the middle than they should."""
    vertices = np.concatenate(contour(phi))
    return np.hypot(*(vertices - middle).T) - radius


def enclosed(line: np.ndarray) -> float:
    """Area that a polyline goes around, with the clock as one sees it."""
    x, y = line.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


# Distances --------------------------------------------------------------------------------------------------


def test_a_mask_and_the_rest_have_the_same_distances_with_opposite_signs():
    mask = disc(20) < 0
    np.testing.assert_array_equal(signed_distance(mask), -signed_distance(~mask))
    np.testing.assert_array_equal(signed_distance(mask) < 0, mask)


def test_distances_of_a_mask_are_those_of_the_nearest_pixel_of_the_other_kind_less_a_half():
    mask = np.random.default_rng(1).random((40, 50)) < 0.5
    expected = ndimage.distance_transform_edt(~mask) - ndimage.distance_transform_edt(mask)
    np.testing.assert_allclose(signed_distance(mask), expected - 0.5 * np.sign(expected), rtol=1e-14)


@pytest.mark.parametrize("radius", [5.0, 8.2, 20.0, 41.7])
def test_a_disc_of_pixels_is_the_disc_within_a_pixel(radius: float):
    phi = signed_distance(disc(radius) < 0)
    near = np.abs(disc(radius)) < 4
    assert np.abs(phi - disc(radius))[near].max() < 0.5
    assert np.abs(off(phi, radius)).max() < 0.75
    assert np.sqrt(moments(phi).area / np.pi) == pytest.approx(radius, abs=0.06)


def test_without_a_border_all_is_as_far_away_as_the_picture_is_wide():
    for value, distance in ((False, 5.0), (True, -5.0)):
        phi = signed_distance(np.full((3, 4), value))
        assert (phi == distance).all()
        assert (redistance(phi) == distance).all()


@pytest.mark.parametrize("radius", [8.0, 20.0, 41.7])
def test_distances_from_an_ellipse_are_distances_and_leave_it_where_it_is(radius: float):
    raw = ellipse(radius, radius)  # of slope 1 / radius
    phi = redistance(raw)
    np.testing.assert_array_equal(phi < 0, raw < 0)
    near = np.abs(disc(radius)) < 3.9
    assert np.abs(phi - disc(radius))[near].max() < 0.25 / radius + 0.04
    assert np.abs(off(phi, radius) - off(raw, radius).mean()).max() < 0.03


@pytest.mark.parametrize(("a", "b"), [(30, 12), (15, 40), (8, 8)])
def test_redistancing_moves_no_contour_by_a_fiftieth_of_a_pixel(a: float, b: float):
    raw = ellipse(a, b) * 9.0
    phi = redistance(raw)
    there, again = np.concatenate(contour(raw)), np.concatenate(contour(phi))
    assert np.abs(sample(phi, there)).max() < 0.02
    np.testing.assert_allclose(again, there, atol=0.03)  # the same edges; along one, the way is longer


def test_the_slope_of_distances_is_one_in_the_band():
    phi = redistance(ellipse(30, 20))
    down, right = np.gradient(phi)
    slope = np.hypot(down, right)[np.abs(phi) < 2.5]
    assert np.abs(slope - 1).max() < 0.06
    assert np.abs(slope - 1).mean() < 0.01


@given(st.integers(0, 2**32 - 1))
def test_distances_stay_as_they_are(seed):
    middle = tuple(np.random.default_rng(seed).uniform(55, 65, 2))
    phi = disc(17.0, middle)
    again = phi
    for _ in range(20):
        again = redistance(again)
    near = np.abs(phi) < 3.9
    np.testing.assert_allclose(again[near], phi[near], atol=2e-3)  # within that of the contour, inside is outside


def test_a_blend_lies_between_the_two():
    one, other = disc(20), disc(26)
    for gain in (0.0, 0.25, 0.5, 1.0):
        assert np.abs(off(blend(one, other, gain), 20 + 6 * gain)).max() < 0.05
    far = blend(signed_distance(disc(20) < 0), signed_distance(disc(40) < 0), 0.5)
    assert np.abs(off(far, 30)).max() < 0.8


# Motion -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("force", "steps"), [(-1.0, 50), (-0.4, 50), (1.0, 20), (-7.0, 50)])
def test_a_disc_under_constant_speed_grows_and_shrinks_by_just_so_much(force: float, steps: int):
    found = evolve(disc(20), force, steps=steps)
    assert found.time == pytest.approx(0.5 * steps / max(1, abs(force)))
    assert np.abs(off(found.phi, 20 - force * found.time)).max() < 0.1


@pytest.mark.parametrize("weight", [0.2, 1.0, 3.0])
def test_curvature_shrinks_a_disc_as_the_root_of_time(weight: float):
    found = evolve(disc(20), 0.0, curvature=weight, steps=int(200 * max(weight, 0.5)))
    expected = np.sqrt(20**2 - 2 * weight * found.time)
    assert expected < 19.5
    assert np.abs(off(found.phi, expected)).max() < 0.03 * (20 - expected) + 0.05


def test_curvature_rounds_an_ellipse_and_takes_a_speck_away():
    before, after = (redistance(ellipse(30, 15)),) * 2
    after = evolve(before, 0.0, curvature=1.0, steps=150).phi
    spread = [np.linalg.eigvalsh(moments(one).spread) for one in (before, after)]
    assert spread[1][1] / spread[1][0] < 0.8 * spread[0][1] / spread[0][0]
    gone = evolve(disc(2), 0.0, curvature=1.0, steps=40)
    assert (gone.phi == np.hypot(120, 121)).all()
    assert gone.steps < 40
    assert contour(gone.phi) == []


def test_the_curvature_of_a_disc_is_one_over_its_radius():
    found = curvature(disc(20))
    ring = np.abs(disc(20)) < 2
    np.testing.assert_allclose(found[ring], 1 / (20 + disc(20)[ring]), rtol=0.01)
    np.testing.assert_array_equal(curvature(-disc(20)), -found)
    assert not curvature(np.zeros((3, 3))).any()


@pytest.mark.parametrize("size", [1e-300, 1e-3, 10.0, 1e8, 1e150])
def test_forces_of_any_size_move_no_contour_by_more_than_half_a_pixel_a_step(size: float):
    rng = np.random.default_rng(3)
    force = size * ndimage.gaussian_filter(rng.normal(size=(120, 121)), 2)
    force[disc(26) > 0] = size
    ways = [redistance(disc(20))]
    evolve(disc(20), force, curvature=0.3, steps=60, on_iteration=lambda _, phi: ways.append(phi.copy()))
    for one, other in pairwise(ways):
        assert np.isfinite(other).all()
        changed = (one < 0) != (other < 0)
        assert np.abs(one[changed]).max(initial=0) < 1.2
    assert (ways[-1][disc(29) > 0] > 0).all()


def test_a_contour_finds_what_is_inside_and_stays_there():
    """From a disc beside it to an ellipse.

    force -1 in the ellipse, 1 outside
    """
    shape = ellipse(30, 18)
    found = evolve(disc(15, (70, 65)), np.where(shape < 0, -1.0, 1.0), curvature=0.1, steps=500, until=0.02)
    assert found.steps < 200
    assert found.moved < 0.02
    assert ((found.phi < 0) != (shape < 0)).sum() <= 4
    assert np.abs(sample(redistance(shape), np.concatenate(contour(found.phi)))).max() < 0.8


def test_every_measuring_finds_less_energy():
    shape, found = ellipse(30, 18), []
    force = np.where(shape < 0, -1.0, 1.0)

    def watch(step: int, phi: np.ndarray) -> None:
        if step % 5 == 0:
            found.append(energy(phi, force, curvature=0.2))

    evolve(disc(15, (70, 65)), force, curvature=0.2, steps=150, on_iteration=watch)
    assert (np.diff(found) < 0.01).all()  # of some thousand; sums over pixels are not quite those over the plane
    assert found[-1] < found[0] - 300


def test_two_discs_that_grow_join_and_part_again():
    pair = np.minimum(disc(12, (40, 60)), disc(12, (72, 60)))
    assert len(contour(redistance(pair))) == 2
    joined = evolve(pair, -1.0, steps=14).phi
    assert len(contour(joined)) == 1
    assert len(contour(evolve(joined, 1.0, steps=26).phi)) == 2


def test_a_hole_closes():
    ring = np.maximum(disc(30), -disc(6))
    assert sorted(np.sign([enclosed(line) for line in contour(ring)])) == [-1, 1]
    assert len(contour(evolve(ring, -1.0, steps=16).phi)) == 1


def test_the_contour_stays_where_it_is_not_to_move():
    domain = np.arange(121) >= np.full((120, 1), 60)
    found = evolve(disc(20), -1.0, steps=20, domain=domain).phi
    assert np.abs(off(found, 20)[np.concatenate(contour(found))[:, 0] < 56]).max() < 0.03
    assert sample(found, [[89.0, 60.0]])[0] < 0 < sample(found, [[92.0, 60.0]])[0]


def test_one_is_told_of_each_step_and_may_stop_it():
    told = []

    def watch(step: int, phi: np.ndarray) -> None:
        told.append(step)
        assert phi.shape == (120, 121)
        assert np.abs(phi).max() < 5
        with pytest.raises(ValueError, match="read-only"):
            phi[0, 0] = 1
        if step == 7:
            raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        evolve(disc(20), -1.0, steps=10, on_iteration=watch)
    assert told == [1, 2, 3, 4, 5, 6, 7]


def test_what_is_passed_is_not_changed_and_no_steps_only_measure():
    phi, force = disc(20), np.ones((120, 121))
    one = evolve(phi, force, steps=7)
    np.testing.assert_array_equal(phi, disc(20))
    assert (force == 1).all()
    still = evolve(phi, force, steps=0)
    np.testing.assert_array_equal(still.phi, redistance(phi))
    assert (still.steps, still.time, still.moved) == (0, 0.0, np.inf)
    np.testing.assert_array_equal(one.phi, evolve(phi, force, steps=7).phi)


def test_where_nothing_is_inside_nothing_moves():
    for sign in (1.0, -1.0):
        found = evolve(np.full((5, 6), sign), -1.0, steps=9)
        assert found.steps == 0
        assert (np.sign(found.phi) == sign).all()
    assert evolve(np.array([[-1.0]]), 1.0, steps=3).phi.tolist() == [[-np.sqrt(2)]]


def test_a_contour_grows_out_of_the_picture_and_over_all():
    found = evolve(disc(20, (3, 3), (40, 40)), -1.0, steps=200)
    assert (found.phi == -np.hypot(40, 40)).all()


def test_the_same_input_gives_the_same_bytes_in_any_process():
    code = (
        "import hashlib, numpy as np; from perdure.maths.levelset import *; y, x = np.indices((60, 60));"
        "e = evolve(np.hypot(x - 30, y - 30) - 12, np.sin(x * y), curvature=.2, steps=23);"
        "print(hashlib.sha256(e.phi.tobytes() + contour(e.phi)[0].tobytes()).hexdigest())"
    )
    said = {
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    }
    assert len(said) == 1


# Contours and moments -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("a", "b"), [(30, 12), (15, 40), (8, 8)])
def test_vertices_lie_on_the_ellipse(a: float, b: float):
    (line,) = contour(redistance(ellipse(a, b)))
    angle = np.linspace(0, 2 * np.pi, 20_000)
    true = np.stack([MIDDLE[0] + a * np.cos(angle), MIDDLE[1] + b * np.sin(angle)], axis=1)
    away = np.hypot(*(line[:, None] - true[None]).transpose(2, 0, 1)).min(axis=1)
    assert away.max() < 0.05
    assert enclosed(line) == pytest.approx(np.pi * a * b, rel=0.01)
    steps = np.hypot(*(line - np.roll(line, 1, axis=0)).T)
    assert steps.max() < 1.42


def test_outlines_run_with_the_clock_and_holes_against_it():
    mask = drawn(
        """
        ..........
        .#####....
        .#...#.##.
        .#.#.#.##.
        .#...#....
        .#####....
        ..........
        """
    )
    areas = [enclosed(line) for line in contour(signed_distance(mask))]
    assert np.sign(areas).tolist() == [1, -1, 1, 1]


def test_pixels_that_touch_by_a_corner_are_joined_if_the_mean_is_inside():
    touching = np.pad([[-1.0, 0.8], [0.8, -1.0]], 1, constant_values=1.0)
    apart = np.pad([[-0.8, 1.0], [1.0, -0.8]], 1, constant_values=1.0)
    even = np.pad([[-1.0, 1.0], [1.0, -1.0]], 1, constant_values=1.0)
    assert [len(contour(phi)) for phi in (touching, apart, even)] == [1, 2, 2]
    assert [len(contour(phi[:, ::-1])) for phi in (touching, apart, even)] == [1, 2, 2]


def test_what_leaves_the_picture_is_closed_half_a_pixel_beyond_it():
    (line,) = contour(np.full((4, 6), -3.0))
    assert (line.min(axis=0).tolist(), line.max(axis=0).tolist()) == ([-0.5, -0.5], [5.5, 3.5])
    (line,) = contour(disc(10, (0, 5), (11, 20)))
    assert line[:, 0].min() == -0.5
    assert contour(np.array([[1.0]])) == []


@given(st.integers(0, 2**32 - 1))
def test_contours_of_noise_are_closed_lines_that_hold_all_that_is_inside(seed):
    phi = np.random.default_rng(seed).normal(size=(9, 12))
    lines = contour(phi)
    every = np.concatenate(lines)
    assert len(np.unique(every.round(9), axis=0)) == len(every)
    for line in lines:
        assert np.hypot(*(line - np.roll(line, 1, axis=0)).T).max() < 1.42
    parts = ndimage.label(phi < 0)[1]  # by sides; corners may join more
    assert sum(enclosed(line) > 0 for line in lines) <= parts
    assert 0 < sum(enclosed(line) for line in lines) < 10 * 13


def test_length_area_centroid_and_spread_are_those_of_an_ellipse():
    phi = redistance(ellipse(30, 12))
    found = moments(phi)
    assert found.area == pytest.approx(np.pi * 30 * 12, rel=0.003)
    np.testing.assert_allclose(found.centroid, MIDDLE, atol=0.01)
    np.testing.assert_allclose(found.spread, np.diag([30**2 / 4, 12**2 / 4]), rtol=0.01, atol=0.1)
    assert length(contour(disc(20))) == pytest.approx(2 * np.pi * 20, rel=0.002)
    assert energy(disc(20), 2.0, curvature=3.0) == pytest.approx(2 * np.pi * 400 + 3 * np.pi * 40, rel=0.002)
    shares = inside(disc(20))
    assert (shares.min(), shares.max()) == (0, 1)
    np.testing.assert_allclose(shares + inside(-disc(20)), 1, atol=1e-12)


def test_a_disc_that_slides_by_a_third_of_a_pixel_slides_by_a_third_of_a_pixel():
    for shift in np.linspace(0, 1, 7):
        centroid = moments(disc(14, (60 + shift, 60))).centroid
        np.testing.assert_allclose(centroid, [60 + shift, 60], atol=1e-3)


# Groups -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("growth", [-0.5, 0.0, 0.5])
def test_a_shape_is_carried_as_its_points_are(growth: float):
    motion = lie.SIMILARITY.exp([5, -3, 0.7, growth])
    goal = lie.compose(lie.SE2.exp([150, 150, 0]), motion, lie.SE2.exp([-MIDDLE[0], -MIDDLE[1], 0]))
    phi = redistance(ellipse(30, 12))
    found = carried(phi, goal, (300, 310))
    assert found.shape == (300, 310)
    expected = lie.act(goal, contour(phi)[0])
    assert np.abs(sample(found, expected)).max() < 0.06 * max(1.2, np.exp(growth))
    down, right = np.gradient(found)
    near = np.abs(found) < 2
    assert np.hypot(down, right)[near].mean() == pytest.approx(1, abs=0.02)
    assert (found[[0, -1]] > 0).all()


def test_beyond_the_picture_all_is_outside_and_farther_away():
    phi = disc(4, (5, 5), (11, 11))
    found = carried(phi, lie.SE2.exp([20, 0, 0]), (11, 60))
    assert (np.diff(found[5, 26:]) > 0.99).all()
    np.testing.assert_allclose(found[:, 20:31], phi, atol=1e-12)


def test_an_affine_motion_carries_a_disc_to_an_ellipse():
    there = lie.SE2.exp([*MIDDLE, 0])
    motion = lie.compose(there, np.diag([1.5, 0.6, 1.0]), lie.inverse(there))
    found = redistance(carried(disc(20), motion))
    np.testing.assert_allclose(moments(found).spread, np.diag([15**2, 6**2]), rtol=0.02, atol=0.1)


# What is refused ----------------------------------------------------------------------------------------------

GOOD = disc(3, (5, 5), (11, 11))


@pytest.mark.parametrize("bad", [np.full((3, 3), np.nan), np.full((3, 3), np.inf), np.zeros((0, 3)), np.zeros(4)])
def test_a_picture_that_is_none_is_refused(bad: np.ndarray):
    for function in (redistance, contour, curvature, inside, moments):
        with pytest.raises(ParameterError, match="phi"):
            function(bad)
    with pytest.raises(ParameterError, match="phi"):
        evolve(bad, 1.0, steps=1)
    with pytest.raises(ParameterError, match="phi"):
        carried(bad, np.eye(3))
    with pytest.raises(ParameterError, match="predicted"):
        blend(bad, bad, 0.5)
    with pytest.raises(ParameterError, match="field"):
        sample(bad, [[0, 0]])


@pytest.mark.parametrize(
    ("change", "because"),
    [
        ({"curvature": -1.0}, "curvature = -1.0"),
        ({"curvature": np.nan}, "curvature = nan"),
        ({"steps": -1}, "steps = -1"),
        ({"cfl": 0.6}, r"cfl = 0.6 is out of range: it must be in \(0, 0.5\]"),
        ({"cfl": 0.0}, "cfl = 0.0"),
        ({"redistance_every": 0}, "redistance_every = 0"),
        ({"until": -0.1}, "until"),
        ({"band": 3.0}, "band = 3.0 .* must be 4 or more"),
        ({"band": np.inf}, "band = inf"),
        ({"force": np.nan}, "force is not finite"),
        ({"force": np.zeros((11, 12))}, r"force has the shape \(11, 12\) beside \(11, 11\)"),
        ({"domain": np.ones((2, 2), bool)}, "domain has the shape"),
        ({"domain": np.ones((11, 11))}, "domain is float64"),
    ],
)
def test_a_number_out_of_its_range_is_refused_by_name_and_value(change: dict, because: str):
    with pytest.raises(ParameterError, match=because):
        evolve(GOOD, **{"force": 1.0, "steps": 1, **change})


def test_shapes_gains_and_masks_that_do_not_fit_are_refused():
    for gain in (-0.1, 1.1, np.nan):
        with pytest.raises(ParameterError, match="gain = "):
            blend(GOOD, GOOD, gain)
    with pytest.raises(ParameterError, match="measured has the shape"):
        blend(GOOD, GOOD[1:], 0.5)
    for mask in (np.zeros((3, 3)), np.zeros((0, 3), bool), np.zeros(3, bool)):
        with pytest.raises(ParameterError, match="mask is"):
            signed_distance(mask)
    with pytest.raises(ParameterError, match="nothing inside"):
        moments(np.full((3, 3), 5.0))
    with pytest.raises(ParameterError, match="band"):
        redistance(GOOD, band=0.0)
    with pytest.raises(ParameterError, match="determinant"):
        carried(GOOD, np.diag([-1.0, 1.0, 1.0]))
    with pytest.raises(ParameterError, match="motion has the shape"):
        carried(GOOD, np.tile(np.eye(3), (2, 1, 1)))
    for points in ([[0, 0, 0]], [[0, np.nan]], [0, 0]):
        with pytest.raises(ParameterError, match="points"):
            sample(GOOD, points)

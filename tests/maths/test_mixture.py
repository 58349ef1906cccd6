"""Gaussian mixtures: scikit-learn and plain NumPy as oracles, and data that would make covariances singular."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perdure.errors import ParameterError
from perdure.maths.kernels.mixtures import (
    BLOCK,
    expect,
    expect_twin,
    log_densities,
    log_densities_twin,
    log_ratios,
    log_ratios_twin,
)
from perdure.maths.mixture import LEAST, Mixture, fit, log_density, log_ratio, subsample


def some_mixture(rng: np.random.Generator, components: int, dimensions: int) -> Mixture:
    shapes = rng.normal(0, 1, (components, dimensions, dimensions))
    covariances = shapes @ shapes.transpose(0, 2, 1) + np.eye(dimensions)
    return Mixture(
        rng.dirichlet(np.full(components, 5.0)), rng.normal(0, 4, (components, dimensions)), covariances
    )


def drawn(mixture: Mixture, rng: np.random.Generator, count: int) -> np.ndarray:
    which = rng.choice(len(mixture), count, p=mixture.weights)
    noise = rng.normal(0, 1, (count, mixture.means.shape[1], 1))
    return mixture.means[which] + (np.linalg.cholesky(mixture.covariances)[which] @ noise)[..., 0]


def in_sklearn(mixture: Mixture, **options):
    from sklearn.mixture import GaussianMixture

    return GaussianMixture(
        len(mixture),
        weights_init=mixture.weights,
        means_init=mixture.means,
        precisions_init=np.linalg.inv(mixture.covariances),
        **options,
    )


def kernel_arguments(seed, components, dimensions, count, dtype):
    rng = np.random.default_rng(seed)
    factors = np.tril(rng.normal(0, 1, (components, dimensions, dimensions)))
    one = (
        rng.normal(0, 2, (count, dimensions)),
        rng.normal(-3, 2, components),
        rng.normal(0, 2, (components, dimensions)),
    )
    return [np.ascontiguousarray(each, dtype) for each in (*one, factors)]


several = given(st.integers(0, 2**32 - 1), st.integers(0, 6), st.integers(1, 4), st.integers(0, 2 * BLOCK + 3))
quick = settings(max_examples=40)


@quick
@several
def test_log_densities_are_those_of_the_twin(seed, components, dimensions, count):
    points, *forms = kernel_arguments(seed, components, dimensions, count, np.float32)
    results = []
    for function in (log_densities, log_densities_twin):
        room = np.full((components + 2 + dimensions, BLOCK), np.nan, np.float32)
        results.append(np.full(count, np.nan, np.float32))
        function(points, *forms, np.float32(-20), room, results[-1])
    np.testing.assert_allclose(*results, atol=2e-4)


@quick
@given(st.integers(0, 2**32 - 1), st.lists(st.integers(0, 3), min_size=2, max_size=5), st.integers(1, 3))
def test_log_ratios_are_those_of_the_twin(seed, sizes, dimensions):
    rng = np.random.default_rng(seed)
    points, *forms = kernel_arguments(seed, sum(sizes), dimensions, BLOCK + 7, np.float32)
    least = rng.uniform(-15, -3, len(sizes)).astype(np.float32)
    results = []
    for function in (log_ratios, log_ratios_twin):
        room = np.full((sum(sizes) + 5 + dimensions, BLOCK), np.nan, np.float32)
        results.append(np.full(len(points), np.nan, np.float32))
        function(points, *forms, np.cumsum(sizes), least, len(sizes) // 2, np.float32(6), room, results[-1])
    np.testing.assert_allclose(*results, atol=2e-4)


@quick
@several
def test_what_components_answer_for_is_what_the_twin_says(seed, components, dimensions, count):
    points, *forms = kernel_arguments(seed, components + 1, dimensions, count, np.float64)
    weights = np.random.default_rng(seed).uniform(0, 2, count)
    results = []
    for function in (expect, expect_twin):
        sums = np.zeros((components + 1, 1 + dimensions + dimensions * (dimensions + 1) // 2))
        room = np.full((components + 3 + dimensions, BLOCK), np.nan)
        results.append([function(points, weights, *forms, room, sums), sums])
    np.testing.assert_allclose(results[0][0], results[1][0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(results[0][1], results[1][1], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("components", "dimensions"), [(1, 1), (4, 2), (10, 3), (3, 5)])
def test_densities_are_those_of_scikit_learn(components, dimensions):
    rng = np.random.default_rng(components)
    mixture = some_mixture(rng, components, dimensions)
    points = drawn(mixture, rng, 600)
    other = in_sklearn(mixture)
    other._initialize_parameters(points, np.random.RandomState(0))
    other.weights_, other.means_, other.covariances_ = mixture.weights, mixture.means, mixture.covariances
    other.precisions_cholesky_ = np.linalg.cholesky(np.linalg.inv(mixture.covariances))
    np.testing.assert_allclose(log_density(mixture, points), other.score_samples(points), atol=1e-4)


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@pytest.mark.parametrize("iterations", [1, 5, 12])
@pytest.mark.parametrize("dimensions", [2, 3])
def test_after_as_many_steps_from_the_same_start_scikit_learn_is_as_far(iterations, dimensions):
    rng = np.random.default_rng(7)
    points = drawn(some_mixture(rng, 5, dimensions), rng, 800)
    start = some_mixture(rng, 5, dimensions)
    mine = fit(points, 5, start=start, iterations=iterations, floor=1e-6, settled=0)
    other = in_sklearn(start, reg_covar=0, tol=0, max_iter=iterations).fit(points)
    assert log_density(mine, points).mean() == pytest.approx(other.score(points), abs=1e-4)
    np.testing.assert_allclose(mine.means, other.means_, atol=1e-6)
    np.testing.assert_allclose(mine.covariances, other.covariances_, atol=1e-6)


def test_from_nothing_it_finds_as_likely_a_mixture_as_scikit_learn():
    from sklearn.mixture import GaussianMixture

    rng = np.random.default_rng(3)
    truth = some_mixture(rng, 5, 3)
    points = drawn(truth, rng, 3000)
    other = GaussianMixture(5, random_state=0, max_iter=50).fit(points)
    assert log_density(fit(points, 5, iterations=50), points).mean() > other.score(points) - 0.05


@pytest.mark.parametrize("floor", [1e-6, 2.0, (0.5, 4.0)])
def test_the_likelihood_never_falls(floor):
    rng = np.random.default_rng(1)
    points = np.round(drawn(some_mixture(rng, 6, 2), rng, 400))  # whole numbers: flat directions at the floor
    start = fit(points, 6, iterations=0, floor=floor)
    reached = [
        log_density(fit(points, 6, start=start, iterations=steps, floor=floor, settled=0), points).mean(
            dtype=float
        )
        for steps in range(12)
    ]
    assert (np.diff(reached) > -1e-5).all(), reached
    assert reached[-1] > reached[0] + 1e-3


def test_a_thing_of_one_colour_is_one_component_as_narrow_as_the_floor():
    found = fit(np.full((500, 3), 77.0), 10, floor=(1.0, 2.0, 3.0))
    np.testing.assert_allclose(found.means, [[77.0, 77.0, 77.0]])
    np.testing.assert_allclose(found.covariances, [np.diag([1.0, 2.0, 3.0])])


def test_colours_on_a_line_have_densities():
    grey = np.repeat(np.arange(0, 256, 4.0), 3).reshape(-1, 3)
    found = fit(np.tile(grey, (4, 1)), 10)
    assert np.linalg.eigvalsh(found.covariances).min() > 1 - 1e-9
    assert np.isfinite(log_density(found, grey)).all()
    assert log_density(found, [100.0, 100.0, 100.0]) > log_density(found, [100.0, 120.0, 100.0])


@pytest.mark.parametrize(("count", "most"), [(1, 1), (19, 1), (40, 2), (500, 10)])
def test_few_points_bear_few_components(count, most):
    points = np.random.default_rng(0).uniform(0, 255, (count, 3))
    assert 1 <= len(fit(points, 10)) <= most


def test_without_points_nothing_is_known_but_what_was_known():
    before = some_mixture(np.random.default_rng(0), 2, 3)
    none = fit(np.zeros((0, 3)), 10)
    assert len(none) == 0
    assert (log_density(none, np.zeros((4, 3))) == LEAST).all()
    assert fit(np.full((5, 3), np.nan), 10, start=before) is before
    assert len(fit(np.random.default_rng(0).normal(0, 5, (100, 3)), 2, start=none)) == 2


def test_a_ratio_of_sums_is_what_their_densities_say():
    rng = np.random.default_rng(1)
    one, other, third = (some_mixture(rng, number, 3) for number in (3, 5, 1))
    points = drawn(one, rng, 500)
    above = np.logaddexp(
        log_density(one, points) + np.log(0.8), log_density(Mixture.empty(3), points) + np.log(0.2)
    )
    below = np.logaddexp(log_density(other, points), log_density(third, points) + np.log(0.1))
    said = log_ratio(points, [(one, 0.8), (Mixture.empty(3), 0.2)], [(other, 1.0), (third, 0.1)], 5.0)
    np.testing.assert_allclose(said, np.clip(above - below, -5, 5), atol=1e-4)
    assert np.abs(said).max() == 5.0


def test_where_nothing_is_known_neither_is_likelier():
    none = [(Mixture.empty(3), 1.0)]
    np.testing.assert_array_equal(log_ratio(np.full((2, 4, 3), 7.0), none, none, 4.0), np.zeros((2, 4)))
    known = [(some_mixture(np.random.default_rng(0), 2, 3), 1.0)]
    np.testing.assert_array_equal(log_ratio([[np.nan, 0, 0], [1e30, 0, 0]], known, none, 4.0), [0, 0])


def test_what_is_no_number_is_left_out_and_least_likely():
    points = np.random.default_rng(0).normal(0, 9, (300, 2))
    dirty = np.insert(points, [0, 100], [[np.nan, 1], [2, np.inf]], axis=0)
    one, other = fit(points, 3), fit(dirty, 3)
    np.testing.assert_array_equal(one.means, other.means)
    said = log_density(one, [[np.nan, 0], [0, np.inf], [0, 0], [1e30, 0]])
    assert (said[[0, 1, 3]] == LEAST).all()
    assert said[2] > LEAST


def test_a_point_that_counts_twice_is_two_points():
    rng = np.random.default_rng(4)
    points, times = rng.normal(0, 9, (200, 2)), rng.integers(0, 4, 200)
    start = some_mixture(rng, 3, 2)
    one = fit(points, 3, start=start, weights=times)
    other = fit(np.repeat(points, times, axis=0), 3, start=start)
    np.testing.assert_allclose(one.means, other.means, atol=1e-9)
    np.testing.assert_allclose(one.covariances, other.covariances, atol=1e-9)


def test_a_component_that_nothing_is_left_for_goes_and_another_takes_its_place():
    rng = np.random.default_rng(2)
    points = np.concatenate([rng.normal(0, 2, (200, 2)), rng.normal(30, 2, (200, 2))])
    gone = Mixture(
        np.array([0.5, 0.5]), np.array([[15.0, 15.0], [900.0, 900.0]]), np.tile(500 * np.eye(2), (2, 1, 1))
    )
    found = fit(points, 2, start=fit(points, 2, start=gone))
    np.testing.assert_allclose(np.sort(found.means[:, 0]), [0, 30], atol=0.5)
    np.testing.assert_allclose(found.weights, 0.5, atol=0.01)


def test_the_next_frame_keeps_the_order_of_the_components():
    rng = np.random.default_rng(6)
    truth = some_mixture(rng, 6, 3)
    first = fit(drawn(truth, rng, 2000), 6, iterations=30, floor=0.1)
    then = fit(drawn(truth, rng, 2000), 6, start=first, floor=0.1)
    assert np.abs(then.means - first.means).max() < 1.0


def test_the_same_points_give_the_same_bytes_and_stay_as_they_are():
    points = np.random.default_rng(0).integers(0, 256, (3000, 3)).astype(np.uint8)
    kept = points.copy()
    one, other = fit(points, 10), fit(points, 10)
    assert one.means.tobytes() == other.means.tobytes()
    assert one.covariances.tobytes() == other.covariances.tobytes()
    np.testing.assert_array_equal(points, kept)


def test_a_picture_has_a_density_at_every_pixel():
    picture = np.random.default_rng(0).integers(0, 256, (11, 7, 3)).astype(np.uint8)
    mixture = fit(picture.reshape(-1, 3), 3)
    flat = log_density(mixture, picture.reshape(-1, 3))
    np.testing.assert_array_equal(log_density(mixture, picture), flat.reshape(11, 7))


def test_a_sample_is_spread_evenly_and_meets_no_column_again_and_again():
    assert len(subsample(np.arange(7), 9)) == 7
    assert len(subsample(np.zeros((9, 3)), 0)) == 0
    rows = subsample(np.arange(640 * 480), 9600)  # one of 32, and 640 is 20 times 32
    assert len(rows) == 9600
    assert (np.diff(rows) > 0).all()
    assert np.diff(rows).max() < 64
    assert np.bincount(rows % 640, minlength=640).max() < 30  # 15 in the mean


@pytest.mark.parametrize(
    "wrong",
    [
        {"components": 0},
        {"iterations": -1},
        {"floor": 0.0},
        {"floor": (1.0, 2.0)},
        {"floor": np.nan},
        {"weights": np.ones(3)},
        {"points": np.zeros(3)},
        {"start": Mixture.empty(2)},
    ],
)
def test_what_cannot_be_is_refused_by_name(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        fit(**{"points": np.zeros((4, 3)), "components": 2, **wrong})


def test_points_of_another_space_are_refused():
    with pytest.raises(ParameterError, match="2 dimensions"):
        log_density(Mixture.empty(2), np.zeros((4, 3)))

"""Ratios of heavy-tailed densities against a plain second implementation, and SciPy's."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.kernels.tails import student_ratios, student_ratios_twin


@given(st.integers(0, 2**32 - 1), st.integers(0, 9), st.integers(0, 9))
def test_student_ratios_are_those_of_the_twin(seed, height, width):
    rng = np.random.default_rng(seed)
    vectors = (rng.normal(0, 1, (height, width, 2)) * 10 ** rng.uniform(-1, 3)).astype(np.float32)
    middle, spread = rng.normal(0, 5, 2).astype(np.float32), rng.uniform(0.4, 3, 2).astype(np.float32)
    results = []
    for function in (student_ratios, student_ratios_twin):
        results.append(np.full((height, width), np.nan, np.float32))
        function(vectors, middle, spread, np.float32(0.4), np.float32(7.0), results[-1])
    np.testing.assert_allclose(*results, atol=1e-4)


def test_the_ratio_is_that_of_scipy_up_to_the_scale_of_its_spread():
    from scipy import stats

    # (1 + d² / 2) ** -1.5 is the Student of the plane with one degree of freedom, d measured in 1 / sqrt(2)
    vectors = np.random.default_rng(0).normal(0, 3, (5, 7, 2)).astype(np.float32)
    middle, spread = np.float32([2, -1]), np.float32([0.5, 1.5])
    said = np.empty((5, 7), np.float32)
    student_ratios(vectors, middle, spread, np.float32(0.4), np.float32(99), said)
    above = stats.multivariate_t(middle, np.diag(2 * spread**2), df=1).logpdf(vectors)
    below = stats.multivariate_t([0, 0], 2 * 0.4**2 * np.eye(2), df=1).logpdf(vectors)
    np.testing.assert_allclose(said, above - below, atol=1e-4)

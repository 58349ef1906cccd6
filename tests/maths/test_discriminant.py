"""Fisher's discriminant over running moments, against NumPy, SciPy and scikit-learn."""

from __future__ import annotations

import numpy as np
import pytest

from perdure.maths.discriminant import Moments, log_odds

MEAN, SPREAD = np.array([0.8, 0.7, 0.9]), np.array([0.1, 0.2, 0.05])
FOREVER = 1e12


def samples() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    mixed = np.array([[1.0, 0.3, 0.0], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
    same = 0.8 + rng.normal(size=(400, 3)) @ mixed * 0.1
    return same, 0.5 + rng.normal(size=(400, 3)) @ mixed.T * 0.1


def learnt(numbers: np.ndarray, memory: float = FOREVER) -> Moments:
    count = numbers.shape[1]
    found = Moments(0.0, np.zeros(count), np.zeros((count, count)))
    for part in np.array_split(numbers, 7):
        found = found.seen(part, memory)
    return found


def test_moments_learnt_in_parts_are_those_of_all():
    same, _ = samples()
    found = learnt(same)
    np.testing.assert_allclose(found.mean, same.mean(axis=0))
    np.testing.assert_allclose(found.covariance, np.cov(same.T, bias=True) + 1e-4 * np.eye(3), atol=1e-9)


def test_what_is_assumed_has_the_given_mean_deviation_and_correlation():
    found = Moments.assumed(MEAN, SPREAD, 0.5, 20.0)
    np.testing.assert_allclose(found.mean, MEAN)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance - 1e-4 * np.eye(3))), SPREAD)
    assert found.covariance[0, 1] == pytest.approx(0.5 * 0.1 * 0.2)


def test_what_is_older_counts_less():
    found = learnt(np.concatenate([np.zeros((700, 1)), np.ones((700, 1))]), memory=200.0)
    assert found.mean[0] > 0.9
    assert found.count < 500, "so that it can change for ever"


def test_kinds_are_parted_as_linear_discriminant_analysis_does():
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

    same, other = samples()
    one, two = learnt(same), learnt(other)
    analysis = LinearDiscriminantAnalysis(solver="lsqr").fit(
        np.concatenate([same, other]), np.repeat([1, 0], len(same))
    )
    direction = np.linalg.solve(one.covariance + two.covariance, one.mean - two.mean)
    theirs = analysis.coef_[0]
    assert direction @ theirs / np.linalg.norm(direction) / np.linalg.norm(theirs) > 0.999
    new = np.random.default_rng(5).uniform(0.4, 0.9, (200, 3))
    ours, margin = log_odds(one, two, new), analysis.decision_function(new)
    sure = np.abs(margin) > 1
    assert (np.sign(ours) == np.sign(margin))[sure].mean() > 0.97


def test_log_odds_between_two_means_are_those_of_normal_densities_and_none_is_more_than_six():
    from scipy.stats import norm

    one, two = (Moments.assumed([mean], [0.1], 0.0, 50.0) for mean in (0.8, 0.6))
    deviation = np.sqrt(0.1**2 + 1e-4)
    between = np.linspace(0.61, 0.79, 7)
    expected = norm.logpdf(between, 0.8, deviation) - norm.logpdf(between, 0.6, deviation)
    np.testing.assert_allclose(log_odds(one, two, between[:, None]), expected, atol=1e-9)
    far = log_odds(one, two, np.array([[0.8], [5.0], [-5.0]]))
    assert far.tolist() == pytest.approx([2.0 * 0.01 / 0.0101, 6.0, -6.0])
    assert log_odds(one, one, np.array([[0.3]]))[0] == 0

"""AdaBoost by hand, against trying every stump, and against the bound on its error."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.boost import (
    LARGEST,
    Boosted,
    best_thresholds,
    boost_at,
    boost_stumps,
    errors_at,
    separation,
)


@st.composite
def samples(draw):
    """Similarities in tenths, some of them not known, and labels of both kinds."""
    count, features = draw(st.integers(2, 9)), draw(st.integers(1, 3))
    tenths = st.lists(st.integers(0, 10), min_size=features, max_size=features)
    flags = st.lists(st.sampled_from([True, True, True, False]), min_size=features, max_size=features)
    similarities = np.array(draw(st.lists(tenths, min_size=count, max_size=count))) / 10
    known = np.array(draw(st.lists(flags, min_size=count, max_size=count)))
    labels = np.array([1, -1, *draw(st.lists(st.sampled_from([1, -1]), min_size=count - 2, max_size=count - 2))])
    return similarities, known, labels


def tried(threshold: float, column: np.ndarray, known: np.ndarray, labels: np.ndarray, weights: np.ndarray):
    """The error of one classifier, sample by sample."""
    error = 0.0
    for value, there, label, weight in zip(column, known, labels, weights, strict=True):
        error += weight * (0.5 if not there else float((1 if value >= threshold else -1) != label))
    return error


def slowly(similarities, known, labels, rounds: int) -> list[tuple[int, float, float]]:
    """AdaBoost with every threshold between two values tried: (feature, error, alpha) of each round."""
    weights = np.full(len(labels), 1 / len(labels))
    chosen = []
    for _ in range(rounds):
        every = []
        for k in range(similarities.shape[1]):
            values = np.unique(similarities[known[:, k], k])
            for threshold in (values[:-1] + values[1:]) / 2:
                error = tried(threshold, similarities[:, k], known[:, k], labels, weights)
                every.append((round(error, 12), k, threshold))
        if not every or min(every)[0] >= 0.5 - 1e-9:
            break
        error, k, threshold = min(every)
        alpha = min(LARGEST, 0.5 * math.log((1 - error) / max(error, 1e-12)))
        chosen.append((k, error, alpha))
        if error <= 1e-12:
            break
        said = np.where(similarities[:, k] >= threshold, 1, -1) * known[:, k]
        weights = weights * np.exp(-alpha * labels * said)
        weights /= weights.sum()
    return chosen


@given(samples())
def test_the_first_round_of_stumps_finds_the_least_error_of_all(given_samples):
    similarities, known, labels = given_samples
    expected = slowly(similarities, known, labels, 1)
    found = boost_stumps(similarities, known, labels, np.ones(len(labels)), 1).rounds
    assert len(found) == len(expected)
    if found:
        assert found[0].error == pytest.approx(expected[0][1], abs=1e-9)
        assert found[0].alpha == pytest.approx(expected[0][2], abs=1e-6)
        even = np.full(len(labels), 1 / len(labels))
        k, threshold = found[0].feature, found[0].threshold
        assert tried(threshold, similarities[:, k], known[:, k], labels, even) == pytest.approx(found[0].error)


def test_many_rounds_are_those_of_trying_all():
    rng = np.random.default_rng(4)
    labels = np.where(rng.random(40) < 0.4, 1, -1)
    similarities = np.clip(rng.normal(0.5 + 0.1 * labels[:, None], 0.2, (40, 3)), 0, 1)
    known = rng.random((40, 3)) < 0.9
    found = boost_stumps(similarities, known, labels, np.ones(40), 12)
    expected = slowly(similarities, known, labels, 12)
    assert [(one.feature, one.error, one.alpha) for one in found.rounds] == [
        (k, pytest.approx(error, abs=1e-9), pytest.approx(alpha, abs=1e-6)) for k, error, alpha in expected
    ]
    sums = [sum(alpha for k, _, alpha in expected if k == feature) for feature in range(3)]
    assert found.weights == pytest.approx(np.array(sums) / sum(sums))


def combined(found: Boosted, similarities: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Σ α h of every sample."""
    total = np.zeros(len(similarities))
    for one in found.rounds:
        said = np.where(similarities[:, one.feature] >= one.threshold, 1, -1) * known[:, one.feature]
        total += one.alpha * said
    return total


@given(samples(), st.integers(1, 6))
def test_the_exponential_loss_stays_below_the_bound_of_the_rounds(given_samples, rounds):
    similarities, known, labels = given_samples
    found = boost_stumps(similarities, known, labels, np.ones(len(labels)), rounds)
    loss = np.exp(-labels * combined(found, similarities, known)).mean()
    errors = [one.error for one in found.rounds if one.alpha < LARGEST]
    assert loss <= math.prod(2 * math.sqrt(error * (1 - error)) for error in errors) + 1e-9


def test_two_rounds_by_hand():
    # The first feature errs on the fourth sample: ε = 1/4, α = ½ ln 3. That sample then weighs 1/2, the others 1/6:
    # the second feature errs on the second, ε = 1/6, α = ½ ln 5; the weights are ln 3 : ln 5.
    similarities = np.array([[0.9, 0.9], [0.9, 0.1], [0.1, 0.1], [0.8, 0.1]])
    labels = np.array([1, 1, -1, -1])
    found = boost_at(0.5, similarities, np.ones((4, 2), bool), labels, np.ones(4), 2)
    assert [one.feature for one in found.rounds] == [0, 1]
    assert [one.error for one in found.rounds] == pytest.approx([1 / 4, 1 / 6])
    assert [one.alpha for one in found.rounds] == pytest.approx([math.log(3) / 2, math.log(5) / 2])
    assert found.weights == pytest.approx(np.log([3, 5]) / np.log(15))
    assert errors_at(0.5, similarities, np.ones((4, 2), bool), labels, np.ones(4)).tolist() == [0.25, 0.25]


def test_a_feature_that_never_errs_ends_it_with_the_largest_alpha():
    similarities = np.array([[0.5, 0.9], [0.4, 0.1]])
    found = boost_stumps(similarities, np.ones((2, 2), bool), np.array([1, -1]), np.ones(2), 9)
    assert [(one.feature, one.alpha, one.error) for one in found.rounds] == [(0, LARGEST, 0.0)]
    assert found.rounds[0].threshold == pytest.approx(0.45)


def test_features_that_tell_nothing_get_no_weight():
    similarities = np.array([[0.5, 0.2], [0.5, 0.9]])
    nothing = boost_stumps(similarities[:, :1], np.ones((2, 1), bool), np.array([1, -1]), np.ones(2), 9)
    assert (nothing.rounds, nothing.weights.tolist()) == ((), [0.0])
    unknown = boost_stumps(similarities, np.zeros((2, 2), bool), np.array([1, -1]), np.ones(2), 9)
    assert unknown.rounds == ()
    thresholds, errors = best_thresholds(similarities, np.ones((2, 2), bool), np.array([1, -1]), np.ones(2))
    assert errors.tolist() == [0.5, 1.0]  # less alike when the same: no similarity
    assert thresholds[0] == 1.0


def test_what_is_seldom_known_is_seldom_chosen():
    labels = np.array([1, 1, 1, -1, -1, -1])
    good = np.array([0.9, 0.9, 0.9, 0.1, 0.1, 0.1])
    fair = np.array([0.9, 0.9, 0.1, 0.1, 0.1, 0.1])
    known = np.ones((6, 2), bool)
    known[[0, 1, 3, 4], 0] = False
    found = boost_stumps(np.column_stack([good, fair]), known, labels, np.ones(6), 1)
    assert found.rounds[0].feature == 1
    assert found.rounds[0].error == pytest.approx(1 / 6)


def test_no_samples_give_no_rounds():
    found = boost_stumps(np.zeros((1, 2)), np.ones((1, 2), bool), np.array([1]), np.ones(1), 3)
    assert found.rounds == ()


def test_separation_is_the_area_under_the_curve():
    from sklearn.metrics import roc_auc_score

    rng = np.random.default_rng(3)
    labels = np.where(rng.random(60) < 0.3, 1, -1)
    similarities = np.round(np.clip(rng.normal(0.5 + 0.1 * labels, 0.2), 0, 1), 1)[:, None]  # with ties
    known = rng.random((60, 1)) < 0.8
    expected = roc_auc_score(labels[known[:, 0]], similarities[known[:, 0], 0])
    assert separation(similarities, known, labels)[0] == pytest.approx(expected)
    assert separation(similarities, known, np.ones(60, int))[0] == 0.5

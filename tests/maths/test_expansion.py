"""Labellings by many labels: against every labelling of a tiny picture, and small scenes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perdure.errors import ParameterError
from perdure.maths.expansion import OUTSIDE, energy, expand, swap


def problem(seed: int, most: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None]:
    rng = np.random.default_rng(seed)
    height, width = rng.integers(1, most + 1, 2)
    count = int(rng.integers(1, 4))
    unary = rng.integers(0, 9, (count, height, width)).astype(float)
    pairwise = rng.integers(0, 5, (rng.choice([2, 4]), height, width)).astype(float)
    domain = None if rng.random() < 0.5 else rng.random((height, width)) < 0.8
    start = None if rng.random() < 0.5 else rng.integers(0, count, (height, width))
    return unary, pairwise, domain, start


def least(unary: np.ndarray, pairwise: np.ndarray, domain: np.ndarray | None) -> float:
    inside = np.ones(unary.shape[1:], bool) if domain is None else domain
    best = np.inf
    for choice in itertools.product(range(len(unary)), repeat=int(inside.sum())):
        labels = np.full(inside.shape, OUTSIDE)
        labels[inside] = choice
        best = min(best, energy(labels, unary, pairwise, domain=domain))
    return best


@pytest.mark.parametrize("minimise", [expand, swap])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_the_energy_falls_at_every_move_and_never_ends_above_its_start(minimise, seed: int):
    unary, pairwise, domain, start = problem(seed, most=6)
    begun = unary.argmin(axis=0) if start is None else start
    begun = begun if domain is None else np.where(domain, begun, OUTSIDE)
    costs = [energy(begun, unary, pairwise, domain=domain)]
    seen = []

    def watch(labelling, move):
        costs.append(energy(labelling.labels, unary, pairwise, domain=domain))
        seen.append(labelling)

    found = minimise(unary, pairwise, domain=domain, start=start, on_move=watch)
    assert all(after < before for before, after in itertools.pairwise(costs))
    assert found.energy == costs[-1] == energy(found.labels, unary, pairwise, domain=domain)
    if domain is not None:
        assert (found.labels[~domain] == OUTSIDE).all()
    if seen:
        np.testing.assert_array_equal(seen[-1].labels, found.labels)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_an_expansion_ends_within_twice_the_least_and_two_labels_at_the_least(seed: int):
    unary, pairwise, domain, start = problem(seed)
    best = least(unary, pairwise, domain)
    found = expand(unary, pairwise, domain=domain, start=start)
    assert best <= found.energy <= 2 * best
    if len(unary) <= 2:
        assert found.energy == best == swap(unary, pairwise, domain=domain, start=start).energy


def test_three_who_touch_are_parted_where_the_picture_has_edges():
    """Each is sure of a place; the ground between is free, and costs least to part where the edges are weak."""
    width = 11
    unary = np.zeros((3, 1, width))
    for label, place in enumerate((1, 5, 9)):
        unary[:, 0, place] = 20.0
        unary[label, 0, place] = 0.0
    pairwise = np.full((2, 1, width), 6.0)
    pairwise[0, 0, 3] = pairwise[0, 0, 7] = 1.0  # between 3 and 4, 7 and 8
    for minimise in (expand, swap):
        found = minimise(unary, pairwise, start=np.zeros((1, width), int))
        assert found.energy == 2.0
        assert "".join(map(str, found.labels[0])) == "00001111222"


def test_one_label_and_no_pixel_are_labellings_too():
    weights = np.ones((4, 2, 2))
    assert expand(np.ones((1, 2, 2)), weights).energy == 4.0
    nobody = np.zeros((2, 2), bool)
    assert expand(np.ones((3, 2, 2)), weights, domain=nobody).energy == 0.0
    assert expand(np.ones((3, 0, 0)), np.ones((4, 0, 0))).labels.shape == (0, 0)


def test_a_weight_that_cannot_be_is_refused_by_name_and_place():
    unary, weights = np.zeros((3, 2, 2)), np.ones((4, 2, 2))
    unary[2, 0, 1] = np.inf
    with pytest.raises(ParameterError, match=r"unary\[2, 0, 1\] = inf: it must be finite"):
        expand(unary, weights)
    unary[2, 0, 1], weights[1, 0, 1] = 0.0, -2.0
    with pytest.raises(ParameterError, match=r"pairwise \(S\)\[0, 1\] = -2.0: it must be finite and ≥ 0"):
        swap(unary, weights)
    with pytest.raises(ParameterError, match="they must be"):
        expand(unary[0], weights)
    with pytest.raises(ParameterError, match="start has labels that are not there: they must be 0 to 2"):
        expand(unary, np.ones((4, 2, 2)), start=np.full((2, 2), 3))
    with pytest.raises(ParameterError, match=r"start has the shape \(3,\)"):
        expand(unary, np.ones((4, 2, 2)), start=np.zeros(3, int))
    with pytest.raises(ParameterError, match="domain is int64"):
        expand(unary, np.ones((4, 2, 2)), domain=np.zeros((2, 2), np.int64))

"""Kernels that compare boxes and count numbers, against their twins: equal to the last bit."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from perdure.maths.kernels.counts import sharing, sharing_twin, uncontested, uncontested_twin
from perdure.maths.kernels.overlaps import distances, distances_twin, nearby, nearby_twin, shares, shares_twin


def boxes(rng: np.random.Generator, count: int) -> np.ndarray:
    """Boxes of all sizes, some on whole pixels, some without area."""
    corner, size = rng.uniform(-20, 120, (count, 2)), rng.uniform(0, 90, (count, 2))
    size[rng.random(count) < 0.1] = 0
    found = np.hstack([corner, corner + size])
    return np.where(rng.random((count, 1)) < 0.5, np.round(found), found).astype(np.float32)


def assert_same(ours, twins):
    for one, other in zip(ours, twins, strict=True):
        assert one.dtype == other.dtype
        assert np.array_equal(one, other)


@given(st.integers(0, 2**32 - 1), st.integers(0, 12), st.integers(0, 12), st.floats(0, 1), st.floats(1, 9))
@settings(max_examples=60, deadline=None)
def test_boxes_nearby_are_those_of_the_whole_matrix(seed, count, others, farthest, ratio):
    rng = np.random.default_rng(seed)
    one, other = boxes(rng, count), boxes(rng, others)
    assert_same(nearby(one, other, farthest, ratio), nearby_twin(one, other, farthest, ratio))


@given(st.integers(0, 2**32 - 1), st.integers(0, 12), st.integers(0, 12))
@settings(max_examples=60, deadline=None)
def test_distances_of_boxes_are_those_of_the_whole_matrix(seed, count, others):
    rng = np.random.default_rng(seed)
    one, other = boxes(rng, count), boxes(rng, others)
    assert_same([distances(one, other)], [distances_twin(one, other)])


@given(st.integers(0, 2**32 - 1), st.integers(0, 12), st.integers(0, 12))
@settings(max_examples=60, deadline=None)
def test_shares_of_boxes_are_those_of_the_whole_matrix(seed, count, others):
    rng = np.random.default_rng(seed)
    one, other = boxes(rng, count), boxes(rng, others)
    assert_same([shares(one, other)], [shares_twin(one, other)])


@given(st.lists(st.tuples(st.integers(-1, 6), st.booleans()), max_size=12))
@settings(max_examples=60, deadline=None)
def test_who_shares_a_number_is_what_whole_columns_say(rows):
    numbers, counted = np.array([row[0] for row in rows], np.int64), np.array([row[1] for row in rows], np.bool_)
    assert_same([sharing(numbers, counted)], [sharing_twin(numbers, counted)])


@given(st.sets(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=12))
@settings(max_examples=60, deadline=None)
def test_entries_alone_are_what_whole_columns_say(entries):
    rows, columns = np.array(sorted(entries), np.int64).reshape(-1, 2).T.copy()
    assert_same([uncontested(rows, columns)], [uncontested_twin(rows, columns)])


def test_a_box_in_the_middle_of_another_lies_in_it_and_holds_a_quarter():
    small, large = np.float32([[1, 1, 3, 3]]), np.float32([[0, 0, 4, 4]])
    assert shares(small, large).tolist() == [[1.0]]
    assert shares(large, small).tolist() == [[0.25]]
    assert [one.tolist() for one in nearby(small, large, 0.8, 4.0)] == [[0], [0], [0.75], [True]]
    assert not len(nearby(small, large, 0.7, 4.0)[0])

"""Points met again against a plain second implementation."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.kernels.nearest_alike import nearest_alike, nearest_alike_twin


def met(kernel, expected, reach, before, places, now, least):
    found, alike = np.full(len(expected), 7), np.full(len(expected), np.nan, np.float32)
    kernel(
        expected, reach, before, places, now, least, found, alike,
        np.empty(len(places), np.int64), np.empty(len(places), np.float32), np.empty(len(places), np.int64),
    )  # fmt: skip
    return found, alike


@given(st.integers(0, 2**32 - 1), st.integers(0, 25), st.integers(0, 25), st.integers(1, 12), st.integers(1, 255))
def test_points_met_are_those_of_every_pair(seed, olds, news, size, range_of_looks):
    rng = np.random.default_rng(seed)
    expected = rng.random((olds, 2), np.float32) * 20
    places = rng.random((news, 2), np.float32) * 20
    places = places[np.argsort(places[:, 1])]
    before, now = (rng.integers(0, range_of_looks, (count, size), dtype=np.uint8) for count in (olds, news))
    given = (expected, rng.random(olds, np.float32) * 12, before, places, now, 0.5)
    for one, other in zip(met(nearest_alike, *given), met(nearest_alike_twin, *given), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)


def test_of_two_points_that_want_the_same_one_only_the_likest_has_it():
    expected = np.zeros((2, 2), np.float32)
    before = np.array([[200, 100], [200, 0]], np.uint8)
    found, alike = met(
        nearest_alike, expected, np.full(2, 5, np.float32), before, expected[:1], before[1:].copy(), 0.1
    )
    assert found.tolist() == [-1, 0]
    assert alike.tolist() == [0, 1]

"""Differences of neighbours against a plain second implementation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.kernels.differences import squared_differences, squared_differences_twin


@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(1, 9))
def test_differences_are_those_of_the_twin(seed, height, width):
    colours = np.random.default_rng(seed).uniform(0, 255, (height, width, 3)).astype(np.float32)
    one, other = np.full((2, 4, height, width), np.nan, np.float32)
    sums = squared_differences(colours, one), squared_differences_twin(colours, other)
    np.testing.assert_allclose(one, other, rtol=1e-5)
    assert sums[0] == pytest.approx(sums[1], rel=1e-5)

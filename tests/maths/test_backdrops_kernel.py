"""Learning what is behind everything, against a plain second implementation."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.kernels.backdrops import learn, learn_twin


@given(st.integers(0, 2**32 - 1), st.integers(0, 9), st.integers(0, 9))
def test_a_backdrop_is_learnt_as_the_twin_learns_it(seed, height, width):
    rng = np.random.default_rng(seed)
    colours = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    mean = (colours + rng.normal(0, 10 ** rng.uniform(-1, 2), colours.shape)).astype(np.float32)
    variance = rng.uniform(0.1, 90, (height, width)).astype(np.float32)
    known, things = rng.random((2, height, width)) < 0.5
    results = []
    for function in (learn, learn_twin):
        results.append((mean.copy(), variance.copy(), known.copy()))
        function(colours, things, np.float32(9), *results[-1])
    for one, other in zip(*results, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-2)
    for one, before in zip(results[0], (mean, variance, known), strict=True):
        assert np.array_equal(one[things], before[things])

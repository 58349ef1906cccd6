"""The background kernel against its NumPy twin, bit by bit."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.kernels.gaussian import compare_and_learn, compare_and_learn_twin


@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(1, 9))
def test_the_kernel_and_its_twin_agree_in_every_bit(seed, height, width):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    exposure = rng.uniform(0.5, 2.0, 3).astype(np.float32)
    mean = rng.uniform(0, 255, (height, width, 3)).astype(np.float32)
    variance = rng.uniform(0, 900, (height, width)).astype(np.float32)
    numbers = [
        np.float32(value)
        for value in (rng.uniform(1, 20), rng.uniform(1, 50), rng.uniform(), rng.uniform(), rng.uniform())
    ]
    results = []
    for function in (compare_and_learn, compare_and_learn_twin):
        state = mean.copy(), variance.copy(), np.full((height, width), 7, np.uint8)
        function(image, exposure, *state, *numbers)
        results.append(state)
    for one, other in zip(*results, strict=True):
        np.testing.assert_array_equal(one, other)

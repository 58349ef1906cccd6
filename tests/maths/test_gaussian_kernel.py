"""The background kernels against their NumPy twins."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.kernels.gaussian import (
    DARKENED,
    MOVING,
    SHADOW,
    WEAK,
    compare_and_learn,
    compare_and_learn_twin,
)
from perdure.maths.kernels.shadow import evenly_darker, evenly_darker_twin


@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(1, 9))
def test_the_kernel_and_its_twin_agree_in_every_bit(seed, height, width):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    exposure = rng.uniform(0.5, 2.0, 3).astype(np.float32)
    mean = rng.uniform(0, 255, (height, width, 3)).astype(np.float32)
    alike = rng.uniform(size=(height, width)) < 0.5  # things of the ground's colour: shadows of every depth
    shade = rng.uniform(0.2, 1.1, (height, width, 1)).astype(np.float32)
    mean[alike] = np.clip(image * exposure / shade, 0, 400)[alike]
    variance = rng.uniform(0, 900, (height, width)).astype(np.float32)
    held = rng.choice(np.uint8([0, 0, 1]), (height, width))
    numbers = [
        np.float32(value)
        for value in (
            rng.uniform(1, 20),
            rng.uniform(1, 50),
            rng.uniform(0.5, 1),
            rng.uniform(0, 0.5),
            rng.uniform(),
            rng.uniform(),
        )
    ]
    results = []
    for function in (compare_and_learn, compare_and_learn_twin):
        state = mean.copy(), variance.copy(), *(np.full((height, width), 7, np.uint8) for _ in range(2))
        mean_of_it, variance_of_it, *written = state
        function(image, exposure, mean_of_it, variance_of_it, held, *written, *numbers)
        results.append(state)
    for one, other in zip(*results, strict=True):
        np.testing.assert_array_equal(one, other)


@given(st.integers(0, 2**32 - 1), st.integers(1, 16), st.integers(1, 16))
def test_even_darkness_is_what_least_squares_say(seed, height, width):
    rng = np.random.default_rng(seed)
    marks = rng.choice(
        np.uint8([DARKENED, DARKENED, DARKENED, DARKENED, MOVING, SHADOW, WEAK, 0]), (height, width)
    )
    mean = rng.uniform(60, 200, (height, width, 3)).astype(np.float32)
    image = (mean * rng.choice([0.5, 0.6], (height, width, 1), p=[0.9, 0.1])).astype(np.uint8)
    variance = rng.uniform(0, 50, (height, width)).astype(np.float32)
    exposure = rng.uniform(0.9, 1.1, 3).astype(np.float32)
    one, other = (np.full((height, width), 9, np.uint8) for _ in range(2))
    for function, even in ((evenly_darker, one), (evenly_darker_twin, other)):
        function(image, exposure, mean, variance, marks, even, np.float32(25), np.float32(1.5))
    np.testing.assert_array_equal(one, other)

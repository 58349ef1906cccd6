"""The kernels behind regions against plain second implementations."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.kernels.basins import basins
from perdure.maths.kernels.enclosed import enclosed, enclosed_twin


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 12))
def test_what_is_enclosed_is_what_four_walks_say(seed, height, width):
    rng = np.random.default_rng(seed)
    seen = rng.choice(np.uint8([0, 127, 127, 255]), (height, width))
    one, other = seen.copy(), seen.copy()
    enclosed(one, rng.integers(0, 256, seen.shape, dtype=np.uint8))
    enclosed_twin(other, np.empty_like(seen))
    np.testing.assert_array_equal(one, other)


def descending(relief: np.ndarray) -> np.ndarray:
    return np.argsort(relief, axis=None, kind="stable")[::-1][: np.count_nonzero(relief)]


def flood(relief: np.ndarray, level: int) -> np.ndarray:
    """The 8-connected components of the pixels at or above a level, by repeated spreading; 0 below."""
    labels = np.where(relief >= level, np.arange(1, relief.size + 1).reshape(relief.shape), 0)
    while True:
        padded = np.pad(labels, 1)
        around = [
            padded[1 + y : padded.shape[0] - 1 + y, 1 + x : padded.shape[1] - 1 + x]
            for y in (-1, 0, 1)
            for x in (-1, 0, 1)
        ]
        spread = np.where(labels > 0, np.max(around, axis=0), 0)
        if np.array_equal(spread, labels):
            return labels
        labels = spread


@given(st.integers(0, 2**32 - 1))
def test_without_a_neck_basins_are_connected_components(seed):
    relief = np.random.default_rng(seed).integers(0, 4, (9, 11)).astype(np.uint16)
    found = basins(relief, descending(relief), 0.0, 0.0, 0.0, 0.0)
    same = {(int(one), int(other)) for one, other in zip(found.ravel(), flood(relief, 1).ravel(), strict=True)}
    assert len(same) == len({one for one, _ in same}) == len({other for _, other in same})


def test_two_peaks_are_apart_where_the_pass_is_low_beside_the_lower():
    relief = np.uint16([[0, 9, 9, 3, 8, 8, 0]])
    order = descending(relief)
    assert basins(relief, order, 0.4, 0.5, 0.5, 1).max() != basins(relief, order, 0.3, 0.5, 0.5, 1).max()
    assert len(np.unique(basins(relief, order, 0.4, 0.5, 0.5, 1))) == 3  # 0 and two
    assert len(np.unique(basins(relief, order, 0.4, 0.9, 0.5, 1))) == 2  # 8 is less than nine tenths of 9
    assert len(np.unique(basins(relief, order, 0.4, 0.5, 0.5, 3))) == 2  # two pixels are too few


def test_a_picture_of_nothing_has_no_basin():
    relief = np.zeros((3, 4), np.uint16)
    assert not basins(relief, descending(relief), 0.3, 0.6, 0.5, 1).any()

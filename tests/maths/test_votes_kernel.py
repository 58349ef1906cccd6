"""Votes by place and colour against a plain second implementation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.kernels.votes import BINS, CELL, bins_of, bins_of_twin, weigh, weigh_twin


def voted(kernels, before, own, colours, bound):
    find, count = kernels
    bins = np.full((2, *own.shape), -1, np.int32)
    find(before, bins[0])
    find(colours, bins[1])
    out = np.full(own.shape, np.nan, np.float32)
    count(bins[0], own, bins[1], bound, np.zeros((2, BINS), np.int32), np.empty(BINS, np.float32), out)
    return out


@given(st.integers(0, 2**32 - 1), st.integers(1, 70), st.integers(1, 70), st.integers(1, 256))
def test_votes_are_those_of_every_bin_of_every_place(seed, height, width, range_of_colours):
    rng = np.random.default_rng(seed)
    first = rng.integers(0, 257 - range_of_colours)
    before, colours = rng.integers(first, first + range_of_colours, (2, height, width, 3), dtype=np.uint8)
    own = rng.random((height, width)) < rng.random()
    one = voted((bins_of, weigh), before, own, colours, 4.0)
    other = voted((bins_of_twin, weigh_twin), before, own, colours, 4.0)
    np.testing.assert_allclose(one, other, atol=1e-5)


@pytest.mark.parametrize(("own", "said"), [(True, 1.0), (False, -1.0)])
def test_where_all_vote_alike_nine_places_are_counted(own, said):
    grey = np.full((3 * CELL, 3 * CELL, 3), 99, np.uint8)
    votes = voted((bins_of, weigh), grey, np.full(grey.shape[:2], own), grey, 9.0)
    assert votes[CELL, CELL] == pytest.approx(said * np.log(9 * CELL**2 / 243 / 0.02 + 1), abs=1e-5)


def test_a_picture_without_pixels_has_no_votes():
    none = np.zeros((0, 0, 3), np.uint8)
    assert voted((bins_of, weigh), none, np.zeros((0, 0), bool), none, 4.0).shape == (0, 0)

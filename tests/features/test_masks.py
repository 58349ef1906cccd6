import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.features.masks import disjoint, of_run_lengths, run_lengths
from perdure.types import Mask


def drawn(picture: str, y: int = 0, x: int = 0) -> Mask:
    return Mask(y, x, np.array([[mark == "#" for mark in row] for row in picture.split()]))


@st.composite
def masks(draw):
    height, width = draw(st.integers(0, 6)), draw(st.integers(0, 6))
    bits = draw(st.lists(st.booleans(), min_size=height * width, max_size=height * width))
    return Mask(draw(st.integers(-5, 12)), draw(st.integers(-5, 12)), np.array(bits, bool).reshape(height, width))


def test_run_lengths_go_down_the_columns_and_begin_with_nothing():
    assert run_lengths(drawn(".# ## ..")) == [1, 1, 1, 2, 1]


@given(masks())
def test_run_lengths_read_back_as_the_same_mask(mask):
    assert of_run_lengths(run_lengths(mask), mask.y, mask.x, *mask.bits.shape) == mask


@pytest.mark.parametrize("runs", [[3], [2, 3], [-1, 5], []])
def test_runs_that_do_not_fill_the_crop_are_refused(runs):
    with pytest.raises(ValueError, match="do not fill"):
        of_run_lengths(runs, 0, 0, 2, 2)


@given(st.lists(masks(), max_size=4))
def test_disjoint_masks_share_no_pixel_lie_inside_and_lose_none_that_was_claimed_first(given_masks):
    cut = disjoint(given_masks, 10, 9)
    pictures = [mask.to_image(10, 9).astype(int) for mask in cut]
    claimed = [mask.to_image(10, 9) for mask in given_masks]
    if cut:
        assert np.array_equal(np.sum(pictures, axis=0) > 0, np.any(claimed, axis=0))
        assert np.sum(pictures, axis=0).max() <= 1
        assert np.array_equal(pictures[0] > 0, claimed[0])
    for mask, picture in zip(cut, pictures, strict=True):
        assert mask.area == picture.sum()
        assert mask.area == 0 or Mask.of_image(picture > 0).box == mask.box

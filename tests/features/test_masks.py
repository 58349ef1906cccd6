import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycocotools import mask as coco

from perdure.features.masks import (
    disjoint,
    mask_overlaps,
    mask_shares,
    of_picture_runs,
    picture_runs,
)
from perdure.types import Mask
from perdure.types.frame import of_run_lengths, run_lengths


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


@given(st.lists(masks(), max_size=4), st.lists(masks(), max_size=4))
def test_overlaps_and_shares_are_those_of_whole_pictures_as_pycocotools_counts_them(one, other):
    one, other = disjoint(one, 10, 9), disjoint(other, 10, 9)
    overlaps, shares = mask_overlaps(one, other), mask_shares(one, other)
    assert overlaps.shape == shares.shape == (len(one), len(other))
    if one and other:
        packed = [
            [coco.encode(np.asfortranarray(mask.to_image(10, 9), np.uint8)) for mask in side]
            for side in (one, other)
        ]
        theirs = np.array(coco.iou(*packed, [False] * len(other)))
        crowd = np.array(coco.iou(*packed, [True] * len(other)))  # intersection / area of the first
        empty = np.array([mask.area == 0 for mask in one])
        both = empty[:, None] & np.array([mask.area == 0 for mask in other])
        assert np.array_equal(overlaps, np.where(both, 0, theirs))
        assert np.array_equal(shares, np.where(empty[:, None], 0, crowd))


def test_silhouettes_apart_or_without_a_pixel_share_nothing():
    masks = [Mask.empty(), drawn("## ##"), drawn("##", y=50), Mask(0, 0, np.zeros((3, 3), bool))]
    assert np.array_equal(mask_overlaps(masks, masks), np.diag([0.0, 1.0, 1.0, 0.0]))
    assert np.array_equal(mask_shares(masks, masks), np.diag([0.0, 1.0, 1.0, 0.0]))
    assert mask_overlaps([], masks).shape == (0, 4)


@given(masks())
def test_runs_of_the_picture_are_those_of_the_mask_drawn_in_it(mask):
    picture = mask.to_image(10, 9)
    runs = picture_runs(mask, 10, 9)
    assert np.array_equal(np.repeat(np.arange(len(runs)) % 2 == 1, runs), picture.ravel(order="F"))
    assert (runs[1:] > 0).all()
    assert of_picture_runs(runs, 10, 9) == Mask.of_image(picture)


@pytest.mark.parametrize("runs", [[], [3], [5], [-1, 5], [1 << 62, 1 << 62, 1 << 62, 1 << 62, 4]])
def test_runs_that_do_not_fill_the_picture_are_refused(runs):
    with pytest.raises(ValueError, match="do not fill"):
        of_picture_runs(np.array(runs, np.int64), 2, 2)

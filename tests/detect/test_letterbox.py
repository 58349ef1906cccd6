"""Pictures fitted into inputs, and boxes brought back."""

from __future__ import annotations

import numpy as np
import pytest

from perdure.detect.letterbox import CORNER, GREY, MIDDLE, STRETCHED, Fit

WIDE = np.full((30, 60, 3), (200, 100, 0), np.uint8)


def test_a_wide_picture_lies_in_the_corner_with_grey_below_and_blue_first():
    given = Fit(120, 120, CORNER, bgr=True, most=255.0).fitted(WIDE)
    assert given.shape == (120, 120, 3)
    assert given.dtype == np.float32
    assert (given[:60] == (0, 100, 200)).all()
    assert (given[60:] == GREY).all()


def test_a_wide_picture_lies_in_the_middle_with_red_first_from_0_to_1():
    given = Fit(120, 120).fitted(WIDE)
    np.testing.assert_allclose(
        given[30:90], np.broadcast_to(np.float32([200, 100, 0]) / 255, (60, 120, 3)), rtol=1e-6
    )
    np.testing.assert_allclose(given[:30], GREY / 255)
    np.testing.assert_allclose(given[90:], GREY / 255)


def test_a_stretched_picture_fills_the_input():
    assert (Fit(120, 40, STRETCHED, most=255.0).fitted(WIDE) == (200, 100, 0)).all()


def test_colours_are_normalised_where_that_is_wanted():
    given = Fit(30, 60, mean=(0.5, 0.5, 0.5), spread=(0.25, 0.5, 1.0)).fitted(WIDE)
    np.testing.assert_allclose(given[0, 0], [(200 / 255 - 0.5) * 4, (100 / 255 - 0.5) * 2, -0.5], rtol=1e-5)


@pytest.mark.parametrize("place", [CORNER, MIDDLE, STRETCHED])
@pytest.mark.parametrize("size", [(30, 60), (61, 29), (64, 64), (7, 500)])
def test_a_box_that_is_seen_in_the_input_comes_back_to_where_it_was(place, size):
    height, width = size
    image = np.zeros((height, width, 3), np.uint8)
    image[height // 4 : height // 2, width // 4 : width // 2] = 255
    fit = Fit(128, 160, place)
    bright = fit.fitted(image)[..., 0] > 0.5
    assert bright.any()
    rows, columns = np.flatnonzero(bright.any(axis=1)), np.flatnonzero(bright.any(axis=0))
    seen = np.float32([[columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]])
    box = fit.back(seen, height, width)[0]
    one = np.array([width / 160, height / 128]).max() + 1e-3  # a pixel of the input in the picture
    np.testing.assert_allclose(box, [width // 4, height // 4, width // 2, height // 2], atol=max(one, 1.0))
    assert fit.back(np.zeros((0, 4), np.float32), height, width).shape == (0, 4)


def test_a_picture_of_the_inputs_size_is_given_as_it_is():
    image = np.random.default_rng(1).integers(0, 256, (32, 48, 3)).astype(np.uint8)
    before = image.copy()
    assert np.array_equal(Fit(32, 48, MIDDLE, most=255.0).fitted(image), image.astype(np.float32))
    assert np.array_equal(image, before)

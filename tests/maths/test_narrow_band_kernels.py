"""The kernels of level sets against their twins, on any pictures."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.kernels.narrow_band import PIECES, borders, carry, measure, pieces, rates, sample
from perdure.maths.kernels.narrow_band_twin import (
    borders_twin,
    carry_twin,
    measure_twin,
    pieces_twin,
    rates_twin,
    sample_twin,
)

pictures = given(st.integers(0, 2**32 - 1), st.integers(1, 14), st.integers(1, 14))


def picture(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    """Noise, or something smoother, or whole numbers with zeros among them."""
    kind, noise = rng.integers(3), rng.normal(0, 2, (height, width))
    if kind == 0:
        return noise
    return cv2.GaussianBlur(noise, (0, 0), 1.5) * 4 if kind == 1 else noise.round()


def found_by(function, phi: np.ndarray, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    ends, edges = np.zeros((PIECES * len(pixels), 4)), np.zeros((PIECES * len(pixels), 2), np.int64)
    number = function(phi, pixels, ends, edges)
    order = np.lexsort(edges[:number].T)
    return ends[:number][order], edges[:number][order]


@pictures
def test_pieces_of_the_contour_are_those_of_a_table_of_all_cells(seed, height, width):
    rng = np.random.default_rng(seed)
    phi = picture(rng, height, width)
    pixels = np.flatnonzero(rng.random(phi.size) < 0.9)
    (ends, edges), (ends_of_it, edges_of_it) = (found_by(one, phi, pixels) for one in (pieces, pieces_twin))
    np.testing.assert_array_equal(edges, edges_of_it)
    np.testing.assert_array_equal(ends, ends_of_it)


@pictures
def test_distances_in_the_band_are_the_least_of_all(seed, height, width):
    rng = np.random.default_rng(seed)
    phi, band = picture(rng, height, width), float(rng.uniform(0.2, 5))
    ends, _ = found_by(pieces, phi, np.arange(phi.size))
    results = []
    for function in (measure, measure_twin):
        near, pixels = phi.copy(), np.arange(phi.size)
        number = function(near, phi, ends, band, pixels, phi.size)
        results.append((near, np.sort(pixels[:number])))
        sure = np.abs(near) > 0.1
        np.testing.assert_array_equal((near < 0)[sure], (phi < 0)[sure])
    np.testing.assert_allclose(results[0][0], results[1][0], rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(results[0][1], results[1][1])


@pictures
def test_distances_from_the_border_are_those_to_the_nearest_pixel_of_the_other_kind(seed, height, width):
    rng = np.random.default_rng(seed)
    mask = picture(rng, height, width) < rng.normal()
    if mask.all() or not mask.any():
        return
    found, expected = np.full(mask.shape, np.nan), np.full(mask.shape, np.nan)
    borders(mask, np.full((3, width + 3), np.nan), found)
    borders_twin(mask, np.empty((3, width + 3)), expected)
    np.testing.assert_array_equal(found, expected)


@pictures
def test_rates_are_those_of_whole_pictures(seed, height, width):
    rng = np.random.default_rng(seed)
    phi, force = picture(rng, height, width), rng.normal(0, 2, (height, width)).round(1)
    domain, pixels = rng.random(phi.shape) < 0.8, rng.permutation(phi.size)[: phi.size * 3 // 4]
    for curvature in (0.0, 0.7):
        one, other = np.full((2, len(pixels)), np.nan)
        fastest = [f(phi, pixels, force, domain, curvature, o) for f, o in ((rates, one), (rates_twin, other))]
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-11)
        assert fastest[0] == pytest.approx(fastest[1])


@pictures
def test_values_between_pixels_are_those_of_scipy(seed, height, width):
    rng = np.random.default_rng(seed)
    phi, points = picture(rng, height, width), rng.uniform(-5, 20, (30, 2))
    back, scale = np.eye(3) + rng.normal(0, 0.3, (3, 3)), float(rng.uniform(0.5, 2))
    one, other = np.zeros((2, 30))
    sample(phi, points, one)
    sample_twin(phi, points, other)
    np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
    one, other = np.zeros((2, 6, 9))
    carry(phi, back, scale, one)
    carry_twin(phi, back, scale, other)
    np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)

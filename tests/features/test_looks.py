"""How things look: histogram, covariance, dominant colours, and the pyramid they stand on."""

import numpy as np
import pytest

from perdure.features.covariance import ColourCovariance
from perdure.features.dominant import DominantColours
from perdure.features.histogram import ColourHistogram
from perdure.features.pool import known
from perdure.features.pyramid import pyramid_distance, with_coarser
from perdure.maths.kernels import colours, covariances, dominant
from perdure.types import Frame, Mask, Regions

LOOKS = [ColourHistogram(), ColourCovariance(), DominantColours()]
each = pytest.mark.parametrize("feature", LOOKS, ids=lambda one: one.name)


def painted(seed=0, height=60, width=80):
    """A picture of coloured blocks of 5 x 5, a little noisy."""
    rng = np.random.default_rng(seed)
    blocks = rng.integers(20, 220, (height // 5, width // 5, 3)).repeat(5, axis=0).repeat(5, axis=1)
    return (blocks + rng.integers(-5, 6, blocks.shape)).astype(np.uint8)


def rows_of(feature, image, boxes, masks=None):
    return feature.describe({}, Frame(0, 0.0, image), Regions.of(boxes, masks=masks))[1]


def alike(feature, one, other):
    return feature.similarity(one, other, np.ones(len(one)))


@each
def test_each_is_like_itself_and_as_like_the_other_as_the_other_is_to_it(feature):
    rows = rows_of(feature, painted(), [[0, 0, 40, 60], [40, 0, 80, 60], [10, 5, 43.5, 50.2]])
    np.testing.assert_allclose(alike(feature, rows, rows), 1, atol=1e-5)
    there, back = alike(feature, rows, rows[::-1]), alike(feature, rows[::-1], rows)
    np.testing.assert_allclose(there, back, atol=1e-5)
    assert ((there >= 0) & (there <= 1)).all()
    assert there[0] < 0.999


@each
def test_where_nothing_is_seen_nothing_is_known(feature):
    boxes = [[5, 5, 5, 30], [-50, 0, -10, 40], [90, 70, 120, 99], [0, 0, 40, 40]]
    masks = [Mask.empty()] * 3 + [Mask(0, 0, np.zeros((40, 40), bool))]
    rows = rows_of(feature, painted(), boxes, masks)
    assert not known(rows).any()
    assert not rows_of(feature, None, [[0, 0, 40, 40]]).any()
    assert alike(feature, rows, rows).tolist() == [0, 0, 0, 0]
    none = rows_of(feature, painted(), np.zeros((0, 4)))
    assert alike(feature, none, none).shape == (0,)


@each
def test_a_pixel_and_a_thing_of_one_colour_are_compared_without_nonsense(feature):
    grey = np.full((60, 80, 3), 77, np.uint8)
    rows = rows_of(feature, grey, [[3, 3, 4, 4], [0, 0, 40, 60], [75, 50, 130, 90]])
    found = alike(feature, rows[[0, 1, 1]], rows[[1, 1, 2]])
    assert np.isfinite(rows).all()
    assert ((found >= 0) & (found <= 1)).all()
    assert found[1] == pytest.approx(1, abs=1e-5)


@each
def test_only_what_is_under_the_mask_counts(feature):
    bits = np.zeros((60, 40), bool)
    bits[10:50, 5:35] = True
    first, second = painted(1), painted(2)
    second[10:50, 5:35] = first[10:50, 5:35]
    masks = [Mask(11, 6, bits[11:49, 6:34])]  # a pixel within, for the gradients
    one, other = (rows_of(feature, image, [[0, 0, 40, 60]], masks) for image in (first, second))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("feature", LOOKS[1:], ids=lambda one: one.name)
def test_a_half_hidden_person_is_still_like_herself(feature):
    image, hidden = painted(1, 120), painted(1, 120)
    hidden[:60] = painted(2)  # the upper half is behind something
    box = [[0, 0, 40, 120]]
    one, half, stranger = (rows_of(feature, each, box) for each in (image, hidden, painted(3, 120)))
    assert alike(feature, one, half)[0] > alike(feature, one, stranger)[0] + 0.1


def test_a_shift_of_the_light_leaves_the_covariance_alike():
    feature, image = ColourCovariance(), painted()
    one, brighter = (rows_of(feature, each, [[0, 0, 40, 60]]) for each in (image, image + np.uint8(30)))
    assert alike(feature, one, brighter)[0] == pytest.approx(1, abs=1e-3)


def test_a_large_box_is_looked_at_through_a_grid():
    image = painted().repeat(8, axis=0).repeat(8, axis=1)
    whole = rows_of(ColourHistogram(), image, [[0, 0, 640, 480]])
    counted = np.zeros((3, 16), np.int64)
    colours.count_channels_twin(image[::9, ::9], np.ones(image[::9, ::9].shape[:2], bool), counted)
    np.testing.assert_allclose(whole[0].reshape(3, 16), counted / counted[0].sum(), atol=1e-6)


def test_coarser_cells_are_the_sums_of_finer_ones_and_the_nearer_half_counts():
    finest = np.arange(16).reshape(1, 4, 4)
    assert with_coarser(finest)[0, :5].tolist() == [120, 10, 18, 42, 50]
    cells = np.array([[4, 0, 1, np.inf, 9], [np.inf] * 5], np.float32)
    assert pyramid_distance(cells).tolist() == pytest.approx([4 / 3 + 1 / 3, np.inf])


def test_histograms_are_those_of_numpy():
    image, bits = painted(), np.random.default_rng(0).random((60, 80)) < 0.5
    for bins in (1, 16, 100, 256):
        one, other = np.zeros((2, 3, bins), np.int64)
        colours.count_channels(image, bits, one)
        colours.count_channels_twin(image, bits, other)
        np.testing.assert_array_equal(one, other)


def test_covariances_and_their_distances_are_those_of_lapack():
    image, bits = painted(), np.random.default_rng(0).random((28, 37)) < 0.8
    sums = np.zeros((2, 16, covariances.WIDE**2))
    box, one = np.array([-3.0, 0.0, 80.0, 70.0]), np.empty(covariances.WIDE)
    for add, out in zip((covariances.add_products, covariances.add_products_twin), sums, strict=True):
        add(image, bits, 1, 3, 2, box, 4, one, out)
    np.testing.assert_allclose(sums[0], sums[1], atol=0.05)  # an arctangent to 1e-5 a pixel
    factors = np.empty((2, 16, covariances.PACKED), np.float32)
    for factor, out in zip((covariances.factor, covariances.factor_twin), factors, strict=True):
        factor(sums[0], 20, 0.001, 1e-6, np.empty((11, 11)), out)
    np.testing.assert_allclose(factors[0], factors[1], atol=1e-5)
    far = np.empty((2, 16), np.float32)
    for measure, out in zip((covariances.forstner, covariances.forstner_twin), far, strict=True):
        measure(factors[0], factors[0][::-1].copy(), np.empty((24, 12)), np.empty((4, 12)), out)
    np.testing.assert_allclose(far[0], far[1], rtol=1e-4, atol=1e-5)


def test_dominant_colours_are_those_of_the_twin():
    image, bits = painted(), np.random.default_rng(0).random((60, 80)) < 0.8
    rows, columns = np.arange(60) // 30 * 2, np.arange(80) // 40
    sums = np.zeros((2, 4, dominant.BINS, 4), np.int32)
    for tally, out in zip((dominant.tally, dominant.tally_twin), sums, strict=True):
        tally(image, bits, rows, columns, out)
    np.testing.assert_array_equal(sums[0], sums[1])
    found = np.empty((2, 4, 5, 4), np.float32)
    for find, out in zip((dominant.dominant, dominant.dominant_twin), found, strict=True):
        find(sums[0], 10, 60.0, 4, np.empty((dominant.BINS, 4)), np.empty((10, 4)), out)
    np.testing.assert_allclose(found[0], found[1], atol=1e-3)
    far = np.empty((2, 4), np.float32)
    for measure, out in zip((dominant.unlikeness, dominant.unlikeness_twin), far, strict=True):
        measure(found[0], found[0][::-1].copy(), 60.0, 60.0, out)
    np.testing.assert_allclose(far[0], far[1], atol=1e-5)

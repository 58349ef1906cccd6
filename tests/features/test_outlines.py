"""Contours of silhouettes: at the edges of pixels, as polygons, thinned, and parted into what is seen and what is not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from shapely.geometry import MultiPolygon, Polygon

from perdure.features.outlines import mask_of, outline_of, outline_of_box, polygons, seen_and_hidden, thinned
from perdure.types import Mask, Outline


def mask(*lines: str, x: int = 0, y: int = 0) -> Mask:
    return Mask(y, x, np.array([[letter == "#" for letter in line] for line in lines]))


def shape_of(outline: Outline) -> MultiPolygon:
    return MultiPolygon([Polygon(one.outer, one.holes) for one in polygons(outline)])


@given(arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=8)), st.integers(-5, 5), st.integers(-5, 5))
def test_the_outline_of_any_pixels_is_a_valid_shape_that_covers_them_and_nothing_else(bits, x, y):
    found = shape_of(outline_of(Mask(y, x, bits)))
    assert found.is_valid
    assert found.area == bits.sum()
    pixels = [
        Polygon([(c, r), (c + 1, r), (c + 1, r + 1), (c, r + 1)]) for r, c in np.argwhere(bits) + np.array([y, x])
    ]
    assert all(found.covers(one) for one in pixels)


@given(arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=8)), st.integers(-5, 5), st.integers(-5, 5))
def test_the_pixels_inside_an_outline_are_those_that_it_was_made_of(bits, x, y):
    before = Mask.of_image(bits, y, x)
    assert mask_of(outline_of(before)) == before


def test_a_pixel_is_inside_a_contour_if_its_middle_is():
    triangle = Outline.of([[[0, 0], [4, 0], [0, 4]]])
    assert mask_of(triangle) == mask("###", "##.", "#..")
    assert mask_of(Outline(())) == Mask.empty()
    with pytest.raises(ValueError, match="too large to be drawn"):
        mask_of(Outline.of([[[0, 0], [9e5, 0], [9e5, 9e5]]]))


def test_holes_belong_to_the_part_around_them_and_parts_that_touch_by_corners_are_two():
    parts = polygons(
        outline_of(
            mask(
                "#####.",
                "#...#.",
                "#.#.#.",
                "#...#.",
                "#####.",
                ".....#",
            )
        )
    )
    areas = sorted((Outline((one.outer,)).area, len(one.holes)) for one in parts)
    assert areas == [(1, 0), (1, 0), (25, 1)]


def test_nothing_has_no_outline():
    assert outline_of(Mask.empty()).rings == ()
    assert outline_of_box([5, 5, 5, 9]).rings == ()
    assert polygons(Outline(())) == []
    assert outline_of_box([1, 2, 4, 4]).area == 6


def test_a_thinned_line_stays_as_near_as_is_asked():
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    ring = 1000 + 40 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = thinned(ring, 0.05)
    assert len(found) < 100
    assert Polygon(found).exterior.hausdorff_distance(Polygon(ring).exterior) < 0.06
    assert thinned(ring[:3], 50.0).tolist() == ring[:3].tolist()


def square(side: float, x: float = 0.0) -> Outline:
    return Outline.of([[[x, 0], [x + side, 0], [x + side, side], [x, side]]])


def test_a_half_that_is_hidden_is_one_line_and_the_half_that_is_seen_another():
    seen = Mask(0, 0, np.ones((60, 30), np.bool_))
    lines = seen_and_hidden(square(60), seen)
    assert (len(lines.seen), len(lines.hidden)) == (1, 1)
    assert lines.seen[0][:, 0].max() == pytest.approx(33, abs=1)
    assert lines.hidden[0][:, 0].min() == pytest.approx(33, abs=1)
    length = sum(np.hypot(*np.diff(line, axis=0).T).sum() for line in (*lines.seen, *lines.hidden))
    assert length == pytest.approx(240)


@pytest.mark.parametrize(("width", "whole"), [(60, "seen"), (0, "hidden")])
def test_what_is_seen_or_hidden_as_a_whole_is_one_closed_line(width, whole):
    (line,) = getattr(seen_and_hidden(square(60), Mask(0, 0, np.ones((60, width), np.bool_))), whole)
    assert line[0].tolist() == line[-1].tolist()


def test_small_gaps_in_what_is_seen_do_not_part_a_line():
    seen = np.ones((60, 60), np.bool_)
    seen[25:33, :9] = False
    assert len(seen_and_hidden(square(60), Mask(0, 0, seen)).seen) == 1
    assert not seen_and_hidden(square(60), Mask(0, 0, seen)).hidden


def test_a_line_of_less_than_a_triangle_is_refused_and_left_out():
    with pytest.raises(ValueError, match="three points"):
        Outline((np.zeros((2, 2)),))
    assert Outline.of([[[0, 0], [0.001, 0], [5, 5]], [[0, 0], [5, 0], [5, 5]]]).area == 12.5

"""Components against a second implementation, and what becomes of specks, gaps and holes."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from perdure.detect.components import clean, components
from perdure.types import Mask


def drawn(picture: str) -> np.ndarray:
    return np.array([[255 * (mark == "#") for mark in row] for row in picture.split()], np.uint8)


def by_labelling(foreground: np.ndarray, least_area: float) -> list[tuple]:
    count, labels = cv2.connectedComponents(foreground, connectivity=8)
    masks = [Mask.of_image(labels == label) for label in range(1, count)]
    return sorted((mask.box, mask.bits.tobytes()) for mask in masks if mask.area >= least_area)


@given(st.integers(0, 2**32 - 1), st.floats(0.2, 0.8), st.integers(1, 12))
def test_components_are_those_of_labelling_every_pixel(seed, density, least):
    rng = np.random.default_rng(seed)
    foreground = (255 * (rng.random((18, 23)) < density)).astype(np.uint8)
    found = components(foreground, least)
    assert sorted((mask.box, mask.bits.tobytes()) for mask in found.masks) == by_labelling(foreground, least)
    assert [tuple(box) for box in found.boxes] == [mask.box for mask in found.masks]


def test_a_hole_is_not_part_of_what_is_seen_and_an_island_in_it_is_another():
    found = components(
        drawn(
            """
            #######
            #.....#
            #.###.#
            #.....#
            #######
            """
        ),
        least_area=1,
    )
    assert sorted(mask.area for mask in found.masks) == [3, 20]


def test_touching_corners_connect():
    assert len(components(drawn("##.. ##.. ..## ..##"), 1)) == 1


def test_what_is_too_small_is_not_a_region():
    assert len(components(drawn("##... ##... ....."), 5)) == 0


def test_outside_the_roi_nothing_counts():
    roi = np.zeros((3, 5), bool)
    roi[:, :1] = True
    assert components(drawn("##### ##### #####"), 1, roi).boxes.tolist() == [[0, 0, 1, 3]]


def test_specks_go_and_gaps_close():
    foreground = np.zeros((40, 40), np.uint8)
    foreground[3, 3] = 255
    foreground[10:30, 10:19] = foreground[10:30, 23:32] = 255
    assert len(components(clean(foreground, 0), 1)) == 2
    assert len(components(clean(foreground, 2), 1)) == 1


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 0.9))
def test_most_of_the_neighbourhood_is_the_median(seed, density):
    rng = np.random.default_rng(seed)
    foreground = (255 * (rng.random((20, 20)) < density)).astype(np.uint8)
    inner = np.s_[2:-2, 2:-2]  # cv2's two filters see the outermost pixels differently
    assert np.array_equal(clean(foreground, 0)[inner], cv2.medianBlur(foreground, 5)[inner])


def test_an_empty_picture_has_no_regions():
    assert len(components(clean(np.zeros((9, 9), np.uint8), 3), 1)) == 0

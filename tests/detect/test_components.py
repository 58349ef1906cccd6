"""Components against a second implementation, and what becomes of specks, gaps and holes."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from perdure.detect.components import Stage, components, regions_of, smooth
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
    assert len(regions_of(foreground, Stage())) == 2
    assert len(regions_of(foreground, Stage(closing=2))) == 1


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 0.9))
def test_most_of_the_neighbourhood_is_the_median(seed, density):
    rng = np.random.default_rng(seed)
    foreground = (255 * (rng.random((20, 20)) < density)).astype(np.uint8)
    inner = np.s_[2:-2, 2:-2]  # cv2's two filters see the outermost pixels differently
    assert np.array_equal(smooth(foreground).seen[inner], cv2.medianBlur(foreground, 5)[inner])


def test_an_empty_picture_has_no_regions():
    assert len(regions_of(np.zeros((9, 9), np.uint8), Stage(closing=3, neck=0.3))) == 0


def test_nothing_outside_the_roi_is_seen():
    foreground = np.full((20, 40), 255, np.uint8)
    roi = np.zeros((20, 40), bool)
    roi[:, :15] = True
    assert regions_of(foreground, Stage(), roi).boxes.tolist() == [[0, 0, 15, 20]]


# Shadow and things of the ground's colour ------------------------------------------------------------------


def person(shadow: tuple[slice, slice]) -> np.ndarray:
    """A person of 10 x 40 pixels with a doubtful part."""
    foreground = np.zeros((60, 60), np.uint8)
    foreground[10:50, 20:30] = 255
    foreground[shadow] = 127
    return foreground


def test_a_shadow_on_the_ground_is_no_part_of_the_one_who_throws_it():
    found = regions_of(person(np.s_[44:54, 30:50]), Stage())
    assert np.abs(found.boxes - [20, 10, 30, 50]).max() <= 2


def test_a_grey_shirt_is_part_of_the_one_who_wears_it():
    (mask,) = regions_of(person(np.s_[20:30, 20:30]), Stage()).masks
    assert mask.area >= 0.95 * 400


def test_a_grey_sleeve_with_something_below_it_is_kept_and_a_grey_hem_is_not():
    sleeve = person(np.s_[20:30, 26:30])  # open to the right; body to the left, above and below
    assert regions_of(sleeve, Stage()).masks[0].area >= 0.95 * 400
    hem = person(np.s_[42:50, 20:30])  # nothing below
    assert regions_of(hem, Stage()).boxes[0][3] <= 44


def test_shadow_alone_is_nothing():
    foreground = np.zeros((30, 30), np.uint8)
    foreground[5:25, 5:25] = 127
    assert len(regions_of(foreground, Stage())) == 0


# Bodies that hang together ---------------------------------------------------------------------------------

STAGE = Stage(closing=2, least_area=20, neck=0.3)


def bodies(*boxes: tuple[int, int, int, int]) -> np.ndarray:
    foreground = np.zeros((100, 120), np.uint8)
    for x1, y1, x2, y2 in boxes:
        foreground[y1:y2, x1:x2] = 255
    return foreground


def test_two_people_who_hold_hands_are_two_regions():
    hand_in_hand = bodies((20, 20, 40, 80), (55, 22, 75, 82), (40, 45, 55, 49))
    found = regions_of(hand_in_hand, STAGE)
    assert len(found) == 2
    assert np.abs(found.boxes[np.argsort(found.boxes[:, 0])][:, 2] - [47, 75]).max() <= 9
    assert len(regions_of(hand_in_hand, Stage(closing=2, least_area=20))) == 1
    assert sum(mask.area for mask in found.masks) == regions_of(hand_in_hand, Stage(2, 20)).masks[0].area


def test_two_people_with_a_gap_between_them_that_was_closed_are_two_regions():
    assert len(regions_of(bodies((20, 20, 40, 80), (43, 22, 63, 82)), STAGE)) == 2


def test_a_body_keeps_its_head_and_its_legs():
    one = bodies((30, 30, 60, 70), (40, 15, 50, 32), (32, 68, 40, 95), (50, 68, 58, 95))
    assert len(regions_of(one, STAGE)) == 1


def test_two_people_side_by_side_without_a_neck_are_one_region():
    assert len(regions_of(bodies((20, 20, 40, 80), (40, 22, 60, 82)), STAGE)) == 1


def test_a_speck_beside_a_body_is_closed_into_it():
    assert len(regions_of(bodies((20, 20, 40, 80), (43, 40, 50, 48)), STAGE)) == 1


def test_large_bodies_are_told_apart_as_small_ones_are():
    small = bodies((20, 20, 40, 80), (55, 22, 75, 82), (40, 45, 55, 49))
    large = cv2.resize(small, None, fx=8, fy=8, interpolation=cv2.INTER_NEAREST)
    assert len(regions_of(large, Stage(closing=16, least_area=20 * 64, neck=0.3))) == 2

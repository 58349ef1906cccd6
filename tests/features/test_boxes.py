import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.features.boxes import areas, centres, distances_between, overlaps

BOXES = np.float32([[0, 0, 4, 2], [2, 0, 6, 2], [9, 9, 9, 9]])


def test_overlap_is_shared_area_over_joint_area():
    assert overlaps(BOXES, BOXES).tolist() == [[1, np.float32(1 / 3), 0], [np.float32(1 / 3), 1, 0], [0, 0, 0]]


def test_a_box_without_area_overlaps_nothing_not_even_itself():
    assert overlaps(BOXES[2:], BOXES[2:]).tolist() == [[0]]


def test_no_boxes_give_empty_tables():
    none = np.zeros((0, 4), np.float32)
    assert overlaps(none, BOXES).shape == (0, 3)


def test_areas_and_centres():
    assert areas(BOXES).tolist() == [8, 8, 0]
    assert centres(BOXES).tolist() == [[2, 1], [4, 1], [9, 9]]


@pytest.mark.parametrize(
    ("other", "distance"),
    [
        ((7, 0, 9, 2), 3),  # to the right
        ((-5, 1, -2, 2), 2),  # to the left
        ((0, -6, 4, -1), 1),  # above
        ((1, 7, 2, 8), 5),  # below
        ((7, 6, 9, 9), 5),  # from corner to corner
        ((-4, -3, -3, -4), 5),
        ((4, 0, 6, 2), 0),  # edge on edge
        ((4, 2, 6, 3), 0),  # corner on corner
        ((1, 1, 9, 9), 0),  # over each other
        ((1, 0.5, 2, 1), 0),  # one in the other
    ],
)
def test_boxes_are_as_far_apart_as_their_nearest_edges(other, distance):
    assert distances_between(np.float32([[0, 0, 4, 2]]), np.float32([other])).tolist() == [[distance]]


@st.composite
def small_boxes(draw):
    corners = draw(st.lists(st.tuples(*[st.integers(0, 7)] * 2, *[st.integers(1, 3)] * 2), max_size=3))
    return np.float32([(x, y, x + width, y + height) for x, y, width, height in corners]).reshape(-1, 4)


@given(small_boxes(), small_boxes())
def test_the_distance_is_that_of_the_nearest_two_points(one, other):
    def points(box: np.ndarray) -> itertools.product:
        return itertools.product(np.arange(box[0], box[2] + 1), np.arange(box[1], box[3] + 1))

    found = distances_between(one, other)
    assert found.shape == (len(one), len(other))
    for n, m in np.ndindex(found.shape):
        nearest = min(np.hypot(x - u, y - v) for x, y in points(one[n]) for u, v in points(other[m]))
        assert found[n, m] == np.float32(nearest)

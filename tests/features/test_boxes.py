import numpy as np

from perdure.features.boxes import areas, centres, overlaps

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

"""Of several boxes of one thing the surest; what cannot be a box."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from perdure.detect.plausible import LeftOut, left_out, plausible, told
from perdure.detect.suppression import one_each
from perdure.features.boxes import overlaps


def by_a_plain_loop(boxes, scores, kinds, most) -> list[int]:
    kept: list[int] = []
    for k in sorted(range(len(boxes)), key=lambda k: -scores[k]):
        rivals = [j for j in kept if kinds[j] == kinds[k]]
        if all(overlaps(boxes[j : j + 1], boxes[k : k + 1])[0, 0] <= most for j in rivals):
            kept.append(k)
    return kept


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 40), st.sampled_from([0.0, 0.3, 0.45, 1.0]))
def test_suppression_is_that_of_a_plain_loop(seed, count, most):
    chance = np.random.default_rng(seed)
    corners = chance.integers(0, 30, (count, 2))
    boxes = np.concatenate([corners, corners + chance.integers(0, 30, (count, 2))], axis=1).astype(np.float32)
    scores = chance.integers(0, 8, count) / np.float32(8)  # many are equal
    kinds = chance.integers(0, 3, count)
    assert one_each(boxes, scores, kinds, most).tolist() == by_a_plain_loop(boxes, scores, kinds, most)


def test_boxes_of_two_classes_do_not_suppress_each_other():
    boxes = np.float32([[0, 0, 10, 10], [0, 0, 10, 10], [1, 0, 11, 10]])
    assert one_each(boxes, np.float32([0.5, 0.6, 0.7]), np.array([0, 1, 0]), 0.45).tolist() == [2, 1]
    assert one_each(boxes[:0], np.zeros(0), np.zeros(0, int), 0.45).tolist() == []


def test_what_cannot_be_a_box_is_left_out_and_counted_once_each():
    boxes = np.float32(
        [
            [0, 0, 9, 9],
            [np.nan, 0, 9, 9],
            [0, 0, np.inf, 9],
            [9, 9, 0, 0],
            [5, 5, 5, 9],
            [0, 0, 2e6, 9],
            [0, 0, 8, 8],
        ]
    )
    scores = np.float32([0.5, 0.5, 0.5, np.nan, 0.5, 0.5, 1.5])
    rows, reasons = plausible(boxes, scores, most=300)
    assert rows.tolist() == [0]
    assert reasons == {
        "with a number that is not finite": 3,
        "without an area": 1,
        "beyond 1e+06 pixels": 1,
        "with a score outside 0 to 1": 1,
    }


def test_of_ten_thousand_boxes_the_surest_stay_in_their_order():
    scores = np.linspace(0, 1, 10_000).astype(np.float32)
    boxes = np.tile(np.float32([0, 0, 9, 9]), (10_000, 1))
    rows, reasons = plausible(boxes, scores, most=300)
    assert rows.tolist() == list(range(9_700, 10_000))
    assert reasons == {"after the surest 300": 9_700}


def test_what_was_left_out_is_added_up_over_frames_and_told_once():
    events = [
        *told(3, {"without an area": 2}),
        *told(4, {}),
        *told(5, {"without an area": 1, "after the surest 9": 4}),
    ]
    assert [(one.kind, one.begin, one.why) for one in events] == [
        ("unusable", 3, "2 boxes left out: 2 without an area"),
        ("unusable", 5, "5 boxes left out: 1 without an area, 4 after the surest 9"),
    ]
    both = left_out(events[1:], left_out(events[:1]))
    assert both.notes == (
        "7 boxes that the detector gave were left out; first, in frame 3, 2 boxes left out: 2 without an area",
    )
    assert LeftOut().notes == left_out([]).notes == ()

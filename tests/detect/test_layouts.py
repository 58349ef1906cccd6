"""What outputs mean: one thing, drawn in every layout, and what is known of none."""

from __future__ import annotations

import numpy as np
import pytest
from networks import cells

from perdure.detect.layouts import Port, recognised
from perdure.detect.letterbox import CORNER, MIDDLE, STRETCHED
from perdure.errors import FormatError

SIZE = (64, 64)
BOX = (8.0, 16.0, 24.0, 48.0)  # of a thing of class 2, seen with .72
CENTRE = (16.0, 32.0, 16.0, 32.0)  # x, y, width, height
N = cells(64)  # 64 + 16 + 4


def layout_of(*outputs: tuple[str, np.ndarray], metadata=None, kind="float32", declared=None):
    ports = [
        Port(name, values.shape if declared is None else declared, values.dtype.name) for name, values in outputs
    ]
    return recognised(ports, [values for _, values in outputs], SIZE, metadata or {}, kind)


def said(layout, *answer: np.ndarray) -> list[tuple[list[float], float, int]]:
    found = layout.decode(answer)
    sure = found.scores > 0.1
    return [
        (box.tolist(), pytest.approx(float(score), abs=1e-5), int(kind))
        for box, score, kind in zip(found.boxes[sure], found.scores[sure], found.kinds[sure], strict=True)
    ]


THING = [(list(BOX), 0.72, 2)]


def test_yolox_says_shifts_within_cells_and_logarithms_of_sizes():
    answer = np.zeros((1, N, 8), np.float32)
    row = 64 + 4 * 1 + 1  # cell x 1, y 1 of stride 16, whose corner is 16, 16
    answer[0, row] = [0, 1, 0, np.log(2), 0.9, 0.1, 0.2, 0.8]
    layout = layout_of(("output", answer))
    assert (layout.name, layout.classes, layout.suppressed) == ("YOLOX", 3, False)
    assert (layout.fit.place, layout.fit.bgr, layout.fit.most) == (CORNER, True, 255.0)
    assert said(layout, answer) == THING


def test_a_yolox_that_decodes_by_itself_is_told_by_the_places_of_its_cells():
    answer = np.zeros((1, N, 8), np.float32)
    answer[0, :, :2] = 32
    answer[0, 7] = [*CENTRE, 0.9, 0.1, 0.2, 0.8]
    layout = layout_of(("output", answer))
    assert layout.name == "YOLOX, decoded"
    assert said(layout, answer) == THING


def test_yolov5_says_rows_of_three_anchors_a_cell():
    answer = np.zeros((1, 3 * N, 8), np.float32)
    answer[0, 100] = [*CENTRE, 0.9, 0.1, 0.2, 0.8]
    layout = layout_of(("output0", answer))
    assert (layout.name, layout.classes) == ("YOLOv5", 3)
    assert (layout.fit.place, layout.fit.bgr, layout.fit.most) == (MIDDLE, False, 1.0)
    assert said(layout, answer) == THING


def test_yolov8_says_columns_without_an_objectness():
    answer = np.zeros((1, 7, N), np.float32)
    answer[0, :, 11] = [*CENTRE, 0.1, 0.2, 0.72]
    layout = layout_of(("output0", answer), declared=(1, 7, None))
    assert (layout.name, layout.classes, layout.fit.place) == ("YOLOv8", 3, MIDDLE)
    assert said(layout, answer) == THING


def test_rows_after_suppression_are_taken_as_they_are_in_pixels_or_shares():
    answer = np.zeros((1, 300, 6), np.float32)
    answer[0, 0] = [*BOX, 0.72, 2]
    layout = layout_of(("output0", answer))
    assert (layout.name, layout.classes, layout.suppressed) == ("rows after suppression", None, True)
    assert said(layout, answer) == THING
    answer[0, 0, :4] /= 64
    assert said(layout, answer) == THING
    assert said(layout, np.zeros((1, 0, 6), np.float32)) == []


def test_ssd_says_shares_of_the_picture_until_a_row_of_no_picture():
    answer = np.zeros((1, 1, 5, 7), np.float32)
    share = np.float32(BOX) / 64
    answer[0, 0, 0] = [0, 2, 0.72, *share]
    answer[0, 0, 1] = [1, 2, 0.72, *share]  # of a second picture
    answer[0, 0, 2] = [-1, 0, 0, 0, 0, 0, 0]
    answer[0, 0, 3] = [0, 2, 0.9, *share]
    layout = layout_of(("detection_out", answer))
    assert (layout.name, layout.fit.place, layout.fit.bgr, layout.fit.most) == ("SSD", STRETCHED, True, 255.0)
    assert said(layout, answer) == THING


def test_boxes_labels_and_scores_are_told_by_their_names():
    boxes, labels, scores = np.float32([BOX]), np.array([2]), np.float32([0.72])
    layout = layout_of(("boxes", boxes), ("labels", labels), ("scores", scores))
    assert (layout.name, layout.fit.place) == ("boxes, scores and labels", CORNER)
    assert said(layout, boxes, labels, scores) == THING


def test_boxes_labels_and_scores_without_names_are_told_by_their_shapes():
    boxes, labels, scores = np.float32([BOX, BOX]), np.array([2, 0]), np.float32([0.72, 0.01])
    layout = layout_of(("3076", scores), ("3077", labels), ("1234", boxes))
    assert said(layout, scores, labels, boxes) == THING


def test_those_of_the_model_zoo_are_shares_of_a_picture_normalised_as_on_imagenet():
    boxes, labels, scores = np.float32([[BOX]]) / 64, np.array([[2]]), np.float32([[0.72]])
    layout = layout_of(("bboxes", boxes), ("labels", labels), ("scores", scores))
    assert (layout.fit.place, layout.fit.mean[0]) == (STRETCHED, 0.485)
    assert said(layout, boxes, labels, scores) == THING


def test_those_of_tensorflow_say_rows_before_columns_and_take_whole_numbers():
    boxes = np.float32([[[BOX[1], BOX[0], BOX[3], BOX[2]]]]) / 64
    answer = [
        ("detection_boxes:0", boxes), ("detection_classes:0", np.float32([[2]])),
        ("detection_scores:0", np.float32([[0.72]])), ("num_detections:0", np.float32([1])),
    ]  # fmt: skip
    layout = layout_of(*answer, kind="uint8")
    assert (layout.fit.most, layout.fit.place) == (255.0, STRETCHED)
    assert said(layout, *(values for _, values in answer)) == THING


def test_a_number_that_is_not_one_stays_so_that_it_can_be_told():
    answer = np.full((1, 7, N), np.nan, np.float32)
    found = layout_of(("output0", np.zeros((1, 7, N), np.float32))).decode([answer])
    assert len(found.scores) == N
    assert np.isnan(found.scores).all()


@pytest.mark.parametrize(
    "outputs",
    [
        [("logits", np.zeros((1, 1000), np.float32))],
        [("mask", np.zeros((1, 21, 64, 64), np.float32))],
        [("dets", np.zeros((1, 100, 5), np.float32))],
        [
            ("boxes", np.zeros((9, 5), np.float32)),
            ("labels", np.zeros(9, int)),
            ("scores", np.zeros(9, np.float32)),
        ],
        [("a", np.zeros((9, 4), np.float32)), ("b", np.zeros(9, np.float32)), ("c", np.zeros(9, np.float32))],
        [("a", np.zeros((9, 4), np.float32)), ("b", np.zeros(9, int))],
    ],
    ids=lambda outputs: outputs[0][0],
)
def test_outputs_of_no_known_layout_are_named_with_the_known_ones(outputs):
    with pytest.raises(FormatError, match=r"no known layout.*YOLOX.*detector=function") as error:
        layout_of(*outputs)
    for name, values in outputs:
        assert f"'{name}' ({', '.join(map(str, values.shape))})" in str(error.value)


def test_a_model_of_another_task_is_refused_by_it():
    with pytest.raises(FormatError, match="'pose'"):
        layout_of(("output0", np.zeros((1, 56, N), np.float32)), metadata={"task": "pose"})

"""People by their outlines: the SVM itself is OpenCV's; boxes, scores and places are ours."""

from __future__ import annotations

import numpy as np
import pytest

from perdure.detect import DETECTORS, people
from perdure.detect.people import People
from perdure.errors import ParameterError
from perdure.pipeline import detector_name
from perdure.types import Frame, Regions, Scene


def found(image: np.ndarray, **parameters: float) -> Regions:
    detector = People(**parameters)
    state = detector.start(Scene(image.shape[1], image.shape[0]))
    return detector.step(state, Frame(0, 0.0, image))[1]


def test_of_windows_on_one_person_the_surest_is_kept():
    boxes = np.array([[0, 0, 10, 20], [1, 1, 11, 21], [30, 0, 40, 20], [31, 0, 41, 20]], np.float32)
    assert people.surest(boxes, 0.4).tolist() == [0, 2]
    assert people.surest(boxes, 1.0).tolist() == [0, 1, 2, 3]
    assert people.surest(boxes[:0], 0.4).tolist() == []


def test_the_margin_of_a_window_is_taken_off():
    box = people.without_margin(np.array([[100, 200, 164, 328]], np.float32))[0]
    assert box[3] - box[1] == pytest.approx(96)
    assert (box[0] + box[2]) / 2 == pytest.approx(132)


def test_nobody_is_in_a_plain_picture_nor_in_one_too_small_for_a_window():
    assert len(found(np.full((90, 60, 3), 99, np.uint8))) == 0
    assert len(found(np.full((5, 4, 3), 99, np.uint8))) == 0
    detector = People()
    assert len(detector.step(detector.start(Scene(9, 9)), Frame(0, 0.0))[1]) == 0


def test_people_are_told_the_surest_first_inside_the_roi_and_the_picture_with_scores_of_the_svm(monkeypatch):
    windows = np.array([[0, 0, 64, 128], [100, 0, 164, 128], [102, 2, 166, 130], [100, 60, 164, 188]], np.float32)
    margins = np.array([0.0, 1.0, 2.0, 3.0], np.float32)
    monkeypatch.setattr(People, "_windows", lambda self, image: (windows, margins))
    roi = np.zeros((150, 200), bool)
    roi[:120] = True
    image = np.zeros((150, 200, 3), np.uint8)
    _, whole = People().step(People().start(Scene(200, 150)), Frame(0, 0.0, image))
    assert whole.scores.tolist() == pytest.approx([0.953, 0.881, 0.5], abs=1e-3)
    assert set(whole.classes) == {"person"}
    assert whole.boxes[0, 3] == 150  # cut off at the border
    _state, inside = People().step(People().start(Scene(200, 150, roi=roi)), Frame(0, 0.0, image))
    assert inside.scores.tolist() == pytest.approx([0.881, 0.5], abs=1e-3)
    assert (inside.boxes[:, 3] <= 120).all()


def test_the_detector_goes_by_its_name():
    assert detector_name("people") == "people"
    assert DETECTORS["people"] is People
    with pytest.raises(ParameterError, match="people"):
        detector_name("peopel")

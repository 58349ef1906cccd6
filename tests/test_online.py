"""`update`, in the ecosystem's habit."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import supervision

import perdure
from perdure.errors import ParameterError, PerdureError
from perdure.types import Regions

BOXES = np.float32([[100, 10, 120, 40], [10, 10, 30, 40]])


def detections(shift: float = 0.0) -> supervision.Detections:
    return supervision.Detections(
        xyxy=BOXES + shift,
        confidence=np.float32([0.9, 0.8]),
        class_id=np.array([2, 0]),
        data={"class_name": np.array(["car", "person"]), "speed": np.array([3.0, 4.0])},
    )


def test_supervision_goes_in_and_out_with_order_and_data_kept():
    tracker = perdure.Online("overlap", fps=10)
    for k in range(6):
        given = detections(k)
        got = tracker.update(given)
    assert got.xyxy.tolist() == given.xyxy.tolist()
    assert got.data["speed"].tolist() == [3.0, 4.0]
    assert got.class_id.tolist() == [2, 0]
    assert sorted(got.tracker_id.tolist()) == [1, 2]
    assert given.tracker_id is None, "what the caller gave stays as it is"


def test_a_detection_without_an_identity_yet_is_minus_one():
    assert perdure.Online("overlap", fps=10).update(detections()).tracker_id.tolist() == [-1, -1]


def test_masks_of_supervision_are_kept_as_silhouettes():
    bits = np.zeros((2, 60, 160), bool)
    bits[0, 12:30, 101:110] = bits[1, 12:30, 11:20] = True
    tracker = perdure.Online("overlap", fps=10, confirm=0.0)
    tracker.update(supervision.Detections(xyxy=BOXES, mask=bits))
    assert sorted(mask.box for mask in tracker.report.rows.masks) == [(11, 12, 20, 30), (101, 12, 110, 30)]


def test_supervision_goes_to_regions_and_back_with_order_masks_classes_ids_and_data_kept():
    bits = np.zeros((2, 60, 160), bool)
    bits[0, 12:30, 101:110] = bits[1, 12:30, 11:20] = True
    given = supervision.Detections(
        xyxy=BOXES,
        mask=bits,
        confidence=np.float32([0.9, 0.8]),
        class_id=np.array([2, 0]),
        tracker_id=np.array([9, 4]),
        data={"class_name": np.array(["car", "person"]), "speed": np.array([[3.0, 1.0], [4.0, 2.0]])},
    )
    again = perdure.to_supervision(perdure.to_regions(given), size=(60, 160))
    assert again == given
    assert again.mask.dtype == bool
    assert perdure.to_supervision(perdure.to_regions(given)).mask is None
    assert perdure.to_supervision(perdure.to_regions(given), names=["person", "bus"]).class_id.tolist() == [-1, 0]


def test_tracks_go_to_supervision_with_ids_silhouettes_and_classes():
    bits = np.zeros((2, 60, 160), bool)
    bits[0, 12:30, 101:110] = True
    tracker = perdure.Online("overlap", fps=10, confirm=0.0)
    tracker.update(supervision.Detections(xyxy=BOXES, mask=bits, class_id=np.array([2, 0])))
    rows = tracker.report.rows
    out = perdure.to_supervision(rows, size=(60, 160))
    assert out.tracker_id.tolist() == rows.ids.tolist()
    assert out.class_id.tolist() == [int(name) for name in rows.classes]
    assert out.data["class_name"].tolist() == rows.classes.tolist()
    assert sorted(int(one.sum()) for one in out.mask) == [0, 162]
    assert len(perdure.to_supervision(perdure.Tracks.empty())) == 0


def test_without_supervision_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "supervision", None)
    with pytest.raises(PerdureError, match=r"perdure\[supervision\]"):
        perdure.to_supervision(Regions.empty())


def test_no_detections_are_a_value():
    tracker = perdure.Online("overlap")
    assert len(tracker.update(supervision.Detections.empty())) == 0
    assert len(tracker.update([])) == 0
    assert len(tracker.update(Regions.empty())) == 0


def test_arrays_may_bring_scores_and_class_numbers():
    tracker = perdure.Online("overlap", confirm=0.0)
    rows = tracker.update(np.array([[10, 10, 30, 40, 0.5, 7]]))
    assert (rows.confidence.tolist(), rows.classes.tolist()) == ([0.5], ["7"])


def test_two_trackers_in_one_process_both_begin_at_one():
    for _ in range(2):
        assert perdure.Online("overlap", confirm=0.0).update(BOXES[:1]).ids.tolist() == [1]


def test_reset_forgets_everything():
    tracker = perdure.Online("overlap", confirm=0.0)
    tracker.update(BOXES)
    tracker.reset()
    assert tracker.update(BOXES[:1], timestamp=0.0).ids.tolist() == [1]


def test_timestamps_must_rise():
    tracker = perdure.Online("overlap")
    tracker.update(BOXES, timestamp=5.0)
    with pytest.raises(ParameterError, match="must rise"):
        tracker.update(BOXES, timestamp=5.0)


@pytest.mark.parametrize("wrong", ["text", np.zeros((2, 3)), np.zeros((2, 9)), [[1, 2, np.nan, 4]], {"a": 1}])
def test_what_are_no_detections_is_refused_with_what_would_do(wrong):
    with pytest.raises(ParameterError):
        perdure.Online("overlap").update(wrong)


@pytest.mark.parametrize(
    "wrong",
    [
        {"timestamp": float("inf")},
        {"timestamp": float("nan")},
        {"timestamp": "soon"},
        {"frame": np.zeros((4, 4, 3))},
    ],
)
def test_what_is_refused_uses_up_neither_frame_number_nor_time(wrong):
    tracker = perdure.Online("overlap", confirm=0.0)
    with pytest.raises(ParameterError):
        tracker.update(BOXES, **{"timestamp": 1.0, **wrong})
    rows = tracker.update(BOXES, timestamp=1.0)
    assert rows.frames.tolist() == [0, 0]


@pytest.mark.parametrize(
    "boxes",
    [[[30, 10, 10, 60]], [[0, 0, 3e38, 9]], [[0, 0, 9, 9, 5.0]], [[0, 0, 9, 9, -1.0]], [[0, 0, 9, 9, np.nan]]],
)
def test_boxes_and_scores_that_cannot_be_are_refused(boxes):
    with pytest.raises(ParameterError):
        perdure.Online("overlap").update(boxes)


@pytest.mark.parametrize(
    "wrong", [{"fps": "x"}, {"fps": float("inf")}, {"width": 1.5}, {"height": -5}, {"tracker": 3}]
)
def test_a_camera_that_cannot_be_is_refused(wrong):
    with pytest.raises(ParameterError):
        perdure.Online(**wrong)


def test_a_mask_that_leaves_its_box_enlarges_what_is_said():
    from perdure.types import Mask

    regions = Regions.of([[30, 30, 40, 40]], masks=[Mask(5, 5, np.ones((15, 15), bool))])
    rows = perdure.Online("overlap", confirm=0.0).update(regions)
    assert rows.boxes.tolist() == [[5, 5, 40, 40]]


def test_an_unknown_tracker_or_parameter_is_refused_with_the_nearest():
    with pytest.raises(ParameterError, match="did you mean 'overlap'"):
        perdure.Online("overlaps")
    with pytest.raises(ParameterError, match="did you mean 'patience'"):
        perdure.Online("overlap", patients=2.0)

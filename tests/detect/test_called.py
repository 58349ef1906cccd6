"""Any function as a detector."""

from __future__ import annotations

import traceback
from pathlib import Path

import numpy as np
import pytest
import supervision
from worlds import two_apart

import perdure
from perdure.cli.running import run
from perdure.detect import Background, Called, Recorded
from perdure.detect.components import components
from perdure.errors import DetectorError, ParameterError
from perdure.files.runs import Reporting, RunFolder
from perdure.types import Frame, Regions, Scene

FILM = [frame.image for frame in two_apart().frames()]


def found(answer, **parameters) -> Regions:
    detector = Called(function=lambda image: answer, **parameters)
    return detector.step(detector.start(Scene(64, 48)), Frame(4, 0.4, np.zeros((48, 64, 3), np.uint8)))[1]


def seen_in(image: np.ndarray) -> Regions:
    return components(np.uint8(255) * (image != 90).any(axis=2), least_area=4)


def test_a_function_takes_the_place_of_a_detector():
    tracks = perdure.track(FILM, detector=lambda image: seen_in(image).boxes, fps=10)
    assert sorted(set(tracks.counted().ids.tolist())) == [1, 2]


def test_a_function_may_answer_in_every_known_kind():
    boxes = [[1, 2, 9, 8], [20, 2, 30, 8]]
    masks = np.zeros((2, 48, 64), bool)
    masks[0, 3:7, 2:8] = masks[1, 3:7, 21:29] = True
    detections = supervision.Detections(
        xyxy=np.float32(boxes),
        confidence=np.float32([0.5, 0.75]),
        mask=masks,
        class_id=np.array([7, 0]),
        data={"class_name": np.array(["cat", "person"]), "speed": np.array([1.0, 2.0])},
    )
    regions = found(detections)
    assert regions.boxes.tolist() == boxes
    assert regions.scores.tolist() == [0.5, 0.75]
    assert regions.classes.tolist() == ["cat", "person"]
    assert [mask.box for mask in regions.masks] == [(2, 3, 8, 7), (21, 3, 29, 7)]
    assert regions.data["speed"].tolist() == [1.0, 2.0]
    assert regions.data["class_id"].tolist() == [7, 0]
    assert found(regions).equals(regions)
    assert found([[1, 2, 9, 8, 0.5, 3]]).classes.tolist() == ["3"]
    for nothing in (None, [], np.zeros((0, 6)), supervision.Detections.empty(), Regions.empty()):
        assert len(found(nothing)) == 0


def test_boxes_that_cannot_be_are_left_out_and_the_user_is_told():
    bad = [[1, 2, 9, 8, 0.5], [np.nan, 2, 9, 8, 0.5], [9, 8, 1, 2, 0.5], [1, 2, 9, 8, np.nan]]
    regions = found(bad)
    assert regions.boxes.tolist() == [[1, 2, 9, 8]]
    assert regions.events[0].why == "3 boxes left out: 2 with a number that is not finite, 1 without an area"
    with pytest.warns(RuntimeWarning, match=r"120 boxes that the detector gave were left out; first, in frame 0"):
        perdure.track(FILM, detector=lambda image: bad, tracker="overlap")


def test_of_ten_thousand_boxes_the_surest_are_kept_with_what_belongs_to_them():
    boxes = np.tile(np.float32([1, 2, 9, 8, 0.0]), (10_000, 1))
    boxes[:, 4] = np.linspace(0, 1, 10_000)
    regions = found(boxes, most_objects=3)
    assert regions.scores.tolist() == boxes[-3:, 4].tolist()
    assert regions.events[0].why == "9997 boxes left out: 9997 after the surest 3"


@pytest.mark.parametrize("answer", ["text", {"boxes": []}, np.zeros((2, 3)), 7, [[1, 2], [3]]])
def test_an_answer_of_no_known_kind_names_the_frame(answer):
    with pytest.raises(ParameterError, match="of frame 4 cannot be taken"):
        found(answer)


def test_a_detector_may_be_given_as_it_is_and_needs_no_word():
    plan = perdure.plan(FILM, detector=Background(least_area=0.5))
    assert plan.detector_name == "own"
    assert all(len(regions) == 0 for _, regions in plan.prepared().seen())
    regions = {k: seen_in(image) for k, image in enumerate(FILM)}
    tracks = perdure.track(FILM, detector=Recorded(regions=regions), fps=10)
    assert len(set(tracks.counted().ids.tolist())) == 2


def test_an_exception_in_a_function_tells_function_frame_and_line_and_is_the_cause():
    def broken(image):
        seen.append(1 / (3 - len(seen)))

    seen: list[float] = []
    with pytest.raises(
        DetectorError, match=r"broken' failed in frame 3 \(0.30 s\), in test_called.py, line \d+: Zero"
    ) as told:
        perdure.track(FILM, detector=broken, fps=10)
    assert told.value.index == 3
    assert isinstance(told.value.__cause__, ZeroDivisionError)
    assert traceback.extract_tb(told.value.__cause__.__traceback__)[-1].name == "broken"
    with pytest.raises(ParameterError, match="detector=function"):
        Called().start(Scene(9, 9))


def test_what_a_run_had_logged_before_a_function_failed_is_kept(tmp_path: Path):
    def tired(image):
        seen.append(image)
        if len(seen) == 20:
            raise MemoryError
        return seen_in(image).boxes

    seen: list[np.ndarray] = []
    folder = RunFolder.create(tmp_path / "run", overwrite=False)
    with pytest.raises(DetectorError, match="in frame 19"):
        run(perdure.plan(FILM, detector=tired, fps=10), folder, Reporting(), film=False)
    assert folder.read_about()["status"] == "failed"
    assert RunFolder.open(folder.path).read()[2] == 19


class Teller:
    """A detector of one's own that answers what it is given."""

    def __init__(self, answer: object) -> None:
        self.answer = answer

    def start(self, scene: Scene) -> object:
        return None

    def step(self, state: object, frame: Frame) -> object:
        return self.answer(frame) if callable(self.answer) else self.answer


@pytest.mark.parametrize("answer", [None, 7, (), (None, [[0, 0, 9, 9]]), (None, None), Regions.empty()])
def test_an_object_that_answers_no_state_and_regions_is_told_what_it_should(answer):
    with pytest.raises(ParameterError, match=r"'Teller' answered .* in frame 0; its step must return a pair"):
        perdure.track(FILM, detector=Teller(answer))


def test_an_exception_in_an_object_names_it_and_the_frame():
    with pytest.raises(DetectorError, match=r"'Teller' failed in frame 0 .*ZeroDivisionError"):
        perdure.track(FILM, detector=Teller(lambda frame: 1 / frame.index))
    unready = Teller(None)
    unready.start = lambda scene: {}["weights"]
    with pytest.raises(DetectorError, match=r"'Teller' failed before the first frame.*KeyError: 'weights'"):
        perdure.track(FILM, detector=unready)

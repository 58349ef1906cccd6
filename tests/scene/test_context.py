"""What a video is like, and which context is near it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perdure.scene import context as contexts
from perdure.scene.context import Context, distance, nearest
from perdure.scene.measuring import Measures, Measuring, measure, measures_of, start
from perdure.states import load, save
from perdure.types import Frame, Regions, Scene

SCENE = Scene(100, 100, 10.0)
TWO_APART = [[0, 0, 10, 20], [50, 0, 60, 40]]
TWO_TOGETHER = [[0, 0, 10, 20], [5, 0, 25, 40]]


def told(frames: int, boxes: list, image=None, state: Measuring | None = None, begin: int = 0, memory=math.inf):
    state = start() if state is None else state
    for k in range(begin, begin + frames):
        state = measure(state, Frame(k, k / 10, image), Regions.of(boxes), SCENE, memory)
    return state


def test_a_video_of_boxes_is_measured():
    found = measures_of(told(5, TWO_APART), SCENE)
    assert (found.objects, found.occlusion, found.pictures, found.ground) == (2.0, 0.0, False, False)
    assert found.cover == pytest.approx((200 + 400) / 10_000)
    assert found.fps == pytest.approx(10.0)
    assert found.depth == pytest.approx(math.log(2), abs=0.1)  # 40 over 20
    assert (found.illumination, found.contrast) == (None, None)


def test_who_is_covered_to_a_fifth_is_overlapped():
    assert (
        measures_of(told(1, TWO_TOGETHER), SCENE).occlusion == 0.5
    )  # half of the small one, an eighth of the large
    assert measures_of(told(1, [[0, 0, 9, 9]]), SCENE).occlusion == 0.0


def test_light_and_contrast_are_those_of_grey():
    image = np.full((100, 100, 3), 100, np.uint8)
    image[:, :50] = 200
    found = measures_of(told(2, [], image), SCENE)
    assert found.illumination == pytest.approx(150, abs=0.1)
    assert found.contrast == pytest.approx(50, abs=0.1)
    assert (found.objects, found.occlusion, found.depth, found.pictures) == (0.0, None, None, True)


def test_old_frames_are_forgotten():
    full = told(50, TWO_APART, memory=1.0)
    emptied = told(50, [], state=full, begin=50, memory=1.0)
    assert measures_of(emptied, SCENE).objects < 0.02
    assert measures_of(told(50, [], state=told(50, TWO_APART), begin=50), SCENE).objects == 1.0


def test_it_can_be_saved_at_any_frame_and_nothing_is_known_before_the_first():
    state = told(3, TWO_TOGETHER)
    again = told(3, TWO_APART, state=load(save(state), Measuring), begin=3)
    assert measures_of(again, SCENE) == measures_of(told(3, TWO_APART, state=state, begin=3), SCENE)
    assert measures_of(start(), SCENE) == Measures()
    assert len(save(again)) < 5000


def test_boxes_outside_the_picture_do_not_count():
    found = measures_of(told(1, [[-50, 0, -10, 20], [3, 3, 3, 3]]), SCENE)
    assert (found.objects, found.cover) == (0.0, 0.0)


STREET = Context("street", {"area": 1.0}, measures=Measures(objects=10, occlusion=0.4, fps=25))
YARD = Context("yard", {"area": 1.0}, measures=Measures(objects=2, occlusion=0.0, fps=25))


def test_the_nearest_context_is_chosen_by_what_both_know():
    found = nearest([YARD, STREET], Measures(objects=8, occlusion=0.3))
    assert (found.context.name, found.runner_up.name) == ("street", "yard")
    expected = math.hypot(math.log(11 / 9) / math.log(2), 0.5) / math.sqrt(2)
    assert found.distance == pytest.approx(expected)
    assert found.runner_up_distance > found.distance
    assert nearest([YARD], Measures(objects=8)).runner_up is None
    assert nearest([YARD, STREET], Measures()).context.name == "street"  # nothing known: the first by name
    with pytest.raises(ValueError, match="no context"):
        nearest([], Measures())


def test_without_pictures_one_that_needs_none_is_preferred(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(contexts, "needs_pixels", lambda name: name == "area")
    coloured = Context("coloured", {"area": 0.7, "shape_ratio": 0.3}, measures=Measures(objects=8, pictures=True))
    plain = Context("plain", {"shape_ratio": 1.0}, measures=Measures(objects=4))
    assert nearest([coloured, plain], Measures(objects=8)).context.name == "plain"
    assert nearest([coloured, plain], Measures(objects=8, pictures=True)).context.name == "coloured"
    assert distance(coloured, Measures(objects=8)) == pytest.approx(0.7 * 3)


def test_metres_help_only_where_the_ground_is_known():
    metres = Context("metres", {"displacement_3d": 1.0})
    assert distance(metres, Measures()) == 3.0
    assert distance(metres, Measures(ground=True)) == 0.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"weights": {"aera": 1.0}}, "did you mean 'area'"),
        ({"weights": {"area": -1.0}}, "must be a number ≥ 0"),
        ({"weights": {"area": math.nan}}, "must be a number ≥ 0"),
        ({"weights": {"area": 0.0}}, "all weights are 0"),
        ({"weights": {}}, "all weights are 0"),
        ({"similar": 1.5}, "out of range"),
        ({"levels": {"area": (0.5, 0.5)}}, "must rise"),
        ({"levels": {"colour": (0.1, 0.5)}}, "is not a feature"),
    ],
)
def test_a_context_that_cannot_be_is_refused(changes, words):
    with pytest.raises(ValueError, match=words):
        Context(**{"name": "street", "weights": {"area": 1.0}, **changes})


def test_levels_bring_typical_similarities_to_0_and_1_and_only_used_features_are_named():
    context = Context("street", {"area": 1.0, "shape_ratio": 0.0}, levels={"area": (0.5, 0.75)})
    assert context.levelled("area", np.array([0.4, 0.625, 0.9])).tolist() == [0.0, 0.5, 1.0]
    assert context.levelled("shape_ratio", np.array([0.4])).tolist() == [0.4]
    assert context.used == ("area",)

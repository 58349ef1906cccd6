"""Whatever a detector of the user's own may say: an error of ours that names it, or rows that can be."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import perdure
from perdure.detect import Network
from perdure.detect.layouts import Found, Layout
from perdure.detect.letterbox import STRETCHED, Fit
from perdure.detect.network import Model
from perdure.errors import DetectorError, PerdureError
from perdure.trackers import TRACKERS
from perdure.types import Frame, Mask, Regions, Scene, Tracks

WIDTH, HEIGHT, FRAMES = 48, 32, 4
PLACES = st.one_of(
    st.integers(-5, 60),
    st.floats(-20, 80, width=32),
    st.sampled_from([float("nan"), float("inf"), -float("inf"), 1e38, -1e38, 1e6, 1e7, 0.0, -0.0, 1e-40]),
)
SCORES = st.one_of(st.floats(0, 1), st.sampled_from([float("nan"), float("inf"), -0.1, 1.5, 0.0, 1.0]))
ROWS = st.lists(st.tuples(PLACES, PLACES, PLACES, PLACES, SCORES), max_size=6)
NONSENSE = st.one_of(
    st.sampled_from([None, 7, "boxes", b"", {}, {"boxes": []}, set(), object(), [[]], [[1, 2], [3]], [["a"] * 4], [None]]),
    st.lists(st.lists(st.floats(), max_size=8), max_size=4),
    st.builds(lambda shape, kind: np.zeros(shape, kind), st.lists(st.integers(0, 5), max_size=3).map(tuple),
              st.sampled_from(["f8", "i1", "c8", "U3", "O", "M8[s]", "?"])),
)  # fmt: skip


@st.composite
def masks(draw: st.DrawFn) -> Mask:
    bits = np.zeros((draw(st.integers(0, 70)), draw(st.integers(0, 70))), bool)
    bits[:: draw(st.integers(1, 5))] = draw(st.booleans())
    return Mask(draw(st.integers(-90, 90)), draw(st.integers(-90, 90)), bits)


@st.composite
def regions(draw: st.DrawFn) -> Regions | Exception:
    """Regions as somebody makes them, or the error that they cannot be."""
    boxes = np.array(draw(st.lists(st.tuples(PLACES, PLACES, PLACES, PLACES), max_size=5)), np.float64).reshape(
        -1, 4
    )
    count = len(boxes) + draw(st.sampled_from([0, 0, 0, 1]))
    data = draw(
        st.sampled_from([{}, {"mark": np.arange(count)}, {"mark": ["a"] * count}, {"mark": -np.ones(count)}])
    )
    with np.errstate(invalid="ignore", over="ignore"):
        if draw(st.booleans()):
            boxes = np.concatenate(
                [np.minimum(boxes[:, :2], boxes[:, 2:]), np.maximum(boxes[:, :2], boxes[:, 2:])], 1
            )
        try:
            return Regions.of(boxes, draw(st.lists(SCORES, min_size=count, max_size=count)), ["x"] * count,
                              draw(st.lists(masks(), min_size=count, max_size=count)), data)  # fmt: skip
        except ValueError as error:
            return error


ANSWERS = st.lists(st.one_of(ROWS, regions(), NONSENSE), min_size=1, max_size=FRAMES)
FILM = [np.random.default_rng(k).integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.uint8) for k in range(FRAMES)]


class Said:
    """A detector that says one answer after the other; as a function of a picture, or as an object with a state."""

    def __init__(self, answers: list[Any]) -> None:
        self.answers = answers

    def __call__(self, image: np.ndarray) -> Any:
        answer = self.answers[int(image[0, 0, 0]) % len(self.answers)]
        if isinstance(answer, Exception):
            raise answer
        return answer


class Stepping(Said):
    def start(self, scene: Scene) -> None:
        return None

    def step(self, state: None, frame: Frame) -> tuple[None, Any]:
        return state, self(frame.image)


def follow(tracker: str, answers: list[Any], kind: type[Said]) -> None:
    detector = kind(answers)
    given = detector if kind is Stepping else lambda image: detector(image)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rows = perdure.track(FILM, tracker=tracker, detector=given, fps=10)
    except PerdureError as error:
        refused = str(error)
    else:
        refused = ""
        check(rows)
    assert not refused or ("detector" in refused and "frame" in refused)


def check(rows: Tracks) -> None:
    """Rows that can be: finite, in order, of frames that there were, one for an id."""
    assert np.isfinite(rows.boxes).all()
    assert np.isfinite(rows.confidence).all()
    assert (rows.boxes[:, :2] <= rows.boxes[:, 2:]).all()
    assert ((rows.frames >= 0) & (rows.frames < FRAMES)).all()
    pairs = list(zip(rows.frames.tolist(), rows.ids.tolist(), strict=True))
    assert pairs == sorted(set(pairs))


@settings(max_examples=25, deadline=None)
@given(ANSWERS, st.sampled_from([Said, Stepping]))
def test_no_answer_of_a_detector_ends_a_run_but_in_our_words(answers: list[Any], kind: type[Said]):
    follow("overlap", answers, kind)


@pytest.mark.slow
@pytest.mark.parametrize("tracker", TRACKERS)
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(answers=ANSWERS, kind=st.sampled_from([Said, Stepping]))
def test_no_answer_of_a_detector_ends_a_run_of_any_tracker(tracker: str, answers: list[Any], kind: type[Said]):
    follow(tracker, answers, kind)


@pytest.mark.slow
@pytest.mark.parametrize("tracker", TRACKERS)
def test_of_a_hundred_thousand_boxes_the_surest_are_tracked(tracker: str):
    boxes = np.random.default_rng(2).uniform(0, 30, (100_000, 4)).astype(np.float32)
    boxes[:, 2:] += boxes[:, :2]
    with pytest.warns(RuntimeWarning, match="after the surest 300"):
        perdure.track(FILM[:2], tracker=tracker, detector=lambda image: boxes, fps=10)


def test_a_network_that_fails_on_the_way_is_named_with_the_frame():
    def fail(given: np.ndarray) -> list[np.ndarray]:
        raise RuntimeError("[E] Where: node 7\nbroadcast of 3 by 4")

    def decode(answer: Any) -> Found:
        return Found(*answer)

    layout = Layout("rows", Fit(32, 32, STRETCHED), decode)
    network = Network(model=Model("m.onnx", layout, ("cat",), fail))
    with pytest.raises(
        DetectorError, match=r"m\.onnx failed in frame 3 \(0\.30 s\): RuntimeError: .*node 7 broadcast of 3 by 4"
    ):
        network.step(network.start(Scene(48, 32)), Frame(3, 0.3, FILM[0]))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"masks": [np.ones((3, 3), bool)]}, r"Mask\.of_image"),
        ({"scores": [[0.5]]}, r"must be \(N,\)"),
        ({"classes": [["cat"]]}, r"must be \(N,\)"),
        ({"data": {"mark": ["Anna"]}}, r"data\['mark'\]"),
        ({"data": {"mark": [-1]}}, r"data\['mark'\]"),
    ],
)
def test_columns_that_cannot_be_are_refused_where_regions_are_made(wrong: dict[str, Any], said: str):
    with pytest.raises(ValueError, match=said):
        Regions.of([[0, 0, 9, 9]], **wrong)

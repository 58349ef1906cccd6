"""`perdure track --init`, as a user types it, and `init` from Python; with a tracker that holds on to what it is given."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from worlds import two_apart

import perdure
from perdure.cli.main import run as run_command
from perdure.detect import Marked
from perdure.errors import ParameterError
from perdure.files.log import read_log
from perdure.trackers import TRACKERS
from perdure.types import Frame, Mask, Regions, Report, Scene, Tracks

FILM = [frame.image for frame in two_apart().frames()]
RED, BLUE = (FILM[10] == (200, 40, 40)).all(axis=2), (FILM[10] == (40, 60, 220)).all(axis=2)
NOTHING_MORE = ["--tracker", "overlap", "--confirm", "0", "--no-video"]


class Done(NamedTuple):
    code: int
    stdout: str
    stderr: str


@dataclass(frozen=True)
class Held:
    """The ids and boxes of the last marks."""

    ids: np.ndarray
    boxes: np.ndarray


@dataclass(frozen=True)
class Hold:
    """A tracker that says the last marks again and again."""

    needs_pixels = False
    follows_marks = True

    def start(self, scene: Scene) -> Held:
        return Held(np.zeros(0, np.int64), np.zeros((0, 4), np.float32))

    def step(self, state: Held, frame: Frame, regions: Regions) -> tuple[Held, Report]:
        if len(regions):
            state = Held(regions.data["mark"], regions.boxes)
        return state, Report(Tracks.of(frames=frame.index, times=frame.time, ids=state.ids, boxes=state.boxes))

    def finish(self, state: Held) -> Report:
        return Report.empty()


@pytest.fixture
def track(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Done]:
    """Run `perdure track film -o run` with some words, in a folder with the film and masks of its frame 10."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "film").mkdir()
    for k, image in enumerate(FILM):
        cv2.imwrite(f"film/{k:03d}.png", image[:, :, ::-1])
    cv2.imwrite("both.png", np.uint8(RED * 1 + BLUE * 4))
    cv2.imwrite("blue.png", np.uint8(BLUE * 255))

    def run_it(*words: str) -> Done:
        monkeypatch.setattr(sys, "argv", ["perdure", "track", "film", "-o", "run", "--fps", "10", *words])
        return Done(run_command(), *capsys.readouterr())

    return run_it


def rows_at(index: int) -> Tracks:
    return next(entry.report.rows for entry in read_log(Path("run/tracks.jsonl")) if entry.frame == index)


def test_several_things_of_one_png_are_regions_of_their_frame_and_the_run_says_so(track):
    done = track("--init", "both.png@10", *NOTHING_MORE)
    assert done.code == 0, done.stderr
    assert "overlap does not follow marks" in done.stderr
    rows = rows_at(10)
    assert [Mask.of_image(bits).box for bits in (RED, BLUE)] == [tuple(box) for box in rows.boxes.tolist()]
    assert len(rows_at(9)) == 0
    about = json.loads(Path("run/run.json").read_text())
    assert about["init"] == ["both.png@10"]
    assert about["detector"] == {"name": "marked", "parameters": {}}
    assert about["tracker"]["name"] == "overlap"


def test_init_may_be_given_several_times_and_a_box_finds_its_silhouette(track):
    done = track("--init", "blue.png@10", "--init", "18,8,16,22@10", *NOTHING_MORE)
    assert done.code == 0, done.stderr
    assert [tuple(box) for box in rows_at(10).boxes.tolist()] == [Mask.of_image(bits).box for bits in (BLUE, RED)]


def test_a_tracker_that_follows_marks_is_the_one_that_gets_them(track, monkeypatch):
    monkeypatch.delitem(TRACKERS, "trackcut")
    monkeypatch.setitem(TRACKERS, "hold", Hold)
    done = track("--init", "both.png@10", "--no-video")
    assert (done.code, "does not follow" in done.stderr) == (0, False)
    assert json.loads(Path("run/run.json").read_text())["tracker"]["name"] == "hold"
    assert rows_at(30).ids.tolist() == [1, 4]
    assert track("--no-video", "--overwrite").code == 0
    assert json.loads(Path("run/run.json").read_text())["tracker"]["name"] == "compound"


def test_frames_of_marks_are_the_sources_own_after_a_start(track):
    done = track("--init", "both.png@10", "--start", "8f", "--stride", "2", *NOTHING_MORE)
    assert done.code == 0, done.stderr
    assert len(rows_at(10)) == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--init", "gone.png"], "init = 'gone.png': there is no such file"),
        (["--init", "small.png"], "the mask is 60x40, the video 120x80"),
        (["--init", "both.png@40"], "frame 40 is not among those that are tracked, 0 to 39"),
        (["--init", "both.png@10", "--start", "20f"], "20 to 39"),
        (["--init", "both.png@10", "--end", "10f"], "0 to 9"),
        (["--init", "both.png@10", "--init", "both.png@10"], "marked twice"),
        (["--init", "0,0,120,80"], "covers 100.0 %"),
        (["--init", "both.png", "--detector", "background"], "do not go together"),
        (["--init", "both.png", "--class", "dog"], "--class"),
        (["--init", "both.png", "--least-area", "0.1"], "'background'"),
        (["--init", "both.png@10", "--roi", "50,0,20,80"], "outside the roi"),
        (["--detector", "marked"], "not a detector"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_mark_that_cannot_be_is_one_clear_line_exit_code_2_and_nothing_left_behind(track, words, said):
    cv2.imwrite("small.png", np.ones((40, 60), np.uint8))
    done = track(*words)
    assert done.code == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not Path("run").exists()


def test_boxes_without_a_picture_are_marked_as_they_are(track, tmp_path):
    (tmp_path / "SEQ").mkdir()
    (tmp_path / "SEQ/seqinfo.ini").write_text(
        "[Sequence]\nname=SEQ\nimDir=img1\nframeRate=10\nseqLength=9\nimWidth=120\nimHeight=80\nimExt=.jpg\n"
    )
    tracks = perdure.track("SEQ", tracker="overlap", init="10,10,20,30@4", confirm=0.0)
    assert tracks.in_frame(4).boxes.tolist() == [[10, 10, 30, 40]]


def test_from_python_masks_may_be_arrays_with_their_frame(monkeypatch):
    monkeypatch.delitem(TRACKERS, "trackcut")
    monkeypatch.setitem(TRACKERS, "hold", Hold)
    indices = RED * 3 + BLUE * 2
    tracks = perdure.track(FILM, init=[(indices, 10), "0,0 5,0 5,5@12"])
    assert tracks.in_frame(11).ids.tolist() == [2, 3]
    assert tracks.in_frame(39).ids.tolist() == [1]
    plan = perdure.plan(FILM, init=(indices, 10))
    assert plan.init == ("an array of 120x80@10",)
    assert isinstance(plan.detector, Marked)
    assert perdure.plan(FILM, init=[]).detector_name == "background"


def test_of_what_passes_once_only_frame_0_can_be_marked(monkeypatch):
    monkeypatch.delitem(TRACKERS, "trackcut")
    monkeypatch.setitem(TRACKERS, "hold", Hold)
    assert perdure.track((image for image in FILM), init="10,10,20,30").ids.tolist() == [1] * len(FILM)
    for options, said in (
        ({"init": "10,10,20,30@3"}, "passes only once"),
        ({"init": "1,1,9,9", "start": 1}, "--start"),
    ):
        with pytest.raises(ParameterError, match=said):
            perdure.track((image for image in FILM), **options)

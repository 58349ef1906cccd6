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
from perdure.cli.commands import run as run_command
from perdure.detect import Background, Marked
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

    reserved: int = 0
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
    for name in ("trackcut", "contour"):
        monkeypatch.delitem(TRACKERS, name)
    monkeypatch.setitem(TRACKERS, "hold", Hold)
    done = track("--init", "both.png@10", "--no-video")
    assert (done.code, "does not follow" in done.stderr) == (0, False)
    assert json.loads(Path("run/run.json").read_text())["tracker"]["name"] == "hold"
    assert rows_at(30).ids.tolist() == [1, 4]
    assert track("--no-video", "--overwrite").code == 0
    assert json.loads(Path("run/run.json").read_text())["tracker"]["name"] == "compound"


def detections(*rows: tuple[int, int, int]) -> None:
    """Write det.txt: boxes of 10x16 pixels at (frame, x, y)."""
    text = "".join(f"{frame + 1},-1,{x + 1},{y + 1},10,16,1,-1,-1,-1\n" for frame, x, y in rows)
    Path("det.txt").write_text(text)


def test_beside_a_detector_marks_come_first_and_its_own_view_of_them_is_left_out(track):
    detections((9, 19, 10), (10, 21, 10), (10, 88, 50), (10, 60, 20))  # 10: the red one, the blue one, a stranger
    done = track("--init", "blue.png@10", "--detector", "det.txt", *NOTHING_MORE)
    assert done.code == 0, done.stderr
    assert rows_at(9).boxes.tolist() == [[19, 10, 29, 26]]
    there = [[21, 10, 31, 26], [60, 20, 70, 36], [*Mask.of_image(BLUE).box]]
    assert sorted(rows_at(10).boxes.tolist()) == there
    about = json.loads(Path("run/run.json").read_text())
    assert (about["detector"]["name"], about["init"]) == ("recorded", ["blue.png@10"])


def test_beside_a_detector_what_is_marked_has_its_id_and_what_is_found_another(track):
    done = track("--init", "both.png@10", "--detector", "background", "--no-video")
    assert done.code == 0, done.stderr
    assert json.loads(Path("run/run.json").read_text())["tracker"]["name"] == "trackcut"
    for frame in (9, 39):
        rows = rows_at(frame)
        red, blue = (next(k for k, box in enumerate(rows.boxes) if near(box, frame, n)) for n in range(2))
        assert [rows.ids[red], rows.ids[blue]] == ([5, 6] if frame == 9 else [1, 4])


def near(box: np.ndarray, frame: int, block: int) -> bool:
    """Whether a box is where a block of the film is."""
    x, y = ((5 + 2 * (frame - 2), 10), (100 - 2 * (frame - 4), 50))[block]
    return bool(np.abs(box - (x, y, x + 10, y + 16)).max() <= 3)


def test_marks_beside_a_detector_of_classes_are_of_every_class(track):
    detections((10, 60, 20))
    done = track("--init", "blue.png@10", "--detector", "det.txt", "--class", "dog", *NOTHING_MORE)
    assert done.code == 0, done.stderr
    assert len(rows_at(10)) == 1


def test_frames_of_marks_are_the_sources_own_after_a_start(track):
    done = track("--init", "both.png@10", "--start", "8f", "--stride", "2", *NOTHING_MORE)
    assert done.code == 0, done.stderr
    assert len(rows_at(10)) == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--init", "gone.png"], "init = 'gone.png': there is no such file"),
        (["--init", "small.png"], "the mask is 60x40, the video 120x80"),
        (["--init", "empty.png"], "the mask is empty"),
        (["--init", "full.png"], "covers 100.0 %"),
        (["--init", "both.png@10", "--detector", "nan.txt"], "nan.txt, line 1"),
        (["--init", "both.png@10", "--detector", "nan.jsonl"], "nan.jsonl, line 2: not JSON (NaN is not a number"),
        (
            ["--init", "both.png@10", "--detector", "score.jsonl"],
            "score.jsonl, line 2: not JSON (NaN is not a number",
        ),
        (["--init", "nan,10,20,30"], "it is no file, no box and no polygon"),
        (["--init", "both.png@10", "--trust", "nan"], "trust = nan is out of range"),
        (["--init", "both.png@40"], "frame 40 is not among those that are tracked, 0 to 39"),
        (["--init", "both.png@10", "--start", "20f"], "20 to 39"),
        (["--init", "both.png@10", "--end", "10f"], "0 to 9"),
        (["--init", "both.png@10", "--init", "both.png@10"], "marked twice"),
        (["--init", "0,0,120,80"], "covers 100.0 %"),
        (["--init", "both.png@10", "--detector", "gone.txt"], "no such file of detections"),
        (["--init", "both.png@40", "--detector", "background"], "frame 40 is not among those that are tracked"),
        (["--init", "both.png@10", "--detector", "background", "--class", "dog"], "names no classes"),
        (["--init", "both.png", "--class", "dog"], "--class"),
        (["--init", "both.png", "--least-area", "0.1"], "'background'"),
        (["--init", "both.png@10", "--roi", "50,0,20,80"], "outside the roi"),
        (["--detector", "marked"], "not a detector"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_mark_that_cannot_be_is_one_clear_line_exit_code_2_and_nothing_left_behind(track, words, said):
    cv2.imwrite("small.png", np.ones((40, 60), np.uint8))
    cv2.imwrite("empty.png", np.zeros((80, 120), np.uint8))
    cv2.imwrite("full.png", np.ones((80, 120), np.uint8))
    Path("nan.txt").write_text("1,-1,10,nan,20,30,1,-1,-1,-1\n")
    for name, x, score in (("nan", "NaN", 1), ("score", 10, "NaN")):
        row = f'{{"frame":0,"time":0,"boxes":[[{x},9,20,30]],"scores":[{score}],"classes":[""],"masks":[null]}}'
        Path(f"{name}.jsonl").write_text(f'{{"format":"perdure-regions","version":1}}\n{row}\n')
    done = track(*words)
    assert done.code == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not Path("run").exists()


@pytest.mark.parametrize("words", [["--init", "box.png"], ["--init", "10,10,30,30"], ["--tracker", "trackcut"]])
@pytest.mark.parametrize("grey", [0, 128, 255])
def test_a_film_of_one_colour_ends_well(track, words, grey):
    for path in Path("film").iterdir():
        cv2.imwrite(str(path), np.full((80, 120, 3), grey, np.uint8))
    box = np.zeros((80, 120), np.uint8)
    box[10:40, 10:40] = 7
    cv2.imwrite("box.png", box)
    done = track(*words, "--end", "12f", "--no-video")
    assert done.code == 0, done.stderr
    marked = rows_at(0)
    assert [mask.area for mask in marked.masks] == ([900] if "--init" in words else [])
    assert {one for k in range(12) for one in rows_at(k).ids.tolist()} <= {1, 7}


def test_frames_of_one_colour_in_between_are_got_over(track):
    for k in (15, 16, 17):
        cv2.imwrite(f"film/{k:03d}.png", np.full((80, 120, 3), 128, np.uint8))
    done = track("--init", "both.png@10", "--no-video")
    assert done.code == 0, done.stderr
    for frame in (14, 25):
        rows = rows_at(frame)
        assert [near(rows.boxes[rows.ids == name][0], frame, n) for n, name in enumerate((1, 4))] == [True, True]


def test_a_mark_of_all_but_a_strip_and_of_one_pixel_ends_well(track):
    strip = np.ones((80, 120), np.uint8)
    strip[:, :2] = 0
    cv2.imwrite("strip.png", strip)
    one = np.zeros((80, 120), np.uint8)
    one[40, 60] = 5
    cv2.imwrite("one.png", one)
    for name, area in (("strip", 118 * 80), ("one", 1)):
        done = track("--init", f"{name}.png@10", "--no-video", "--overwrite")
        assert done.code == 0, done.stderr
        assert rows_at(10).masks[0].area == area


def test_boxes_without_a_picture_are_marked_as_they_are(track, tmp_path):
    (tmp_path / "SEQ").mkdir()
    (tmp_path / "SEQ/seqinfo.ini").write_text(
        "[Sequence]\nname=SEQ\nimDir=img1\nframeRate=10\nseqLength=9\nimWidth=120\nimHeight=80\nimExt=.jpg\n"
    )
    tracks = perdure.track("SEQ", tracker="overlap", init="10,10,20,30@4", confirm=0.0)
    assert tracks.in_frame(4).boxes.tolist() == [[10, 10, 30, 40]]


def test_from_python_masks_may_be_arrays_with_their_frame(monkeypatch):
    for name in ("trackcut", "contour"):
        monkeypatch.delitem(TRACKERS, name)
    monkeypatch.setitem(TRACKERS, "hold", Hold)
    indices = RED * 3 + BLUE * 2
    tracks = perdure.track(FILM, init=[(indices, 10), "0,0 5,0 5,5@12"])
    assert tracks.in_frame(11).ids.tolist() == [2, 3]
    assert tracks.in_frame(39).ids.tolist() == [1]
    plan = perdure.plan(FILM, init=(indices, 10))
    assert plan.init == ("an array of 120x80@10",)
    assert isinstance(plan.detector, Marked)
    assert perdure.plan(FILM, init=[]).detector_name == "background"
    plan = perdure.plan(FILM, init=(indices, 10), detector="background")
    assert isinstance(plan.detector, Background)
    assert [mark.id for mark in plan.marks] == [2, 3]


def test_of_what_passes_once_only_frame_0_can_be_marked(monkeypatch):
    for name in ("trackcut", "contour"):
        monkeypatch.delitem(TRACKERS, name)
    monkeypatch.setitem(TRACKERS, "hold", Hold)
    assert perdure.track((image for image in FILM), init="10,10,20,30").ids.tolist() == [1] * len(FILM)
    for options, said in (
        ({"init": "10,10,20,30@3"}, "passes only once"),
        ({"init": "1,1,9,9", "start": 1}, "--start"),
    ):
        with pytest.raises(ParameterError, match=said):
            perdure.track((image for image in FILM), **options)

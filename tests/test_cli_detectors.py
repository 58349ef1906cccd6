"""Detectors of others on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
pytest.importorskip("onnx", reason="onnx is not installed, by which networks are drawn")

from networks import network
from test_cli import perdure, write_film
from worlds import two_apart

from perdure import pipeline
from perdure.files.mot import read_tracks


@pytest.fixture(name="at", scope="module")
def a_folder_with_a_film_and_a_network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("detectors")
    write_film(folder / "walk.avi", [frame.image for frame in two_apart().frames()][:20])
    answer = np.zeros((1, 300, 6), np.float32)
    answer[0, :4] = [
        [0.25, 0.25, 0.5, 0.75, 0.9, 0], [0.6, 0.25, 0.8, 0.75, 0.8, 1], [0, 0, 0.5, np.nan, 0.9, 1], [1, 1, 0, 0, 0.9, 1],
    ]  # fmt: skip
    network(folder / "two.onnx", {"out": answer}, metadata={"names": "['cat', 'dog']"})
    (folder / "names.txt").write_text("lion\nwolf\n")
    return folder


def test_a_network_is_tracked_by_class_and_the_run_tells_what_it_was(at: Path):
    words = [
        "walk.avi",
        "--detector",
        "onnx:two.onnx",
        "--class",
        "wolf",
        "--class-names",
        "names.txt",
        "--confirm",
        0,
    ]
    done = perdure("track", *words, "-o", "wolves", "--no-video", at=at)
    assert done.returncode == 0, done.stderr
    assert (
        "40 boxes that the detector gave were left out; first, in frame 0, 2 boxes left out: 1 with" in done.stderr
    )
    rows = read_tracks(at / "wolves" / "tracks.txt")
    assert set(rows.ids.tolist()) == {1}
    assert rows.boxes[0].tolist() == pytest.approx(
        [72, 11.16, 96, 70.7], abs=0.01
    )  # 43 rows of 64 are the picture
    told = json.loads((at / "wolves" / "run.json").read_text())["detector"]
    assert told["name"] == "onnx"
    assert told["network"] == {
        "file": "two.onnx", "layout": "rows after suppression", "input": "64x64, in the middle, RGB 0 to 1", "classes": ["lion", "wolf"],
    }  # fmt: skip
    events = (at / "wolves" / "events.csv").read_text()
    assert events.count("unusable") == 20


def test_a_class_of_which_nothing_was_seen_is_told(at: Path):
    answer = np.zeros((1, 300, 6), np.float32)
    answer[0, 0] = [0.25, 0.25, 0.5, 0.75, 0.9, 3]
    network(at / "numbers.onnx", {"out": answer})
    for command in (("track", "-o", "none", "--no-video"), ("detect", "-o", "none.jsonl")):
        done = perdure(*command, "walk.avi", "--detector", "onnx:numbers.onnx", "--class", 99, at=at)
        assert done.returncode == 0, done.stderr
        assert "no region was of class 99; without --class, `perdure detect` shows which" in done.stderr
    assert "no region was of class" in json.loads((at / "none" / "run.json").read_text())["warnings"][-1]
    film = [np.zeros((64, 64, 3), np.uint8)] * 3
    with pytest.warns(RuntimeWarning, match="no region was of class 4 or 99"):
        pipeline.track(film, detector=f"onnx:{at / 'numbers.onnx'}", classes=["4", "99"])


def test_regions_of_a_network_with_silhouettes_are_written_to_a_file(at: Path):
    words = ["walk.avi", "--detector", "onnx:two.onnx", "--box-masks", "background", "--network-score", 0.85]
    done = perdure("detect", *words, "-o", "cats.jsonl", "--least-area", 0.001, "--json", at=at)
    assert json.loads(done.stdout.splitlines()[-1])["regions"] == 20
    assert "boxes that the detector gave were left out" in done.stderr
    lines = [json.loads(line) for line in (at / "cats.jsonl").read_text().splitlines()[1:]]
    assert {name for line in lines for name in line["classes"]} == {"cat"}
    assert any(line["masks"][0] for line in lines)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--detector", "onnx:none.onnx"], "there is no such file"),
        (["--detector", "onnx:."], "is a folder"),
        (["--detector", "onnx:walk.avi"], "not a whole ONNX model"),
        (["--detector", "two.onnx"], "--detector onnx:two.onnx"),
        (["--detector", "onnx:two.onnx", "--class-names", "none.txt"], "none.txt"),
        (["--class-names", "names.txt"], "--class-names goes with"),
        (["--detector", "onnx:two.onnx", "--box-masks", "cuts"], "none or background or cut"),
        (["--detector", "onnx:two.onnx", "--threshold", 4], "'threshold' belongs to the detector 'background'"),
        (["--detector", "onnx:two.onnx", "--input-size", 640], "takes pictures of 64x64 only"),
        (["--tracker", "multifeature", "--embedding", "."], "is a folder"),
        (["--tracker", "norfair"], "--tracker norfair:CLASS"),
    ],
)
def test_a_mistake_is_said_in_one_line_and_leaves_nothing(at: Path, words, said):
    done = perdure("track", "walk.avi", *words, "-o", "nothing", at=at)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (at / "nothing").exists()


def test_a_run_does_not_take_the_place_of_its_network(at: Path):
    done = perdure("track", "walk.avi", "--detector", "onnx:two.onnx", "-o", "two.onnx", "--overwrite", at=at)
    assert done.returncode == 2
    assert (at / "two.onnx").is_file()

"""`perdure convert`, and the formats that `perdure export` and `perdure score` share with it, as a user types them."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from format_rows import FPS, HEIGHT, RING, WIDTH, at_rate, content, everything

from perdure.cli.commands import run as run_command
from perdure.files.formats import FORMATS, WRITTEN, read, recognised
from perdure.files.log import RunLog
from perdure.files.runs import RunFolder
from perdure.types import Report, Tracks

BOXES = """\
1,1,912.48,484.10,97.55,109.06,1,-1,-1,-1
2,1,12.03,21.00,30.37,40.00,0.5,-1,-1,-1
2,2,61.00,-3.21,30.00,40.91,0.875,-1,-1,-1
"""


class Done(NamedTuple):
    code: int
    stdout: str
    stderr: str

    @property
    def value(self) -> dict:
        return json.loads(self.stdout.splitlines()[-1])


@pytest.fixture
def perdure_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Done]:
    """Run `perdure` with some words, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def run_it(*words: object) -> Done:
        monkeypatch.setattr(sys, "argv", ["perdure", *map(str, words)])
        return Done(run_command(), *capsys.readouterr())

    return run_it


@pytest.fixture
def boxes(tmp_path: Path) -> Path:
    path = tmp_path / "boxes.txt"
    path.write_text(BOXES)
    return path


def write_run(folder: Path, tracks: Tracks) -> Path:
    folder.mkdir()
    RunFolder(folder).write_about({"height": HEIGHT, "width": WIDTH, "source": "/films/yard.mp4"})
    with RunLog(folder / "tracks.jsonl") as log:
        for frame in range(5):
            log.append(frame, frame / FPS, Report(tracks.in_frame(frame)))
    return folder


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", at_rate(everything()))


ROUND = [  # from MOT text and back, by the words that each format needs
    ("a.csv", ()),
    ("a.xml", ()),
    ("a.parquet", ()),
    ("a.geojson", ()),
    ("a.txt", ("--to", "kitti")),
    ("a.json", ("--to", "coco-video", "--size", "640x480")),
]


@pytest.mark.parametrize(("name", "words"), ROUND)
def test_boxes_go_to_another_format_and_come_back_as_the_same_bytes(
    perdure_says: Callable[..., Done], boxes: Path, name: str, words: tuple[str, ...]
):
    there = perdure_says("convert", "boxes.txt", name, *words, "--json")
    assert (there.code, there.value["rows"], there.value["ids"]) == (0, 3, 2)
    back = perdure_says("convert", name, "back.txt")
    assert (back.code, Path("back.txt").read_text()) == (0, BOXES)


def test_what_is_lost_is_a_warning_with_the_number_of_rows(perdure_says: Callable[..., Done], run: Path):
    done = perdure_says("convert", "run", "a.txt", "--json")
    assert done.stderr == (
        "perdure: warning: mot does not hold silhouettes (4 rows); whole silhouettes as believed (1 row); contours between"
        " pixels (1 row); classes (4 rows); status (2 rows); groups (1 row); hidden sides (1 row); places on the ground"
        " (2 rows); links to regions (3 rows)\n"
    )
    assert done.value["from"] == "run"
    assert done.value["lost"][0] == {"what": "silhouettes", "rows": 4}
    assert perdure_says("convert", "run", "a.parquet").stderr == ""


def test_what_nothing_is_lost_of_is_no_warning(perdure_says: Callable[..., Done], boxes: Path):
    done = perdure_says("convert", "boxes.txt", "a.csv")
    assert (done.stderr, done.stdout) == ("", "3 rows, 2 ids: a.csv  (mot → csv)\n")


def test_rows_without_a_silhouette_are_left_out_of_silhouettes_and_counted(
    perdure_says: Callable[..., Done], tmp_path: Path
):
    FORMATS["parquet"].write(tmp_path / "a.parquet", content(everything()), overwrite=False)
    done = perdure_says("convert", "a.parquet", "masks", "--to", "mask-png", "--json")
    assert "warning: rows left out, without a silhouette: 2\n" in done.stderr
    assert (done.value["rows"], done.value["left_out"]) == (4, 2)


def test_a_run_is_converted_with_the_rows_that_count(perdure_says: Callable[..., Done], run: Path):
    assert perdure_says("convert", "run", "a.json", "--to", "coco-vis").code == 0
    found = read(Path("a.json"), recognised(Path("a.json")))
    assert found.tracks.ids.tolist() == [1, 2, 1, 2]  # neither the group nor the lost one
    assert (found.name, found.size, tuple(found.frames)) == ("yard", (HEIGHT, WIDTH), (0, 1, 2, 3, 4))
    assert found.tracks.masks[0] == RING
    assert perdure_says("convert", "run/tracks.jsonl", "b.json", "--to", "coco-vis").code == 0
    assert Path("b.json").read_bytes() == Path("a.json").read_bytes()


def test_a_folder_of_labels_is_converted_file_by_file(perdure_says: Callable[..., Done], tmp_path: Path):
    (tmp_path / "label_02").mkdir()
    for name in ("0000", "0001"):
        FORMATS["kitti"].write(tmp_path / f"label_02/{name}.txt", content(at_rate(everything())), overwrite=False)
    assert "name the format of the new ones by --to" in perdure_says("convert", "label_02", "out").stderr
    done = perdure_says("convert", "label_02", "out", "--to", "mot", "--json")
    assert (done.code, [one["rows"] for one in done.value["files"]]) == (0, [6, 6])
    assert sorted(one.name for one in (tmp_path / "out").iterdir()) == ["0000.txt", "0001.txt"]
    assert done.value["files"][0]["output"] == "out/0000.txt"
    (tmp_path / "label_02/0001.txt").write_text("0 1 Car\n" * 2)
    assert perdure_says("convert", "label_02", "other", "--to", "mot").code == 2
    assert not (tmp_path / "other").exists()  # all of it or nothing


def test_times_size_and_class_are_what_the_user_says(perdure_says: Callable[..., Done], boxes: Path):
    words = ("--to", "coco-video", "--size", "640x480", "--fps", "50", "--class", "dog")
    assert perdure_says("convert", "boxes.txt", "a.json", *words).code == 0
    found = read(Path("a.json"), recognised(Path("a.json")))
    assert (found.size, found.fps) == ((480, 640), 50)
    assert found.tracks.times.tolist() == [0, 0.02, 0.02]
    assert set(found.tracks.classes.tolist()) == {"dog"}


def test_a_class_of_several_words_becomes_one_word_in_kitti_and_that_is_told(
    perdure_says: Callable[..., Done], boxes: Path
):
    done = perdure_says("convert", "boxes.txt", "a.txt", "--to", "kitti", "--class", "person on vehicle")
    assert (done.code, done.stderr) == (
        0,
        "perdure: warning: kitti does not hold blanks in classes: they are '_' there (3 rows)\n",
    )
    assert {line.split()[2] for line in Path("a.txt").read_text().splitlines()} == {"person_on_vehicle"}
    again = perdure_says("convert", "a.txt", "b.txt", "--to", "kitti")
    assert (again.code, again.stderr, Path("b.txt").read_text()) == (0, "", Path("a.txt").read_text())


def test_a_size_in_which_the_boxes_do_not_lie_is_a_note_that_names_one(
    perdure_says: Callable[..., Done], boxes: Path
):
    there = perdure_says("convert", "boxes.txt", "a.json", "--to", "coco-video", "--size", "640x480")
    assert (there.code, there.stderr) == (
        0,
        "perdure: note: 1 of 3 boxes lie more outside than inside the 640x480 of --size, "
        "the first that of id 1 in frame 0 (911.48, 483.1, 1009.03, 592.16)\n",
    )
    wide = perdure_says("convert", "boxes.txt", "b.json", "--to", "coco-video", "--size", "1920x1080")
    assert (wide.code, wide.stderr) == (0, "")  # a box may leave the picture a little


REFUSED = [
    (("boxes.txt", "a.json"), "a.json may be of several formats; name one by --to: coco-vis, coco-video"),
    (("boxes.txt", "a.xyz"), "a.xyz does not tell its format; name one by --to: mot, mots"),
    (("boxes.txt", "a.csv", "--to", "cvt"), "cvat"),
    (("boxes.txt", "a.csv", "--to", "run"), "run"),
    (("boxes.txt", "a.csv", "--from", "voc"), "voc"),
    (("boxes.txt", "a.json", "--to", "coco-vis"), "needs the size of the pictures, .*add --size WIDTHxHEIGHT"),
    (("boxes.txt", "a.json", "--to", "coco-vis", "--size", "640"), "'640' is not WIDTHxHEIGHT, as in 1920x1080"),
    (
        ("boxes.txt", "a.txt", "--to", "mots", "--size", "64x48"),
        "there is no silhouette to write.*of boxes there are mot",
    ),
    (("boxes.txt", "a.csv", "--fps", "0"), "fps 0 is out of range"),
    (("nowhere.txt", "a.csv"), "there is no nowhere.txt"),
    (("boxes.txt", "boxes.txt", "--overwrite"), "boxes.txt is what is read"),
    (("boxes.txt", "taken.csv"), "taken.csv is there already; add --overwrite"),
    (("taken.zip", "a.csv"), "taken.zip is none of the known formats: mot, .*name it by --from"),
    (("empty", "a.csv"), "empty is none of the known formats, nor does it hold files of them"),
    (("run", "run/tracks.jsonl", "--to", "csv", "--overwrite"), "a part of run, which is read"),
    (("run", "a.json", "--to", "coco-vis", "--size", "9x9"), "run says 16x12, --size says 9x9"),
    (("boxes.txt", "a.xml", "--class", "\x01"), "a character that XML cannot hold"),
]


@pytest.mark.parametrize(("words", "why"), REFUSED, ids=[" ".join(one[0])[:40] for one in REFUSED])
def test_a_mistake_is_one_line_and_leaves_nothing_behind(
    perdure_says: Callable[..., Done], boxes: Path, run: Path, tmp_path: Path, words: tuple[str, ...], why: str
):
    (tmp_path / "taken.csv").write_text("precious")
    (tmp_path / "taken.zip").write_text("precious")
    (tmp_path / "empty").mkdir()
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    done = perdure_says("convert", *words)
    assert (done.code, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert re.search(why, done.stderr)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_what_is_there_is_replaced_only_if_that_is_asked(perdure_says: Callable[..., Done], boxes: Path):
    for name in ("a.csv", "a.xml", "a.parquet", "a.geojson"):
        assert perdure_says("convert", "boxes.txt", name).code == 0
        assert perdure_says("convert", "boxes.txt", name).code == 2
        assert perdure_says("convert", "boxes.txt", name, "--overwrite").code == 0


def test_without_pyarrow_parquet_says_what_to_install(
    perdure_says: Callable[..., Done], boxes: Path, monkeypatch: pytest.MonkeyPatch
):
    assert perdure_says("convert", "boxes.txt", "there.parquet").code == 0
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    for words in (("boxes.txt", "a.parquet"), ("there.parquet", "a.csv")):
        done = perdure_says("convert", *words)
        assert (done.code, "pip install 'perdure[parquet]'" in done.stderr) == (2, True)


@pytest.mark.parametrize("name", ["coco-vis", "coco-video", "cvat", "cvat-mask", "kitti", "parquet"])
def test_a_run_is_exported_in_the_formats_of_others(perdure_says: Callable[..., Done], run: Path, name: str):
    path = Path(f"a{FORMATS[name].suffixes[0]}")
    done = perdure_says("export", "run", "--format", name, "-o", path, "--json")
    assert (done.code, done.value) == (0, {"output": str(path), "rows": 4})
    assert ("does not hold" in done.stderr) == (name != "parquet")
    assert read(path, recognised(path)).tracks.ids.tolist() == [1, 2, 1, 2]
    assert perdure_says("export", "run", "--format", name, "-o", path).code == 2


def test_whole_silhouettes_are_exported_where_they_are_asked_for(perdure_says: Callable[..., Done], run: Path):
    done = perdure_says("export", "run", "--format", "coco-vis", "--believed", "-o", "a.json")
    assert done.code == 0
    assert read(Path("a.json"), FORMATS["coco-vis"]).tracks.masks[2].area == 20
    for name in ("cvat", "kitti", "parquet"):
        assert perdure_says("export", "run", "--format", name, "--believed", "-o", "b").code == 2


def test_a_score_is_the_same_whatever_the_format(perdure_says: Callable[..., Done], tmp_path: Path):
    truth = at_rate(everything().take([0, 1, 2, 3]).replace(confidence=[1, 1, 1, 1]))
    said = truth.replace(boxes=truth.boxes + np.float32(0.25), ids=[1, 2, 1, 1], frames=[0, 0, 1, 2])
    FORMATS["mot"].write(tmp_path / "said.txt", content(said), overwrite=False)
    FORMATS["mot"].write(tmp_path / "gt.txt", content(truth), overwrite=False)
    wanted = perdure_says("score", "said.txt", "--truth", "gt.txt", "--json").value["sequences"][0]["boxes"]
    assert 0 < wanted["HOTA"] < 1
    for name in ("csv", "kitti", "coco-vis", "coco-video", "cvat", "parquet", "geojson"):
        result, true = (Path(f"{one}-{name}{FORMATS[name].suffixes[0]}") for one in ("said", "gt"))
        FORMATS[name].write(result, content(said), overwrite=False)
        FORMATS[name].write(true, content(truth), overwrite=False)
        done = perdure_says("score", result, "--truth", true, "--json")
        assert done.code == 0, done.stderr
        assert done.value["sequences"][0]["protocol"] == "rows"
        assert done.value["sequences"][0]["boxes"] == pytest.approx(wanted), name


def test_silhouettes_of_another_format_are_scored_too(perdure_says: Callable[..., Done], run: Path):
    for name in ("mots", "coco-vis"):
        perdure_says("convert", "run", f"{name}{FORMATS[name].suffixes[0]}", "--to", name)
    done = perdure_says("score", "run", "--truth", "coco-vis.json", "--masks", "--json")
    assert done.value["sequences"][0]["masks"]["MOTSA"] == 1
    assert (
        "every row of the truth counts"
        in perdure_says("score", "mots.txt", "--truth", "coco-vis.json", "--masks").stdout
    )


def test_every_format_is_named_in_the_help(perdure_says: Callable[..., Done], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("COLUMNS", "400")
    shown = perdure_says("convert", "--help").stdout
    assert all(name in shown for name in (*WRITTEN, "run"))

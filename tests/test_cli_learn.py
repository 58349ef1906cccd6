"""`perdure learn` and `perdure context`: a context from boxes, and what a video is like."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from perdure.cli.commands import app
from perdure.errors import DamagedVideo
from perdure.files.contexts import read_context

COUNT = 16


def box(k: int, who: int) -> tuple[float, float, float, float]:
    """Left, top, width, height of a tall one who goes right and a short one who goes left."""
    return (10 + 5 * k, 20, 20, 60) if who == 1 else (90 - 5 * k, 35, 20, 30)


def sequence(folder: Path, whose: tuple[int, ...] = (1, 2)) -> Path:
    """A MOTChallenge folder without images, with its truth and detections."""
    for part in ("gt", "det"):
        (folder / part).mkdir(parents=True)
    (folder / "seqinfo.ini").write_text(
        f"[Sequence]\nname=yard\nframeRate=10\nseqLength={COUNT}\nimWidth=120\nimHeight=90\n"
    )
    for part, first in (("gt/gt.txt", None), ("det/det.txt", -1)):
        rows = []
        for k in range(COUNT):
            for who in whose:
                left, top, width, height = box(k, who)
                rows.append(f"{k + 1},{first or who},{left + 1},{top + 1},{width},{height},1,-1,-1,-1\n")
        (folder / part).write_text("".join(rows))
    return folder


@pytest.fixture
def yard(tmp_path: Path) -> Path:
    return sequence(tmp_path / "yard")


def said(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, list(map(str, words)))
    return done.exit_code, done.stdout, str(done.exception or "")


def test_a_context_is_learnt_written_drawn_and_told(tmp_path: Path, yard: Path):
    out = tmp_path / "yard.json"
    code, text, wrong = said("learn", yard, "--truth", yard, "--detector", yard / "det/det.txt", "-o", out)
    assert code == 0, wrong
    assert text.splitlines()[0].split() == [
        "feature",
        "AUC",
        "threshold",
        "error",
        "%",
        "known",
        "%",
        "rounds",
        "weight",
    ]
    assert "pairs     " in text
    assert "displacement_3d" in text.split("unknown")[1]
    context = read_context(out)
    assert (context.name, context.training.sources) == ("yard", ("yard",))
    assert sum(context.weights.values()) == pytest.approx(1.0, abs=1e-5)
    assert cv2.imread(str(tmp_path / "yard.png")).shape[1] == 1240
    assert sorted(one.name for one in tmp_path.iterdir()) == ["yard", "yard.json", "yard.png"]


def test_several_sources_as_in_the_paper_for_machines_and_twice_the_same(tmp_path: Path, yard: Path):
    other = sequence(tmp_path / "other")
    words = (
        "learn",
        yard,
        other,
        "--truth",
        yard,
        other / "gt/gt.txt",
        "--paper",
        "--rounds",
        5,
        "--name",
        "both",
        "--json",
    )
    for name in ("one", "two"):
        code, text, wrong = said(*words, "-o", tmp_path / f"{name}.json", "--end", "8f")
        assert code == 0, wrong
    told = json.loads(text.splitlines()[-1])
    assert (told["name"], told["training"]["sources"]) == ("both", ["yard", "other"])
    assert told["training"]["same"] == 2 * 2 * 7
    assert told["training"]["options"]["rounds"] == 5
    assert (told["similar"], told["levels"]) == (0.5, {})
    for end in (".json", ".png"):
        assert (tmp_path / f"one{end}").read_bytes() == (tmp_path / f"two{end}").read_bytes()


def test_a_truth_with_a_single_object_gives_displacement_and_says_why(tmp_path: Path):
    alone = sequence(tmp_path / "alone", (1,))
    code, text, wrong = said("learn", alone, "--truth", alone, "-o", tmp_path / "alone.json")
    assert code == 0, wrong
    assert "displacement alone" in text
    assert read_context(tmp_path / "alone.json").weights == {"displacement_2d": 1.0}


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (("-o", "x.txt", "--truth", "yard"), "must end in .json"),
        (("-o", "x.json"), "1 sources and 0 truths; give one --truth for each"),
        (("-o", "x.json", "--truth", "yard", "yard"), "1 sources and 2 truths"),
        (
            ("yard", "-o", "x.json", "--truth", "yard", "yard", "--detector", "yard/det/det.txt"),
            "regions of one source",
        ),
        (("-o", "x.json", "--truth", "yard", "--draw", "x.jpg"), "must end in .png"),
        (("-o", "x.json", "--truth", "yard", "--name", " "), "--name is empty"),
        (("-o", "x.json", "--truth", "yard", "--rounds", "0"), "rounds = 0 is out of range"),
        (("-o", "x.json", "--truth", "yard/gt/none.txt"), "yard/gt/none.txt"),
        (("-o", "old.json", "--truth", "yard"), "is there already; add --overwrite"),
        (("-o", "y.json", "--draw", "old.png", "--truth", "yard"), "is there already; add --overwrite"),
        (("-o", "x.json", "--truth", "yard", "--detector", "far.txt"), "nothing can be learnt from yard"),
        (("-o", "x.json", "--truth", "empty.txt"), "nothing can be learnt from yard"),
    ],
)
def test_what_cannot_be_learnt_is_refused_and_nothing_is_left_behind(
    tmp_path: Path, yard: Path, monkeypatch: pytest.MonkeyPatch, words, hint
):
    monkeypatch.chdir(tmp_path)
    for name in ("old.json", "old.png"):
        Path(name).write_text("mine")
    Path("far.txt").write_text("1,-1,100,1,5,5,1\n2,-1,100,1,5,5,1\n")
    Path("empty.txt").write_text("")
    code, _, wrong = said("learn", "yard", *words)
    assert code != 0
    assert hint in wrong
    assert "\n" not in wrong
    assert {one.name for one in tmp_path.iterdir()} == {"yard", "old.json", "old.png", "far.txt", "empty.txt"}
    assert Path("old.json").read_text() == "mine"


def test_a_video_is_measured_and_held_against_contexts(tmp_path: Path, yard: Path):
    out = tmp_path / "yard.json"
    assert said("learn", yard, "--truth", yard, "-o", out)[0] == 0
    code, text, wrong = said("context", yard, "--context", out)
    assert code == 0, wrong
    lines = [line.split() for line in text.splitlines()]
    assert ["objects", "2", "objects", "in", "a", "frame"] in lines
    assert ["illumination", "-", "mean", "grey"] in lines
    assert ["yard", "0.00"] in [line[:2] for line in lines]
    told = json.loads(said("context", yard, "--context", out, "--json")[1].splitlines()[-1])
    assert told["measures"]["fps"] == pytest.approx(10.0)
    assert (told["measures"]["illumination"], told["measures"]["pictures"]) == (None, False)
    assert min(told["contexts"], key=lambda one: one["distance"])["name"] == "yard"


def test_pictures_tell_of_light(tmp_path: Path, yard: Path):
    (tmp_path / "film").mkdir()
    for k in range(COUNT):
        cv2.imwrite(str(tmp_path / f"film/{k:03d}.png"), np.full((90, 120, 3), 80, np.uint8))
    code, text, wrong = said("context", tmp_path / "film", "--detector", yard / "det/det.txt", "--json")
    assert code == 0, wrong
    told = json.loads(text.splitlines()[-1])["measures"]
    assert told["illumination"] == pytest.approx(80, abs=0.5)
    assert told["contrast"] == pytest.approx(0, abs=0.01)


def test_a_context_that_is_none_is_refused_before_the_video_is_read(tmp_path: Path, yard: Path):
    (tmp_path / "odd.json").write_text('{"format": "perdure-context", "version": 9}')
    code, _, wrong = said("context", yard, "--context", tmp_path / "odd.json")
    assert code != 0
    assert "it has version 9" in wrong


def test_what_came_before_a_damage_is_learnt_from_and_the_damage_told(tmp_path: Path, yard: Path, monkeypatch):
    def broken(items, *_):
        yield from list(items)[:8]
        raise DamagedVideo("yard breaks off at frame 8", 8, 0.8)

    for command in ("learn", "context"):
        monkeypatch.setattr(f"perdure.cli.{command}.watched", broken)
    code, text, wrong = said("learn", yard, "--truth", yard, "-o", tmp_path / "yard.json")
    assert (code, wrong) == (1, "yard breaks off at frame 8")  # as `main` turns into exit code 3
    assert read_context(tmp_path / "yard.json").training.same == 2 * 7 + 2 * 6
    code, text, wrong = said("context", yard)
    assert (code, wrong) == (1, "yard breaks off at frame 8")
    assert "objects" in text

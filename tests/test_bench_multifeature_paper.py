"""The bench of the multi-feature paper: learns from one drawn street, tests on another, and counts what it says."""

from __future__ import annotations

import argparse
from pathlib import Path

import multifeature_paper as bench
import numpy as np
import pytest
from regions import Table

from perdure.errors import ParameterError
from perdure.features.pool import PAPER, POOL
from perdure.learn import Samples

FRAMES = 24


def street(folder: Path, seed: int) -> None:
    """Write a sequence without pictures: three people of different sizes who pass each other."""
    rng = np.random.default_rng(seed)
    truth, seen = [], []
    for frame in range(1, FRAMES + 1):
        for number, (x, speed, height) in enumerate(((20, 6, 60), (160, -6, 90), (90, 1, 75)), 1):
            left, top, width = x + speed * frame, 40 + 12 * number, 0.4 * height
            truth.append(f"{frame},{number},{left},{top},{width},{height},1,1,1")
            jitter = rng.normal(0, 0.5, 2)
            seen.append(f"{frame},-1,{left + jitter[0]:.2f},{top + jitter[1]:.2f},{width},{height},0.95")
    for name, lines in (("gt/gt.txt", truth), ("det/det.txt", seen)):
        (folder / name).parent.mkdir(parents=True)
        (folder / name).write_text("\n".join(lines) + "\n")
    (folder / "seqinfo.ini").write_text(
        f"[Sequence]\nname=x\nimDir=img1\nframeRate=10\nseqLength={FRAMES}\nimWidth=400\nimHeight=240\nimExt=.jpg\n"
    )


@pytest.fixture
def streets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> bench.Bench:
    for seed, name in enumerate(("here", "there")):
        street(tmp_path / name, seed)
    clips = {name: bench.Clip(name, "", "det/det.txt") for name in ("here", "there", "nowhere")}
    monkeypatch.setattr(bench, "CLIPS", clips)
    return bench.Bench(tmp_path)


def view(name: str, half: int = 0) -> bench.View:
    return bench.View(name, half)


@pytest.mark.parametrize("setting", list(bench.SETTINGS))
def test_a_trial_is_followed_with_equal_weights_and_with_those_learnt_elsewhere(
    streets: bench.Bench, setting: str
):
    (both,) = streets.compared([bench.Trial((view("here"),), view("there", 2))], setting)
    told = both.as_json()
    assert told["learnt from"] == "here"
    assert told["tested on"] == "there, 2nd half"
    assert told["equal"]["features"] == 3, "displacement, shape and area: there are no pictures"
    assert told["learnt"]["M"] == 1.0, "whatever the weights, three people who are always seen are easy"
    assert told["learnt"]["tracks_TP"] == 3
    ((_, _, weights),) = streets.learnt_weights()
    if setting == "paper":
        assert set(weights) <= set(PAPER)
        assert both.fitted is None, "Th1 is the same for all"
    else:
        assert both.further == both.learnt.figures["M"] - both.fitted.figures["M"]
        assert streets.context(setting, bench.FITTED, (view("here"),)).weights == dict.fromkeys(PAPER, 1.0)


def test_halves_are_the_frames_before_and_from_the_middle(streets: bench.Bench):
    frames = []
    for half in (1, 2):
        with bench.opened(streets.data, view("here", half)) as film:
            frames.append([frame.index for frame, _ in film.seen])
    assert frames == [list(range(FRAMES // 2)), list(range(FRAMES // 2, FRAMES))]


def test_what_is_not_there_is_left_out_with_a_note(streets: bench.Bench, capsys: pytest.CaptureFixture[str]):
    assert streets.compared([bench.Trial((view("nowhere"),), view("here"))], "paper") == []
    assert "nowhere" in capsys.readouterr().err
    assert streets.beside_peers(streets.data / "no environment") == []


def test_features_outside_the_paper_are_not_known_to_its_learning():
    there = np.ones((2, len(POOL)), np.bool_)
    known = bench.limited(Samples(there * 0.5, there, np.array([1, -1], np.int8), np.ones(2)), PAPER).known
    assert [name for name, one in zip(POOL, known[0], strict=True) if one] == list(PAPER)


def test_features_are_counted_that_can_be_known():
    weights = dict.fromkeys(PAPER, 1.0) | {"area": 0.0}
    assert bench.features_used(weights, pictures=True, ground=True) == 7
    assert bench.features_used(weights, pictures=True, ground=False) == 6
    assert bench.features_used(weights, pictures=False, ground=False) == 2


def run(mean: float, ms: float) -> bench.Run:
    return bench.Run(dict.fromkeys(bench.FIGURES, mean) | dict.fromkeys(bench.TRAJECTORIES, 2.0), ms, 3)


def test_tables_say_on_how_many_trials_learning_helps():
    trial = bench.Trial((view("here"),), view("there"))
    found = [bench.Both(trial, run(0.5, 4.0), run(0.75, 3.0)), bench.Both(trial, run(0.5, 4.0), run(0.5, 5.0))]
    one = bench.table_1("halves", "paper", found)
    assert one.title.startswith(
        "halves: as the paper has it; learning raises M on 1 of 2 and takes less time on 1"
    )
    assert [row[-1] for row in one.rows] == ["", "+25.0", "", "+0.0"]
    fitted = bench.table_1(
        "halves", "defaults", [bench.Both(trial, run(0.5, 4.0), run(0.75, 3.0), run(0.75, 3.0))]
    )
    assert "M on 1 of 1 (weights beyond Th1 on 0) and" in fitted.title
    assert [row[-1] for row in fitted.rows] == ["", "+25.0", "+25.0"]
    three = bench.table_3("defaults", found)
    assert three.rows[-1] == ["all", "8", *["4"] * 6]
    two = bench.table_2(
        [{"clip": "x", "ours": {"equal": 0.5, "learnt": 0.6, "built in": 0.4}, "peers": {"p": 0.7}}]
    )
    assert two.rows == [["x", "60.0", "40.0", "50.0", "**70.0**"]]
    for table in (one, fitted, two, three):
        assert {len(row) for row in table.rows} == {len(table.head)}


def test_tables_of_what_was_not_run_stay_on_the_page():
    def result(title: str) -> bench.Result:
        return bench.Result((Table(title, ["a"], [["1"]]),), {"versions": {"python": "3"}})

    titles = [f"others: {words}; so" for words in bench.SETTING_WORDS.values()] + ["peers: M"]
    page = f"{bench.MARKS.begin}\n{bench.MARKS.end}"
    for title in titles[::-1]:
        page = bench.MARKS.replaced(page, bench.section("python x", result(title), page))
    assert [title for title, _ in bench.MARKS.tables(page)] == titles
    newer = f"others: {bench.SETTING_WORDS['paper']}; otherwise"
    page = bench.section("python x", result(newer), page)
    assert f"**{newer}**" in page
    assert titles[0] not in page


@pytest.mark.parametrize("wrong", [{"parts": ["table9"]}, {"settings": ["mine"]}])
def test_an_unknown_part_or_setting_is_refused_by_name(wrong: dict[str, list[str]], tmp_path: Path):
    given = {"parts": [], "settings": [], "data": tmp_path, **wrong}
    with pytest.raises(ParameterError, match=next(iter(wrong.values()))[0]):
        bench.measure(argparse.Namespace(**given))

"""`perdure track --scenarios`, its live events, and `perdure scenarios`."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

import perdure
from perdure.cli.commands import app
from perdure.cli.film import Doings
from perdure.errors import ParameterError
from perdure.interpret import Feedback
from perdure.types import Event

OWN = """
[[scenario]]
name = "hurries"
pace = {above = 1.0}
lasts = 0.5
"""


def said(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, list(map(str, words)))
    return done.exit_code, done.stdout, f"{done.exception or ''}\n{done.stderr}"


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A MOTChallenge folder without images: one goes slowly, then fast; a detection flickers."""
    folder = tmp_path_factory.mktemp("films") / "yard"
    (folder / "det").mkdir(parents=True)
    (folder / "seqinfo.ini").write_text(
        "[Sequence]\nname=yard\nframeRate=10\nseqLength=60\nimWidth=640\nimHeight=240\n"
    )
    rows = []
    for k in range(60):
        left = 20 + 2 * k if k < 30 else 80 + 12 * (k - 30)
        rows.append(f"{k + 1},-1,{left},60,24,60,1,-1,-1,-1\n")
        if 10 <= k < 15:
            rows.append(f"{k + 1},-1,400,100,20,20,1,-1,-1,-1\n")
    (folder / "det/det.txt").write_text("".join(rows))
    return folder


@pytest.fixture
def own(tmp_path: Path) -> Path:
    (tmp_path / "own.toml").write_text(OWN)
    return tmp_path / "own.toml"


def test_a_line_outside_the_picture_is_a_note(yard: Path, tmp_path: Path):
    lines = "[line]\ndoor = [[600, 10], [900, 50]]\ngate = [[0, 0], [640, 240]]\n"
    (tmp_path / "far.toml").write_text(lines + OWN)
    run, note = (
        tmp_path / "run",
        "perdure: note: line door: its point 900,50 lies outside the picture of 640x240\n",
    )
    words = ("--scenarios", tmp_path / "far.toml")
    code, _, wrong = said("track", yard, "--tracker", "overlap", "--no-video", "-o", run, *words)
    assert (code, note in wrong, "line gate" in wrong) == (0, True, False)
    assert note.split(": ", 2)[2].strip() in json.loads((run / "run.json").read_text())["warnings"]
    code, _, wrong = said("scenarios", run, *words)
    assert (code, wrong.endswith(note)) == (0, True)


def test_events_of_scenarios_are_in_the_run_and_noise_is_taken_back(yard: Path, own: Path, tmp_path: Path):
    run = tmp_path / "run"
    words = ("track", yard, "--tracker", "overlap", "--no-video", "-o", run)
    code, _, wrong = said(*words, "--scenarios", own)
    assert code == 0, wrong
    told = list(csv.DictReader((run / "events.csv").read_text().splitlines()))
    assert [(one["kind"], one["ids"]) for one in told if one["kind"] in ("hurries", "noise")] == [
        ("noise", ""),
        ("hurries", "1"),
    ]
    assert len({line.split(",")[1] for line in (run / "tracks.txt").read_text().splitlines()}) == 1
    about = json.loads((run / "run.json").read_text())["scenarios"]
    assert [one["name"] for one in about["scenarios"]] == ["hurries"]
    assert about["feedback"]["protect"] == 3.0
    said(*words, "--scenarios", own, "--no-drop-noise", "--overwrite")
    assert len({line.split(",")[1] for line in (run / "tracks.txt").read_text().splitlines()}) == 2


def test_events_are_written_live_as_json_lines_with_nothing_between(yard: Path, own: Path, tmp_path: Path):
    code, out, err = said(
        "track",
        yard,
        "--tracker",
        "overlap",
        "--no-video",
        "-o",
        tmp_path / "run",
        "--scenarios",
        own,
        "--events",
        "-",
    )
    told = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    states = [(one["kind"], one["state"]) for one in told if one["kind"] == "hurries"]
    assert states == [("hurries", "begins"), ("hurries", "ends")]
    begins, ends = (one for one in told if one["kind"] == "hurries")
    assert begins["begin"] == ends["begin"]
    assert begins["time"] < ends["time"] or ends["end"] > begins["end"]
    assert "tracks" in err
    assert "both write to stdout" in said("track", yard, "--events", "-", "--json")[2]
    assert "only '-'" in said("track", yard, "--events", "file")[2]


def test_a_finished_run_tells_what_was_not_asked_when_it_ran(yard: Path, own: Path, tmp_path: Path):
    run, table = tmp_path / "run", tmp_path / "events.csv"
    said("track", yard, "--tracker", "overlap", "--no-video", "-o", run)
    before = (run / "events.csv").read_text()
    code, out, wrong = said("scenarios", run, "--scenarios", own, "-o", table, "--json")
    assert code == 0, wrong
    value = json.loads(out)
    assert value["counts"] == {"hurries": 1}
    assert {one["id"]: one["best"] for one in value["targets"]} == {1: "person", 2: "noise"}
    assert [one["kind"] for one in csv.DictReader(table.read_text().splitlines())] == ["hurries"]
    assert (run / "events.csv").read_text() == before
    shown = said("scenarios", run, "--scenarios", own)[1]
    assert "hurries" in shown
    assert "person" in shown
    assert "add --overwrite" in said("scenarios", run, "-o", table)[2]
    assert "not a run folder" in said("scenarios", tmp_path)[2]
    assert "no file" in said("scenarios", run, "--scenarios", tmp_path / "none.toml")[2]


def test_feedback_without_scenarios_is_refused(yard: Path, tmp_path: Path):
    assert "'protect' goes with --scenarios" in said("track", yard, "-o", tmp_path / "run", "--protect", 2)[2]
    with pytest.raises(ParameterError, match=r"protect = 0\.5 is out of range"):
        perdure.plan(yard, scenarios="usual", parameters={"protect": 0.5})


def test_scenarios_are_recognised_from_python(yard: Path, own: Path):
    begun = [one for step in perdure.follow(yard, tracker="overlap", scenarios=own) for one in step.report.begun]
    assert [one.kind for one in begun] == ["hurries"]
    assert set(perdure.track(yard, tracker="overlap", scenarios="usual").ids.tolist()) == {1}
    assert set(perdure.track(yard, tracker="overlap", scenarios="usual", drop_noise=False).ids.tolist()) == {1, 2}
    assert Feedback().drop_noise


def test_a_zone_that_is_not_there_is_refused_before_the_first_frame(yard: Path, tmp_path: Path):
    (tmp_path / "own.toml").write_text('[[scenario]]\nname = "a"\non = "enters"\nzone = "gate"\n')
    code, _, wrong = said("track", yard, "-o", tmp_path / "run", "--scenarios", tmp_path / "own.toml")
    assert code
    assert "there is no zone 'gate'" in wrong
    assert not (tmp_path / "run").exists()


def test_the_film_says_what_everybody_does_while_it_lasts():
    doings = Doings.of(
        [Event("runs", 5, 20, (1,)), Event("takes_away", 8, 8, (1, 2)), Event("runs", 18, 30, (1,))], fps=10
    )
    told = {k: doings.at(k) for k in range(40)}
    assert told[4] == {}
    assert told[5] == {1: "runs"}
    assert told[10] == {1: "runs, takes away", 2: "takes away"}
    assert told[18] == {1: "runs, takes away", 2: "takes away"}
    assert told[21] == {1: "runs"}
    assert told[30] == {1: "runs"}
    assert told[31] == {}

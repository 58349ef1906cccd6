"""`perdure count`: lines and zones as they are typed, results on the terminal and in a folder."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import cv2
import pytest
from typer.testing import CliRunner
from worlds import Block, World, walk

from perdure.cli.commands import app
from perdure.errors import PerdureError
from perdure.files.zones import write_zones
from perdure.scene.zones import Zone, Zones, rectangle

WEST = Zone("entry", "west door", rectangle(0, 0, 40, 80))
DOOR = "door=60,80,60,0"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run in which two go to the right and one to the left, with a zone of its own."""
    folder = tmp_path_factory.mktemp("count")
    blocks = (
        Block(walk((5, 5), (3, 0), begin=3)),
        Block(walk((105, 30), (-3, 0), begin=3)),
        Block(walk((5, 55), (3, 0), begin=6)),
    )
    (folder / "film").mkdir()
    for frame in World(blocks).frames():
        cv2.imwrite(str(folder / "film" / f"{frame.index:03d}.png"), frame.image[..., ::-1])
    write_zones(folder / "zones.json", Zones((WEST,)))
    words = ["--fps", "10", "--tracker", "overlap", "--zones", str(folder / "zones.json"), "--no-video"]
    done = CliRunner().invoke(app, ["track", str(folder / "film"), *words, "-o", str(folder / "run")])
    assert done.exit_code == 0, done.output
    return folder / "run"


def count(run: Path, *words: str) -> tuple[str, str]:
    """What it printed, and the mistake it told."""
    done = CliRunner().invoke(app, ["count", str(run), *words])
    assert done.exception is None or isinstance(done.exception, (PerdureError, SystemExit)), done.exception
    return done.output, str(done.exception or "")


def test_a_table_and_one_object_tell_what_was_counted(run: Path):
    printed, mistake = count(run, "--line", DOOR, "--zone", "west door", "--json")
    assert not mistake
    told = json.loads(printed.splitlines()[-1])
    assert {way: one["count"] for way, one in told["lines"]["door"].items()} == {"in": 2, "out": 1}
    assert told["lines"]["door"]["in"]["speed"] == pytest.approx(30, abs=1)
    assert told["zones"]["west door"]["left"] == 2
    assert "from the left of a line to its right" in told["in"]
    assert ["door", "in", "2", "30.0"] in [line.split() for line in printed.splitlines()]


def test_a_folder_holds_tables_and_a_plot(run: Path, tmp_path: Path):
    out = tmp_path / "counts"
    _, mistake = count(run, "--line", DOOR, "--zone", "yard=70,0 120,0 120,80 70,80", "-o", str(out))
    assert not mistake, mistake
    assert sorted(one.name for one in out.iterdir()) == [
        "counts.json", "counts.png", "crossings.csv", "dwell.csv", "occupancy.csv",
    ]  # fmt: skip
    with (out / "crossings.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert sorted(row["direction"] for row in rows) == ["in", "in", "out"]
    assert list(rows[0]) == ["frame", "time", "id", "class", "line", "direction", "x", "y", "speed"]
    with (out / "occupancy.csv").open() as file:
        occupancy = list(csv.DictReader(file))
    assert len(occupancy) == 40, "a row for every frame, also where nobody is"
    with (out / "dwell.csv").open() as file:
        assert {row["zone"] for row in csv.DictReader(file)} == {"yard"}
    assert json.loads((out / "counts.json").read_text())["lines"]["door"]["in"]["count"] == 2
    plot = cv2.imread(str(out / "counts.png"))
    assert plot.shape == (720, 1200, 3)
    assert (plot != 255).any(axis=2).mean() > 0.01


def test_results_are_replaced_only_if_that_is_asked_and_other_files_never(run: Path, tmp_path: Path):
    out = tmp_path / "counts"
    assert not count(run, "--line", DOOR, "-o", str(out))[1]
    assert "holds results already; add --overwrite" in count(run, "--line", DOOR, "-o", str(out))[1]
    assert not count(run, "--line", DOOR, "-o", str(out), "--overwrite")[1]
    assert "holds other files" in count(run, "--line", DOOR, "-o", str(run), "--overwrite")[1]
    assert [one.name for one in tmp_path.iterdir()] == ["counts"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "nothing to count; name a line with --line"),
        (["--zone", "west dor"], "did you mean 'west door'?"),
        (["--line", "a=5,5,5,5"], "line 'a' has no length; give it two different points"),
        (["--line", "a=5,5,130,5"], "--line 'a': its point 130,5 lies outside the picture of 120x80"),
        (["--line", "a=5,5,x"], "is no line; write NAME=x1,y1,x2,y2 in pixels"),
        (["--line", DOOR, "--line", DOOR], "two lines have one name, 'door'"),
        (["--zone", "a=0,0 9,9 9,0 0,9"], "--zone: 'a': its outline crosses itself"),
        (["--zone", "a=0,0 9,y"], "is no polygon; write 'NAME=x,y x,y x,y'"),
        (["--line", DOOR, "--point", "feet"], "there are: centre, foot"),
        (["--line", DOOR, "--away", "-1"], "away = -1 is out of range"),
        (["--line", DOOR, "--class", "car"], "'car' is not a class of this run"),
    ],
)
def test_a_mistake_is_named_with_what_would_do(run: Path, tmp_path: Path, words: list[str], said: str):
    _, mistake = count(run, *words, "-o", str(tmp_path / "counts"))
    assert said in mistake
    assert not (tmp_path / "counts").exists()


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path):
    assert "is not a run folder" in count(tmp_path, "--line", DOOR)[1]


def test_a_file_of_zones_is_counted_whole_if_none_is_named(run: Path):
    printed, mistake = count(run, "--zones", str(run.parent / "zones.json"))
    assert not mistake
    assert "west door" in printed


def test_a_run_without_tracks_is_refused(run: Path, tmp_path: Path):
    shutil.copytree(run, tmp_path / "empty")
    log = (run / "tracks.jsonl").read_text().splitlines()
    (tmp_path / "empty" / "tracks.jsonl").write_text("\n".join(log[:3]) + "\n")
    assert "has no rows that count; look at its film" in count(tmp_path / "empty", "--line", DOOR)[1]

"""`perdure learn-zones`: a file and a picture of zones, from a run."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner
from worlds import Block, World, walk

from perdure.cli.commands import app
from perdure.cli.learn_zones import learnt_from
from perdure.files.log import RunLog
from perdure.files.runs import RunFolder
from perdure.files.zones import read_zones
from perdure.types import Mask, Report, Tracks

PEOPLE = tuple(Block(walk((0, 30), (2, 0), 10 + 70 * n, 65 + 70 * n)) for n in range(3))
WORLD = World(PEOPLE, count=230)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run of three who come in at the left and leave at the right, over a folder of pictures."""
    return written(tmp_path, WORLD)


def written(tmp_path: Path, world: World) -> Path:
    folder, film, rows = tmp_path / "run", tmp_path / "film", world.truth()
    film.mkdir()
    folder.mkdir()
    for frame in World(world.blocks, count=3).frames():
        cv2.imwrite(str(film / f"{frame.index:03d}.png"), frame.image)
    RunFolder(folder).write_about({"source": str(film), "width": 120, "height": 80})
    with RunLog(folder / "tracks.jsonl") as log:
        for k in range(world.count):
            log.append(k, k / 10, Report(rows.in_frame(k)))
    return folder


def learn(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["learn-zones", *map(str, words)])
    return done.exit_code, done.output, str(done.exception or "")


def test_zones_are_written_with_their_reasons_and_drawn(tmp_path: Path, run: Path):
    code, said, wrong = learn(run, "-o", tmp_path / "zones.json")
    assert code == 0, wrong
    assert "entry     entry left  3 came in here" in said
    assert "noise     none        what flickered" in said
    zones = read_zones(tmp_path / "zones.json", 120, 80)
    assert [zone.name for zone in zones.zones] == ["entry left", "exit right"]
    features = json.loads((tmp_path / "zones.json").read_text())["features"]
    assert [one["properties"]["reason"] for one in features] == ["3 came in here", "3 went out here"]
    assert cv2.imread(str(tmp_path / "zones.png")).shape == (80, 120, 3)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["film", "run", "zones.json", "zones.png"]


def test_twice_the_same_bytes_and_one_object_for_machines(tmp_path: Path, run: Path):
    for name in ("one", "two"):
        code, said, wrong = learn(
            run, "-o", tmp_path / f"{name}.json", "--draw", tmp_path / f"{name}-drawn.png", "--json"
        )
        assert code == 0, wrong
    for end in (".json", "-drawn.png"):
        assert (tmp_path / f"one{end}").read_bytes() == (tmp_path / f"two{end}").read_bytes()
    told = json.loads(said.splitlines()[-1])
    assert told["zones"][0] == {"kind": "entry", "name": "entry left", "count": 3, "reason": "3 came in here"}
    assert set(told["missing"]) == {"occlusion", "noise"}
    assert told["picture"] == str(tmp_path / "two-drawn.png")


def test_a_run_that_had_zones_is_told_to_tell_less(tmp_path: Path, run: Path):
    learnt, again = tmp_path / "learnt.json", tmp_path / "again"
    assert learn(run, "-o", learnt)[0] == 0
    about = json.loads((run / "run.json").read_text())
    about["zones"] = json.loads(learnt.read_text())
    again.mkdir()
    for one in run.iterdir():
        (again / one.name).write_bytes(one.read_bytes())
    (again / "run.json").write_text(json.dumps(about))
    code, said, wrong = learn(again, "-o", tmp_path / "second.json")
    assert code == 0, wrong
    assert "was tracked with zones" in said


def test_a_film_that_is_gone_is_a_note_and_the_picture_is_dark(tmp_path: Path, run: Path):
    (tmp_path / "film").rename(tmp_path / "elsewhere")
    code, said, wrong = learn(run, "-o", tmp_path / "zones.json")
    assert code == 0, wrong
    assert "--source tells where the film is" in said
    code, _, wrong = learn(run, "-o", tmp_path / "zones.json", "--overwrite", "--source", tmp_path / "elsewhere")
    assert code == 0, wrong
    code, _, wrong = learn(run, "-o", tmp_path / "zones.json", "--overwrite", "--source", tmp_path / "nowhere")
    assert "nowhere" in wrong


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere", "-o", "zones.json"], "not a run folder"),
        (["run", "-o", "there.json"], "add --overwrite"),
        (["run", "-o", "fresh.json", "--draw", "there.png"], "add --overwrite"),
        (["run", "-o", "zones.txt"], "must end in .json"),
        (["run", "-o", "zones.json", "--draw", "zones.jpg"], "must end in .png"),
        (["run", "-o", "run/run.json", "--overwrite"], "part of the run itself"),
        (["run", "-o", "fresh.json", "--draw", "film/000.png", "--overwrite"], "picture of the film itself"),
        (["run", "-o", "there.json/zones.json"], "cannot write"),
        (["run", "-o", "fresh.json", "--source", "small"], "the run was over 120x80"),
    ],
)
def test_what_cannot_be_is_said_and_leaves_nothing(tmp_path: Path, run: Path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.json").write_text("mine")
    (tmp_path / "there.png").write_text("mine")
    (tmp_path / "small").mkdir()
    cv2.imwrite(str(tmp_path / "small" / "0.png"), np.zeros((40, 60, 3), np.uint8))
    before = {str(path): path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    code, _, wrong = learn(*words)
    assert code != 0
    assert message in wrong
    assert {str(path): path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_a_run_that_tells_nothing_says_why(tmp_path: Path):
    run = written(tmp_path, World(PEOPLE[:1], count=80))
    code, _, wrong = learn(run, "-o", tmp_path / "zones.json")
    assert code != 0
    assert "tells of no zone (entry, exit, occlusion: tracks that went anywhere: 1, needed are 3" in wrong
    assert "track a longer film, or draw the zones yourself" in wrong
    assert not (tmp_path / "zones.json").exists()


def test_a_pole_that_cuts_silhouettes_is_an_occluder():
    """Eight pass behind an upright pole; the rows go on, but of each silhouette what the pole hides is missing."""
    height, width, pole = 144, 192, slice(90, 98)
    place = np.full((height, width, 3), 90, np.uint8)
    place[20:120, pole] = 200
    settled = []
    for k in range(8 * 100):
        x, y = 2 * (k % 100) - 20, 60
        bits = np.zeros((height, width), np.bool_)
        bits[y : y + 40, max(0, x) : max(0, x + 20)] = True
        bits[20:120, pole] = False
        rows = Tracks.of(
            frames=k, times=k / 20, ids=[1 + k // 100], boxes=[[x, y, x + 20, y + 40]], masks=[Mask.of_image(bits)]
        )
        settled.append((k, rows))
    found = learnt_from(settled, (0.0, 40.0), (height, width), [place])
    (post,) = [one for one in found.proposals if one.zone.kind == "occlusion"]
    xs = [x for x, _ in post.zone.polygons[0][0]]
    assert 88 <= min(xs) <= 90
    assert 98 <= max(xs) <= 100
    assert post.count >= 6

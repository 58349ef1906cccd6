"""`perdure run`: many videos, each into a folder of its own, whatever becomes of the others."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from test_cli import perdure, write_film
from worlds import crossing, lone_walker, two_apart

from perdure.cli.jobs import Job, told_apart
from perdure.files.mot import write_rows


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two films and their truths, and something that is no film; `runs` holds what came of it."""
    folder = tmp_path_factory.mktemp("many")
    for name, world in (("apart", two_apart()), ("crossing", crossing())):
        write_film(folder / f"{name}.avi", [frame.image for frame in world.frames()])
        with (folder / f"{name}.txt").open("w") as file:
            write_rows(file, world.truth())
    (folder / "broken.avi").write_text("no film")
    done = perdure(
        "run", "apart.avi", "broken.avi", "crossing.avi", "-o", "runs", "--workers", 2, "--json", at=folder
    )
    assert done.returncode == 3, done.stderr
    (folder / "said.json").write_text(done.stdout.splitlines()[-1])
    return folder


def test_a_broken_video_costs_no_other(place: Path):
    said = {one["name"]: one for one in json.loads((place / "said.json").read_text())["jobs"]}
    assert {name: one["status"] for name, one in said.items()} == {
        "apart": "done", "broken": "failed", "crossing": "done",
    }  # fmt: skip
    assert "broken.avi" in said["broken"]["message"]
    assert sorted(one.name.rpartition("-")[0] for one in (place / "runs").iterdir()) == ["apart", "crossing"]


def test_a_job_has_the_results_of_the_run_alone(place: Path):
    perdure("track", "crossing.avi", "-o", "alone", "--no-video", at=place)
    (folder,) = (place / "runs").glob("crossing-*")
    for name in ("tracks.jsonl", "tracks.txt", "events.csv"):
        assert (folder / name).read_bytes() == (place / "alone" / name).read_bytes()


def test_what_was_done_is_not_done_again_and_is_scored(place: Path):
    before = {one: one.stat().st_mtime_ns for one in (place / "runs").rglob("*")}
    words = ("run", "apart.avi", "crossing.avi", "-o", "runs", "--truth", "crossing.txt", "apart.txt")
    done = perdure(*words, at=place)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("done before") == 2
    assert "IDF1" in done.stdout
    assert "together" in done.stdout
    assert {one: one.stat().st_mtime_ns for one in (place / "runs").rglob("*")} == before
    value = json.loads(perdure(*words, "--json", at=place).stdout)
    assert all(one["scores"]["IDF1"] > 0.8 for one in value["jobs"])


def test_other_parameters_are_another_job(place: Path):
    base = Job(str(place / "apart.avi"), {"parameters": {}})
    assert base.key == Job(str(place / "apart.avi"), {"parameters": {}}).key
    assert base.key != Job(str(place / "apart.avi"), {"parameters": {"patience": 3.0}}).key
    assert base.key != Job(str(place / "crossing.avi"), {"parameters": {}}).key


def test_a_file_that_has_changed_is_another_job(tmp_path: Path):
    film = write_film(tmp_path / "walk.avi", [frame.image for frame in lone_walker(count=5).frames()])
    zones = tmp_path / "zones.json"
    zones.write_text("{}")
    keys = [Job(str(film), {"zones": str(zones)}).key]
    zones.write_text("{ }")
    keys.append(Job(str(film), {"zones": str(zones)}).key)
    write_film(film, [frame.image for frame in lone_walker(count=6).frames()])
    keys.append(Job(str(film), {"zones": str(zones)}).key)
    assert len(set(keys)) == 3


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("apart.avi", "--patience", "-1"), "out of range"),
        (("apart.avi", "--tracker", "compond"), "did you mean 'compound'"),
        (("0",), "perdure live 0"),
        (("apart.avi", "--on", "moon"), "must be local, ray"),
        (("apart.avi", "--truth", "apart.txt", "--stride", "2"), "--stride"),
        (("apart.avi", "crossing.avi", "--truth", "apart.txt"), "2 sources and 1 truths"),
    ],
)
def test_a_mistake_in_what_all_share_is_told_before_anything_begins(
    place: Path, words: tuple[str, ...], said: str
):
    done = perdure("run", *words, "-o", "none", at=place)
    assert done.returncode == 2
    assert said in done.stderr
    assert not (place / "none").exists()


def test_files_of_one_name_are_told_apart_by_their_folders():
    assert told_apart(["x/a/film.avi", "y/a/film.avi", "b.avi"]) == ["x/a/film", "y/a/film", "b"]

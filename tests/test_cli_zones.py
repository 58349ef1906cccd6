"""Zones from the command line and from Python: read, obeyed, recorded, drawn."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner
from worlds import two_apart

import perdure
from perdure.cli.commands import app
from perdure.draw import Trails, paint
from perdure.draw.zones import COLOURS
from perdure.errors import FormatError
from perdure.files.zones import read_zones, write_zones, zones_of_json
from perdure.scene.zones import KINDS, Zone, Zones, rectangle
from perdure.types import Frame, Scene, Tracks

WEST = Zone("entry", "west", rectangle(0, 0, 30, 80))
SKY = Zone("ignore", "sky", rectangle(0, 0, 120, 36))


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of pictures of two walkers, one above the other, and a file of zones."""
    import cv2

    folder = tmp_path_factory.mktemp("zones")
    (folder / "film").mkdir()
    for frame in two_apart().frames():
        cv2.imwrite(str(folder / "film" / f"{frame.index:03d}.png"), frame.image[..., ::-1])
    write_zones(folder / "zones.json", Zones((WEST, SKY)))
    return folder


def track(place: Path, *words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["track", str(place / "film"), "--fps", "10", *words])
    return done.exit_code, done.output + str(done.exception or "")


def test_a_run_obeys_its_zones_and_records_them(place: Path):
    code, said = track(place, "--zones", str(place / "zones.json"), "-o", str(place / "run"), "--no-video")
    assert code == 0, said
    about = json.loads((place / "run" / "run.json").read_text())
    assert about["window"]["zones"] == str(place / "zones.json")
    assert zones_of_json(about["zones"], 120, 80) == read_zones(place / "zones.json", 120, 80)
    with (place / "run" / "events.csv").open() as file:
        entered = [row for row in csv.DictReader(file) if row["kind"] == "entered"]
    assert len(entered) == 1, "who walks above is ignored"
    rows = np.loadtxt(place / "run" / "tracks.txt", delimiter=",")
    assert (rows[:, 3] > 36).all()


def test_a_run_without_zones_records_none(place: Path):
    code, said = track(place, "-o", str(place / "plain"), "--no-video")
    assert code == 0, said
    about = json.loads((place / "plain" / "run.json").read_text())
    assert "zones" not in about
    assert "zones" not in about["window"]


def test_a_zone_outside_of_the_film_is_refused_before_anything_is_written(place: Path):
    write_zones(place / "large.json", Zones((Zone("exit", "east", rectangle(100, 0, 130, 80)),)))
    code, said = track(place, "--zones", str(place / "large.json"), "-o", str(place / "none"))
    assert code != 0
    assert "zone 1 'east': its point [130, 0] lies outside the picture of 120x80" in said
    assert not (place / "none").exists()


def test_from_python_zones_are_a_file_or_made_there(place: Path):
    images = [frame.image for frame in two_apart().frames()]
    by_file = perdure.track(images, fps=10, zones=place / "zones.json")
    made = perdure.track(images, fps=10, zones=Zones((WEST, SKY)))
    assert by_file.equals(made)
    assert len(np.unique(made.ids)) == 1
    with pytest.raises(FormatError, match="cannot read"):
        perdure.track(images, zones="nowhere.json")


def test_an_online_tracker_knows_zones(place: Path):
    plain, zoned = (perdure.Online(fps=10, confirm=0, zones=one) for one in (None, place / "zones.json"))
    boxes = [[10, 40, 20, 60], [60, 5, 70, 25]]
    assert plain.update(boxes).ids.tolist() == [1, 2]
    assert zoned.update(boxes).ids.tolist() == [1]
    assert zoned.report.events[0].zone == "west"


def like(picture: np.ndarray, kind: str) -> int:
    """How many pixels are nearly of a kind's colour; lines are smoothed."""
    return int((np.abs(picture.astype(int) - COLOURS[kind]).max(axis=2) < 50).sum())


def test_the_film_shows_outlines_and_names():
    image = np.full((240, 320, 3), 90, np.uint8)
    nothing, scene = (Tracks.empty(), Trails.empty()), Scene(320, 240)
    plain = paint(Frame(0, 0.0, image), *nothing, scene)
    for kind in KINDS:
        zoned = Scene(320, 240, zones=(Zone(kind, "here", rectangle(100, 100, 200, 180)),))
        picture = paint(Frame(0, 0.0, image), *nothing, zoned)
        assert like(picture, kind) > 100, kind
        changed = (picture != plain).any(axis=2)
        assert not changed[110:170, 130:190].any(), "what is inside stays as it is"
        assert changed[75:99, 100:200].any(), "the name is above"
    assert np.array_equal(paint(Frame(0, 0.0, image), *nothing, zoned), picture)


def test_an_id_stands_beside_the_name_of_a_zone_where_there_is_room():
    zone = Zone("entry", "here", rectangle(100, 100, 200, 180))
    rows = Tracks.of(frames=0, times=0.0, ids=[1], boxes=[[100, 100, 130, 180]])
    image = np.full((240, 320, 3), 90, np.uint8)
    alone = paint(Frame(0, 0.0, image), Tracks.empty(), Trails.empty(), Scene(320, 240, zones=(zone,)))
    both = paint(Frame(0, 0.0, image), rows, Trails.empty(), Scene(320, 240, zones=(zone,)))
    name = (slice(80, 94), slice(106, 150))
    assert (alone[name] != 90).any()
    assert np.array_equal(alone[name], both[name]), "the name can still be read"


def test_an_exit_over_an_entry_leaves_both_to_be_seen():
    both = tuple(Zone(kind, kind, rectangle(50, 50, 150, 150)) for kind in ("exit", "entry"))
    picture = paint(
        Frame(0, 0.0, np.full((240, 320, 3), 90, np.uint8)),
        Tracks.empty(),
        Trails.empty(),
        Scene(320, 240, zones=both),
    )
    for kind in ("exit", "entry"):
        assert like(picture, kind) > 80

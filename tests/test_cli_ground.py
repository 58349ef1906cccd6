"""`perdure track --calibration`: places in metres and speeds in the log, the table and the film."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from perdure.cli.commands import app
from perdure.errors import ParameterError, PerdureError
from perdure.files.calibration import read_calibration
from perdure.files.runs import RunFolder
from perdure.pipeline import plan
from perdure.scene.ground import of_camera
from perdure.scene.lens import Lens

SIZE = (1280, 720)
CAMERA = {"focal": 900, "height": 6.0, "tilt_degrees": 22}
GROUND = of_camera(
    Lens(np.array([900.0, 900]), np.array([640.0, 360]), np.zeros(5)), 6.0, np.radians(22), 0.0, SIZE
)


@pytest.fixture
def street(tmp_path):
    """A folder of MOTChallenge without images: two people of 1.7 m who walk at 1.5 m/s."""
    folder = tmp_path / "street"
    (folder / "det").mkdir(parents=True)
    (folder / "seqinfo.ini").write_text(
        "[Sequence]\nname=street\nframeRate=20\nseqLength=40\nimWidth=1280\nimHeight=720\n"
    )
    lines = []
    for frame in range(40):
        places = np.array([[-3, 12], [4, 20]]) + np.array([[1.5, 0], [0, -1.5]]) * frame / 20
        foot, head = GROUND.seen(places), GROUND.seen(places, 1.7)
        for (x, y), (_, top) in zip(foot, head, strict=True):
            lines.append(f"{frame + 1},-1,{x - 19:.2f},{top + 1:.2f},40,{y - top:.2f},1")
    (folder / "det/det.txt").write_text("\n".join(lines))
    (tmp_path / "calibration.json").write_text(json.dumps({"frame": list(SIZE), "camera": CAMERA}))
    return folder


def track(*words):
    return app([str(word) for word in ("track", *words)], standalone_mode=False)


@pytest.mark.parametrize("tracker", ["compound", "overlap"])
def test_the_log_tells_metres_and_speeds(tmp_path, street, tracker):
    run = tmp_path / "run"
    track(street, "-o", run, "--tracker", tracker, "--calibration", tmp_path / "calibration.json", "--no-video")
    rows = RunFolder.open(run).tracks()
    last = rows.take((rows.frames == 39) & (rows.status == 0))
    assert sorted(place.x for place in last.ground) == pytest.approx([-3 + 1.5 * 39 / 20, 4], abs=0.1)
    assert [place.speed for place in last.ground] == pytest.approx([1.5, 1.5], abs=0.1)
    about = json.loads((run / "run.json").read_text())
    assert about["ground"]["origin"] == "camera"
    assert about["window"]["calibration"].endswith("calibration.json")


def test_the_table_has_the_metres_of_a_run_that_knows_them(tmp_path, street):
    for name, more in (("with", ("--calibration", tmp_path / "calibration.json")), ("without", ())):
        track(street, "-o", tmp_path / name, *more, "--no-video")
        app(
            ["export", str(tmp_path / name), "--format", "csv", "-o", str(tmp_path / f"{name}.csv")],
            standalone_mode=False,
        )
    table = list(csv.DictReader((tmp_path / "with.csv").read_text().splitlines()))
    assert float(table[-1]["ground_speed"]) == pytest.approx(1.5, abs=0.1)
    assert table[0]["ground_speed"] == ""
    assert "ground_x" not in (tmp_path / "without.csv").read_text()
    assert "ground" not in (tmp_path / "without/tracks.jsonl").read_text()
    assert "ground" not in json.loads((tmp_path / "without/run.json").read_text())


def test_places_are_in_the_tracks_of_python_too(tmp_path, street):
    made = plan(street, calibration=tmp_path / "calibration.json")
    rows = next(step.report.rows for step in made.steps() if len(step.report.rows))
    assert all(place is not None for place in rows.ground)


@pytest.fixture
def square(tmp_path):
    """A folder without images: forty people of 1.7 m who stroll about for 20 s, four times a second."""
    folder = tmp_path / "square"
    (folder / "det").mkdir(parents=True)
    (folder / "seqinfo.ini").write_text(
        "[Sequence]\nname=square\nframeRate=4\nseqLength=80\nimWidth=1280\nimHeight=720\n"
    )
    generator, lines = np.random.default_rng(1), []
    start = np.stack([np.arange(-14, 15, 4).repeat(5), np.tile([9, 15, 22, 30, 40], 8)], axis=1).astype(float)
    walk = generator.normal(0, 0.02, start.shape)
    for frame in range(80):
        places = start + walk * frame / 4
        foot, head = GROUND.seen(places), GROUND.seen(places, 1.7)
        for (x, y), (_, top) in zip(foot, head, strict=True):
            tall = y - top
            lines.append(f"{frame + 1},-1,{x - tall / 6 + 1:.2f},{top + 1:.2f},{tall / 3:.2f},{tall:.2f},1")
    (folder / "det/det.txt").write_text("\n".join(lines))
    return folder


def test_the_ground_is_estimated_in_a_first_look_and_noted(tmp_path, square):
    run = tmp_path / "run"
    track(square, "-o", run, "--calibration", "auto", "--no-video")
    about = json.loads((run / "run.json").read_text())
    assert about["ground"]["origin"] == "video"
    assert "the ground plane is estimated from" in about["warnings"][0]
    assert about["ground"]["calibration"]["camera"]["height"] == pytest.approx(6.0, rel=0.4)
    assert '"ground":[' in (run / "tracks.jsonl").read_text()


def test_the_estimate_is_written_and_read_and_of_a_source_or_of_its_run(tmp_path, square):
    written = tmp_path / "written.json"
    app(["calibrate", str(square), "-o", str(written), "--focal", "900"], standalone_mode=False)
    camera = json.loads(written.read_text())["camera"]
    assert camera["height"] == pytest.approx(6.0, rel=0.08)
    assert camera["tilt_degrees"] == pytest.approx(22, abs=1)
    ground = read_calibration(written, *SIZE)
    assert ground.places([[640, 500]]) == pytest.approx(GROUND.places([[640, 500]]), rel=0.08, abs=0.1)
    assert ground.spread([[640, 500]], 0.0).any()
    track(square, "-o", tmp_path / "run", "--tracker", "overlap", "--no-video")
    again = tmp_path / "again.json"
    app(["calibrate", str(tmp_path / "run"), "-o", str(again), "--focal", "900"], standalone_mode=False)
    assert json.loads(again.read_text())["camera"] == camera


def test_who_cannot_be_estimated_is_told_why(tmp_path, street):
    with pytest.raises(PerdureError, match=r"not enough: 2 upright people.*write a calibration file"):
        app(["calibrate", str(street), "-o", str(tmp_path / "none.json")], standalone_mode=False)
    assert not (tmp_path / "none.json").exists()
    track(street, "-o", tmp_path / "run", "--calibration", "auto", "--no-video")
    about = json.loads((tmp_path / "run/run.json").read_text())
    assert "ground" not in about
    assert "the ground plane is not known (not enough" in about["warnings"][0]


def test_a_height_without_an_estimate_is_refused(street):
    with pytest.raises(ParameterError, match="goes with --calibration auto"):
        plan(street, object_height=1.5)
    with pytest.raises(ParameterError, match=r"0\.05 to 20 m"):
        plan(street, calibration="auto", object_height=-1.0)

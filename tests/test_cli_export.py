"""`perdure export` of silhouettes, as a user types it."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest
from shapely import from_wkt
from shapely.geometry import MultiPolygon, Polygon, shape
from worlds import two_apart

from perdure.cli.commands import run as run_command
from perdure.files import mask_pngs, mots
from perdure.files.log import RunLog, read_log
from perdure.files.runs import RunFolder
from perdure.fold import settle
from perdure.types import Mask, Outline, Renamed, Report, Rows, Status, Tracks

HEIGHT, WIDTH = 30, 40


class Done(NamedTuple):
    code: int
    stdout: str
    stderr: str


@pytest.fixture
def export(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Done]:
    """Run `perdure export` with some words, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def run_it(*words: str) -> Done:
        monkeypatch.setattr(sys, "argv", ["perdure", "export", *words])
        return Done(run_command(), *capsys.readouterr())

    return run_it


def disc(x: int, radius: int) -> Mask:
    return Mask.of_image(cv2.circle(np.zeros((HEIGHT, WIDTH), np.uint8), (x, 15), radius, 1, -1) > 0)


def write_run(folder: Path, reports: dict[int, Report], **about: object) -> Path:
    folder.mkdir()
    RunFolder(folder).write_about({"height": HEIGHT, "width": WIDTH, **about})
    with RunLog(folder / "tracks.jsonl") as log:
        for frame, report in reports.items():
            log.append(frame, 0.0, report)
    return folder


def report(frame: int, *ids_and_masks: tuple[int, Mask], **more: object) -> Report:
    ids, masks = zip(*ids_and_masks, strict=True)
    boxes = [mask.box for mask in masks]
    return Report(Tracks.of(frames=frame, times=0.0, ids=ids, boxes=boxes, masks=masks), **more)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Every second frame from 6 to 14; nothing in 8; id 300 turns out to be 1; a lost and an unseen target."""
    lost = Tracks.of(
        frames=10, times=0.0, ids=[9], boxes=[[0, 0, 5, 5]], masks=[disc(30, 2)], status=[Status.LOST]
    )
    reports = {
        6: report(6, (1, disc(5, 4)), (2, disc(20, 6))),
        8: Report(),
        10: Report(Tracks.join([report(10, (300, disc(8, 4)), (2, Mask.empty())).rows, lost])),
        12: report(12, (1, disc(9, 5)), renamed=(Renamed(300, 1, 0, 12),)),
        14: Report(),
        -1: Report(),
    }
    return write_run(tmp_path / "run", reports)


def told(rows: Rows) -> list[tuple[int, int, tuple[int, int, int, int]]]:
    return [(int(f), int(i), mask.box) for f, i, mask in zip(rows.frames, rows.ids, rows.masks, strict=True)]


WANTED = [(6, 1, disc(5, 4).box), (6, 2, disc(20, 6).box), (10, 1, disc(8, 4).box), (12, 1, disc(9, 5).box)]


def test_mots_holds_the_settled_silhouettes_of_the_rows_that_count(
    export: Callable[..., Done], run: Path, tmp_path: Path
):
    done = export("run", "--format", "mots", "-o", "out.txt", "--json")
    assert json.loads(done.stdout) == {"output": "out.txt", "rows": 4}
    assert done.stderr == "perdure: note: rows left out, without a silhouette: 1\n"
    rows = mots.read_masks(tmp_path / "out.txt")
    assert (told(rows), rows.size) == (WANTED, (HEIGHT, WIDTH))
    assert rows.masks[1] == disc(20, 6)


def test_mask_png_holds_a_picture_for_every_frame_of_the_run(
    export: Callable[..., Done], run: Path, tmp_path: Path
):
    done = export("run", "--format", "mask-png", "-o", "out", "--json")
    assert json.loads(done.stdout) == {"output": "out", "rows": 4, "frames": 5}
    names = ["000006.png", "000008.png", "000010.png", "000012.png", "000014.png"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names
    rows = mask_pngs.read_masks(tmp_path / "out", void=True)
    assert (told(rows), rows.size) == (WANTED, (HEIGHT, WIDTH))
    assert cv2.imread(str(tmp_path / "out/000006.png"), cv2.IMREAD_UNCHANGED).dtype == np.uint8


def test_large_ids_take_16_bits_and_larger_ones_are_refused(export: Callable[..., Done], tmp_path: Path):
    write_run(tmp_path / "wide", {0: report(0, (255, disc(5, 4)))})
    write_run(tmp_path / "wider", {0: report(0, (65_536, disc(5, 4)))})
    assert export("wide", "--format", "mask-png", "-o", "out").code == 0
    assert mask_pngs.read_masks(tmp_path / "out", void=True).ids.tolist() == [255]
    refused = export("wider", "--format", "mask-png", "-o", "other")
    assert (refused.code, "65536 is too large" in refused.stderr) == (2, True)
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("form", ["mots", "mask-png"])
def test_a_run_that_does_not_tell_its_size_is_named(export: Callable[..., Done], tmp_path: Path, form: str):
    for number, size in enumerate((None, -3, "wide", 3.5, 10**9)):
        write_run(tmp_path / f"run{number}", {0: report(0, (1, disc(5, 4)))}, width=size)
        refused = export(f"run{number}", "--format", form, "-o", "out")
        assert (refused.code, "run.json does not tell the size" in refused.stderr) == (2, True)
        assert not (tmp_path / "out").exists()


def test_pictures_are_replaced_only_if_that_is_asked(export: Callable[..., Done], run: Path, tmp_path: Path):
    export("run", "--format", "mask-png", "-o", "out")
    refused = export("run", "--format", "mask-png", "-o", "out")
    assert (refused.code, "--overwrite" in refused.stderr) == (2, True)
    assert export("run", "--format", "mask-png", "-o", "out", "--overwrite").code == 0


@pytest.mark.parametrize("form", ["csv", "mots", "mask-png"])
@pytest.mark.parametrize("place", ["run", "run/tracks.jsonl", "run/run.json"])
def test_what_the_run_rests_on_is_never_replaced(
    export: Callable[..., Done], run: Path, tmp_path: Path, form: str, place: str
):
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    assert export("run", "--format", form, "-o", place, "--overwrite").code == 2
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before


def test_a_damaged_log_leaves_nothing_behind(export: Callable[..., Done], run: Path, tmp_path: Path):
    log = run / "tracks.jsonl"
    log.write_text(log.read_text().replace('"runs":[', '"runs":[1,', 3))
    for form in ("mots", "mask-png"):
        refused = export("run", "--format", form, "-o", "out")
        assert (refused.code, "line" in refused.stderr) == (2, True)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_silhouettes_that_track_and_cut_found_come_back_from_both_formats(
    export: Callable[..., Done], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    frames = two_apart().frames()[10:20]
    (tmp_path / "film").mkdir()
    for frame in frames:
        cv2.imwrite(f"film/{frame.index:03d}.png", frame.image[:, :, ::-1])
    reds = (frames[0].image == (200, 40, 40)).all(axis=2)
    blues = (frames[0].image == (40, 60, 220)).all(axis=2)
    cv2.imwrite("both.png", np.uint8(reds * 3 + blues * 1))
    monkeypatch.setattr(
        sys, "argv", ["perdure", "track", "film", "-o", "run", "--init", "both.png", "--no-video", "--fps", "10"]
    )
    assert run_command() == 0
    said = settle(entry.report for entry in read_log(Path("run/tracks.jsonl"))).counted()
    assert sorted(set(said.ids.tolist())) == [1, 3]
    assert len(said) == 20
    assert export("run", "--format", "mots", "-o", "out.txt").code == 0
    assert export("run", "--format", "mask-png", "-o", "out").code == 0
    wanted = sorted(told(Rows.of(frames=said.frames, ids=said.ids, masks=said.masks)))
    size = frames[0].image.shape[:2]
    for rows in (mots.read_masks(Path("out.txt")), mask_pngs.read_masks(Path("out"), void=True)):
        assert rows.size == size
        assert sorted(told(rows)) == wanted
        there = {
            (int(frame), int(name)): mask
            for frame, name, mask in zip(rows.frames, rows.ids, rows.masks, strict=True)
        }
        for frame, name, mask in zip(said.frames, said.ids, said.masks, strict=True):
            assert np.array_equal(there[int(frame), int(name)].to_image(*size), mask.to_image(*size))
    first = {
        name: mask.to_image(*size)
        for frame, name, mask in zip(said.frames, said.ids, said.masks, strict=True)
        if frame == 0
    }
    assert np.array_equal(first[3], reds)
    assert np.array_equal(first[1], blues)


# Contours between pixels


def round_of(x: float, y: float, radius: float, points: int = 60) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, points, endpoint=False)
    return np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)


RING = Outline.of([round_of(15.3, 14.8, 9), round_of(15.3, 14.8, 4)[::-1], round_of(33.25, 8, 5)])


@pytest.fixture
def contours(tmp_path: Path) -> Path:
    """A contour with a hole and two parts; pixels seen and more believed; a box; a row that is nowhere."""
    rows = Tracks.of(
        frames=4,
        times=0.16,
        ids=[1, 2, 3, 4],
        boxes=[[3, 2, 40, 24], [0, 0, 20, 20], [1.5, 2, 8, 9], [5, 5, 5, 5]],
        status=[Status.PARTLY_OCCLUDED, Status.VISIBLE, Status.VISIBLE, Status.VISIBLE],
        classes=['<dog & "cat">', "", "", ""],
        masks=[disc(10, 4), disc(20, 6), Mask.empty(), Mask.empty()],
        believed=[disc(15, 9), disc(20, 9), None, None],
        outlines=[RING, None, None, None],
    )
    return write_run(tmp_path / "run", {2: Report(), 4: Report(rows), -1: Report()})


def features(path: Path) -> dict[int, dict]:
    told = json.loads(path.read_text(encoding="utf-8"))
    assert told["type"] == "FeatureCollection"
    assert (told["picture"]["height"], told["picture"]["width"]) == (HEIGHT, WIDTH)
    return {one["properties"]["id"]: one for one in told["features"]}


def test_geojson_holds_contours_between_pixels_with_their_holes_and_parts(
    export: Callable[..., Done], contours: Path, tmp_path: Path
):
    done = export("run", "--format", "geojson", "-o", "out.geojson", "--json")
    assert json.loads(done.stdout) == {"output": "out.geojson", "rows": 3}
    assert "without a silhouette: 1" in done.stderr
    found = features(tmp_path / "out.geojson")
    first = shape(found[1]["geometry"])
    assert first.is_valid
    assert sorted(len(one.interiors) for one in first.geoms) == [0, 1]
    assert first.area == pytest.approx(RING.area, abs=0.01)
    assert {name: found[1]["properties"][name] for name in ("frame", "class", "status", "outline")} == {
        "frame": 4, "class": '<dog & "cat">', "status": "partly_occluded", "outline": "contour",
    }  # fmt: skip
    assert found[1]["properties"]["visibility"] == pytest.approx(disc(10, 4).area / disc(15, 9).area, abs=1e-4)
    for outer in (one.exterior for one in first.geoms):
        assert outer.is_ccw  # as RFC 7946 wants it, in numbers


def test_a_row_without_a_contour_has_the_outline_of_its_pixels_or_its_box(
    export: Callable[..., Done], contours: Path, tmp_path: Path
):
    export("run", "--format", "geojson", "-o", "out")
    export("run", "--format", "geojson", "-o", "whole", "--believed")
    seen, whole = features(tmp_path / "out"), features(tmp_path / "whole")
    assert [seen[one]["properties"]["outline"] for one in (1, 2, 3)] == ["contour", "seen", "box"]
    assert [whole[one]["properties"]["outline"] for one in (1, 2, 3)] == ["contour", "believed", "box"]
    assert shape(seen[2]["geometry"]).area == disc(20, 6).area
    assert shape(whole[2]["geometry"]).bounds == disc(20, 9).box
    assert shape(seen[3]["geometry"]).bounds == (1.5, 2, 8, 9)


def test_points_and_well_known_text_say_the_same(export: Callable[..., Done], contours: Path, tmp_path: Path):
    assert export("run", "--format", "contour-csv", "-o", "points.csv").code == 0
    assert export("run", "--format", "csv", "-o", "rows.csv").code == 0
    rings: dict[tuple[int, int], list[tuple[float, float]]] = {}
    with (tmp_path / "points.csv").open(newline="") as file:
        for line in csv.DictReader(file):
            assert line["frame"] == "4"
            if line["id"] == "1":
                ring = rings.setdefault((int(line["part"]), int(line["ring"])), [])
                assert int(line["point"]) == len(ring)
                ring.append((float(line["x"]), float(line["y"])))
    assert sorted(rings) == [(0, 0), (0, 1), (1, 0)]
    built = MultiPolygon([Polygon(rings[0, 0], [rings[0, 1]]), Polygon(rings[1, 0])])
    with (tmp_path / "rows.csv").open(newline="") as file:
        told = {line["id"]: line for line in csv.DictReader(file)}
    assert from_wkt(told["1"]["contour"]).symmetric_difference(built).area < 0.05
    assert [told[one]["contour"] for one in ("2", "3", "4")] == [""] * 3
    assert float(told["2"]["visibility"]) == pytest.approx(disc(20, 6).area / disc(20, 9).area, abs=1e-3)


def test_svg_is_a_drawing_a_frame_and_what_is_not_seen_is_dashed(
    export: Callable[..., Done], contours: Path, tmp_path: Path
):
    from xml.etree import ElementTree

    done = export("run", "--format", "svg", "-o", "out", "--json")
    assert json.loads(done.stdout) == {"output": "out", "rows": 3, "frames": 2}
    assert sorted(one.name for one in (tmp_path / "out").iterdir()) == ["000002.svg", "000004.svg"]
    picture = ElementTree.parse(tmp_path / "out/000004.svg").getroot()
    assert picture.get("viewBox") == f"0 0 {WIDTH} {HEIGHT}"
    groups = {one.get("id"): one for one in picture.iter() if one.tag.endswith("}g")}
    drawn = {
        name: [(path.get("class"), path.get("stroke-dasharray") is not None) for path in group if path.get("d")]
        for name, group in groups.items()
    }
    assert drawn["target-1"] == [("whole", False), ("seen", False), ("believed", True)]
    assert drawn["target-2"] == drawn["target-3"] == [("whole", False), ("seen", False)]
    assert export("run", "--format", "svg", "-o", "out").code == 2
    assert export("run", "--format", "svg", "-o", "out", "--overwrite").code == 0
    assert export("run", "--format", "svg", "-o", "run", "--overwrite").code == 2


def test_believed_silhouettes_instead_of_the_pixels_seen(
    export: Callable[..., Done], contours: Path, tmp_path: Path
):
    assert export("run", "--format", "mots", "-o", "out.txt", "--believed").code == 0
    rows = mots.read_masks(tmp_path / "out.txt")
    assert [(int(one), mask) for one, mask in zip(rows.ids, rows.masks, strict=True)] == [
        (1, disc(15, 9)),
        (2, disc(20, 9)),
    ]
    assert export("run", "--format", "mask-png", "-o", "out", "--believed").code == 0
    assert mask_pngs.read_masks(tmp_path / "out", void=True).masks[0] == disc(15, 9)
    refused = export("run", "--format", "mot", "-o", "boxes.txt", "--believed")
    assert (refused.code, "--believed" in refused.stderr) == (2, True)


def test_who_asks_for_what_is_believed_hears_that_nothing_is(export: Callable[..., Done], tmp_path: Path):
    rows = Tracks.of(frames=0, times=0.0, ids=[1], boxes=[[3, 2, 17, 18]], masks=[disc(10, 4)])
    write_run(tmp_path / "run", {0: Report(rows), -1: Report()})
    done = export("run", "--format", "mots", "-o", "out.txt", "--believed")
    assert (done.code, "--believed changes nothing" in done.stderr) == (0, True)


@pytest.mark.parametrize("form", ["geojson", "contour-csv", "svg"])
def test_contours_appear_whole_or_not_at_all(
    export: Callable[..., Done], contours: Path, tmp_path: Path, form: str
):
    log = contours / "tracks.jsonl"
    log.write_text(log.read_text().replace('"per_pixel":64', '"per_pixel":63'))
    refused = export("run", "--format", form, "-o", "out")
    assert (refused.code, "line 3: not a report (an outline's per_pixel" in refused.stderr) == (2, True)
    (tmp_path / "file").write_text("precious")
    for place in ("file/out", "file"):
        assert export("run", "--format", form, "-o", place).code == 2
    assert (tmp_path / "file").read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "run"]
    assert export("nowhere", "--format", form, "-o", "out").code == 2


def test_the_contour_of_a_disc_comes_back_between_pixels(
    export: Callable[..., Done], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "film").mkdir()
    y, x = np.mgrid[:96, :128] + 0.5
    middles = [(45.3 + 1.37 * frame, 48.6 - 0.45 * frame) for frame in range(8)]
    rough = np.random.default_rng(0).integers(0, 60, (96, 128, 3), np.uint8)
    for frame, middle in enumerate(middles):
        inside = np.hypot(x - middle[0], y - middle[1]) < 20.75
        cv2.imwrite(
            f"film/{frame:03d}.png",
            np.where(inside[..., None], (40, 50, 190), rough + (60 + 60 * (np.arange(3) == 1))),
        )
        if not frame:
            cv2.imwrite("mark.png", np.uint8(inside))
    words = [
        "track",
        "film",
        "-o",
        "run",
        "--init",
        "mark.png",
        "--tracker",
        "contour",
        "--no-video",
        "--fps",
        "25",
    ]
    monkeypatch.setattr(sys, "argv", ["perdure", *words])
    assert run_command() == 0
    assert export("run", "--format", "geojson", "-o", "out.geojson").code == 0
    told = json.loads((tmp_path / "out.geojson").read_text())["features"]
    said = settle(entry.report for entry in read_log(tmp_path / "run/tracks.jsonl"))
    assert [one["properties"]["frame"] for one in told] == list(range(8))
    for frame, one in enumerate(told):
        found = shape(one["geometry"])
        assert found.is_valid
        assert np.hypot(found.centroid.x - middles[frame][0], found.centroid.y - middles[frame][1]) < 0.15
        assert found.area == pytest.approx(said.believed[frame].area, rel=0.02)
    assert np.sqrt(shape(told[0]["geometry"]).area / np.pi) == pytest.approx(20.75, abs=0.15)

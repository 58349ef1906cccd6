"""The bench of the observer's paper counts what it says: overlaps, hidings, errors, and draws what it counts."""

from __future__ import annotations

import json
from pathlib import Path

import contour_paper as bench
import cv2
import numpy as np
import pytest
from regions import Table

from perdure.errors import ParameterError
from perdure.types import Frame, Mask, Rows, Tracks

HEIGHT, WIDTH = 72, 96


def block(x: int, y: int = 20, width: int = 20, height: int = 30) -> Mask:
    return Mask(y, x, np.ones((height, width), np.bool_))


def rows(*one: tuple[int, int, Mask]) -> Rows:
    """Rows of (frame, object, mask)."""
    frames, ids, masks = zip(*one, strict=True)
    return Rows.of(frames=frames, ids=ids, masks=masks, size=(HEIGHT, WIDTH))


def said(*one: tuple[int, int, Mask]) -> Tracks:
    """Rows of (frame, id, whole silhouette)."""
    frames, ids, masks = zip(*one, strict=True)
    boxes = [mask.box for mask in masks]
    return Tracks.of(frames=frames, times=np.array(frames) / 25, ids=ids, boxes=boxes, masks=masks, believed=masks)


def clip(whole: Rows, visible: Rows, *numbers: int) -> bench.Clip:
    """A clip whose objects are marked in frame 0."""
    mark = np.zeros((HEIGHT, WIDTH), np.bool_)
    return bench.Clip("turning", Path("none.mp4"), bench.Truth(visible, whole), dict.fromkeys(numbers, (0, mark)))


def a_hiding(*shares: float) -> bench.Watched:
    """An object whose silhouette is half right while it is hidden, and wholly otherwise."""
    readings = [
        bench.Reading(k, 1, share, 1.0 if share >= bench.SEEN else 0.5, 1) for k, share in enumerate(shares)
    ]
    return bench.Watched("turning", "automatic", tuple(readings))


# binary


def test_the_error_of_a_drawn_shape_goes_down():
    one = bench.decay(0.3, frames=12)
    assert len(one.places) == len(one.speeds) == 11
    assert one.places[-1] < 0.1 * max(one.places)
    assert one.speeds[-1] < 0.1 * max(one.speeds)


@pytest.mark.parametrize(("later", "does"), [(0.5, True), (bench.FLAT, True), (1.5, False)])
def test_an_envelope_decays_if_no_ten_frames_are_worse_than_those_before(later: float, does: bool):
    one = bench.Decay(0.5, (1.0,) * 10 + (later,) * 10, (0.0,) * 20)
    assert one.decays == does
    assert one.as_json()["decays"] == does
    table = bench.binary_table([one, one._replace(gain=None)])
    assert [row[0] for row in table.rows] == ["0.5", "defaults"]
    assert {len(row) for row in table.rows} == {len(table.head)}


# clips


def test_a_silhouette_is_compared_beyond_the_picture_too():
    assert bench.iou(block(-10), block(-10)) == 1.0
    assert bench.iou(block(-10), block(0)) == pytest.approx(1 / 3)
    assert bench.iou(block(0), block(60)) == 0.0


def test_an_object_is_read_after_its_mark_while_it_is_whole_in_the_picture():
    whole = rows((0, 1, block(4)), (1, 1, block(8)), (2, 1, block(12)), (3, 1, block(0)), (2, 7, block(40)))
    visible = rows((0, 1, block(4)), (1, 1, block(8, width=5)), (2, 7, block(40)))
    told = said((1, 1, block(8)), (2, 1, block(40)), (2, 2, block(12)))
    found = bench.look(clip(whole, visible, 1), "automatic", told).readings
    assert found == (
        bench.Reading(1, 1, 0.25, 1.0, 1),
        bench.Reading(2, 1, 0.0, 0.0, 2),
    )


def test_means_are_of_frames_in_which_it_is_partly_hidden_hidden_or_free():
    one = a_hiding(1.0, 0.5, 0.5, 0.0, 1.0)
    assert (one.free, one.partly, one.hidden) == (1.0, 0.5, 0.5)
    assert a_hiding(1.0).partly is None


def test_the_same_target_is_the_one_that_stands_on_it_in_the_end():
    one = a_hiding(1.0, 0.5, 1.0)
    assert one.kept() == [1]
    other = bench.Watched("turning", "x", (*one.readings, bench.Reading(3, 1, 1.0, 0.6, 2)))
    assert other.kept() == []


def test_it_has_reappeared_when_all_of_it_is_seen_for_some_frames():
    gap = bench.GAP
    shares = [1.0, *[0.5] * gap, 1.0, 0.9, *[1.0] * gap, *[0.5] * (gap - 1), *[1.0] * gap]
    assert bench.reappeared(shares) == [gap + 3], "neither a moment in between nor a short hiding"
    one = a_hiding(*shares)
    assert one.again() == [(1, gap + 3, 0)]
    low = [bench.Reading(r.frame, 1, r.share, 0.5, 1) for r in one.readings]
    never = bench.Watched("turning", "x", tuple(low))
    assert never.again() == [(1, gap + 3, None)]
    assert [bench._slowest(each) for each in (one, never, a_hiding(1.0))] == ["0", "never", "-"]


def test_marks_are_read_with_their_frame_counted_from_zero(tmp_path: Path):
    for name in ("gt", "init"):
        (tmp_path / name).mkdir()
    for name in ("visible", "amodal"):
        (tmp_path / "gt" / f"{name}.txt").write_text("")
    one = {"id": 3, "first_full": {"frame": 7, "mask": "init/3.png"}}
    (tmp_path / "clip.json").write_text(json.dumps({"objects": [one]}))
    with pytest.raises(ParameterError, match=r"no picture init/3\.png"):
        bench.read_clip(tmp_path)
    cv2.imwrite(str(tmp_path / "init" / "3.png"), block(5).to_image(HEIGHT, WIDTH).astype(np.uint8))
    frame, mask = bench.read_clip(tmp_path).marks[3]
    assert frame == 6
    assert np.array_equal(mask, block(5).to_image(HEIGHT, WIDTH))


# tables and pictures


def test_a_gain_has_a_row_and_a_clip_a_column():
    rows_of = [
        bench.Watched(name, setting, a_hiding(1.0, share, 1.0).readings)
        for name, share in (("turning", 0.5), ("attractive", 0.9))
        for setting in ("L = 0.1", "automatic")
    ]
    tables = bench.figure_tables(rows_of)
    assert [len(one.rows) for one in tables] == [2, 2]
    assert all(len(row) == len(one.head) for one in tables for row in one.rows)
    grid = bench.grid_table(rows_of)
    assert grid.rows[-1] == ["best constant of each", "0.500", "0.500", "0.500"]
    assert [row[0] for row in grid.rows[:-1]] == ["L = 0.1", "automatic"]
    told = rows_of[0].as_json()
    assert told["frames"]["1"][1] == [1, 0.5, 0.5]
    json.dumps(told)


def test_settings_say_their_gains():
    assert bench.constant(0.3, 0.3).name == "L = 0.3"
    low = bench.constant(0.5, 0.3, "acceleration", rising=True)
    assert low.name == "Lμ = 0.5, Lv = 0.3, low at first"
    assert low.parameters["motion"] == "acceleration"
    assert set(bench.FIGURES) == set(bench.CLIPS)


def test_what_is_drawn_has_contours_and_a_curve():
    frame = Frame(3, 0.1, np.full((HEIGHT, WIDTH, 3), 90, np.uint8))
    picture = bench.tile(frame, said((3, 1, block(20))), [block(22)])
    assert picture.shape == (bench.TILE[1], bench.TILE[0], 3)
    assert (picture == bench.TRUE).all(axis=2).any() or (np.abs(picture.astype(int) - bench.TRUE) < 60).all(
        axis=2
    ).any()
    empty = bench.tile(frame, Tracks.empty())
    assert empty.shape == picture.shape
    one = a_hiding(1.0, *[0.5] * 8, 0.0, 1.0, 1.0)
    curve = bench.curve(one, [1, 4])
    assert curve.shape == (bench.TILE[1], bench.CURVE, 3)
    assert (curve == bench.PALE).all(axis=2).any()
    assert bench.columns_of(one.readings)[0] == 0


def test_the_mark_of_a_film_is_the_largest_thing_once_it_is_whole():
    def moving(*masks: Mask) -> np.ndarray:
        return np.any([mask.to_image(HEIGHT, WIDTH) for mask in masks], axis=0)

    frames = [
        np.zeros((HEIGHT, WIDTH), np.bool_),
        moving(block(90), block(2, 2, 5, 5)),
        moving(block(60), block(2, 2)),
    ]
    mark = bench.first_whole(frames)
    assert mark is not None
    assert mark.frame == 2
    assert np.count_nonzero(mark.mask) == 600
    assert bench.first_whole(frames[:2]) is None


# the page


def test_tables_of_parts_that_were_not_run_stay_on_the_page():
    versions = {"versions": {"python": "3"}}
    grid = Table("grid: g", ["gain", "mean"], [["L = 0.1", "0.5"]])
    binary = Table("binary: b", ["gain", "px"], [["0.1", "0.2"]])
    page = f"before\n{bench.MARKS.begin}\nold\n{bench.MARKS.end}\nafter\n"
    page = bench.MARKS.replaced(page, bench.section("run", bench.Result((grid,), {**versions, "grid": []}), page))
    page = bench.MARKS.replaced(
        page, bench.section("run", bench.Result((binary,), {**versions, "binary": []}), page)
    )
    assert page.index("**binary: b**") < page.index("**grid: g**")
    assert page.startswith("before")
    assert page.endswith("after\n")
    assert "old" not in page
    with pytest.raises(ParameterError, match=r"contour-observer\.md must have the lines"):
        bench.MARKS.replaced("no marks", "x")


def test_a_part_that_is_not_known_is_the_callers_mistake(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["contour_paper.py", "--parts", "figure"])
    with pytest.raises(SystemExit) as stopped:
        bench.main()
    assert stopped.value.code == 2
    assert "'figure' is no part" in capsys.readouterr().err


def test_a_clip_that_is_not_there_is_noted(tmp_path: Path, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["x", "--parts", "figures", "grid", "fall", "--data", str(tmp_path), "--json"])
    bench.main()
    out, err = capsys.readouterr()
    assert err.count("is left out") == len(bench.CLIPS) + 1
    assert json.loads(out.splitlines()[-1])["figures"] == []

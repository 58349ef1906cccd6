"""The bench of the contour observer counts what it says: lengths, slopes, stages."""

from __future__ import annotations

import contour as bench
import numpy as np
import pytest
from regions import plain as as_text

from perdure.errors import ParameterError
from perdure.types import Frame, Scene


def test_a_walk_times_updates_and_waves_make_the_contour_longer(monkeypatch):
    monkeypatch.setattr(bench, "FRAMES", 3)
    monkeypatch.setattr(bench, "WARM", 0)
    plain, wavy = (bench.walk(30, 50, waves, 1) for waves in (0, 14))
    assert plain.length == pytest.approx(np.pi * np.sqrt(2 * (15**2 + 25**2)), rel=0.03)
    assert wavy.length > plain.length
    assert plain.clock > 0
    assert plain.rate == pytest.approx(1e3 / plain.clock)
    assert "30x50" in as_text(bench.updates_table([plain]))


def test_a_slope_is_the_power_by_which_time_grows():
    assert bench.exponent([1, 2, 4], [3, 12, 48]) == pytest.approx(2)
    assert bench.exponent([1, 2, 4], [3, 3, 3]) == pytest.approx(0)


def test_what_a_stage_calls_counts_as_its_own():
    watch = bench.Stopwatch()
    inner = watch.wrapped("inner", lambda: None)
    watch.wrapped("outer", inner)()
    assert set(watch.spent) == {"outer"}
    inner()
    assert set(watch.spent) == {"outer", "inner"}


def test_every_stage_of_a_step_is_timed(monkeypatch):
    monkeypatch.setattr(bench, "WARM", 1)
    size = 90, 130
    shapes = [bench.shape_at(number, 24, 40, 0, size) for number in range(5)]
    rough = np.random.default_rng(0).integers(0, 90, (*size, 3), np.uint8)
    frames = [
        Frame(number, number / 25, np.where(shape[..., None], rough // 2 + np.uint8([150, 0, 0]), rough))
        for number, shape in enumerate(shapes)
    ]
    found = bench.steps_of("drawn", frames, Scene(130, 90, 25.0), {0: {1: shapes[0]}})
    assert (found.frames, found.objects) == (3, 1)
    assert all(found.stages[stage] > 0 for stage in bench.STAGES)
    assert sum(found.stages.values()) == pytest.approx(found.whole)
    assert "step / pass" in as_text(bench.stages_table([found]))


def test_tables_of_other_parts_stay_on_the_page_and_its_marks_are_needed(tmp_path, capsys):
    assert bench.measure(["stages"], 1, tmp_path).tables == ()
    assert "is not there" in capsys.readouterr().err
    with pytest.raises(ParameterError, match="'speed' is no part"):
        bench.measure(["speed"], 1, tmp_path)
    with pytest.raises(ParameterError, match="rounds = 0"):
        bench.measure(["updates"], 0, tmp_path)
    with pytest.raises(ParameterError, match="must have the lines"):
        bench.MARKS.replaced("no marks", "inside")
    table = bench.Table("updates: new", ["one"], [["new"]])
    result = bench.Result((table,), {"versions": {"cv2": "5"}, "updates": []})
    page = f"{bench.MARKS.begin}\n**updates: old**\n\n| old |\n\n**area: old**\n\n| kept |\n{bench.MARKS.end}\n"
    inside = bench.section("run", result, page)
    assert "new" in inside
    assert "| kept |" in inside
    assert "| old |" not in inside
    assert bench.MARKS.replaced(page, inside).startswith(f"{bench.MARKS.begin}\n`run`")

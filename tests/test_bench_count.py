"""The bench of counting: what was seen is read, and matched with what is counted."""

import count as bench
import pytest


def test_what_was_seen_is_read_by_line_and_direction():
    seen = bench.read_seen(bench.SEEN)
    assert {place: len(frames) for place, frames in seen.items()} == {
        ("far", "in"): 28, ("far", "out"): 0, ("near", "in"): 27, ("near", "out"): 0,
    }  # fmt: skip
    assert all(frames == sorted(frames) for frames in seen.values())


def test_the_nearest_go_together_and_what_is_left_is_missed_or_too_many():
    told = bench.compared("compound", "far", "in", [10, 20, 100], [12, 21, 30, 60])
    assert told.matched == [(10, 12), (20, 21)]
    assert (told.missed, told.doubled) == ([100], [30, 60])
    assert told.off == pytest.approx(100 / 3)


def test_nothing_seen_is_no_share():
    assert bench.compared("compound", "far", "out", [], []).off is None

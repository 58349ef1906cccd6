"""The bench of detectors, without its data: what counts as found, who is offered what, and how tables are kept."""

from __future__ import annotations

import detectors as bench
import numpy as np
import pytest

from perdure.types import Frame, Regions, Rows, Scene

BOX, OTHER = [10.0, 10, 30, 60], [50.0, 10, 70, 60]


def looked() -> bench.Looked:
    """In every second frame of six a person where one is, surely, another where none is, less so, and a dog."""
    regions = Regions.of([BOX, OTHER, BOX], [0.9, 0.4, 0.8], ["person", "person", "dog"])
    return bench.Looked(Scene(80, 80), tuple((Frame(k, k / 10), regions) for k in (0, 2, 4)), 7.0)


@pytest.fixture(autouse=True)
def a_truth_of_two_of_whom_one_is_never_seen(monkeypatch):
    frames, ids = np.repeat(np.arange(6), 2), np.tile([1, 2], 6)
    truth = Rows.of(frames=frames, ids=ids, boxes=np.tile([BOX, [0, 0, 5, 5]], (6, 1)))
    monkeypatch.setattr(bench, "true_rows", lambda count: truth.between(0, count - 1))


def test_only_frames_that_were_looked_at_and_the_class_that_is_asked_for_count():
    found = bench.found_by(looked(), 0.5, "person")
    assert (found["frames"], found["boxes"], found["precision"], found["recall"]) == (3, 3, 1.0, 0.5)
    assert bench.found_by(looked(), 0.1, "person")["precision"] == 0.5
    assert bench.found_by(looked(), 0.1, "")["boxes"] == 9


def test_trackers_are_given_people_from_the_score_that_the_title_names(monkeypatch):
    monkeypatch.setattr(bench, "network_of", lambda name, least: (name, least))
    monkeypatch.setattr(
        bench, "looked", lambda detector, frames: looked() if detector == ("yolox_nano", 0.25) else None
    )
    given = bench.given_to_trackers(None)
    assert [len(regions) for regions in given.regions] == [2, 2, 2]
    assert all(set(regions.classes) == {"person"} for regions in given.regions)


def test_tables_of_other_parts_stay_in_the_page():
    line = {
        "detector": "people",
        "score": None,
        "precision": 0.5,
        "recall": 0.25,
        "boxes": 9,
        "frames": 3,
        "ms": 1.0,
    }
    boxes = bench.tables_of("boxes", [line])
    batch = bench.tables_of("batch", [{"pictures": 1, "ms": 2.0}])
    marks = f"{bench.MARKS.begin}\n{bench.MARKS.end}"
    page = bench.MARKS.replaced(marks, bench.section({"batch": batch}, marks))
    page = bench.MARKS.replaced(page, bench.section({"boxes": boxes}, page))
    assert page.index("| people |  | 0.500 | 0.250 | 9 | 3 | 1.0 |") < page.index("| 1 | 2.0 |")


def test_a_tracker_that_failed_has_a_line_that_says_so():
    lines = [{"tracker": "norfair", "settings": "defaults", "fault": "no such library", "ms": 0.0}]
    (table,) = bench.tables_of("trackers", lines)
    assert table.rows[0][2] == "failed: no such library"
    assert len(table.rows[0]) <= len(table.head)

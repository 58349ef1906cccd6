"""Trackers of other libraries in the place of ours: by a library drawn in the test, and by the real ones where they are."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from worlds import two_apart

import perdure
from perdure.errors import ParameterError
from perdure.foreign import made_foreign
from perdure.pipeline import plan
from perdure.trackers.foreign import Foreign
from perdure.types import Frame, Mask, Regions, Scene, Status

NORFAIR = '''
"""A library that says: the first box is 7, seen; and 8 is believed beside it."""
import sys
import numpy as np


class Detection:
    def __init__(self, points, scores):
        self.points = points


class Told:
    def __init__(self, id, estimate, last_detection, live=True):
        self.id, self.estimate, self.last_detection = id, np.asarray(estimate, float), last_detection
        self.live_points = np.array([live])


class Tracker:
    def __init__(self, distance_function, distance_threshold, first=7, ends=99):
        print("hello from the library")
        self.first, self.ends, self.count = first, ends, 0

    def update(self, detections):
        self.count += 1
        if self.count > self.ends:
            sys.exit(3)
        if not detections:
            return []
        seen = detections[-1]
        shadow = [[0, 0], [5, 5]] if self.count % 2 else [[0, 0], [float("nan"), 5]]
        return [
            Told(self.first, seen.points, seen), Told(8, shadow, None), Told(9, seen.points, seen, live=False),
        ]
'''


@pytest.fixture(name="library")
def a_library_that_is_installed(tmp_path: Path, monkeypatch) -> Path:
    (tmp_path / "norfair").mkdir()
    (tmp_path / "norfair" / "__init__.py").write_text(NORFAIR)
    (tmp_path / "norfair" / "filter.py").write_text("")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.delenv("PERDURE_PEERS", raising=False)
    return tmp_path


def test_what_it_says_rests_on_the_regions_that_it_was_given(library):
    masks = [Mask(10, 10, np.ones((5, 5), bool)), Mask(20, 38, np.ones((9, 4), bool))]
    regions = Regions.of([[10, 10, 15, 15], [40, 20, 50, 30]], [0.5, 0.75], ["cat", "dog"], masks)
    tracker = Foreign("norfair", "Tracker")
    state = tracker.start(Scene(64, 48, 10))
    state, report = tracker.step(state, Frame(0, 0.0), regions)
    rows = report.rows
    assert rows.ids.tolist() == [7, 8]
    assert rows.boxes.tolist() == [[38, 20, 50, 30], [0, 0, 5, 5]]  # it holds the pixels seen
    assert rows.status.tolist() == [Status.VISIBLE, Status.OCCLUDED]
    assert rows.classes.tolist() == ["dog", ""]
    assert rows.links == ((1,), ())
    assert rows.masks == (masks[1], Mask.empty())
    assert rows.inferred.tolist() == [False, True]
    state, report = tracker.step(state, Frame(1, 0.1), regions)
    assert report.rows.ids.tolist() == [7], "a place that is no number is nobody's"
    state, report = tracker.step(state, Frame(2, 0.2), Regions.empty())
    assert len(report.rows) == 0
    assert len(tracker.finish(state).rows) == 0
    assert state.process.returncode == 0


def test_a_whole_film_is_tracked_by_it(library):
    world = two_apart()
    film = [frame.image for frame in world.frames()]
    tracks = perdure.track(film, tracker="norfair:Tracker", tracker_settings={"first": 3}, fps=10)
    assert set(tracks.ids.tolist()) == {3, 8}
    assert any(mask.area for mask in tracks.masks)


def test_what_it_refuses_and_that_it_ended_is_told_in_its_words(library):
    film = [frame.image for frame in two_apart().frames()]
    for name, settings, words in (
        ("Traker", {}, "norfair:Traker says: AttributeError"),
        ("Tracker", {"patience": 2}, "TypeError.*'patience'"),
        ("Tracker", {"ends": 3}, "norfair:Tracker says: its process ended"),
    ):
        with pytest.raises(ParameterError, match=words):
            perdure.track(film, tracker=f"norfair:{name}", tracker_settings=settings)


def test_a_library_that_is_not_there_says_where_it_may_be_had(monkeypatch):
    monkeypatch.delenv("PERDURE_PEERS", raising=False)
    monkeypatch.setenv("PYTHONPATH", "")
    tracker = Foreign("pyxtrackers", "SORT")
    with pytest.raises(ParameterError, match=r"pyxtrackers is not installed.*--tracker-environment"):
        tracker.start(Scene(64, 48))
    with pytest.raises(ParameterError, match="does not run"):
        Foreign("norfair", "Tracker", python="/nowhere/python").start(Scene(64, 48))


def test_settings_are_a_mapping_json_or_a_file(tmp_path):
    (tmp_path / "settings.json").write_text('{"first": 3}')
    for given in ({"first": 3}, '{"first": 3}', tmp_path / "settings.json"):
        assert made_foreign("norfair:Tracker", given).arguments == {"first": 3}
    (tmp_path / "list.json").write_text("[3]")
    for wrong in ("{", tmp_path / "none.json", tmp_path / "list.json"):
        with pytest.raises(ParameterError, match="JSON"):
            made_foreign("norfair:Tracker", wrong)


def test_words_that_do_not_go_together_are_refused(tmp_path):
    film = [np.zeros((48, 64, 3), np.uint8)]
    for options, words in (
        ({"tracker": "norfair"}, "norfair:CLASS"),
        ({"tracker": "norfair:a b"}, "norfair:CLASS"),
        ({"tracker": "overlap", "tracker_settings": "{}"}, "--tracker-settings goes with"),
        ({"tracker": "overlap", "tracker_environment": tmp_path}, "--tracker-environment goes with"),
        ({"tracker": "norfair:Tracker", "tracker_environment": tmp_path}, "is no environment"),
        ({"tracker": "norfair:Tracker", "parameters": {"patience": 2.0}}, "patience"),
        ({"tracker": "norfair:Tracker", "embedding": "m.onnx"}, "--embedding goes with"),
    ):
        with pytest.raises(ParameterError, match=words):
            plan(film, **options)


PEERS = Path(os.environ.get("PERDURE_PEERS") or Path(__file__).parents[2] / "bench/peers/.venv")


@pytest.mark.skipif(
    not (PEERS / "bin/python").exists(), reason="no environment of the peers; python bench/peers.py makes it"
)
@pytest.mark.parametrize("word", ["trackers:ByteTrackTracker", "trackers:SORTTracker", "norfair:Tracker"])
def test_a_real_library_follows_two_who_walk_apart(word, tmp_path):
    film = [frame.image for frame in two_apart().frames()]
    (tmp_path / "settings.json").write_text(json.dumps({}))
    tracks = perdure.track(
        film, tracker=word, tracker_environment=PEERS, tracker_settings=tmp_path / "settings.json", fps=10
    ).counted()
    ids, counts = np.unique(tracks.ids, return_counts=True)
    assert len(ids) == 2
    assert (counts > 20).all()
    assert all(mask.area for mask, links in zip(tracks.masks, tracks.links, strict=True) if links)

"""What the smallest tracker does, told as stories."""

from __future__ import annotations

import numpy as np
from worlds import World, crossing, flicker, lone_walker, two_apart

from perdure.fold import settle, track
from perdure.metrics.clear import clear
from perdure.trackers.overlap import Overlap
from perdure.types import Frame, Regions, Scene, Status, Tracks


def said(world: World, tracker: Overlap | None = None) -> Tracks:
    return settle(step.report for step in track(world.seen(), tracker or Overlap(), world.scene))


def test_a_lone_walker_is_one_track_from_her_first_frame_on():
    world = lone_walker()
    assert clear(said(world), world.truth()) == clear(world.truth(), world.truth())


def test_two_who_never_meet_keep_their_ids():
    world = two_apart()
    figures = clear(said(world), world.truth())
    assert (figures.recall, figures.precision, figures.switches) == (1.0, 1.0, 0)


def test_a_speck_of_one_frame_is_never_said():
    assert len(set(said(flicker()).ids.tolist())) == 1


def test_a_target_not_seen_for_a_moment_keeps_its_id_and_is_said_lost_meanwhile():
    seen = [
        (frame, Regions.empty() if 15 <= frame.index < 20 else regions) for frame, regions in lone_walker().seen()
    ]
    tracks = settle(step.report for step in track(seen, Overlap(), lone_walker().scene))
    assert set(tracks.ids.tolist()) == {1}
    assert (tracks.status[(tracks.frames >= 15) & (tracks.frames < 20)] == Status.LOST).all()
    assert set(tracks.counted().frames.tolist()) == set(range(3, 40)) - set(range(15, 20))


def test_a_target_not_seen_for_longer_than_its_patience_comes_back_as_another():
    seen = [
        (frame, Regions.empty() if 15 <= frame.index < 20 else regions) for frame, regions in lone_walker().seen()
    ]
    tracks = settle(step.report for step in track(seen, Overlap(patience=0.3), lone_walker().scene))
    assert set(tracks.counted().ids.tolist()) == {1, 2}


def test_patience_is_in_seconds_whatever_the_frame_rate():
    for fps in (5.0, 50.0):
        gone = round(0.8 * fps)
        seen = [
            (Frame(k, k / fps), Regions.empty() if fps <= k < fps + gone else Regions.of([[10, 10, 30, 40]]))
            for k in range(round(4 * fps))
        ]
        tracks = settle(step.report for step in track(seen, Overlap(patience=1.0), Scene(64, 48, fps)))
        assert set(tracks.ids.tolist()) == {1}


def test_rows_name_the_region_they_rest_on():
    boxes = [[100, 10, 120, 40], [10, 10, 30, 40]]
    seen = [(Frame(k, k / 10), Regions.of(boxes, classes=["car", "person"])) for k in range(9)]
    tracks = settle(step.report for step in track(seen, Overlap(), Scene(200, 100)))
    for box, name, links in zip(tracks.boxes, tracks.classes, tracks.links, strict=True):
        assert boxes[links[0]] == box.tolist()
        assert name == ["car", "person"][links[0]]


def test_two_who_meet_and_part_are_two_again_though_not_surely_the_same():
    world = crossing()
    last = said(world).counted().in_frame(world.count - 1)
    assert len(last) == 2


def test_entering_and_leaving_are_events():
    seen = [(Frame(k, k / 10), Regions.of([[10, 10, 30, 40]]) if k < 10 else Regions.empty()) for k in range(40)]
    events = [event for step in track(seen, Overlap(), Scene(64, 48)) for event in step.report.events]
    assert [(event.kind, event.begin, event.ids) for event in events] == [("entered", 0, (1,)), ("left", 20, (1,))]


def test_scores_of_the_detector_are_the_confidence():
    seen = [(Frame(k, k / 10), Regions.of([[10, 10, 30, 40]], scores=[0.5])) for k in range(9)]
    tracks = settle(step.report for step in track(seen, Overlap(), Scene(64, 48)))
    assert np.allclose(tracks.confidence, 0.5)

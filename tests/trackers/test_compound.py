"""What the tracker of compound targets does, told as stories; then the parts that it is made of."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import pytest
from worlds import Block, Path, World, flicker, lone_walker

from perdure import states
from perdure.features.boxes import overlaps
from perdure.fold import settle, track
from perdure.maths.kernels.follow import follow
from perdure.metrics.clear import clear
from perdure.trackers.compound import Compound
from perdure.trackers.compound.bodies import Bodies, learnt
from perdure.trackers.compound.companies import Pair, accompany
from perdure.trackers.compound.darting import darted
from perdure.trackers.compound.identity import by_motion, by_order, is_rigid
from perdure.trackers.compound.matrix import Matched, Thresholds, distances, match
from perdure.trackers.compound.targets import (
    CENTRE,
    Targets,
    extended,
    generic_points,
    motions,
    newborn,
    predicted,
    side_words,
)
from perdure.types import Event, Frame, Regions, Renamed, Report, Status, Tracks

RED, BLUE, GREEN, YELLOW, FLOOR = (200, 40, 40), (40, 60, 220), (40, 180, 60), (200, 200, 60), (90, 90, 90)
Seen = list[tuple[Frame, Regions]]


class Story(NamedTuple):
    """What was said, from beginning to end."""

    tracks: Tracks
    events: tuple[Event, ...]
    renamed: tuple[Renamed, ...]
    reports: tuple[Report, ...]

    def told(self, *kinds: str) -> list[tuple[str, int, tuple[int, ...]]]:
        return [(one.kind, one.begin, one.ids) for one in self.events if one.kind in kinds]

    def why(self, kind: str) -> list[str]:
        return [one.why for one in self.events if one.kind == kind]


def person(path: Path, colour: tuple[int, int, int] = RED, size: tuple[int, int] = (24, 48)) -> Block:
    return Block(path, size, colour)


def bar(x1: int, x2: int, y1: int = 60, y2: int = 240) -> Block:
    """Something that always stands there, in front of those drawn before it."""
    return Block(lambda k: (x1, y1), (x2 - x1, y2 - y1), FLOOR)


def street(*blocks: Block, count: int, fps: float = 10.0) -> World:
    return World(blocks, count, 320, 240, fps)


def along(*stations: tuple[int, int, int]) -> Path:
    """A walk from station (frame, x, y) to station; from the first to the last."""
    frames, x, y = zip(*stations, strict=True)

    def path(k: int) -> tuple[int, int] | None:
        if not frames[0] <= k <= frames[-1]:
            return None
        return round(float(np.interp(k, frames, x))), round(float(np.interp(k, frames, y)))

    return path


def story(world: World, seen: Iterable[tuple[Frame, Regions]] | None = None, **parameters: float) -> Story:
    steps = list(track(world.seen() if seen is None else seen, Compound(**parameters), world.scene))
    reports = tuple(step.report for step in steps)
    events = tuple(event for report in reports for event in report.events)
    renamed = tuple(one for report in reports for one in report.renamed)
    return Story(settle(reports), events, renamed, reports)


def without_pictures(seen: Seen, begin: int = 0, end: int = 10**6) -> Seen:
    return [(Frame(f.index, f.time) if begin <= f.index < end else f, regions) for f, regions in seen]


def boxes_alone(seen: Seen) -> Seen:
    return [(Frame(f.index, f.time), Regions.of(regions.boxes)) for f, regions in seen]


def nothing_seen(seen: Seen, begin: int, end: int, blind: bool = False) -> Seen:
    none = Regions.empty()
    none = Regions(none.boxes, none.scores, none.classes, none.masks, blind=blind)
    return [(f, none if begin <= f.index < end else regions) for f, regions in seen]


def names(tracks: Tracks, world: World, frame: int) -> list[int]:
    """The ids that each person of a world, in order, goes by in a frame; 0 where nobody is said to be there."""
    rows = tracks.take(~tracks.is_group).in_frame(frame)
    found = []
    for block in world.blocks:
        if block.colour != FLOOR and (corner := block.path(frame)) is not None:
            box = np.array([[*corner, corner[0] + block.size[0], corner[1] + block.size[1]]], np.float32)
            share = overlaps(box, rows.boxes)[0]
            found.append(int(rows.ids[share.argmax()]) if share.max(initial=0) > 0.5 else 0)
    return found


def width(tracks: Tracks, frame: int) -> float:
    x1, _, x2, _ = tracks.in_frame(frame).boxes[0]
    return float(x2 - x1)


def height(tracks: Tracks, frame: int) -> float:
    _, y1, _, y2 = tracks.in_frame(frame).boxes[0]
    return float(y2 - y1)


def two_who_turn_back() -> World:
    """Red from the left and blue from the right, almost in one place for 1.5 s; each goes back."""
    return street(
        person(along((0, 40, 100), (25, 140, 100), (40, 140, 100), (65, 40, 100))),
        person(along((0, 240, 100), (25, 142, 100), (40, 142, 100), (65, 240, 100)), BLUE),
        count=66,
    )


def two_who_pass(other: tuple[int, int, int] = RED) -> World:
    """From the left to the right and from the right to the left, through one place."""
    return street(
        person(along((0, 40, 100), (50, 240, 100))), person(along((0, 240, 100), (50, 40, 100)), other), count=51
    )


def two_who_stand_together(count: int = 86) -> World:
    return street(
        person(along((0, 40, 100), (30, 140, 100), (60, 140, 100), (85, 20, 100))),
        person(along((0, 280, 100), (30, 156, 100), (60, 156, 100), (85, 290, 100)), BLUE),
        count=count,
    )


# ---- targets by themselves: points 2, 8 and 12 ------------------------------------------------------------------


def test_a_lone_walker_is_one_track_from_her_first_frame_on():
    world = lone_walker()
    assert clear(story(world).tracks, world.truth()) == clear(world.truth(), world.truth())


def test_a_speck_of_one_frame_is_never_said():
    assert set(story(flicker()).tracks.ids.tolist()) == {1}


def test_who_walks_out_of_the_picture_has_left_and_who_vanishes_inside_is_lost():
    leaves = street(person(along((0, 200, 100), (20, 310, 100))), count=90)
    vanishes = street(person(along((0, 100, 100), (20, 160, 100))), count=90)
    assert [kind for kind, _, _ in story(leaves).told("left", "lost")] == ["left"]
    assert [kind for kind, _, _ in story(vanishes).told("left", "lost")] == ["lost"]


def test_who_is_not_seen_for_a_short_time_is_suspended_where_her_way_led_and_does_not_count():
    world = street(person(along((0, 20, 100), (50, 220, 100))), count=51)
    said = story(world, nothing_seen(without_pictures(world.seen()), 20, 26))
    gone = said.tracks.take((said.tracks.frames >= 20) & (said.tracks.frames < 26))
    assert (gone.status == Status.LOST).all()
    assert gone.inferred.all()
    assert set(said.tracks.ids.tolist()) == {1}
    assert [names(said.tracks, world, frame) for frame in range(20, 26)] == [[1]] * 6
    assert not set(said.tracks.counted().frames.tolist()) & set(range(20, 26))
    assert said.told("suspended", "found_again") == [("suspended", 22, (1,)), ("found_again", 26, (1,))]


def test_a_detection_of_low_score_continues_a_target_but_never_founds_one():
    def scored(score: float, begin: int, end: int) -> Seen:
        return [
            (f, Regions.of(r.boxes, scores=[score if begin <= f.index < end else 0.9] * len(r)))
            for f, r in world.seen()
        ]

    world = street(person(along((0, 20, 100), (40, 180, 100))), count=41)
    weak = story(world, scored(0.3, 15, 30))
    assert set(weak.tracks.ids.tolist()) == {1}
    assert (weak.tracks.status == Status.VISIBLE).all()
    assert len(story(world, scored(0.3, 0, 41)).tracks) == 0
    assert len(story(world, scored(0.65, 0, 41)).tracks) == 0


def test_a_blind_frame_is_no_reason_to_lose_anybody():
    world = street(person(along((0, 20, 100), (20, 100, 100), (60, 100, 100))), count=61)
    said = story(world, nothing_seen(world.seen(), 25, 55, blind=True), recall=2.0)
    assert names(said.tracks, world, 58) == [1]
    assert said.told("suspended", "lost", "found_again") == []
    assert story(world, nothing_seen(world.seen(), 25, 55), recall=2.0).told("lost") == [("lost", 25, (1,))]


# ---- who meet: points 8 and 9 -----------------------------------------------------------------------------------


def test_individuals_inside_a_merged_region_are_said_in_every_frame_and_name_their_group():
    world = two_who_stand_together()
    tracks = story(world).tracks
    for frame in range(32, 60):
        rows = tracks.in_frame(frame)
        members, group = rows.take(rows.groups > 0), rows.take(rows.is_group)
        assert members.ids.tolist() == [1, 2]
        assert set(members.groups.tolist()) == set(group.ids.tolist())
        assert (members.status == Status.AMBIGUOUS).all()
        assert names(tracks, world, frame) == [1, 2]
        assert group.boxes.tolist() == [[140, 100, 180, 148]]
        assert group.status.tolist() == [Status.VISIBLE]
    assert set(tracks.counted().ids.tolist()) == {1, 2}


def test_meeting_and_parting_are_told_with_the_frames_in_which_they_began():
    world = two_who_stand_together()
    regions = [len(regions) for _, regions in world.seen()]
    first, last = regions.index(1), len(regions) - regions[::-1].index(1)
    assert story(world).told("merge", "split") == [("merge", first, (1, 2)), ("split", last, (1, 2))]


def test_a_body_cut_in_two_by_a_thin_bar_is_one_target_with_two_regions():
    world = street(person(along((0, 10, 100), (31, 289, 100))), bar(140, 146), count=32)
    seen = world.seen()
    assert max(len(regions) for _, regions in seen) == 2
    tracks = story(world, seen).tracks
    assert set(tracks.ids.tolist()) == {1}
    assert max(len(links) for links in tracks.links) == 2


@pytest.mark.xfail(
    strict=True,
    reason="who walks slowly into a bar shrinks before it counts as hidden; then the far piece becomes id 2",
)
def test_a_body_that_stands_behind_a_thin_bar_is_one_target():
    world = street(person(along((0, 20, 100), (30, 142, 100), (60, 142, 100))), bar(151, 156), count=61)
    assert set(story(world).tracks.ids.tolist()) == {1}


def test_who_is_hidden_by_another_is_said_to_be_and_not_counted_and_comes_out_as_herself():
    small = person(along((0, 20, 100), (30, 140, 100), (60, 140, 100), (90, 260, 100)), BLUE, (22, 44))
    large = person(along((0, 280, 98), (30, 140, 98), (90, 140, 98)), RED, (26, 52))
    world = street(small, large, count=91)
    for seen in (world.seen(), without_pictures(world.seen())):
        said = story(world, seen)
        behind, before = names(said.tracks, world, 10)
        for frame in range(33, 59):
            row = said.tracks.of_id(behind).in_frame(frame)
            assert row.status.tolist() == [Status.OCCLUDED]
            assert row.inferred.tolist() == [True]
            assert said.tracks.counted().in_frame(frame).ids.tolist() == [before]
        assert [ids for _, _, ids in said.told("occluded", "found_again")] == [(behind,)] * 2
        assert names(said.tracks, world, 85) == [behind, before]


# ---- who part: point 10 -----------------------------------------------------------------------------------------


def test_rule_a_look_alikes_who_walk_together_keep_their_order():
    world = street(
        person(along((0, 20, 100), (20, 90, 100), (35, 142, 100), (60, 230, 100))),
        person(along((0, 70, 100), (20, 110, 100), (35, 162, 100), (60, 290, 100))),
        count=61,
    )
    for seen in (world.seen(), without_pictures(world.seen())):
        said = story(world, seen)
        assert names(said.tracks, world, 25) == names(said.tracks, world, 55) == [1, 2]
        assert "rule a: order kept" in said.why("resolved")[0]


def test_rule_b_look_alikes_who_pass_each_other_are_told_apart_by_their_motions():
    world = two_who_pass()
    for seen in (world.seen(), without_pictures(world.seen()), boxes_alone(world.seen())):
        said = story(world, seen)
        assert names(said.tracks, world, 10) == names(said.tracks, world, 45) == [1, 2]
        assert "rule b: distinct motions" in said.why("resolved")[0]


def test_two_who_stand_together_and_go_back_are_told_apart_by_their_colours():
    world = two_who_turn_back()
    said = story(world)
    assert names(said.tracks, world, 10) == names(said.tracks, world, 60) == [1, 2]
    assert "colours +2.00" in said.why("resolved")[0]


def test_who_is_a_hand_apart_is_set_free_only_when_that_has_lasted():
    """A gap of 3 pixels between two of 24, from frame 41 on."""
    world = street(
        person(along((0, 40, 100), (30, 140, 100), (40, 140, 100), (41, 134, 100), (60, 134, 100))),
        person(along((0, 280, 100), (30, 156, 100), (40, 156, 100), (41, 161, 100), (60, 161, 100)), BLUE),
        count=61,
    )
    assert story(world, apart=0.1).told("resolved") == [("resolved", 41, (1,)), ("resolved", 41, (2,))]
    assert story(world).told("resolved") == [("resolved", 47, (1,)), ("resolved", 47, (2,))]


def test_three_in_two_regions_are_one_company_until_one_has_moved_away():
    world = street(
        person(along((0, 20, 100), (30, 118, 100), (70, 118, 100))),
        person(along((0, 300, 100), (30, 140, 100), (70, 140, 100)), BLUE),
        person(
            along((0, 260, 20), (30, 160, 100), (40, 160, 100), (41, 167, 100), (45, 167, 100), (70, 290, 20)),
            GREEN,
        ),
        count=71,
    )
    said = story(world)
    assert [names(said.tracks, world, frame) for frame in (10, 35, 43, 65)] == [[2, 3, 1]] * 4
    assert [(begin > 45, ids) for _, begin, ids in said.told("resolved")] == [(True, (1,))]
    assert said.told("split")[0][2] == (1, 2, 3)
    assert said.told("mixed") == [("mixed", 41, (1, 2, 3))]
    assert said.why("mixed")[0].startswith("3 targets in 2 regions")


def test_without_colours_two_who_stood_in_one_place_and_go_back_are_taken_for_passing():
    world = two_who_turn_back()
    assert names(story(world, colour=0.0).tracks, world, 60) == [2, 1]


def test_a_mistake_that_shows_when_they_part_is_corrected_backwards():
    world = two_who_turn_back()
    said = story(world, without_pictures(world.seen(), 21, 43))  # silhouettes alone, until they part
    (begin,) = {one.begin for one in said.renamed}
    assert {(one.old, one.new, one.end) for one in said.renamed} == {(1, 2, 43), (2, 1, 43)}
    assert said.told("exchanged") == [("exchanged", begin, (2, 1))]
    assert 25 <= begin <= 40
    live = Tracks.join(report.rows for report in said.reports)
    for frame in (41, 42):
        assert names(live, world, frame) == [2, 1]
        assert names(said.tracks, world, frame) == [1, 2]
    assert [names(said.tracks, world, frame) for frame in (22, 43, 60)] == [[1, 2]] * 3


def test_who_goes_from_one_company_straight_into_another_is_in_that_one():
    """Red passes before blue and is before green, who comes slowly, when blue comes out alone."""
    world = street(
        person(along((0, 127, 100), (50, 167, 100)), GREEN),
        person(along((0, 40, 96), (40, 280, 96)), BLUE),
        person(along((0, 280, 104), (40, 40, 104))),
        count=40,
    )
    said = story(world)
    assert names(said.tracks, world, 8) == names(said.tracks, world, 39) == [2, 1, 3]


def test_two_who_have_parted_are_not_exchanged_for_where_they_went_later():
    """Red passes before blue, then before green, who stands; red and blue stay who they are when both are free."""
    world = street(
        person(along((0, 120, 92), (60, 120, 92)), GREEN),
        person(along((0, 72, 96), (40, 232, 96)), BLUE),
        person(along((0, 248, 104), (40, 88, 104))),
        count=40,
    )
    said = story(world)
    assert names(said.tracks, world, 10) == names(said.tracks, world, 39) == [1, 2, 3]
    assert not said.told("exchanged")


def test_rule_c_a_third_who_comes_out_of_a_group_is_new_and_the_others_stay_who_they_are():
    third = person(lambda k: None if k < 30 else (149 + 5 * max(k - 50, 0), 100), GREEN)
    world = street(
        third,  # behind blue, until she walks away
        person(along((0, 40, 100), (30, 130, 100), (90, 130, 100))),
        person(along((0, 280, 100), (30, 149, 100), (90, 149, 100)), BLUE),
        count=72,
    )
    said = story(world)
    new, red, blue = names(said.tracks, world, 70)
    assert [red, blue] == names(said.tracks, world, 10) == [1, 2]
    assert new not in (0, 1, 2)
    assert said.told("resolved", "exchanged") == []
    assert [ids for _, _, ids in said.told("entered")] == [(1,), (2,), (new,)]
    late = said.tracks.in_frame(70)
    assert late.status[np.isin(late.ids, [1, 2])].tolist() == [Status.AMBIGUOUS] * 2


def test_every_resolution_says_its_rule_and_its_figures():
    said = story(two_who_turn_back())
    first, second = said.why("resolved")
    assert first.startswith("rule b: distinct motions, log odds -0.")
    assert first.endswith(" for who was believed, colours +2.00 for who was believed (met 2)")
    assert "last of its compound" in second
    assert [ids for _, _, ids in said.told("resolved")] == [(1,), (2,)]


def test_a_third_who_joins_unseen_can_be_mislabelled_and_the_events_show_it():
    """Fig. 3: two walk together, a third has come in behind them; who she is cannot be known without pictures."""
    third = person(lambda k: None if k < 30 else (149 + 5 * max(k - 50, 0), 100), GREEN)
    world = street(
        third,
        person(along((0, 40, 100), (30, 130, 100), (90, 130, 100))),
        person(along((0, 280, 100), (30, 149, 100), (90, 149, 100)), BLUE),
        count=72,
    )
    said = story(world, without_pictures(world.seen()))
    taken = names(said.tracks, world, 70)[0]
    assert taken in (1, 2)
    (resolved,) = [event for event in said.events if event.kind == "resolved" and event.why.startswith("rule")]
    assert resolved.why.startswith("rule b")
    assert resolved.confidence < 0.75  # nothing speaks for her but that she was believed there


def test_the_tracks_of_a_group_and_of_each_person_in_it_go_on():
    """Fig. 3: who walk together."""
    world = street(
        person(along((0, 20, 100), (20, 90, 100), (50, 210, 100))),
        person(along((0, 70, 100), (20, 106, 100), (50, 226, 100)), BLUE),
        count=51,
    )
    tracks = story(world).tracks
    groups = tracks.take(tracks.is_group)
    assert len(set(groups.ids.tolist())) == 1
    assert groups.frames.tolist() == list(range(int(groups.frames[0]), 51))
    for frame in groups.frames.tolist():
        assert names(tracks, world, frame) == [1, 2]


# ---- a second ambiguity, and a compound lost: points 11 and 15 --------------------------------------------------


def test_a_second_ambiguity_joins_the_compounds_and_all_four_come_out_as_themselves():
    world = street(
        person(along((0, 20, 60), (20, 90, 60), (60, 90, 60), (80, 20, 60))),
        person(along((0, 170, 60), (20, 108, 60), (60, 108, 60), (80, 170, 20)), BLUE),
        person(along((0, 60, 180), (20, 90, 150), (40, 92, 82), (60, 92, 82), (80, 60, 180)), GREEN),
        person(along((0, 130, 180), (20, 109, 150), (40, 110, 82), (60, 110, 82), (80, 150, 180)), YELLOW),
        count=81,
    )
    said = story(world)
    ((_, frame, ids),) = said.told("approximated")
    assert ids == (1, 2, 3, 4)
    assert said.told("merge") == [("merge", 18, (3, 4)), ("merge", 20, (1, 2)), ("merge", frame, ids)]
    assert "merge since frame 18, merge since frame 20" in said.why("approximated")[0]
    for k in range(81):  # the places believed meanwhile fill the gap
        assert names(said.tracks, world, k) == [1, 2, 3, 4]


def test_a_group_whose_region_is_lost_altogether_is_suspended_and_its_members_found_one_by_one():
    world = two_who_stand_together()
    said = story(world, nothing_seen(world.seen(), 40, 68))
    assert said.told("suspended") == [("suspended", 42, (1,)), ("suspended", 42, (2,))]
    assert [ids for _, _, ids in said.told("found_again")] == [(1,), (2,)]
    assert all(why.startswith("rule b") for why in said.why("found_again"))
    assert names(said.tracks, world, 80) == [1, 2]


def test_a_group_that_is_not_seen_for_a_moment_is_found_again_with_all_its_members():
    world = two_who_stand_together()
    for seen in (world.seen(), without_pictures(world.seen())):
        said = story(world, nothing_seen(seen, 40, 48))
        assert [names(said.tracks, world, frame) for frame in (39, 44, 48, 80)] == [[1, 2]] * 4


def test_a_group_that_is_lost_altogether_has_not_split():
    world = two_who_stand_together()
    said = story(world, nothing_seen(world.seen(), 40, 48))
    assert [begin for _, begin, _ in said.told("split")] == [61]


def test_a_meeting_that_is_over_has_been_told_as_split():
    small = person(along((0, 20, 100), (30, 140, 100), (60, 140, 100), (90, 20, 100)), BLUE, (22, 44))
    large = person(along((0, 280, 98), (30, 140, 98), (60, 140, 98), (90, 280, 98)), RED, (26, 52))
    said = story(street(small, large, count=91))
    assert [kind for kind, _, _ in said.told("merge", "split")] == ["merge", "split"]


def test_whoever_names_a_group_is_in_a_frame_with_its_row():
    world = two_who_stand_together()
    tracks = story(world, nothing_seen(world.seen(), 40, 48)).tracks
    for frame in range(world.count):
        rows = tracks.in_frame(frame)
        assert set(rows.groups[rows.groups > 0].tolist()) <= set(rows.ids.tolist())


def test_blind_frames_change_nothing_in_a_group():
    world = two_who_stand_together()
    tracks = story(world, nothing_seen(world.seen(), 40, 48, blind=True)).tracks
    assert len(set(tracks.take(tracks.is_group).ids.tolist())) == 1


def test_blind_frames_tell_nothing_of_a_group():
    world = two_who_stand_together()
    said = story(world, nothing_seen(world.seen(), 40, 48, blind=True))
    kinds = ("merge", "split", "suspended", "found_again", "lost", "exchanged")
    assert [kind for kind, _, _ in said.told(*kinds)] == ["merge", "split"]
    assert [names(said.tracks, world, frame) for frame in (39, 44, 48, 80)] == [[1, 2]] * 4


# ---- behind something that stands: points 5 and 8 ---------------------------------------------------------------


def behind_a_bar(hidden: int, speed: int) -> World:
    """Walks right until `hidden` of her 24 pixels are behind a bar, stands for 3 s, and goes back."""
    x = 120 + hidden
    far = x - 15 * speed
    return street(
        person(along((0, far, 100), (15, x, 100), (45, x, 100), (60, far, 100))), bar(144, 170), count=61
    )


def test_the_side_that_a_bar_hides_is_said_and_told():
    said = story(behind_a_bar(hidden=12, speed=8))
    rows = said.tracks.take((said.tracks.frames >= 16) & (said.tracks.frames <= 19))
    assert rows.status.tolist() == [Status.PARTLY_OCCLUDED] * 4
    assert rows.hidden_side.tolist() == ["right"] * 4
    ((_, begin, ids),) = said.told("partly_occluded")
    assert (14 < begin < 22, ids) == (True, (1,))
    assert [width(said.tracks, frame) > 20 for frame in range(16, 20)] == [True] * 4
    assert set(said.tracks.ids.tolist()) == {1}


def test_who_comes_out_from_behind_a_bar_is_as_wide_as_before():
    said = story(behind_a_bar(hidden=12, speed=6))
    assert said.tracks.ids.tolist() == [1] * 61
    assert [width(said.tracks, frame) for frame in (5, 54)] == [24.0, 24.0]
    assert said.tracks.hidden_side[[5, 54]].tolist() == ["", ""]


@pytest.mark.parametrize("hidden", [12, 14])
def test_who_stands_half_hidden_does_not_shrink(hidden: int):
    tracks = story(behind_a_bar(hidden, speed=6)).tracks
    assert min(width(tracks, frame) for frame in range(12, 30)) > 19


@pytest.mark.xfail(
    strict=True,
    reason="the mean size follows what is seen: 24 becomes 16 within 0.8 s (8 and 10 hidden) or 3 s (12 and 14)",
)
@pytest.mark.parametrize("hidden", [8, 10, 12, 14])
def test_who_stands_half_hidden_for_three_seconds_has_not_shrunk(hidden: int):
    tracks = story(behind_a_bar(hidden, speed=6)).tracks
    assert min(width(tracks, frame) for frame in range(12, 45)) > 19


@pytest.mark.xfail(
    strict=True, reason="the mean height follows what is seen: 48 becomes 28, and then no side is hidden"
)
def test_who_walks_down_behind_a_low_wall_does_not_shrink():
    path = along((0, 100, 2), (15, 100, 92), (45, 100, 92), (60, 100, 2))  # 20 of 48 pixels below the edge
    tracks = story(street(person(path), bar(0, 320, 120), count=61)).tracks
    assert min(height(tracks, frame) for frame in range(12, 45)) > 40


def test_who_walks_behind_a_bar_is_found_again_where_her_trajectory_led():
    world = street(person(along((0, 10, 100), (31, 289, 100))), bar(140, 172), count=32)
    said = story(world, without_pictures(world.seen()))
    assert min(len(regions) for _, regions in world.seen()) == 0
    assert [ids for _, _, ids in said.told("found_again")] == [(1,)]
    assert "where its trajectory led" in said.why("found_again")[0]
    assert set(said.tracks.ids.tolist()) == {1}


@pytest.mark.xfail(
    strict=True,
    reason="she seems to slow down and shrink as she vanishes, is slowed down further, and comes out as a slit",
)
@pytest.mark.parametrize("speed", [4, 6])
def test_who_is_hidden_by_a_wider_bar_for_half_a_second_is_found_by_her_trajectory(speed: int):
    last = 280 // speed
    world = street(person(along((0, 10, 100), (last, 10 + last * speed, 100))), bar(140, 172), count=last + 1)
    said = story(world, without_pictures(world.seen()))
    assert set(said.tracks.ids.tolist()) == {1}


def behind_a_wall(out: int, colour: tuple[int, int, int] = RED) -> World:
    """Goes behind a wall of 80 pixels, loiters, and comes out on the other side (out > 0) or where she went in."""
    end = 296 if out > 0 else 20
    return street(
        person(along((0, 20, 100), (20, 150, 100))),
        person(along((21, 150, 100), (60, 164, 100), (80, end, 100)), colour),
        bar(130, 210),
        count=81,
    )


@pytest.mark.parametrize("out", [1, -1])
def test_who_was_hidden_for_longer_is_found_again_by_her_colours(out: int):
    world = behind_a_wall(out)
    said = story(world)
    assert set(said.tracks.ids.tolist()) == {1}
    assert "colours 1.00 alike" in said.why("found_again")[0]


def test_somebody_else_who_comes_out_from_behind_the_wall_is_somebody_else():
    said = story(behind_a_wall(1, BLUE))
    assert set(said.tracks.ids.tolist()) == {1, 2}
    assert said.told("found_again") == []


def test_who_is_found_again_is_said_from_the_first_frame_in_which_she_was_seen_again():
    world = behind_a_wall(1)
    said = story(world)
    ((_, begin, _),) = said.told("found_again")
    visible = [frame for frame, regions in world.seen() if len(regions) and frame.index > 30]
    assert begin == visible[0].index
    assert begin in said.tracks.counted().frames.tolist()


# ---- other eyes, other clocks -----------------------------------------------------------------------------------


@pytest.mark.parametrize("fps", [5, 10, 50])
def test_the_same_story_gives_the_same_ids_at_every_frame_rate(fps: int):
    def walk(start: int, speed: int, colour: tuple[int, int, int]) -> Block:
        return person(lambda k: (round(start + speed * k / fps), 100), colour)

    world = street(walk(20, 50, RED), walk(270, -50, BLUE), count=5 * fps + 1, fps=fps)
    for seen in (world.seen(), without_pictures(world.seen())):
        said = story(world, seen)
        assert names(said.tracks, world, fps) == names(said.tracks, world, 5 * fps - 1) == [1, 2]
        begins = [(kind, begin / fps) for kind, begin, _ in said.told("entered", "merge", "split")]
        assert [kind for kind, _ in begins] == ["entered", "entered", "merge", "split"]
        assert np.allclose([time for _, time in begins], [0, 0, 2.27, 2.76], atol=1 / fps)


def test_boxes_alone_are_enough():
    world = two_who_stand_together()
    said = story(world, boxes_alone(world.seen()))
    assert [names(said.tracks, world, frame) for frame in (10, 40, 80)] == [[1, 2]] * 3
    assert set(said.tracks.counted().ids.tolist()) == {1, 2}


def test_without_the_weight_of_colours_the_picture_is_never_looked_at():
    world = two_who_turn_back()
    with_pictures = story(world, colour=0.0).reports
    blindfolded = story(world, without_pictures(world.seen()), colour=0.0).reports
    assert all(one.equals(other) for one, other in zip(with_pictures, blindfolded, strict=True))


def test_the_state_stays_as_it_is_while_two_stand_together_for_ever():
    world = two_who_stand_together(count=41)
    tracker, seen = Compound(), world.seen()
    state, sizes = tracker.start(world.scene), []
    for k in range(400):
        frame, regions = seen[min(k, 40)]
        state, report = tracker.step(state, Frame(k, k / 10, frame.image), regions)
        if k % 50 == 49:
            sizes.append((len(state.targets), len(state.pairs), len(state.compounds)))
            assert len(states.save(state)) < 150_000
    assert set(sizes) == {(3, 1, 1)}
    assert report.rows.take(~report.rows.is_group).ids.tolist() == [1, 2]


def test_who_is_wholly_hidden_by_another_for_ever_is_let_go():
    world = street(
        person(along((0, 40, 100), (20, 140, 100), (80, 140, 100))),
        person(along((0, 240, 100), (20, 140, 100), (80, 140, 100)), BLUE),
        count=70,
    )
    said = story(world, longest=3.0)
    (lost,) = said.told("lost")
    assert 18 <= lost[1] <= 22, "from the first frame without her"
    assert said.tracks.in_frame(65).ids.tolist() == [2]


# ---- two who come in together ------------------------------------------------------------------------------------


def side_by_side(part: int) -> World:
    """Two who come in from the left hand in hand, as one region, and part in a frame."""
    return street(
        person(along((0, -40, 100), (part, 130, 100), (part + 15, 130, 40))),
        person(along((0, -18, 100), (part, 152, 100), (part + 15, 152, 160)), BLUE),
        count=part + 16,
    )


def test_two_who_came_in_as_one_region_are_both_said_from_then_on_once_they_part():
    world = side_by_side(34)
    told = story(world)
    (mended,) = [one for one in told.events if one.kind == "mended"]
    assert mended.ids == (1, 2)
    assert mended.begin <= 9
    assert mended.end == 40
    told_then = [k for k in range(12, 50) if sorted(names(told.tracks, world, k)) == [1, 2]]
    assert set(told_then) >= {*range(12, 41), *range(45, 50)}  # the newcomer is believed in after .25 s
    for k in range(12, 41):
        left, right = told.tracks.in_frame(k).masks
        assert min(left.area, right.area) > 0.6 * 24 * 48


def test_who_was_alone_before_another_came_out_from_behind_her_was_alone():
    world = street(
        bar(150, 182, 60, 240),
        person(along((0, 10, 100), (30, 158, 100), (60, 158, 100))),
        person(along((20, 154, 100), (30, 160, 100), (50, 230, 100)), BLUE),
        count=60,
    )
    before = story(world).tracks.in_frame(10)
    assert len(before) == 1


def test_a_bag_that_is_left_behind_was_nobody_before():
    world = street(
        person(along((0, 10, 100), (60, 250, 100))),
        Block(lambda k: (min(10 + 4 * k, 130) + 2, 138), (10, 10), BLUE),
        count=60,
    )
    told = story(world)
    assert not told.told("mended")


def two_flies(parted: tuple[int, int], count: int) -> World:
    """Two of a size, who touch but for some frames, in which a gap is between them that one of them makes."""

    def gap(k: int) -> int:
        return 14 if parted[0] <= k < parted[1] else 0

    return street(
        Block(lambda k: (100, 100), (50, 24), RED),
        Block(lambda k: (150 + gap(k), 104), (50, 24), BLUE),
        count=count,
    )


def test_two_of_a_size_who_touch_from_the_beginning_are_two_once_they_were_apart_for_a_second():
    told = story(two_flies((20, 45), 70))
    bodies = told.tracks.take(~told.tracks.is_group)
    assert set(bodies.ids.tolist()) == {1, 2}
    assert [bodies.in_frame(k).ids.tolist() for k in (0, 10, 30, 60)] == [[1, 2]] * 4
    (mended,) = [one for one in told.events if one.kind == "mended"]
    assert mended.ids == (1, 2)


def test_what_comes_in_two_for_a_moment_is_one():
    told = story(two_flies((20, 28), 60))
    assert set(told.tracks.ids.tolist()) == {1}


# ---- who darts off -----------------------------------------------------------------------------------------------


def darter(count: int = 40) -> Block:
    """A fish that swims a little at a time, and in frame 20 flees by one and a half of its length."""
    return Block(lambda k: (60 + 2 * k + (75 if k >= 20 else 0), 60 + (20 if k >= 20 else 0)), (50, 12), RED)


def test_who_flees_farther_than_her_length_in_one_frame_is_still_herself():
    told = story(street(darter(), count=40))
    assert set(told.tracks.ids.tolist()) == {1}
    assert not told.told("suspended", "found_again")
    assert (np.bincount(told.tracks.frames, minlength=40) == 1).all()


def test_a_shoal_that_flees_at_once_keeps_its_names():
    fish = [
        Block(lambda k, x=x, y=y: (x + 2 * k + (70 if k >= 20 else 0), y), (50, 12), RED)
        for x, y in ((20, 40), (85, 60), (30, 90))
    ]
    world = street(*fish, count=40)
    told = story(world).tracks
    assert [names(told, world, k) for k in (10, 30)] == [[1, 2, 3], [1, 2, 3]]


def darts(regions: list[list[int]], targets: list[list[int]], pairs: list[list[int]]) -> list[list[int]]:
    """The (target, region) pairs once those left over have been looked at, in a picture of 320x240."""
    boxes = [np.array(some, np.float32) for some in (regions, targets)]
    found = Matched(np.array(pairs, np.intp).reshape(-1, 2), ())
    sure, eager = np.ones(len(regions), np.bool_), np.ones(len(targets), np.bool_)
    return darted(found, boxes[0], sure, boxes[1], eager, None, (240, 320)).pairs.tolist()


def test_who_is_gone_is_the_one_who_is_new_two_lengths_away_and_not_farther():
    assert darts([[100, 40, 140, 50]], [[30, 40, 70, 50]], []) == [[0, 0]]
    assert darts([[130, 40, 170, 50]], [[30, 40, 70, 50]], []) == []
    assert darts([[100, 40, 118, 50]], [[30, 40, 70, 50]], []) == []  # another, by size


def test_who_is_covered_by_another_has_not_darted_off_nor_who_goes_out_of_the_picture():
    cover, elsewhere, covered = [20, 20, 80, 90], [100, 40, 140, 50], [40, 40, 75, 50]
    assert darts([cover, elsewhere], [cover, covered], [[0, 0]]) == [[0, 0]]
    assert darts([[280, 40, 320, 50]], [[230, 40, 270, 50]], []) == []


def test_of_a_shoal_the_paths_are_chosen_that_are_shortest_together():
    before = [[30, 40, 70, 50], [90, 40, 130, 50]]
    after = [[85, 20, 125, 30], [145, 20, 185, 30]]  # the first is now near where the second was
    assert darts(after, before, []) == [[0, 0], [1, 1]]


# ---- boxes that jitter -------------------------------------------------------------------------------------------


def shaken(seen: Seen, by: float) -> Seen:
    """The same boxes, each off by about so many px."""
    rng = np.random.default_rng(0)
    return [
        (f, Regions.of((r.boxes + np.tile(rng.normal(0, by, (len(r), 2)), 2)).astype(np.float32))) for f, r in seen
    ]


def trust(seen: Seen, world: World) -> float:
    """The gain at the end of a film."""
    tracker = Compound()
    state = tracker.start(world.scene)
    for frame, regions in seen:
        state, _ = tracker.step(state, frame, regions)
    return float(state.jitter.gain.mean())


def strollers(count: int = 135) -> World:
    return street(*(person(along((0, 10, y), (count, 10 + 2 * count, y))) for y in (20, 90, 160)), count=count)


def test_boxes_that_jitter_are_trusted_less_than_boxes_that_do_not():
    world = strollers()
    still, little, much = (trust(shaken(boxes_alone(world.seen()), by), world) for by in (0.0, 1.0, 4.0))
    assert still > 0.7 > 0.55 > much
    assert still > little >= much


def test_two_side_by_side_keep_their_names_though_their_boxes_jitter_by_a_sixth_of_their_width():
    world = street(
        person(along((0, 10, 100), (120, 250, 100))), person(along((0, 38, 100), (120, 278, 100))), count=120
    )
    tracks = story(world, shaken(boxes_alone(world.seen()), 4.0)).tracks
    told = [names(tracks, world, k) for k in range(120)]
    assert sum(one in ([1, 2], [0, 2], [1, 0]) for one in told) >= 118


# ---- points and trajectories: points 2 to 5 ---------------------------------------------------------------------


def table(*boxes: tuple[float, float, float, float]):
    return np.array(boxes, np.float32).reshape(-1, 4)


def one_target(box: tuple[float, float, float, float] = (100, 100, 120, 140)) -> Targets:
    return newborn(Frame(0, 0.0), table(box), np.ones(1, np.float32), np.array([""]), 1)


def walked(target: Targets, times: Iterable[float], xs: Iterable[float]) -> Targets:
    for time, x in zip(times, xs, strict=True):
        target = extended(target, np.array([0]), time, np.array([[x, 120]], np.float32), target.size)
    return target


def test_the_generic_points_are_the_centre_and_the_middles_of_top_bottom_left_and_right():
    points = generic_points(np.array([[0, 0, 10, 20]], np.float32))
    assert points.tolist() == [[[5, 10], [5, 0], [5, 20], [0, 10], [10, 10]]]


def test_a_straight_walk_is_one_segment_and_a_turn_begins_another():
    times = np.arange(1, 11) / 10
    straight = walked(one_target(), times, 110 + 50 * times)
    assert straight.lines.knots[0, -1].tolist() == [0.0, 110.0, 120.0]
    turned = walked(straight, 1 + times[:3], 160 - 50 * times[:3])
    assert np.allclose(turned.lines.knots[0, -1], [1.0, 160.0, 120.0], atol=0.1)


def test_a_reliable_trajectory_is_extended_by_its_last_segment_and_another_by_more_of_them():
    times = np.arange(1, 11) / 10
    straight = walked(one_target(), times, 110 + 50 * times)
    assert np.allclose(motions(straight), [[50, 0]])
    stopped = walked(straight, 1 + times[:2], [160, 160])
    assert 20 < motions(stopped)[0, 0] < 45


def test_who_is_unseen_is_expected_at_her_mean_size_and_slows_down():
    target, motion = one_target(), np.array([[100, 0]], np.float32)
    soon, late = (predicted(target, motion, time, patience=1.5)[0] for time in (0.1, 60.0))
    assert np.allclose(soon, [110, 100, 130, 140], atol=1)
    assert np.allclose(late, [250, 100, 270, 140], atol=1)


EXPECTED = (100.0, 100.0, 140.0, 180.0)
CENTRE_EXPECTED = (120.0, 140.0)


def cut(side: str, share: float) -> tuple[float, float, float, float]:
    """The expected box with a share of it hidden on one side."""
    x1, y1, x2, y2 = EXPECTED
    return {
        "left": (x1 + share * 40, y1, x2, y2),
        "top": (x1, y1 + share * 80, x2, y2),
        "right": (x1, y1, x2 - share * 40, y2),
        "bottom": (x1, y1, x2, y2 - share * 80),
    }[side]


class Followed(NamedTuple):
    points: np.ndarray  # (5, 2)
    hidden: str
    size: list[float]


def followed(box: tuple[float, float, float, float]) -> Followed:
    """A target of 40 x 80, no longer coming into view, of which this is seen."""
    one, none = np.ones(1, np.float32), np.zeros(1, np.bool_)
    picture = np.array([320, 240], np.float32)
    points, hidden, size = follow(table(EXPECTED), table(box), none, one / 10, picture, 0.3)
    return Followed(points[0], side_words(hidden)[0], size[0].tolist())


each_side = pytest.mark.parametrize("side", ["left", "top", "right", "bottom"])


@each_side
@pytest.mark.parametrize("share", [0.4, 0.7])
def test_a_side_that_does_not_match_while_its_opposite_does_is_hidden(side: str, share: float):
    assert followed(cut(side, share)).hidden == side


@each_side
def test_the_side_that_stands_where_it_should_locates_who_is_mostly_hidden(side: str):
    points = followed(cut(side, 0.7)).points
    assert np.allclose(points, generic_points(table(EXPECTED)), atol=1e-3)


@pytest.mark.xfail(
    strict=True,
    reason="points up to the tolerance off count as much as the best one: the centre is drawn to the seen side",
)
@each_side
def test_the_point_with_the_smallest_error_locates_who_is_half_hidden(side: str):
    assert np.allclose(followed(cut(side, 0.4)).points[CENTRE], CENTRE_EXPECTED, atol=1)


@each_side
def test_the_mean_size_hardly_follows_where_a_side_does_not_match(side: str):
    width, height = followed(cut(side, 0.4)).size
    assert (width > 39.5) & (height > 79)


def test_a_target_seen_whole_a_little_further_is_where_it_is_seen():
    found = followed((104, 104, 144, 184))
    assert found.points[CENTRE].tolist() == [124, 144]
    assert (found.hidden, found.size) == ("", [40, 80])


def test_a_target_that_is_larger_than_expected_hides_no_side():
    assert followed((100, 100, 160, 180)).hidden == ""


# ---- the ambiguity matrix: points 6, 7 and 9 --------------------------------------------------------------------

LIMITS = Thresholds(
    distance=0.85, size_ratio=4.0, second_distance=0.5, sure=0.6, least=0.1, share=0.5, gain=0.1, near=2.0
)


def matched(regions, targets, scores=None, whole=None):
    count = len(targets)
    return match(
        regions,
        np.ones(len(regions), np.float32) if scores is None else np.array(scores, np.float32),
        targets,
        np.zeros(count, bool) if whole is None else np.array(whole),
        np.zeros(count, np.float32),
        LIMITS,
    )


def test_the_distance_is_one_less_the_overlap_or_one_and_the_way_in_sizes():
    target = table((0, 0, 10, 10))
    regions = table((0, 0, 10, 10), (5, 0, 15, 10), (30, 40, 40, 50), (30, 30, 40, 50))
    away = np.hypot(30, 35) / 20  # the larger side of both
    assert np.allclose(distances(regions, target)[:, 0], [0, 2 / 3, 6, 1 + away])
    assert distances(regions[:0], target).shape == (0, 1)


def test_a_correspondence_is_close_and_of_similar_size():
    target = table((0, 0, 10, 10))
    regions = table((0, 0, 10, 10), (0, 0, 10, 40), (0, 0, 10, 41), (5, 5, 15, 15), (8, 0, 18, 10))
    found = [len(matched(regions[[one]], target).pairs) for one in range(5)]
    # whole; ratio 4 at a distance of 0.75; ratio 4.1; a distance of 1 - 25/175; a distance of 1 - 20/180
    assert found == [1, 1, 0, 0, 0]


def test_targets_with_regions_of_their_own_are_visible():
    found = matched(table((50, 0, 70, 40), (1, 0, 21, 40)), table((0, 0, 20, 40), (51, 0, 71, 40)))
    assert sorted(map(tuple, found.pairs.tolist())) == [(0, 1), (1, 0)]
    assert found.knots == ()


def test_two_targets_that_explain_a_region_together_are_a_merge():
    found = matched(table((0, 0, 36, 40)), table((0, 0, 20, 40), (16, 0, 36, 40)))
    assert found.knots == (((0, 1), (0,)),)
    assert len(found.pairs) == 0


def test_two_regions_that_are_a_target_together_are_a_split():
    found = matched(table((0, 0, 20, 18), (0, 22, 20, 40)), table((0, 0, 20, 40)))
    assert found.knots == (((0,), (0, 1)),)


def test_a_group_may_come_apart_in_regions_that_are_much_smaller():
    group, regions = table((0, 0, 60, 40)), table((0, 0, 50, 40), (51, 0, 60, 40))
    assert matched(regions, group, whole=[True]).knots == (((0,), (0, 1)),)


def test_a_target_far_from_every_region_is_lost():
    found = matched(table((0, 0, 20, 40)), table((0, 0, 20, 40), (200, 0, 220, 40)))
    assert found.pairs.tolist() == [[0, 0]]
    assert found.knots == ()


def test_a_region_of_low_score_is_given_only_to_who_found_nothing_else():
    target = table((0, 0, 20, 40))
    regions = table((0, 0, 20, 40), (6, 0, 26, 40))
    assert matched(regions, target, scores=[0.3, 0.9]).pairs.tolist() == [[0, 1]]
    assert matched(regions[:1], target, scores=[0.3]).pairs.tolist() == [[0, 0]]
    assert len(matched(regions[:1], target, scores=[0.05]).pairs) == 0


# ---- who is who: point 10 ---------------------------------------------------------------------------------------


def place(*values: float):
    return np.array(values, np.float64)


def test_parallel_motions_and_standing_together_are_rigid_and_opposite_ways_are_not():
    assert is_rigid(place(50, 0), place(40, 10), size=30)
    assert is_rigid(place(2, 0), place(-3, 0), size=30)
    assert not is_rigid(place(50, 0), place(-50, 0), size=30)
    assert not is_rigid(place(50, 0), place(0, 0), size=30)


def test_order_speaks_for_who_was_first_less_so_if_they_were_near_or_it_was_long_ago():
    one, other, here, there = place(0, 0), place(30, 0), place(100, 0), place(140, 0)
    assert by_order(one, other, here, there, 30, 0).odds == pytest.approx(-3)
    assert by_order(one, other, there, here, 30, 0).odds == pytest.approx(3)
    assert by_order(one, other, here, place(100, 40), 30, 0).odds == pytest.approx(0)
    assert by_order(one, place(15, 0), here, there, 30, 0).odds == pytest.approx(-1.5)
    assert by_order(one, other, here, there, 30, 20).odds == pytest.approx(-3 / np.e)
    assert by_order(one, one, here, there, 30, 0).odds == 0
    assert "order kept (+1.00)" in by_order(one, other, here, there, 30, 0).why
    assert "order turned round (-1.00)" in by_order(one, other, there, here, 30, 0).why


def test_motion_speaks_for_who_was_on_the_way_there():
    """Frozen at time, x, y, speed x, speed y."""
    right, left = place(0, 100, 0, 50, 0), place(0, 130, 0, -50, 0)
    passed = by_motion(right, left, place(145, 0), place(85, 0), 30, 1.0)
    assert passed.odds < -0.5
    turned = by_motion(right, left, place(85, 0), place(145, 0), 30, 1.0)
    assert turned.odds == pytest.approx(-passed.odds)
    assert by_motion(right, left, place(115, 0), place(115, 0), 30, 1.0).odds == pytest.approx(0)
    assert by_motion(right, left, place(900, 0), place(-900, 0), 30, 1.0).odds == -3


# ---- one body or several ----------------------------------------------------------------------------------------


def used_to(*boxes: tuple[float, float, float, float], seconds: float = 6.0) -> Bodies:
    bodies = Bodies.unknown()
    for k in range(round(seconds * 10)):
        bodies = learnt(bodies, table(boxes[k % len(boxes)]), 0.1, memory=120.0)
    return bodies


def test_the_size_of_bodies_is_known_once_enough_were_seen_that_are_alike():
    assert not Bodies.unknown().known
    assert not used_to((0, 0, 20, 50), seconds=2).known
    assert used_to((0, 0, 20, 50), (0, 0, 22, 52)).known
    assert not used_to((0, 0, 20, 50), (0, 0, 60, 20), (0, 0, 150, 90)).known


def test_two_side_by_side_are_stranger_than_each_and_two_halves_are_stranger_than_the_whole():
    bodies = used_to((0, 0, 20, 50), (0, 0, 22, 52), (0, 0, 19, 48))
    pair, one, other = bodies.strangeness(table((0, 0, 42, 50), (0, 0, 20, 50), (22, 0, 42, 50)))
    assert pair > (one + other) / 2
    whole, upper, lower = bodies.strangeness(table((0, 0, 20, 50), (0, 0, 20, 23), (0, 27, 20, 50)))
    assert whole < (upper + lower) / 2


def test_bodies_nearer_to_the_camera_are_expected_to_be_larger():
    far, near = (100, 60, 110, 85), (100, 160, 130, 235)
    bodies = used_to(far, near, seconds=120)
    mean, _ = bodies.expected(np.array([85, 235]))
    assert np.allclose(mean, [[10, 25], [30, 75]], rtol=0.25)
    alien = bodies.strangeness(table((100, 10, 130, 85)))
    assert alien > bodies.strangeness(table(near))


# ---- who is with whom -------------------------------------------------------------------------------------------


def members(named: tuple[int, ...]) -> Targets:
    """The members of a compound, side by side, and its temporary target."""
    count = len(named)
    boxes = table(*((100 + 15 * n, 100, 120 + 15 * n, 140) for n in range(count)), (100, 100, 150, 140))
    born = newborn(Frame(0, 0.0), boxes, np.ones(count + 1, np.float32), np.array([""] * (count + 1)), 1)
    born = born.with_(np.arange(count), ids=named, within=count + 1)
    return born.with_(np.arange(count + 1), compound=9).with_([count], temporary=True)


def kept_company(regions: dict[int, list[int]], count: int, named: tuple[int, ...] = (1, 2), blind=()):
    """Events (kind, begin, ids, frame told) of targets whose regions change in some frames, 20 a second."""
    pairs: tuple[Pair, ...] = ()
    region, told = [-1] * len(named), []
    for k in range(count):
        region = regions.get(k, region)
        found = accompany(pairs, members(named), np.array([*region, -1]), Frame(k, k / 20), k in blind)
        pairs = found.pairs
        told += [(event.kind, event.begin, event.ids, k) for event in found.events]
    return told, pairs


def test_a_merge_is_told_after_a_moment_and_a_split_too_each_from_its_first_frame():
    told, pairs = kept_company({0: [0, 1], 5: [0, 0], 20: [0, 1]}, 40)
    assert told == [("merge", 5, (1, 2), 7), ("split", 20, (1, 2), 23)]
    assert pairs == ()


def test_a_short_gap_is_bridged_and_a_touch_is_not_told():
    assert kept_company({5: [0, 0], 20: [0, 1], 22: [0, 0]}, 40)[0] == [("merge", 5, (1, 2), 7)]
    assert kept_company({5: [0, 0], 6: [0, 1]}, 40)[0] == []


def test_nobody_parts_while_nothing_can_be_seen():
    told, _ = kept_company({5: [0, 0], 20: [-1, -1], 30: [0, 0]}, 40, blind=range(20, 30))
    assert told == [("merge", 5, (1, 2), 7)]


def test_three_who_meet_at_once_are_told_together():
    told, _ = kept_company({5: [0, 0, 0], 20: [0, 0, 1]}, 40, named=(4, 7, 6))
    assert told == [("merge", 5, (4, 6, 7), 7), ("split", 20, (4, 6, 7), 23)]


def test_who_has_no_name_yet_is_not_told():
    assert kept_company({5: [0, 0]}, 40, named=(1, 0))[0] == []

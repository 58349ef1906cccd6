"""What zones change for the trackers, on drawn films: each with the zone and without."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from worlds import Block, Path, World, walk

from perdure.fold import settle, track
from perdure.scene.zones import Rule, Zone, rectangle
from perdure.trackers import TRACKERS
from perdure.types import Event, Frame, Regions, Status, Tracks

FLOOR = (90, 90, 90)
DOOR = Zone("entry", "door", rectangle(0, 0, 20, 80))
OUT = Zone("exit", "out", rectangle(100, 0, 120, 80))


class Told(NamedTuple):
    """What was said, from beginning to end."""

    tracks: Tracks
    events: tuple[Event, ...]

    def of(self, *kinds: str) -> list[tuple[str, int, tuple[int, ...], str]]:
        return [(one.kind, one.begin, one.ids, one.zone) for one in self.events if one.kind in kinds]

    @property
    def ids(self) -> list[int]:
        return np.unique(self.tracks.ids).tolist()


def told(
    tracker: str, world: World, zones: tuple[Zone, ...] = (), rules: tuple[Rule, ...] = (), **own: Any
) -> Told:
    """Track a world, or the boxes of its truth where a tracker needs no pixels."""
    kind = TRACKERS[tracker]
    seen = world.seen() if kind.needs_pixels else boxes_of(world)
    scene = replace(world.scene, zones=zones, rules=rules)
    steps = list(track(seen, kind(**own), scene))
    return Told(
        settle(step.report for step in steps), tuple(event for step in steps for event in step.report.events)
    )


def boxes_of(world: World) -> list[tuple[Frame, Regions]]:
    """What is seen of a world, as boxes alone: without pixels nobody is known by looks."""
    return [(Frame(frame.index, frame.time), Regions.of(regions.boxes)) for frame, regions in world.seen()]


def wall(x1: int, x2: int) -> Block:
    """Something of the floor's colour, before all others."""
    return Block(lambda k: (x1, 0), (x2 - x1, 80), FLOOR)


def still(x: int, y: int, begin: int, end: int = 10**6) -> Path:
    return walk((x, y), (0, 0), begin, end)


every = pytest.mark.parametrize("tracker", TRACKERS)
PLAIN = [name for name, kind in TRACKERS.items() if not kind.needs_pixels]
boxes_alone = pytest.mark.parametrize("tracker", PLAIN)
from_pixels = pytest.mark.parametrize("tracker", [name for name in TRACKERS if name not in PLAIN])


# Entries ----------------------------------------------------------------------------------------------------


@boxes_alone
def test_who_comes_in_by_an_entry_is_said_as_soon_as_anywhere_and_the_event_names_it(tracker: str):
    world = World((Block(walk((5, 30), (2, 0), begin=3)),))
    with_door = told(tracker, world, (DOOR,))
    assert with_door.of("entered") == [("entered", 3, (1,), "door")]
    assert with_door.tracks.equals(told(tracker, world).tracks)


@boxes_alone
def test_who_appears_outside_all_entries_must_be_seen_for_a_second_and_then_all_of_it_is_said(tracker: str):
    shortly, long = World((Block(still(60, 30, 3, 12)),)), World((Block(still(60, 30, 3)),))
    assert told(tracker, shortly).ids == [1]
    assert told(tracker, shortly, (DOOR,)).ids == []
    with_door = told(tracker, long, (DOOR,))
    assert with_door.of("entered") == [("entered", 3, (1,), "")]
    assert with_door.tracks.equals(told(tracker, long).tracks), "his first rows are said late"


@from_pixels
def test_from_pixels_who_appears_outside_all_entries_is_born_after_a_second(tracker: str):
    shortly, long = World((Block(still(60, 30, 3, 11)),), 14), World((Block(still(60, 30, 3)),), 15)
    assert told(tracker, shortly, (DOOR,)).ids == []
    assert told(tracker, long).of("entered") == [("entered", 4, (1,), "")]
    assert told(tracker, long, (DOOR,)).of("entered") == [("entered", 13, (1,), "")]
    by_door = World((Block(still(5, 30, 3)),), 7)
    assert told(tracker, by_door, (DOOR,)).of("entered") == [("entered", 4, (1,), "door")]


def test_who_parts_from_somebody_came_in_with_him():
    """Two come in by the door as one region and part in the middle, less than a second before the film ends."""
    upper = Block(lambda k: (5 + 2 * k, 20 - max(k - 20, 0)))
    lower = Block(lambda k: (5 + 2 * k, 36 + max(k - 20, 0)), colour=(40, 60, 220))
    said = _with_pictures(World((upper, lower), count=36, zones=(DOOR,)))[0]
    assert len(np.unique(said.in_frame(35).ids)) == 2


# Exits ------------------------------------------------------------------------------------------------------


@every
def test_who_is_lost_in_an_exit_has_left_by_it_soon(tracker: str):
    world, door = World((Block(still(50, 30, 3, 25)),), count=40), Zone("exit", "out", rectangle(40, 0, 80, 80))
    (event,) = [one for one in told(tracker, world, (door,)).events if one.kind in ("left", "lost")]
    assert (event.kind, event.zone, event.ids) == ("left", "out", (1,))
    assert event.end == 24 + 11, "1.0 s after he was seen last, and not later than that"


@every
def test_who_is_lost_elsewhere_is_kept_for_twice_as_long_where_exits_are_drawn(tracker: str):
    world = World((Block(still(50, 30, 3, 25)),), count=150)
    ends = {}
    for zones in ((), (OUT,)):
        (event,) = [one for one in told(tracker, world, zones).events if one.kind in ("left", "lost")]
        assert event.zone == ""
        ends[zones] = (event.end - 25 + 1) / 10
    assert ends[(OUT,)] == pytest.approx(2 * ends[()], abs=0.21)


# Occluders --------------------------------------------------------------------------------------------------


def behind_a_wall(for_so_long: int) -> World:
    """Somebody walks behind a wall (50 to 80), stays there, and comes out on the other side."""

    def path(k: int) -> tuple[int, int] | None:
        if k < 3:
            return None
        going = min(k - 3, 28)
        after = max(k - 31 - for_so_long, 0)
        return 4 + 2 * going + 2 * after, 30

    return World((Block(path), wall(50, 80)), count=70 + for_so_long)


WALL = Zone("occlusion", "wall", rectangle(50, 0, 80, 80))


@boxes_alone
def test_who_is_behind_an_occluder_for_long_keeps_the_id_and_is_said_to_be_there(tracker: str):
    world = behind_a_wall(45)
    assert told(tracker, world).ids == [1, 2]
    kept = told(tracker, world, (WALL,))
    assert kept.ids == [1]
    (occluded,), (again,) = kept.of("occluded"), kept.of("found_again")
    assert occluded[2:] == again[2:] == ((1,), "wall")
    hidden = kept.tracks.take(kept.tracks.status == Status.OCCLUDED)
    assert len(hidden) > 40
    middle = (hidden.boxes[:, 0] + hidden.boxes[:, 2]) / 2
    assert (middle >= 45).all()
    assert (middle <= 85).all()


@boxes_alone
def test_behind_an_occluder_one_is_kept_for_as_long_as_it_says(tracker: str):
    assert told(tracker, behind_a_wall(45), (replace(WALL, patience=3.0),)).ids == [1, 2]
    assert told(tracker, behind_a_wall(140), (replace(WALL, patience=20.0),)).ids == [1]


@every
def test_who_is_lost_at_an_occluder_is_kept_for_longer_and_the_event_names_it(tracker: str):
    world, hedge = World((Block(still(50, 30, 3, 15)),), count=64), replace(WALL, name="hedge", patience=4.0)
    said = told(tracker, world, (hedge,))
    assert [one[2:] for one in said.of("occluded")] == [((1,), "hedge")]
    (end,) = [one for one in said.events if one.kind in ("left", "lost")]
    assert end.end == 14 + 41


@boxes_alone
def test_who_comes_out_far_from_the_occluder_is_somebody_else(tracker: str):
    world = World((Block(still(36, 30, 3, 20)), Block(still(100, 30, 60))), count=90)
    assert told(tracker, world, (WALL,)).ids == [1, 2]


# Low contrast -----------------------------------------------------------------------------------------------


@boxes_alone
def test_in_low_contrast_the_lost_are_looked_for_for_longer(tracker: str):
    dark = Zone("low-contrast", "dark", rectangle(40, 0, 80, 80))
    patience = 1.0
    world = World((Block(still(50, 30, 3, 20)), Block(still(50, 30, 36))), count=60)
    kept = {"window" if tracker == "multifeature" else "patience": patience}
    assert told(tracker, world, **kept).ids == [1, 2]
    assert told(tracker, world, (dark,), **kept).ids == [1]


@boxes_alone
def test_in_low_contrast_a_region_may_be_farther_away(tracker: str):
    """Somebody who stands jumps by more than half of his width."""
    dark = Zone("low-contrast", "dark", rectangle(20, 0, 100, 80), distance=3.0)
    world = World((Block(lambda k: (50 if k < 20 else 56, 30)),), count=40)
    narrow = {
        "compound": {"max_distance": 0.6},
        "overlap": {"least_overlap": 0.4},
        "multifeature": {"weights": "overlap=1", "similar": 0.4},
    }[tracker]
    assert told(tracker, world, **narrow).ids == [1, 2]
    assert told(tracker, world, (dark,), **narrow).ids == [1]


# Noise, what is ignored, the ground -------------------------------------------------------------------------

TREES = Zone("noise", "trees", rectangle(40, 0, 80, 80))


@boxes_alone
def test_in_noise_what_lives_shortly_is_nobody(tracker: str):
    leaf, person = World((Block(still(50, 30, 3, 20)),)), World((Block(still(50, 30, 3)),))
    assert told(tracker, leaf).ids == [1]
    assert told(tracker, leaf, (TREES,)).ids == []
    assert told(tracker, person, (TREES,)).tracks.equals(told(tracker, person).tracks)


@from_pixels
def test_from_pixels_what_lives_shortly_in_noise_is_nobody(tracker: str):
    leaf = World((Block(still(50, 30, 3, 20)),))
    assert told(tracker, leaf).ids == [1]
    assert told(tracker, leaf, (TREES,)).ids == []


@every
def test_what_is_seen_in_what_is_ignored_does_not_count(tracker: str):
    screen = Zone("ignore", "screen", rectangle(0, 0, 60, 80))
    world = World((Block(still(20, 30, 2)), Block(still(80, 30, 2), colour=(40, 60, 220))), count=30)
    alone = World(world.blocks[1:], count=30)
    said = told(tracker, world, (screen,))
    assert said.ids == [1]
    assert {one for some in said.tracks.links for one in some} == {1}, "regions are counted as they were given"
    assert np.array_equal(said.tracks.boxes, told(tracker, alone).tracks.boxes)


@every
def test_nobody_is_born_who_does_not_stand_on_the_ground(tracker: str):
    street = Zone("ground", "street", rectangle(0, 40, 120, 80))
    bird, person = Block(still(20, 5, 2)), Block(still(80, 50, 2), colour=(40, 60, 220))
    said = told(tracker, World((bird, person), count=30), (street,))
    assert said.ids == [1]
    assert (said.tracks.boxes[:, 0] > 60).all()


# Rules ------------------------------------------------------------------------------------------------------

TUNNEL = tuple(
    Zone("noise", name, rectangle(x, 0, x + 24, 80), evidence=0.0) for name, x in (("A", 0), ("B", 48), ("C", 96))
)


def away(gap: int, x: int) -> World:
    """Somebody goes at 8, and after a gap somebody is at x."""
    return World((Block(still(8, 30, 3, 20)), Block(still(x, 30, 20 + gap))), count=50 + gap)


@boxes_alone
@pytest.mark.parametrize(("gap", "same"), [(15, False), (25, True), (55, True), (70, False)])
def test_who_is_lost_in_a_may_be_found_in_b_in_time(tracker: str, gap: int, same: bool):
    rules = (Rule("A", "B", after=2.0, within=6.0),)
    assert told(tracker, away(gap, 54)).ids == [1, 2]
    said = told(tracker, away(gap, 54), TUNNEL, rules)
    assert said.ids == ([1] if same else [1, 2])
    if same:
        assert said.of("found_again") == [("found_again", 20 + gap, (1,), "B")]


@boxes_alone
def test_who_is_lost_in_a_is_never_found_in_c_even_where_he_should_be(tracker: str):
    rules = (Rule("A", "A", never=True),)
    assert told(tracker, away(4, 8), TUNNEL).ids == [1]
    assert told(tracker, away(4, 8), TUNNEL, rules).ids == [1, 2]


@from_pixels
def test_from_pixels_too_who_is_lost_in_a_is_never_found_in_a(tracker: str):
    rules = (Rule("A", "A", never=True),)
    assert told(tracker, away(4, 8), TUNNEL).ids == [1]
    said = told(tracker, away(4, 8), TUNNEL, rules)
    assert said.ids == [1, 2]
    assert said.of("found_again") == []


@boxes_alone
def test_of_two_who_are_lost_who_went_first_comes_first(tracker: str):
    first, second = still(8, 10, 3, 20), still(8, 50, 3, 26)
    back = tuple(Block(still(54, y, begin)) for y, begin in ((30, 50), (50, 58)))
    world = World((Block(first), Block(second), *back), count=90)
    said = told(tracker, world, TUNNEL, (Rule("A", "B", within=6.0),))
    assert said.ids == [1, 2]
    assert [one[2] for one in said.of("found_again")] == [(1,), (2,)]


# Laws -------------------------------------------------------------------------------------------------------


@every
def test_zones_that_nobody_is_in_change_nothing(tracker: str):
    """An ignored corner, an occluder and noise far away: the same rows and events."""
    corner = rectangle(100, 70, 120, 80)
    idle = tuple(Zone(kind, kind, corner) for kind in ("occlusion", "noise", "ignore", "low-contrast"))
    world = World((Block(walk((5, 30), (2, 0), begin=3)), Block(walk((90, 10), (-2, 0), begin=2))), count=16)
    plain, zoned = told(tracker, world), told(tracker, world, idle)
    assert plain.tracks.equals(zoned.tracks)
    assert plain.events == zoned.events


# With pictures ----------------------------------------------------------------------------------------------


def test_of_two_behind_an_occluder_colours_tell_who_comes_out():
    """Red goes behind the wall, then blue; blue comes out first, after longer than anybody is remembered elsewhere."""

    def path(begin: int, back: int) -> Path:
        return lambda k: (
            None if k < begin else (min(4 + 2 * (k - begin), 60) if k < back else 60 + 2 * (k - back), 30)
        )

    red, blue = Block(path(3, 106)), Block(path(14, 92), colour=(40, 60, 220))
    world = World((red, blue, wall(48, 82)), count=124, zones=(WALL,))
    tracks, events = _with_pictures(world)
    assert np.unique(tracks.ids).tolist() == [1, 2]
    assert [one.ids for one in events if one.kind == "found_again"] == [(2,), (1,)]
    plain, _ = _with_pictures(replace(world, zones=()))
    assert len(np.unique(plain.ids)) == 4


def _with_pictures(world: World) -> tuple[Tracks, list[Event]]:
    steps = list(track(world.seen(), TRACKERS["compound"](), world.scene))
    return settle(step.report for step in steps), [event for step in steps for event in step.report.events]

"""Who crosses a line and who is in a zone, in drawn worlds of which all is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import Block, World, walk

from perdure.errors import ParameterError
from perdure.scene.counting import Counts, Line, count, crossings, visits
from perdure.scene.zones import Zone, rectangle
from perdure.types import Ground, Tracks

DOOR = Line("door", ((60, 80), (60, 0)))  # upwards, so that 'in' is from left to right
ROOM = Zone("ground", "room", rectangle(40, 0, 80, 80))


def turning(k: int) -> tuple[int, int]:
    """Up to the line with the foot at x = 59, and back."""
    return (54 - abs(20 - k) * 2, 20)


def jittering(k: int) -> tuple[int, int]:
    """On the line: the foot at x = 58 and 62 in turn."""
    return (53 + 4 * (k % 2), 40)


def street() -> World:
    """Three go from left to right, two back; one turns at the line, one stands on it."""
    there = [Block(walk((0, 5 * n), (3, 0), begin=n)) for n in range(3)]
    back = [Block(walk((110, 30 + 5 * n), (-3, 0), begin=n)) for n in range(2)]
    return World((*there, *back, Block(turning), Block(jittering)))


def track(xs: list[float], *, frames: list[int] | None = None, ys: float = 40.0, identity: int = 1) -> Tracks:
    """One target whose foot is at x, a row a frame at 10 frames a second."""
    frames = list(range(len(xs))) if frames is None else frames
    return Tracks.of(
        frames=frames,
        times=np.array(frames) / 10,
        ids=[identity] * len(xs),
        boxes=[[x - 5, ys - 20, x + 5, ys] for x in xs],
    )


def ways(tracks: Tracks, line: Line = DOOR, away: float = 5.0) -> list[str]:
    return [one.direction for one in crossings(tracks, [line], away=away)]


def test_three_go_in_two_go_out_and_who_turns_or_stands_on_the_line_is_not_counted():
    counts = count(street().truth(), lines=[DOOR], away=5)
    assert [one.id for one in counts.of_line("door", "in")] == [1, 2, 3]
    assert [one.id for one in counts.of_line("door", "out")] == [4, 5]


def parting(at: int, second: int = 2, width: int = 12, first_ends: int = 40) -> Tracks:
    """Two of `width` side by side go 2 px a frame to the right, the right one beyond x = 60 from frame 18; id 1 is
    both until frame `at`, then the right one until `first_ends`, and id `second` is the left one."""
    rows = []
    for k in range(40):
        x = 12 + 2 * k
        both = (x, 20, x + 24, 40)
        if k < first_ends:
            rows.append((k, 1, both if k < at else (x + width, 20, x + 24, 40)))
        if k >= at:
            rows.append((k, second, (x, 20, x + width, 40)))
    frames, ids, boxes = zip(*rows, strict=True)
    return Tracks.of(frames=frames, times=np.array(frames) / 10, ids=ids, boxes=boxes)


def test_who_parts_from_another_just_beyond_a_line_crossed_it_with_him():
    """The left one's foot, at 18 + 2 k, is at the line in frame 21; they part in frame 25."""
    first, other = crossings(parting(at=25), [DOOR], away=2)
    assert (first.id, first.direction, other.id, other.direction) == (1, "in", 2, "in")
    assert other.time == pytest.approx(2.1, abs=0.15)


@pytest.mark.parametrize(
    "tracks",
    [parting(at=34), parting(at=25, width=4), parting(at=25, first_ends=25)],
    ids=["long beyond the line", "a piece", "the same with another id"],
)
def test_who_did_not_come_with_another_over_the_line_is_not_counted(tracks):
    assert [one.id for one in crossings(tracks, [DOOR], away=2)] == [1]


def test_a_crossing_has_its_place_its_time_between_frames_and_its_speed():
    (first, *_) = count(street().truth(), lines=[DOOR], away=5).of_line("door", "in")
    assert first.time == pytest.approx(55 / 30)  # from x = 5 at 30 px/s
    assert first.frame == 19  # at 62; at 59 in frame 18
    assert (first.x, first.y) == pytest.approx((60, 16))
    assert first.speed == pytest.approx(30)
    assert first.ground_speed is None


def test_who_jitters_on_the_line_and_then_goes_on_crossed_it_once():
    xs = [30, 45, 58, 61, 59, 62, 58, 63, 59, 62, 80, 90]
    (one,) = crossings(track(xs), [DOOR], away=5)
    assert (one.direction, one.frame) == ("in", 9)  # the last of its crossings


def test_who_jitters_on_the_line_and_goes_back_did_not_cross():
    assert ways(track([30, 58, 61, 59, 62, 58, 40])) == []


def test_a_line_is_crossed_again_when_one_comes_back_from_away():
    assert ways(track([40, 70, 40, 70])) == ["in", "out", "in"]


def test_a_crossing_that_has_not_got_away_is_none_yet():
    assert ways(track([40, 55, 63])) == []
    assert ways(track([40, 55, 63]), away=3) == ["in"]


def test_who_is_lost_on_one_side_and_found_on_the_other_crossed_once():
    (one,) = crossings(track([20, 30, 90, 100], frames=[0, 1, 13, 14]), [DOOR], away=5)
    assert (one.frame, one.direction) == (7, "in")
    assert one.time == pytest.approx(0.7)


def test_a_direction_turns_with_its_line():
    assert ways(track([40, 80]), Line("door", DOOR.points[::-1])) == ["out"]


def test_who_passes_the_end_of_a_line_does_not_cross_it():
    assert ways(track([40, 80], ys=70), Line("short", ((60, 60), (60, 0)))) == []


@pytest.mark.parametrize("height", [20.0, 40.0, 60.0])
def test_who_passes_a_corner_of_a_bent_line_crosses_once(height: float):
    bent = Line("bent", ((60, 80), (60, 40), (60, 40), (70, 20), (60, 0)))
    assert ways(track([40, 50, 75, 90], ys=height), bent) == ["in"]
    assert ways(track([90, 75, 50, 40], ys=height), bent) == ["out"]


@given(
    xs=st.lists(st.integers(0, 12), min_size=4, max_size=4),
    path=st.lists(st.tuples(st.integers(0, 12), st.integers(1, 11)), min_size=2, max_size=8),
)
@settings(max_examples=150, deadline=None)
def test_crossings_add_up_to_the_change_of_side_also_through_corners(xs: list[int], path: list[tuple[int, int]]):
    bent = tuple((x, 12 - 4 * n) for n, x in enumerate(xs))  # upwards, over the whole height

    def is_right(x: int, y: int) -> bool:
        n = min((12 - y) // 4, 2)
        (x1, y1), (x2, y2) = bent[n], bent[n + 1]
        return (x2 - x1) * (y - y1) - (y2 - y1) * (x - x1) >= 0

    rows = Tracks.of(frames=range(len(path)), times=0.0, ids=1, boxes=[[x, y, x, y] for x, y in path])
    rows = rows.replace(times=rows.frames / 10, ids=np.ones(len(path)))
    said = ways(rows, Line("bent", bent), away=0)
    assert said.count("in") - said.count("out") == is_right(*path[-1]) - is_right(*path[0])


def test_who_stops_with_the_foot_exactly_on_the_line_crosses_once_or_not_at_all():
    assert ways(track([40, 60, 60, 80])) == ["in"]
    assert ways(track([40, 60, 60, 40])) == []
    assert ways(track([80, 60, 60, 40])) == ["out"]
    assert ways(track([80, 60, 60, 80])) == []


def test_the_centre_may_be_counted_by_instead_of_the_foot():
    level = Line("level", ((0, 35), (120, 35)))
    falls = Tracks.of(frames=[0, 1], times=[0, 1], ids=[1, 1], boxes=[[50, 20, 60, 40], [50, 30, 60, 50]])
    assert crossings(falls, [level], away=0) == []
    assert [one.direction for one in crossings(falls, [level], away=0, point="centre")] == ["in"]
    with pytest.raises(ParameterError, match="there are: centre, foot"):
        count(falls, lines=[level], point="feet")


def room(tracks: Tracks, away: float = 5.0, frames: int = 40) -> Counts:
    return count(tracks, zones=[ROOM], away=away, frames=range(frames), times=np.arange(frames) / 10)


def test_dwell_and_occupancy_are_exact():
    walkers = World(tuple(Block(walk((15, 5 * n), (4, 0), begin=5 * n)) for n in range(2))).truth()
    counts = room(walkers)
    assert [(one.id, one.enter, one.leave) for one in counts.visits] == [
        (1, pytest.approx(0.5), pytest.approx(1.5)),  # x = 20 + 40 t
        (2, pytest.approx(1.0), pytest.approx(2.0)),
    ]
    assert all(one.entered and one.left and one.speed == pytest.approx(40) for one in counts.visits)
    assert counts.occupancy["room"].tolist() == [0] * 5 + [1] * 5 + [2] * 6 + [1] * 5 + [0] * 19


def test_who_is_there_from_first_to_last_neither_entered_nor_left():
    (one,) = room(track([60.0] * 11)).visits
    assert (one.entered, one.left, one.seconds) == (False, False, 1.0)


def test_who_jitters_on_the_edge_of_a_zone_enters_it_once():
    (one,) = room(track([20, 38, 41, 39, 42, 38, 42, 60, 60, 82, 78, 82, 100])).visits
    assert one.enter == pytest.approx(0.55)
    assert one.leave == pytest.approx(1.05)
    assert room(track([20, 38, 41, 39, 42, 38, 20])).visits == ()


def test_who_is_lost_in_a_zone_and_found_there_was_there():
    counts = room(track([20, 60, 60, 100], frames=[0, 1, 21, 22]))
    (one,) = counts.visits
    assert one.seconds == pytest.approx(2.1)
    assert counts.occupancy["room"].sum() == 21


def test_who_goes_through_a_zone_between_two_frames_was_there():
    (one,) = visits(track([20, 100]), [ROOM], away=5)
    assert one.seconds == pytest.approx(0.05)


def test_a_narrow_zone_is_entered_though_nobody_gets_deep_into_it():
    narrow = Zone("ground", "kerb", rectangle(58, 0, 62, 80))
    assert len(visits(track([20, 40, 60, 80]), [narrow], away=5)) == 1


def test_speeds_are_metres_a_second_where_the_ground_is_known():
    tracks = track([40, 50, 58, 66, 80]).replace(
        ground=[None, *(Ground(0, 0, speed) for speed in (1, 2, 3)), None]
    )
    counts = count(tracks, lines=[DOOR], zones=[ROOM], away=5)
    assert counts.crossings[0].ground_speed == 2
    assert counts.visits[0].ground_speed == 2


def test_a_target_is_counted_with_the_class_that_most_of_its_rows_have():
    car = track([40, 50, 70, 80]).replace(classes=["car", "bus", "car", "car"])
    counts = count(Tracks.join([car, track([40, 80], identity=2)]), lines=[DOOR], zones=[ROOM], away=5)
    assert [one.label for one in counts.of_classes(["car"]).crossings] == ["car"]
    assert [one.id for one in counts.of_classes(["car"]).visits] == [1]
    assert counts.of_classes(["bus"]).crossings == ()


def test_nobody_is_counted_where_nobody_is():
    counts = count(Tracks.empty(), lines=[DOOR], zones=[ROOM], away=5)
    assert (counts.crossings, counts.visits) == ((), ())
    assert counts.occupancy["room"].tolist() == []


def test_a_mistake_is_named():
    with pytest.raises(ParameterError, match="line 'spot' has no length"):
        Line("spot", ((3, 3), (3, 3)))
    with pytest.raises(ParameterError, match="two lines have one name, 'door'"):
        count(Tracks.empty(), lines=[DOOR, DOOR])
    with pytest.raises(ParameterError, match="away = -1 is out of range"):
        count(Tracks.empty(), away=-1)

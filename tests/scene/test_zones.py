"""What zones answer, on places drawn in the test; a picture of 100x60 pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure import states
from perdure.errors import ParameterError
from perdure.scene.zones import EXPECTED, FORBIDDEN, OPEN, Rule, Zone, Zones, rectangle
from perdure.types import Scene


def place(*zones: Zone, rules: tuple[Rule, ...] = ()) -> Zones:
    return Zones(zones, rules, (60, 100))


def boxes(*some: tuple[float, float, float, float]) -> np.ndarray:
    return np.array(some, np.float32).reshape(-1, 4)


LEFT = Zone("entry", "left", rectangle(0, 0, 20, 60))
POST = Zone("occlusion", "post", rectangle(45, 0, 55, 60))


def test_a_point_is_in_a_zone_or_on_its_edge():
    holding = place(LEFT, POST).holding(np.array([[0, 0], [20, 60], [20.5, 30], [50, 30]]))
    assert holding.tolist() == [[True, False], [True, False], [False, False], [False, True]]


def test_a_hole_is_no_part_of_a_zone():
    ring = ((0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0))
    hole = ((10.0, 10.0), (30.0, 10.0), (30.0, 30.0), (10.0, 30.0))
    zones = place(Zone("noise", "frame", ((ring, hole),)))
    assert zones.holding(np.array([[5, 5], [20, 20]])).tolist() == [[True], [False]]
    assert zones.shares(boxes((0, 0, 40, 40)))[0, 0] == pytest.approx(0.75)


def test_the_share_of_a_box_is_that_of_its_part_in_the_picture():
    """|#####|          half of the box is outside of the picture, the other half in the zone"""
    assert place(LEFT).shares(boxes((-10, 10, 10, 30), (10, 10, 30, 30), (60, 0, 70, 9))).tolist() == [
        [1],
        [0.5],
        [0],
    ]
    assert place(LEFT).shares(boxes((5, 5, 5, 9))).tolist() == [[0]], "a box without area"


@given(st.lists(st.integers(0, 99), min_size=4, max_size=4), st.lists(st.integers(0, 59), min_size=4, max_size=4))
def test_shares_are_those_of_the_pixels(across: list[int], down: list[int]):
    x, y = sorted(across), sorted(down)
    zone = Zone("noise", "it", rectangle(x[0], y[0], x[2] + 1, y[2] + 1))
    box = (x[1], y[1], x[3] + 1, y[3] + 1)
    inside = np.zeros((60, 100), bool)
    inside[y[0] : y[2] + 1, x[0] : x[2] + 1] = True
    crop = inside[box[1] : box[3], box[0] : box[2]]
    assert place(zone).shares(boxes(box))[0, 0] == pytest.approx(crop.mean())


def test_a_box_is_in_a_zone_by_its_foot_or_by_half_of_it():
    floor = Zone("noise", "floor", rectangle(0, 40, 100, 60))
    foot, half, none = (10, 0, 20, 41), (10, 35, 20, 62), (10, 0, 20, 39)
    assert place(floor).within(boxes(foot, half, none))[:, 0].tolist() == [True, True, False]


def test_without_a_zone_nothing_is_changed():
    nothing, some = Zones(size=(60, 100)), boxes((10, 10, 20, 30), (50, 10, 60, 30))
    none = np.full(2, -1)
    assert not nothing
    assert nothing.counted(some).all()
    assert not nothing.evidence(some).any()
    assert (nothing.behind(some, some) == -1).all()
    assert (nothing.reach(some) == 1).all()
    assert nothing.kept(some, none, np.array([2.0, 6.0]), np.zeros(2, bool)).tolist() == [2.0, 6.0]
    assert (nothing.left(some) == -1).all()
    assert (nothing.verdicts(some, none, some, np.ones((2, 2))) == OPEN).all()
    assert nothing.held(some, none) is some


def test_newcomers_outside_all_entries_and_in_noise_must_be_seen_for_longer():
    trees = Zone("noise", "trees", rectangle(80, 0, 100, 60), evidence=3.0)
    at_door, inside, in_trees = (5, 10, 15, 30), (40, 10, 50, 30), (85, 10, 95, 30)
    assert place(LEFT, trees).evidence(boxes(at_door, inside, in_trees)).tolist() == [0, 1, 3]
    assert place(trees).evidence(boxes(at_door, inside, in_trees)).tolist() == [0, 0, 3]


def test_nobody_comes_in_above_the_ground():
    street = Zone("ground", "street", rectangle(0, 30, 100, 60))
    wait = place(street).evidence(boxes((10, 10, 20, 40), (10, 0, 20, 20), (10, 40, 20, 70)))
    assert wait.tolist() == [0, np.inf, 0], "who is cut by the border stands below it"


def test_regions_that_lie_half_in_what_is_ignored_do_not_count():
    screen = Zone("ignore", "screen", rectangle(0, 0, 50, 60))
    assert place(screen).counted(boxes((40, 0, 60, 20), (41, 0, 61, 20))).tolist() == [False, True]


def test_what_is_ignored_twice_is_not_twice_as_much():
    twice = [Zone("ignore", name, rectangle(0, 0, 50, 60)) for name in "ab"]
    beside = [Zone("ignore", name, rectangle(x, 0, x + 10, 60)) for name, x in (("a", 40), ("b", 50))]
    assert place(*twice).counted(boxes((44, 0, 64, 20))).tolist() == [True]
    assert place(*beside).counted(boxes((44, 0, 64, 20))).tolist() == [False]


def test_who_is_lost_at_an_occluder_or_goes_into_it_is_behind_it():
    before, far, going = (30, 10, 44, 40), (10, 10, 20, 40), (40, 10, 50, 40)
    behind = place(LEFT, POST).behind(boxes(before, far, going), boxes(going, far, going))
    assert behind.tolist() == [1, -1, 1]


def test_who_is_behind_an_occluder_is_held_there():
    moved = place(POST).held(boxes((80, 10, 90, 40), (80, 10, 90, 40)), np.array([0, -1]))
    assert moved.tolist() == [[50, 10, 60, 40], [80, 10, 90, 40]]


def test_how_long_the_lost_are_kept():
    dark = Zone("low-contrast", "dark", rectangle(60, 0, 80, 60), longer=3.0)
    out = Zone("exit", "out", rectangle(0, 0, 20, 60), patience=0.5, longer=2.0)
    rows = boxes((5, 10, 15, 30), (30, 10, 40, 30), (65, 10, 75, 30), (46, 10, 54, 30), (30, 10, 40, 30))
    behind, leaving = np.array([-1, -1, -1, 0, -1]), np.array([False] * 4 + [True])
    kept = place(POST, out, dark).kept(rows, behind, np.full(5, 2.0), leaving)
    assert kept.tolist() == [0.5, 4.0, 6.0, 10.0, 2.0], "exit, elsewhere, dark, behind, over the border"
    short = place(replace(POST, patience=1.0), out, dark).kept(rows, behind, np.full(5, 2.0), leaving)
    assert short[3] == 2.0, "an occluder never shortens"
    rule = Rule("out", "post", within=20)
    assert place(POST, out, rules=(rule,)).kept(rows[:1], behind[:1], np.full(1, 2.0), leaving[:1]).tolist() == [
        20.0
    ]


def test_rules_say_who_may_be_found_where_and_when():
    a, b, c = (
        Zone("noise", name, rectangle(x, 0, x + 20, 60), evidence=0)
        for name, x in (("A", 0), ("B", 40), ("C", 80))
    )
    zones = place(a, b, c, rules=(Rule("A", "B", 2, 5), Rule("A", "C", never=True)))
    lost, found = boxes((5, 10, 15, 30)), boxes((45, 10, 55, 30), (85, 10, 95, 30), (25, 10, 35, 30))
    for gap, said in ((1, FORBIDDEN), (2, EXPECTED), (5, EXPECTED), (5.1, FORBIDDEN)):
        assert zones.verdicts(lost, np.array([-1]), found, np.full((1, 3), gap)).tolist() == [
            [said, FORBIDDEN, OPEN]
        ]
    assert (zones.verdicts(found[1:2], np.array([-1]), found, np.full((1, 3), 1)) == OPEN).all(), "C has no rule"


def test_of_two_rules_the_first_decides():
    a, b = (Zone("noise", name, rectangle(x, 0, x + 20, 60)) for name, x in (("A", 0), ("B", 40)))
    both = (Rule("A", "B", 0, 9), Rule("A", "*", never=True))
    lost, found, gap = boxes((5, 10, 15, 30)), boxes((45, 10, 55, 30), (65, 10, 75, 30)), np.ones((1, 2))
    none = np.array([-1])
    assert place(a, b, rules=both).verdicts(lost, none, found, gap).tolist() == [[EXPECTED, FORBIDDEN]]
    assert place(a, b, rules=both[::-1]).verdicts(lost, none, found, gap).tolist() == [[FORBIDDEN, FORBIDDEN]]


def test_who_is_behind_an_occluder_is_expected_at_its_edge_for_as_long_as_it_says():
    found = boxes((57, 10, 67, 40), (80, 10, 90, 40))
    for gap, said in ((9.0, EXPECTED), (11.0, OPEN)):
        verdicts = place(POST).verdicts(boxes((35, 10, 47, 40)), np.array([0]), found, np.full((1, 2), gap))
        assert verdicts.tolist() == [[said, OPEN]]


@pytest.mark.parametrize(
    ("kind", "settings", "named"),
    [
        ("entrance", {}, "'entrance' is not a kind of zone; did you mean 'entry'"),
        ("exit", {"patience": -1.0}, "patience = -1.0 must be a number from 0 to 3600"),
        ("exit", {"patience": True}, "patience = True must be a number"),
        (
            "noise",
            {"distance": 2.0},
            "distance belongs to the kinds low-contrast; a zone of kind noise may set evidence",
        ),
        ("ground", {"patience": 2.0}, "a zone of kind ground may set nothing"),
    ],
)
def test_a_kind_or_setting_that_cannot_be_is_refused(kind: str, settings: dict[str, float], named: str):
    with pytest.raises(ParameterError) as caught:
        Zone(kind, "it", rectangle(0, 0, 9, 9), **settings)
    assert named in str(caught.value)


def test_zones_are_data_that_is_saved_with_a_state():
    zones = place(LEFT, POST, rules=(Rule("left", "*", never=True),))
    assert zones.holding(np.array([[1, 1]])).any()  # the geometry is made now, and is not saved
    assert states.load(states.save(zones), Zones) == zones
    assert Zones.of(Scene(100, 60, zones=zones.zones, rules=zones.rules)) == zones

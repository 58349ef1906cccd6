"""Scenarios, a drawn film each, with exactly the events that it shows; and what they give back to the tracker."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import Block, World, walk

from perdure.features.boxes import overlaps
from perdure.files.scenarios import usual_rules
from perdure.fold import Corrections, coherent, settle
from perdure.interpret import Feedback, Interpreter, over_run
from perdure.scene.advice import Advice
from perdure.scene.counting import Line
from perdure.scene.scenarios import Bounds, Recognition, Rules, Scenario
from perdure.scene.scenarios.lasting import Hold
from perdure.scene.zones import Zone, rectangle
from perdure.states import load, save
from perdure.trackers import TRACKERS
from perdure.types import Regions, Report, Tracks

RED, BLUE, GREEN = (200, 40, 40), (40, 60, 220), (40, 190, 60)
OWN = {one.name: one for one in usual_rules().scenarios}


def reports(
    world: World, rules: Rules, kind: str = "overlap", feedback: Feedback | None = None, seen=None
) -> list[Report]:
    """What a tracker and an interpreter say of a world, with the feedback from one to the other."""
    tracker, interpreter = TRACKERS[kind](), Interpreter.of(world.scene, rules, feedback)
    state, views, told = tracker.start(world.scene), interpreter.start(), []
    for frame, regions in seen or world.seen():
        state, report = tracker.step(state, frame, regions)
        views, report, advice = interpreter.step(views, frame.index, frame.time, report)
        state = tracker.heed(state, advice)
        told.append(report)
    return [*told, interpreter.finish(views, tracker.finish(state))]


def events(world: World, *scenarios: Scenario, **options) -> list[tuple]:
    """Events of these scenarios (kind, begin, end, ids, zone), settled, in the order of their beginnings."""
    lines = options.pop("lines", ())
    told = reports(world, Rules(scenarios, lines=lines), **options)
    corrections = Corrections.of(told)
    settled = [corrections.event(one, k) for k, report in enumerate(told) for one in report.events]
    names = {one.name for one in scenarios}
    kept = coherent(settled, set(settle(told).ids.tolist()))
    return [(one.kind, one.begin, one.end, one.ids, one.zone) for one in kept if one.kind in names]


def there_and_still(begin: int, end: int, start=(5, 30), step=(2, 0)):
    """One who walks, stands from frame `begin` up to `end`, and walks on."""

    def path(k: int):
        moved = k if k < begin else begin if k < end else k - (end - begin)
        return start[0] + step[0] * moved, start[1] + step[1] * moved

    return path


def test_one_comes_into_a_zone_and_goes_out_of_it():
    gate = Zone("low-contrast", "gate", rectangle(50, 0, 90, 80))
    world = World((Block(walk((5, 30), (2, 0))),), count=55, zones=(gate,))
    assert events(world, OWN["enters"], OWN["leaves"]) == [
        ("enters", 20, 20, (1,), "gate"),  # its foot is at 5 + 5 + 2 k
        ("leaves", 41, 41, (1,), "gate"),
    ]


def test_who_is_first_seen_in_a_zone_has_not_come_in():
    gate = Zone("low-contrast", "gate", rectangle(0, 0, 40, 80))
    world = World((Block(walk((5, 30), (2, 0))),), count=40, zones=(gate,))
    assert events(world, OWN["enters"], OWN["leaves"]) == [("leaves", 16, 16, (1,), "gate")]


def test_one_stays_in_a_zone_for_as_long_as_it_is_there():
    yard = Zone("low-contrast", "yard", rectangle(30, 0, 70, 80))
    world = World((Block(there_and_still(20, 60)),), count=100, zones=(yard,))
    assert events(world, OWN["stays"]) == [("stays", 10, 70, (1,), "yard")]


def test_one_loiters_who_goes_to_and_fro():
    def path(k: int):
        return 40 + round(12 * np.sin(k / 8)), 30

    world = World((Block(path),), count=300)
    assert [(one[0], one[2:]) for one in events(world, OWN["loiters"])] == [("loiters", (299, (1,), ""))]
    passing = World((Block(walk((5, 30), (1, 0))),), count=300, width=400)
    assert events(passing, OWN["loiters"]) == []


def test_one_runs_while_she_is_fast():
    def path(k: int):
        return (5 + k, 30) if k < 30 else (35 + 4 * (k - 30), 30) if k < 50 else (115 + k - 50, 30)

    found = events(World((Block(path),), count=80, width=200), OWN["runs"])
    assert [one[0] for one in found] == ["runs"]
    assert abs(found[0][1] - 32) <= 1, (
        "4 px a frame are 2.5 heights a second; the speed is that of the last half second"
    )
    assert abs(found[0][2] - 53) <= 1


def test_one_stops_who_has_walked():
    found = events(World((Block(there_and_still(30, 60)),), count=100, width=200), OWN["walks"], OWN["stops"])
    assert [one[0] for one in found] == ["stops"], "and walking is not told"
    assert abs(found[0][1] - 35) <= 1
    assert abs(found[0][2] - 61) <= 1
    standing = World((Block(walk((30, 30), (0, 0))),), count=60)
    assert events(standing, OWN["walks"], OWN["stops"]) == [], "who never walked has not stopped"


def coming_together(part: int = 10**6) -> World:
    def path(start: int, step: int):
        def at(k: int):
            moved = min(k, 20) - max(0, k - part)
            return start + step * moved, 30

        return at

    return World(
        (Block(path(10, 2)), Block(path(102, -2), colour=BLUE)), count=80, width=130
    )  # at 50 and 62 from frame 20 on


def test_two_meet_and_part():
    found = events(coming_together(part=50), OWN["meets"], OWN["parts"])
    assert [(one[0], one[3]) for one in found] == [("meets", (1, 2)), ("parts", (1, 2))]
    meets, parts = found
    assert meets[1] == 20, "12 px are 0.75 heights"
    assert meets[2] == parts[1] - 1
    assert parts[1:3] == (54, 54), "26 px and more are 1.6 heights"


def test_two_who_pass_each_other_have_not_met():
    world = World(
        (Block(walk((5, 20), (3, 0))), Block(walk((125, 40), (-3, 0)), colour=BLUE)), count=42, width=140
    )
    assert events(world, OWN["meets"], OWN["parts"]) == []


def test_one_crosses_a_line_once_though_he_wavers_on_it():
    def path(k: int):
        return 5 + 2 * min(k, 20) + (k % 2 if 20 <= k < 40 else 0) + 2 * max(0, k - 40), 30

    line = Line("kerb", ((50.5, 80), (50.5, 0)))
    world = World((Block(path),), count=60)
    found = events(world, OWN["crosses"], lines=(line,))
    assert len(found) == 1
    assert found[0][0] == "crosses"
    assert found[0][3:] == ((1,), "kerb")
    only_out = Scenario("crosses", on="crosses", line=("kerb",), direction="out")
    assert events(world, only_out, lines=(line,)) == []


def left_behind(taken: int = 10**6, count: int = 110) -> World:
    """One comes with a bag, leaves it at x = 60, goes on; later another takes it along."""

    def bag(k: int):
        if k < 25:
            return None
        return (60, 40) if k < taken else (60 - 2 * (k - taken), 40)

    def other(k: int):
        if k < taken - 30:
            return None
        return 60 + 2 * abs(k - taken) + 4 if k <= taken else 64 - 2 * (k - taken), 28

    blocks = [
        Block(walk((0, 28), (2, 0), end=75), size=(12, 20)),
        Block(bag, size=(6, 6), colour=GREEN),
    ]
    if taken < 10**6:
        blocks.append(Block(other, size=(12, 20), colour=BLUE))
    return World(tuple(blocks), count=count, width=160)


def boxes_of(world: World):
    """The frames with a box for every block that is there: what a detector of things and people sees."""
    return [
        (frame, Regions.of([world._box(one, frame.index) for one in world.blocks if one.path(frame.index)] or np.zeros((0, 4))))
        for frame in world.frames()
    ]  # fmt: skip


def test_a_thing_is_left_behind():
    world = left_behind()
    found = events(world, OWN["leaves_behind"], seen=boxes_of(world))
    assert [(one[0], one[1], one[3]) for one in found] == [("leaves_behind", 25, (1, 2))]
    assert 55 <= found[0][2] <= 57, "3 s after it was first seen, when he is far away"


def test_a_thing_is_taken_away():
    world = left_behind(taken=80, count=110)
    found = events(world, OWN["takes_away"], seen=boxes_of(world))
    assert [(one[0], one[3]) for one in found] == [("takes_away", (3, 2))]
    assert found[0][1:3] == (81, 84)


def test_who_walks_away_herself_was_not_taken():
    world = World(
        (Block(there_and_still(0, 50, start=(40, 30))), Block(walk((10, 34), (1, 0)), size=(14, 22), colour=BLUE)),
        count=80,
    )
    assert events(world, OWN["takes_away"], seen=boxes_of(world)) == []


def test_who_is_hidden_while_two_are_together_is_still_with_the_other():
    def path(k: int):
        return None if 35 <= k < 45 else (10 + 2 * min(k, 20), 30)

    world = World((Block(path), Block(walk((62, 30), (0, 0)), colour=BLUE)), count=80, width=130)
    assert events(world, OWN["meets"], seen=boxes_of(world)) == [("meets", 20, 79, (1, 2), "")]


def test_two_pairs_that_turn_out_to_be_one_have_met_once():
    old = Hold("meets", 1, 2, "", 5, 0.5, 30, 3.0, True, False, 1.0)
    new = Hold("meets", 2, 3, "", 12, 1.2, 30, 3.0, True, False, 1.0)
    own = Hold("meets", 1, 3, "", 20, 2.0, 30, 3.0, True, False, 1.0)
    after = Recognition(holds=(own, new, old)).renamed({3: 1})
    assert [(one.id, one.other, one.begin) for one in after.holds] == [(1, 2, 5)]


def test_a_scenario_may_come_after_another():
    """He stops, and runs within two seconds; who runs without having stopped is not told of."""

    def path(k: int):
        return (5 + 2 * min(k, 20) + 4 * max(0, k - 40), 20)

    bolts = Scenario("bolts", pace=Bounds(above=1.5), lasts=0.5, after="stops", within=2.0)
    runner = Block(walk((5, 50), (4, 0)), colour=BLUE)
    world = World((Block(path), runner), count=60, width=300)
    found = events(world, OWN["walks"], OWN["stops"], bolts)
    assert [(one[0], one[3]) for one in found if one[0] == "bolts"] == [("bolts", (1,))]


def test_several_in_a_zone_are_one_event():
    yard = Zone("low-contrast", "yard", rectangle(40, 0, 80, 80))
    blocks = (
        Block(walk((5, 10), (2, 0))),
        Block(walk((5, 34), (2, 0)), colour=BLUE),
        Block(walk((5, 58), (2, 0), begin=30)),
    )
    crowd = Scenario("crowd", zone=("yard",), count=Bounds(above=1.5), lasts=1.0)
    world = World(blocks, count=60, zones=(yard,))
    assert events(world, crowd) == [("crowd", 15, 35, (), "yard")]


def test_every_event_of_a_run_is_the_same_over_the_finished_run():
    world = coming_together(part=50)
    rules = Rules((OWN["meets"], OWN["parts"], OWN["walks"], OWN["stops"]))
    live = reports(world, rules)
    names = {one.name for one in rules.scenarios}
    told = sorted(
        (one for report in live for one in report.events if one.kind in names), key=lambda one: one.begin
    )
    frames = list(range(world.count))
    after = over_run(Interpreter.of(world.scene, rules), settle(live), frames, [k / world.fps for k in frames])
    assert [(one.kind, one.ids) for one in after.events] == [(one.kind, one.ids) for one in told]
    assert all(abs(one.begin - other.begin) <= 3 for one, other in zip(after.events, told, strict=True))
    assert after.beliefs[1].best == "person"


# Feedback -----------------------------------------------------------------------------------------------------------


def noisy() -> World:
    """Two who walk by; leaves that tremble in one place; specks that flicker."""
    rng = np.random.default_rng(3)
    sizes = rng.integers(5, 14, 200)

    def leaf(size: int, k0: int):
        return lambda k: (20, 5) if k >= k0 and sizes[k] == size else None

    leaves = tuple(Block(leaf(size, 5), size=(size, size), colour=GREEN) for size in range(5, 14))
    specks = tuple(
        Block(walk((70 + 3 * n, 60), (0, 0), begin=7 * n, end=7 * n + 5), size=(5, 5), colour=GREEN)
        for n in range(1, 8)
    )
    people = (Block(walk((5, 30), (2, 0), begin=3)), Block(walk((110, 42), (-2, 0), begin=20), colour=BLUE))
    return World((*leaves, *specks, *people), count=75)


SLOW = [pytest.param(one, marks=pytest.mark.slow) if one in ("contour", "trackcut") else one for one in TRACKERS]


@pytest.mark.parametrize("kind", SLOW)
def test_leaves_and_flicker_are_taken_back_and_nobody_is_lost(kind: str):
    world = noisy()
    found = {}
    for name, feedback in (("without", Feedback(drop_noise=False)), ("with", Feedback())):
        told = reports(world, Rules(), kind, feedback)
        found[name] = settle(told).counted()
    people = world.truth()
    people = people.take(people.ids > len(world.blocks) - 2)
    for name in found:
        assert _recall(people, found[name]) >= 0.8, name
    assert _recall(people, found["with"]) >= _recall(people, found["without"]) - 0.01
    assert _recall(found["with"], people) > _recall(found["without"], people) + 0.05, "precision"


def _recall(rows: Tracks, others: Tracks) -> float:
    """The share of rows on which one of the others lies."""
    hits = 0
    for k in np.unique(rows.frames):
        one, other = rows.in_frame(int(k)), others.in_frame(int(k))
        hits += int((overlaps(one.boxes, other.boxes).max(axis=1, initial=0) > 0.4).sum()) if len(other) else 0
    return hits / max(len(rows), 1)


def test_noise_is_told_of_in_the_events_with_the_reason():
    told = reports(noisy(), Rules())
    noise = [one for report in told for one in report.events if one.kind == "noise"]
    assert noise
    assert all(one.ids == () and one.why.startswith("id ") for one in noise)
    dropped = {one.id for report in told for one in report.dropped}
    assert len(dropped) == len(noise)


def test_who_only_seemed_noise_gets_her_rows_back():
    """She trembles in one place for three seconds, then walks off: one id, from the first frame on."""

    def path(size: int):
        def at(k: int):
            if (9 + k * 7 % 5 if k < 40 else 9) != size:
                return None
            return (20, 30) if k < 40 else (20 + 2 * (k - 40), 30)

        return at

    world = World(tuple(Block(path(size), size=(size, 16 + size)) for size in range(9, 14)), count=90, width=160)
    told = reports(world, Rules())
    kinds = [one.kind for report in told for one in report.events]
    assert "noise" in kinds
    assert "believed" in kinds
    rows = settle(told)
    assert set(rows.ids.tolist()) == {1}
    assert rows.frames.min() <= 2
    assert len(rows) >= 85


@pytest.mark.parametrize("kind", ["overlap", "compound", "multifeature"])
def test_who_does_something_of_interest_is_kept_for_longer_when_lost(kind: str):
    def path(k: int):
        return None if 40 <= k < 62 else (30 + (k // 10) % 2, 30)

    waits = Scenario("waits", pace=Bounds(below=0.5), lasts=1.0, interesting=True)
    world = World((Block(path),), count=90)
    options = {
        "overlap": {},
        "compound": {"patience": 1.0, "recall": 1.0},
        "multifeature": {"window": 1.0, "recall": 1.0},
    }[kind]
    tracker = TRACKERS[kind](**options)
    found = {}
    for protect in (1.0, 4.0):
        interpreter = Interpreter.of(world.scene, Rules((waits,)), Feedback(protect=protect))
        state, views, lost = tracker.start(world.scene), interpreter.start(), []
        for frame, regions in world.seen():
            state, report = tracker.step(state, frame, regions)
            views, report, advice = interpreter.step(views, frame.index, frame.time, report)
            state = tracker.heed(state, advice)
            lost += [frame.index for one in report.events if one.kind in ("left", "lost")]
        found[protect] = lost
    assert found[1.0]
    assert found[1.0][0] < 62
    assert not [one for one in found[4.0] if one < 62]


def test_interpretation_resumed_from_a_saved_state_goes_on_as_it_would_have():
    world, interpreter = noisy(), Interpreter.of(noisy().scene, usual_rules())
    tracker = TRACKERS["overlap"]()
    state, views, whole = tracker.start(world.scene), interpreter.start(), []
    for frame, regions in world.seen():
        state, report = tracker.step(state, frame, regions)
        kept = save(views)
        views, said, advice = interpreter.step(views, frame.index, frame.time, report)
        state = tracker.heed(state, advice)
        whole.append((kept, report, said))
    views = load(whole[40][0], type(views))
    for index, (kept, report, said) in enumerate(whole[40:], 40):
        assert save(views) == kept
        views, again, _ = interpreter.step(views, index, index / world.fps, report)
        assert again.equals(said)


@pytest.mark.parametrize("kind", TRACKERS)
def test_every_tracker_lets_go_at_once_of_who_is_taken_for_noise(kind: str):
    world = World((Block(lambda k: None if 12 <= k < 18 else (30 + k, 30)),), count=22)
    tracker = TRACKERS[kind]()
    state, gone = tracker.start(world.scene), []
    for frame, regions in world.seen():
        state, report = tracker.step(state, frame, regions)
        state = tracker.heed(state, Advice(np.array([1]), np.array([0.0])))
        gone += [frame.index for one in report.events if one.kind in ("left", "lost") and one.ids == (1,)]
    assert gone == [12]

"""Beliefs: fuzzy sets over what is known of a target's life."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.errors import ParameterError
from perdure.scene.advice import Advice
from perdure.scene.beliefs import MEASURES, NOISE, USUAL, Kind, Trapezoid, beliefs, measured
from perdure.scene.lives import noted, passed, renamed
from perdure.types import Ground, Renamed, Status, Tracks

FPS = 10.0
WALKER = {
    "ratio": 2.5,
    "size": 0.2,
    "reach": 5.0,
    "restless": 0.05,
    "presence": 1.0,
    "straightness": 0.9,
    "pace": 0.7,
}


def row(frame: int, one: int = 1, x: float = 50.0, y: float = 60.0, size=(10, 20), **columns) -> Tracks:
    """A row whose foot is at x, y."""
    box = [[x - size[0] / 2, y - size[1], x + size[0] / 2, y]]
    return Tracks.of(frames=frame, times=frame / FPS, ids=[one], boxes=box, **columns)


def life(rows: list[Tracks], gone: bool = False):
    lives = {}
    for one in rows:
        lives = passed(noted(lives, one), (), float(one.times[0]))
    if gone:
        lives = passed(lives, [1], float(rows[-1].times[0]) + 1 / FPS)
    return lives[1]


def test_a_trapezoid_rises_and_falls_and_is_never_outside_0_to_1():
    steep = Trapezoid(1, 1, 2, 2)
    assert [steep(value) for value in (0.9, 1, 1.5, 2, 2.1)] == [0, 1, 1, 1, 0]
    assert Trapezoid(-math.inf, -math.inf, 1, 3)(-1e9) == 1
    assert Trapezoid(0, 2, math.inf, math.inf)(1) == 0.5
    with pytest.raises(ParameterError, match="in order"):
        Trapezoid(2, 1, 3, 4)


@given(st.lists(st.floats(-10, 10), min_size=4, max_size=4), st.floats(-20, 20))
def test_belonging_is_a_share(corners: list[float], value: float):
    assert 0 <= Trapezoid(*sorted(corners))(value) <= 1


@given(st.dictionaries(st.sampled_from(sorted(MEASURES)), st.floats(0, 50)))
def test_what_is_noise_for_sure_is_nothing_else(measures: dict[str, float]):
    found = beliefs(measures, USUAL)
    assert all(0 <= one <= 1 for one in found.of.values())
    assert found.coefficient <= 1 - found.of[NOISE] + 1e-12


def test_a_walker_is_a_person_a_car_a_vehicle_and_a_dog_an_animal():
    metres = {"person": (1.75, 0.6, 1.4), "vehicle": (1.5, 4.2, 12.0), "animal": (0.5, 0.9, 2.0)}
    for name, (height, width, speed) in metres.items():
        seen = WALKER | {"height": height, "width": width, "speed": speed, "ratio": height / width}
        assert beliefs(seen, USUAL).best == name


def test_of_what_the_detector_says_a_share_is_believed_at_least():
    unclear = {"ratio": 1.2}
    assert beliefs(unclear, USUAL, {"dog": 1.0}).best == "animal"
    both = beliefs(WALKER, USUAL, {"person": 0.5, "car": 0.5})
    assert both.of["vehicle"] >= 0.5
    assert beliefs(WALKER, USUAL, {"umbrella": 1.0}).of == beliefs(WALKER, USUAL).of, (
        "a label of no class says nothing"
    )


def test_metres_that_are_not_known_say_nothing_and_other_unknowns_speak_against_a_look():
    look = Kind(({"height": Trapezoid(1, 1, 2, 2), "ratio": Trapezoid(1, 1, 3, 3)},))
    assert beliefs({"ratio": 2.0}, {"one": look}).of == {"one": 1.0}
    assert beliefs({"height": 1.5}, {"one": look}).of == {"one": 0.0}
    assert beliefs({}, {"one": Kind(({"height": Trapezoid(1, 1, 2, 2)},))}).of == {"one": 0.0}


def test_a_straight_walk_is_measured():
    walk = life([row(k, x=20 + 3 * k) for k in range(41)])
    found = measured(walk, (100, 200))
    assert found["ratio"] == pytest.approx(2.0)
    assert found["size"] == pytest.approx(0.2)
    assert found["pace"] == pytest.approx(30 / 20, rel=0.1)
    assert found["reach"] == pytest.approx(120 / math.sqrt(200), rel=0.01)
    assert found["straightness"] == pytest.approx(1.0, abs=0.05)
    assert found["restless"] == 0
    assert found["presence"] == 1
    assert math.isnan(found["lifetime"])
    assert math.isnan(found["height"])
    assert measured(life([row(k) for k in range(6)], gone=True), (100, 200))["lifetime"] == pytest.approx(0.5)


def test_jitter_is_no_way_and_trembling_is_restless():
    rng = np.random.default_rng(1)
    stands = life([row(k, x=50 + float(rng.normal(0, 0.5))) for k in range(50)])
    assert measured(stands, (100, 200))["way"] == 0
    leaf = life([row(k, size=(10 + 4 * (k % 2), 20)) for k in range(50)])
    assert measured(leaf, (100, 200))["restless"] == pytest.approx(math.log(1.4), rel=0.01)


def test_who_is_seen_every_other_frame_is_half_present():
    rows = [
        row(k, inferred=[bool(k % 2)], status=[int(Status.OCCLUDED if k % 2 else Status.VISIBLE)])
        for k in range(40)
    ]
    assert measured(life(rows), (100, 200))["presence"] == pytest.approx(0.5)


def test_boxes_cut_by_the_border_do_not_tell_the_size():
    rows = [row(k, x=2 + k, size=(10, 20) if k > 10 else (4, 20)) for k in range(30)]
    assert measured(life(rows), (100, 200))["ratio"] == pytest.approx(2.0)


def test_who_is_cut_by_the_border_all_the_time_is_no_noise():
    rows = [row(k, x=4 + 2 * (k % 2), size=(8 + 4 * (k % 2), 20)) for k in range(30)]
    found = measured(life(rows, gone=True), (100, 200))
    assert math.isnan(found["reach"])
    assert beliefs(found, USUAL).of[NOISE] == 0
    inside = measured(life([row(k, size=(8 + 4 * (k % 2), 20)) for k in range(30)], gone=True), (100, 200))
    assert beliefs(inside, USUAL).of[NOISE] == 1


def test_on_the_ground_speed_is_in_metres_a_second():
    rows = [row(k, x=20 + k, ground=[Ground(0.1 * k, 0.0, 1.0)]) for k in range(20)]
    found = measured(life(rows), (100, 200), heights=[1.7] * 20)
    assert (found["height"], found["speed"]) == (1.7, 1.0)
    assert found["width"] == pytest.approx(0.85)


def test_two_who_exchange_ids_exchange_what_is_known_of_them_since():
    lives = {}
    for k in range(20):
        rows = Tracks.join([row(k, 1, x=20 + k), row(k, 2, x=180 - k, classes=["car"])])
        lives = passed(noted(lives, rows), (), k / FPS)
    swapped = renamed(lives, (Renamed(1, 2, 10, 19), Renamed(2, 1, 10, 19)))
    assert swapped[1].path[:, 2].tolist() == [20 + k if k < 10 else 180 - k for k in range(20)]
    assert swapped[2].votes == (10.0,)
    assert swapped[1].labels == ("car",)
    assert renamed(lives, (Renamed(3, 1, 0, 19),)).keys() == {1, 2}


def test_who_turns_out_to_be_somebody_lost_has_lived_since_she_was_first_seen():
    lives = {}
    for k in range(30):
        one = row(k, 1 if k < 10 else 2, x=20 + k) if not 10 <= k < 15 else Tracks.empty()
        lives = passed(noted(lives, one), (), k / FPS)
    both = renamed(lives, (Renamed(2, 1, 0, 29),))
    assert set(both) == {1}
    assert both[1].first == 0
    assert both[1].age == pytest.approx(2.9)


def test_lives_are_forgotten_after_a_while_and_paths_do_not_grow_without_end():
    lives = {}
    for k in range(1500):
        lives = passed(noted(lives, row(k, 1 if k < 300 else 2)), (), k / FPS)
    assert set(lives) == {2}
    assert len(lives[2].path) <= 601


def test_advice_speaks_of_those_it_names():
    advice = Advice(np.array([7, 3]), np.array([0.0, 4.0]))
    assert advice.of([3, 5, 7, 0]).tolist() == [4.0, 1.0, 0.0, 1.0]
    assert float(advice.of(7)) == 0.0
    assert Advice.none().of([1, 2]).tolist() == [1.0, 1.0]
    assert advice.of(np.zeros(0, np.int64)).shape == (0,)

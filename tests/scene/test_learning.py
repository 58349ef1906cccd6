"""Zones learnt from tracks of drawn worlds."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import Block, World, walk

from perdure.files.zones import zones_of_json, zones_to_json
from perdure.scene.learning import Learnt, Standing, learn_zones
from perdure.scene.zones import Zones, shape_of
from perdure.types import Tracks

SIZE = (80, 120)  # of every world


def learnt(rows: Tracks, span: tuple[float, float], **more: list[Standing]) -> Learnt:
    told = learn_zones(rows, SIZE, span, **more)
    zones = Zones(tuple(one.zone for one in told.proposals), (), SIZE)
    assert zones_of_json(zones_to_json(zones), 120, 80) == zones, "whatever is proposed can be read"
    return told


def of(world: World, **more: list[Standing]) -> Learnt:
    return learnt(world.truth(), (0.0, (world.count - 1) / world.fps), **more)


def told(found: Learnt) -> list[tuple[str, str, int]]:
    return [(one.zone.kind, one.zone.name, one.count) for one in found.proposals]


def bounds(found: Learnt, name: str) -> list[float]:
    (zone,) = [one.zone for one in found.proposals if one.zone.name == name]
    return list(shape_of(zone.polygons).bounds)


def from_left_to_right(people: int = 4) -> World:
    """One after the other comes in at the left and leaves at the right, at the same height."""
    blocks = [Block(walk((0, 30), (2, 0), 10 + 70 * n, 65 + 70 * n)) for n in range(people)]
    return World(tuple(blocks), count=20 + 70 * people)


def behind_a_post(people: int = 4) -> World:
    """The same, but nobody is seen between x = 50 and 70: a post hides all who pass."""
    blocks = []
    for n in range(people):
        path = walk((0, 30), (2, 0), 10 + 70 * n, 65 + 70 * n)
        blocks.append(Block(lambda k, path=path: at if (at := path(k)) and not 41 <= at[0] <= 69 else None))
    return World(tuple(blocks), count=20 + 70 * people)


def test_who_enters_left_and_leaves_right_shows_where():
    found = of(from_left_to_right())
    assert told(found) == [("entry", "entry left", 4), ("exit", "exit right", 4)]
    assert [one.reason for one in found.proposals] == ["4 came in here", "4 went out here"]
    assert bounds(found, "entry left") == [0, 26, 12, 50], "as deep as they are wide, a quarter round them"
    assert bounds(found, "exit right") == [105, 26, 120, 50], "seen last two pixels before the border"
    assert set(found.missing) == {"occlusion", "noise"}


def test_a_post_hides_all_who_pass():
    found = of(behind_a_post())
    assert told(found)[2:] == [("occlusion", "occluder", 4)]
    assert bounds(found, "occluder") == [50, 30, 70, 46]
    assert found.proposals[2].reason == "4 were lost and found again here"


def test_who_comes_out_from_behind_a_post_under_another_id_neither_left_nor_came_in_there():
    rows = behind_a_post().truth()
    other = np.where(rows.boxes[:, 0] >= 70, rows.ids + 100, rows.ids)
    found = learnt(rows.replace(ids=other), (0.0, 29.9))
    assert told(found)[:2] == [("entry", "entry left", 4), ("exit", "exit right", 4)]
    assert told(found)[2:] == [("occlusion", "occluder", 4)]


def test_an_occluder_is_wide_enough_to_hide_somebody():
    """The detector loses them in the middle, and its boxes before and after touch: nothing lies between."""
    world = from_left_to_right()
    rows = world.truth()
    found = learnt(rows.take((rows.boxes[:, 0] <= 50) | (rows.boxes[:, 0] >= 60)), (0.0, 29.9))
    assert told(found)[2:] == [("occlusion", "occluder", 4)]
    x1, _, x2, _ = bounds(found, "occluder")
    assert (x1 + x2) / 2 == pytest.approx(60, abs=1)
    assert x2 - x1 >= 3


def test_who_is_hidden_by_another_shows_no_post():
    rows = behind_a_post().truth()
    friends = [
        (k, 200, (x - 3, 28, x + 13, 48))
        for k in range(300)
        for x in [2 * ((k - 10) % 70)]
        if 10 <= k < 290 and 30 <= x < 85
    ]
    frames = np.array([k for k, _, _ in friends])
    boxes = np.array([box for _, _, box in friends], np.float32)
    with_friends = Tracks.join(
        [rows, Tracks.of(frames=frames, times=frames / 10, ids=200 + frames // 70, boxes=boxes)]
    )
    assert "occlusion" in learnt(with_friends, (0.0, 29.9)).missing


def test_flicker_at_one_place_is_noise():
    leaves = [Block(walk((60, 8), (0, 0), 20 * n, 20 * n + 4), size=(8, 6)) for n in range(1, 6)]
    world = from_left_to_right()
    found = of(World((*world.blocks, *leaves), count=world.count))
    assert told(found)[2:] == [("noise", "flicker", 5)]
    assert bounds(found, "flicker") == [58, 6, 70, 16]


def test_who_comes_out_of_a_house_shows_its_door():
    blocks = [Block(walk((60, 20), (0, 1), 10 + 70 * n, 54 + 70 * n)) for n in range(3)]
    found = of(World(tuple(blocks), count=230))
    assert told(found) == [("entry", "entry door", 3), ("exit", "exit bottom", 3)]
    x1, y1, x2, y2 = bounds(found, "entry door")
    assert x1 < 65 < x2
    assert y1 < 36 < y2, "their feet are in it"


def test_who_stood_there_at_first_or_stays_to_the_end_tells_no_entry_and_no_exit():
    blocks = [Block(walk((0, 4 + 18 * n), (2, 0), 0, 40)) for n in range(4)]
    found = of(World(tuple(blocks), count=40))
    assert found.proposals == ()
    assert found.missing["entry"] == "who came in at one place: 0 at most, needed are 2"


def test_few_tracks_tell_nothing_and_why():
    found = of(from_left_to_right(people=1))
    assert found.proposals == ()
    assert found.missing["exit"] == "tracks that went anywhere: 1, needed are 3"
    assert learnt(Tracks.empty(), (0.0, 0.0)).walks == 0


def test_what_the_background_shows_is_an_occluder_and_its_parts_are_one():
    sign = np.float32([[50, 10], [70, 10], [70, 25], [50, 25]])
    pole = np.float32([[58, 30], [62, 30], [62, 60], [58, 60]])
    far = np.float32([[5, 60], [15, 60], [15, 70], [5, 70]])
    found = of(
        from_left_to_right(),
        standing=[Standing(one, 4.0, 0.9) for one in (sign, pole)] + [Standing(far, 1.0, 0.9)],
    )
    (post,) = [one for one in found.proposals if one.zone.kind == "occlusion"]
    assert (post.count, post.reason) == (4, "about 4 went behind what stands here in the background")
    shape = shape_of(post.zone.polygons)
    assert shape.contains(shape_of(((tuple(map(tuple, sign.tolist())),),)))
    assert shape.bounds == pytest.approx((50, 10, 70, 60), abs=1)
    assert len(shape.exterior.coords) - 1 <= 12


def test_the_order_of_rows_and_the_names_of_ids_do_not_matter():
    rows = behind_a_post().truth()
    shuffled = np.random.default_rng(3).permutation(len(rows))
    other = rows.take(shuffled)
    again = learnt(other.replace(ids=1000 - other.ids), (0.0, 29.9))
    assert again.proposals == learnt(rows, (0.0, 29.9)).proposals

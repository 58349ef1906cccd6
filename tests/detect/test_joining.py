"""Drawn worlds in which something hides the middle of a thing, and others in which two things are near each other."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perdure.detect.joining import joined
from perdure.types import Mask

HEIGHT, WIDTH = 120, 160
SLACK = 3
GROUND, POST = 120.0, 40.0
Box = tuple[int, int, int, int]  # x1, y1, x2, y2


def body(*boxes: Box) -> np.ndarray:
    """A silhouette of rectangles."""
    seen = np.zeros((HEIGHT, WIDTH), np.uint8)
    for x1, y1, x2, y2 in boxes:
        seen[y1:y2, x1:x2] = 255
    return seen


PERSON = body((60, 30, 80, 100), (64, 20, 76, 30))


def ground(*occluders: Box) -> np.ndarray:
    """The model's mean: even ground with a little texture, and what stands before everything."""
    mean = np.random.default_rng(0).normal(GROUND, 4.0, (HEIGHT, WIDTH, 3))
    for x1, y1, x2, y2 in occluders:
        mean[y1:y2, x1:x2] = POST
    return cv2.GaussianBlur(mean, (3, 3), 0).astype(np.float32)


def behind(seen: np.ndarray, *occluders: Box) -> list[Mask]:
    """The pieces of silhouettes that are seen behind occluders, from top to bottom."""
    left = seen.copy()
    for x1, y1, x2, y2 in occluders:
        left[y1:y2, x1:x2] = 0
    count, labels = cv2.connectedComponents(left)
    return [Mask.of_image(labels == label) for label in range(1, count)]


def people(*silhouettes: np.ndarray) -> list[Mask]:
    return [Mask.of_image(one > 0) for one in silhouettes]


def mirrored(masks: list[Mask]) -> list[Mask]:
    return [Mask(mask.y, WIDTH - mask.box[2], mask.bits[:, ::-1].copy()) for mask in masks]


def in_order(masks: list[Mask]) -> list[tuple]:
    return sorted((mask.box, mask.bits.tobytes()) for mask in masks)


# What is one thing --------------------------------------------------------------------------------------


def test_a_person_behind_a_post_is_one_and_the_post_is_no_part_of_her():
    post = (68, 0, 72, HEIGHT)
    pieces = behind(PERSON, post)
    assert len(pieces) == 2
    (one,) = joined(pieces, ground(post), SLACK)
    assert one.box == (60, 20, 80, 100)
    assert one.area == sum(piece.area for piece in pieces)
    assert not one.to_image(HEIGHT, WIDTH)[:, 68:72].any()


def test_a_car_behind_a_leaning_trunk_is_one():
    trunk, car = np.zeros((HEIGHT, WIDTH), np.uint8), body((20, 50, 140, 90), (45, 30, 110, 50))
    cv2.line(trunk, (70, 0), (94, HEIGHT), 255, 9)
    mean = ground()
    mean[trunk > 0] = POST
    count, labels = cv2.connectedComponents(cv2.subtract(car, trunk))
    pieces = [Mask.of_image(labels == label) for label in range(1, count)]
    assert len(pieces) == 2
    assert len(joined(pieces, cv2.GaussianBlur(mean, (3, 3), 0), SLACK)) == 1


def test_a_person_behind_a_bar_is_one_by_her_chest_and_her_legs():
    bar = (0, 50, WIDTH, 62)
    assert len(behind(PERSON, bar)) == 2
    assert [one.box for one in joined(behind(PERSON, bar), ground(bar), SLACK)] == [(60, 20, 80, 100)]


def test_a_person_behind_a_sign_that_hides_half_of_her_is_one():
    sign = (50, 38, 90, 80)
    assert len(joined(behind(PERSON, sign), ground(sign), SLACK)) == 1


def test_a_car_behind_two_posts_is_one():
    posts = [(50, 0, 56, HEIGHT), (95, 0, 101, HEIGHT)]
    pieces = behind(body((20, 50, 140, 90)), *posts)
    assert len(pieces) == 3
    assert len(joined(pieces, ground(*posts), SLACK)) == 1


def test_a_border_that_closing_moved_into_the_post_is_still_at_the_post():
    post = (68, 0, 72, HEIGHT)
    halves = people(body((60, 30, 70, 100)), body((70, 30, 80, 100)))
    assert len(joined(halves, ground(post), SLACK)) == 1


def test_a_foot_and_a_wheel_are_of_the_body_that_they_lie_at():
    foot = body((81, 96, 85, 100))
    assert len(joined(people(PERSON, foot), ground(), SLACK)) == 1
    assert len(joined(people(PERSON, foot), None, SLACK)) == 1


def test_who_enters_by_an_arm_and_a_leg_is_one():
    limbs = people(body((0, 30, 8, 55)), body((0, 68, 12, 100)))
    assert len(joined(limbs, ground(), SLACK)) == 1


def test_a_foot_too_large_for_half_a_person_is_joined_to_the_whole_one():
    post, foot = (68, 0, 72, HEIGHT), body((81, 82, 85, 100))
    halves = behind(PERSON, post)
    assert len(joined([*halves, *people(foot)], ground(), SLACK)) == 3
    assert len(joined([*halves, *people(foot)], ground(post), SLACK)) == 1


# What is not --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [1, 4, 8, 12])
def test_two_people_side_by_side_on_open_ground_are_two(gap):
    other = np.roll(PERSON, 20 + gap, axis=1)
    assert len(joined(people(PERSON, other), ground(), SLACK)) == 2


@pytest.mark.parametrize("away", [6, 8])
def test_two_people_with_a_post_between_them_that_neither_reaches_are_two(away):
    post = (74, 0, 78, HEIGHT)
    pair = people(body((50, 20, 74 - away, 100)), body((78 + away, 20, 102, 100)))
    assert len(joined(pair, ground(post), SLACK)) == 2


def test_two_people_who_touch_a_post_with_an_elbow_are_two():
    one, other = np.zeros((HEIGHT, WIDTH), np.uint8), np.zeros((HEIGHT, WIDTH), np.uint8)
    cv2.fillPoly(one, [np.array([(60, 20), (73, 60), (60, 100)])], 255)
    cv2.fillPoly(other, [np.array([(92, 20), (79, 60), (92, 100)])], 255)
    assert len(joined(people(one, other), ground((74, 0, 78, HEIGHT)), SLACK)) == 2


def test_two_people_on_either_side_of_a_wide_wall_are_two():
    wall = (66, 0, 96, HEIGHT)
    pair = people(body((40, 20, 66, 100)), body((96, 20, 122, 100)))
    assert len(joined(pair, ground(wall), SLACK)) == 2


def test_a_person_over_anothers_head_stays_two():
    far = body((64, 4, 74, 36), (66, 0, 72, 4))
    near = body((60, 52, 80, 118), (64, 42, 76, 52))
    assert len(joined(people(far, near), ground(), SLACK)) == 2


def test_a_person_over_anothers_head_with_a_kerb_between_them_stays_two():
    far = body((66, 4, 72, 36))
    near = body((50, 42, 90, 118))  # a like width is cut by an occluder, not a sixth of one
    assert len(joined(people(far, near), ground((0, 36, WIDTH, 42)), SLACK)) == 2


def test_a_head_that_looks_out_beside_another_is_not_hers():
    head = body((77, 22, 85, 30))
    assert len(joined(people(PERSON, head), ground(), SLACK)) == 2


def test_a_tape_that_flutters_at_the_feet_is_not_hers():
    tape = body((82, 90, 110, 93))
    assert len(joined(people(PERSON, tape), ground(), SLACK)) == 2


def test_two_birds_on_either_side_of_a_post_are_two():
    post = (70, 0, 74, HEIGHT)
    birds = people(body((60, 40, 70, 45)), body((74, 40, 84, 45)))
    assert len(joined(birds, ground(post), SLACK)) == 2


def test_two_cars_that_enter_in_two_lanes_are_two():
    cars = people(body((0, 50, 70, 70)), body((0, 76, 80, 100)))
    assert len(joined(cars, ground(), SLACK)) == 2


def test_two_people_who_stand_beside_each_other_at_the_lower_end_of_the_picture_are_two():
    pair = people(body((40, 100, 60, HEIGHT)), body((64, 100, 84, HEIGHT)))
    assert len(joined(pair, ground(), SLACK)) == 2


def test_without_a_model_no_occluder_is_known():
    post = (68, 0, 72, HEIGHT)
    assert len(joined(behind(PERSON, post), None, SLACK)) == 2


# Laws ---------------------------------------------------------------------------------------------------


def test_nothing_gives_nothing_and_one_piece_is_returned_as_it_is():
    assert joined([], ground(), SLACK) == []
    (one,) = people(PERSON)
    assert joined([one], ground(), SLACK)[0] is one


def test_a_union_stands_where_its_first_piece_stood():
    post = (68, 0, 72, HEIGHT)
    left, right = behind(PERSON, post)
    above, below = people(body((120, 2, 130, 12)), body((120, 80, 130, 110)))
    assert [one.box for one in joined([above, left, below, right], ground(post), SLACK)] == [
        above.box,
        (60, 20, 80, 100),
        below.box,
    ]


rectangles = st.tuples(st.integers(0, 150), st.integers(0, 110), st.integers(3, 40), st.integers(3, 60))
worlds = st.tuples(st.lists(rectangles, min_size=1, max_size=5), st.lists(st.integers(5, 150), max_size=3))


def drawn(world: tuple) -> tuple[list[Mask], np.ndarray]:
    things, places = world
    posts = [(x, 0, x + 6, HEIGHT) for x in places]
    seen = body(*((x, y, min(x + w, WIDTH), min(y + h, HEIGHT)) for x, y, w, h in things))
    return behind(seen, *posts), ground(*posts)


@settings(max_examples=60, deadline=None)
@given(worlds)
def test_a_mirrored_world_gives_the_mirrored_regions(world):
    pieces, mean = drawn(world)
    reflected = joined(mirrored(pieces), mean[:, ::-1], SLACK)
    assert in_order(reflected) == in_order(mirrored(joined(pieces, mean, SLACK)))


@settings(max_examples=60, deadline=None)
@given(worlds)
def test_no_pixel_is_won_or_lost_the_input_is_left_alone_and_the_order_does_not_matter(world):
    pieces, mean = drawn(world)
    before = [(piece.box, piece.bits.copy()) for piece in pieces], mean.copy()
    found = joined(pieces, mean, SLACK)
    count = sum(one.to_image(HEIGHT, WIDTH).astype(int) for one in found) if found else np.zeros(1)
    assert count.max() <= 1
    assert sum(one.area for one in found) == sum(piece.area for piece in pieces)
    assert all(
        p.box == box and np.array_equal(p.bits, bits) for p, (box, bits) in zip(pieces, before[0], strict=True)
    )
    assert np.array_equal(mean, before[1])
    assert in_order(joined(pieces[::-1], mean, SLACK)) == in_order(found)

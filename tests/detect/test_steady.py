"""Where a shaken camera's picture stands against the model, in drawn scenes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from perdure.detect.steady import aligned, blank, moved, shift, steadied
from perdure.types import Mask, Regions

PLAIN = np.ones(3, np.float32)
HEIGHT, WIDTH, MARGIN = 240, 320, 16


def yard(seed: int = 1) -> np.ndarray:
    """Paving slabs of many sizes and greys, softly seen, with a margin all around; float."""
    rng = np.random.default_rng(seed)
    floor = np.full((HEIGHT + 2 * MARGIN, WIDTH + 2 * MARGIN, 3), 110, np.float32)
    for _ in range(250):
        x, y, width, height = (
            int(rng.integers(low, high)) for low, high in ((0, 350), (0, 270), (5, 40), (5, 40))
        )
        floor[y : y + height, x : x + width] = rng.uniform(30, 220, 3)
    return cv2.GaussianBlur(floor, (0, 0), 0.8)


def seen(floor: np.ndarray, dx: float = 0.0, dy: float = 0.0, noise: float = 0.0, seed: int = 2) -> np.ndarray:
    """What a camera sees of a floor when its picture stands (dx, dy) off."""
    displacement = np.array([[1, 0, dx], [0, 1, dy]], np.float32)
    picture = cv2.warpAffine(floor, displacement, floor.shape[1::-1], flags=cv2.INTER_CUBIC)
    picture = picture[MARGIN:-MARGIN, MARGIN:-MARGIN]
    picture = picture + np.random.default_rng(seed).normal(0, noise, picture.shape)
    return np.rint(picture).clip(0, 255).astype(np.uint8)


def model(floor: np.ndarray) -> np.ndarray:
    return floor[MARGIN:-MARGIN, MARGIN:-MARGIN].copy()


@pytest.mark.parametrize("place", [(0.4, -0.3), (-1.0, 0.0), (1.7, 2.2), (-3.6, 0.8), (2.5, -2.5)])
def test_a_push_of_the_camera_is_found_to_a_tenth_of_a_pixel(place):
    assert shift(seen(yard(), *place, noise=3), model(yard()), PLAIN) == pytest.approx(place, abs=0.1)


def test_in_a_larger_picture_a_wider_jump_is_found():
    large = cv2.resize(yard(), None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    assert shift(seen(large, 5.5, -4.5), model(large), PLAIN) == pytest.approx((5.5, -4.5), abs=0.15)


@pytest.mark.parametrize("noise", [0, 2, 8, 20])
def test_a_camera_that_stands_still_is_exactly_still_however_much_it_rustles(noise):
    for seed in range(4):
        assert shift(seen(yard(), noise=noise, seed=seed), model(yard()), PLAIN) == (0, 0)


def test_a_crowd_that_walks_one_way_over_two_fifths_of_the_picture_is_no_push():
    picture = seen(yard())
    for k in range(4):  # all of them go on by two pixels
        picture[:, 80 * k : 80 * k + 32] = seen(yard(9), 2, 0)[:, 80 * k : 80 * k + 32]
    assert shift(picture, model(yard()), PLAIN) == (0, 0)


def test_a_push_is_found_behind_a_crowd_over_two_fifths_of_the_picture():
    picture = seen(yard(), 1.4, -0.6, noise=2)
    picture[:, 150:278] = seen(yard(9), 3, 1)[:, 150:278]
    assert shift(picture, model(yard()), PLAIN) == pytest.approx((1.4, -0.6), abs=0.1)


def test_a_push_is_found_in_a_darker_picture():
    dimmed = np.rint(seen(yard(), -1.2, 0.7) * 0.7).astype(np.uint8)
    assert shift(dimmed, model(yard()), PLAIN / np.float32(0.7)) == pytest.approx((-1.2, 0.7), abs=0.1)


def test_a_tree_that_sways_before_a_still_house_is_no_push():
    picture = seen(yard())
    picture[:, :190] = seen(yard(), 1.5, 0)[:, :190]
    assert shift(picture, model(yard()), PLAIN) == (0, 0)


def test_before_a_blank_wall_nothing_is_claimed():
    wall = np.full((HEIGHT + 2 * MARGIN, WIDTH + 2 * MARGIN, 3), 140, np.float32)
    assert shift(seen(wall, noise=4), model(wall), PLAIN) == (0, 0)


def test_one_who_stood_in_an_empty_room_when_it_was_learnt_does_not_push_the_camera_by_walking():
    room = np.full((HEIGHT + 2 * MARGIN, WIDTH + 2 * MARGIN, 3), 140, np.float32)
    room[80:200, 100:150] = 30
    assert shift(seen(room, 3, 0), model(room), PLAIN) == (0, 0)


def test_along_a_fence_only_the_push_across_its_posts_is_told():
    fence = np.tile(yard()[40], (HEIGHT + 2 * MARGIN, 1, 1))
    dx, dy = shift(seen(fence, 1.3, 2.0, noise=2), model(fence), PLAIN)
    assert dx == pytest.approx(1.3, abs=0.1)
    assert dy == pytest.approx(0, abs=0.1)


def test_of_the_places_where_a_chequered_floor_fits_the_nearest_is_taken():
    tiles = np.indices((HEIGHT + 2 * MARGIN, WIDTH + 2 * MARGIN)).sum(axis=0)
    chequered = np.repeat(110 + 60 * np.sin(tiles * np.pi / 4)[..., None], 3, axis=2).astype(np.float32)
    across = np.repeat(110 + 60 * np.sin(np.arange(WIDTH + 2 * MARGIN) * np.pi / 3)[None, :, None], 3, axis=2)
    chequered = (chequered + across.astype(np.float32)) / 2
    assert shift(seen(chequered, 1, 0), model(chequered), PLAIN) == pytest.approx((1, 0), abs=0.15)


def test_a_picture_too_small_for_edges_is_still():
    tiny = np.zeros((5, 7, 3), np.uint8)
    assert shift(tiny, tiny.astype(np.float32), PLAIN) == (0, 0)


def test_the_same_picture_always_stands_at_the_same_place():
    picture, known = seen(yard(), 1.1, 0.4, noise=5), model(yard())
    assert len({shift(picture, known, PLAIN) for _ in range(5)}) == 1


@pytest.mark.parametrize("place", [(2.0, -3.0), (0.5, 0.25), (-1.3, 2.6)])
def test_a_steadied_picture_lies_on_the_model(place):
    back = steadied(seen(yard(), *place), *place).astype(np.float32)[8:-8, 8:-8]
    off = seen(yard(), *place).astype(np.float32)[8:-8, 8:-8]
    known = model(yard())[8:-8, 8:-8]
    assert np.abs(back - known).mean() < 0.35 * np.abs(off - known).mean()


def test_moved_back_by_whole_pixels_a_picture_repeats_its_border():
    strip = np.arange(12, dtype=np.uint8).reshape(3, 4)
    assert steadied(strip, 1, 0).tolist() == [[1, 2, 3, 3], [5, 6, 7, 7], [9, 10, 11, 11]]
    assert steadied(strip, 0, -2).tolist() == [[0, 1, 2, 3], [0, 1, 2, 3], [0, 1, 2, 3]]
    assert (steadied(strip, 0, 0) == strip).all()


def test_what_a_displaced_picture_did_not_show_is_blank():
    marks = np.ones((4, 5), np.uint8)
    blank(marks, 1.2, -1)
    assert marks.tolist() == [[0] * 5] + [[1, 1, 1, 0, 0]] * 3
    still = np.ones((4, 5), np.uint8)
    blank(still, 0, 0)
    assert still.all()


def test_regions_go_back_to_where_they_stand_in_the_picture_and_are_cut_at_its_border():
    one, other = Mask(2, 3, np.ones((4, 5), bool)), Mask(20, 36, np.ones((3, 4), bool))
    found = Regions.of([one.box, other.box], scores=[0.5, 0.75], masks=[one, other])
    there = moved(found, 1.6, -0.9, 30, 40)
    assert [mask.box for mask in there.masks] == [(5, 1, 10, 5), (38, 19, 40, 22)]
    assert there.boxes.tolist() == [[5, 1, 10, 5], [38, 19, 40, 22]]
    assert there.scores.tolist() == [0.5, 0.75]
    assert moved(found, 9, 0, 30, 40).masks[0].box == (12, 2, 17, 6)
    assert len(moved(found, 9, 0, 30, 40)) == 1, "the other is outside"
    assert moved(found, 0.3, -0.4, 30, 40) is found


def test_shaken_pictures_are_laid_onto_one_another_for_a_first_look():
    places = np.random.default_rng(4).uniform(-2, 2, (7, 2))
    film = np.stack([seen(yard(), *place, noise=2) for place in places])
    before, after = (pictures[:, 8:-8, 8:-8].std(axis=0).mean() for pictures in (film, aligned(film)))
    assert after < 0.4 * before


def test_pictures_of_a_fixed_camera_are_left_as_they_are():
    film = np.stack([seen(yard(), noise=3, seed=seed) for seed in range(5)])
    assert aligned(film) is film

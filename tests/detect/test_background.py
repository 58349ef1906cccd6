"""What the plain background model sees, in drawn rooms."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest
from worlds import Block, World, lone_walker, walk

from perdure.detect.background import Background
from perdure.detect.first_look import exposure, look_over
from perdure.errors import ParameterError
from perdure.types import Frame, Regions, Scene


def regions_of(world: World, detector: Background | None = None, frames=None) -> list[Regions]:
    detector = detector or Background()
    state = detector.start(world.scene)
    found = []
    for frame in frames or world.frames():
        state, regions = detector.step(state, frame)
        found.append(regions)
    return found


def test_a_walker_is_one_region_close_to_where_she_is():
    world = lone_walker()
    for k, regions in enumerate(regions_of(world)):
        there = world.truth().in_frame(k).boxes
        assert len(regions) == len(there)
        assert np.abs(regions.boxes - there).max(initial=0) <= 2


def test_a_clip_that_begins_with_somebody_in_it_leaves_no_ghost_after_a_first_look():
    world = World((Block(walk((5, 30), (2, 0))),))
    detector = Background().prepare(world.frames()[::4])
    for k, regions in enumerate(regions_of(world, detector)):
        assert len(regions) == len(world.truth().in_frame(k))


def test_a_film_that_is_entered_late_leaves_no_ghost_of_who_is_there_then():
    """What stands in the first picture is not what was there in all the time before it."""
    world = World((Block(walk((5, 30), (2, 0))),))
    detector = Background().prepare(world.frames()[::4])
    late = [Frame(frame.index + 300, frame.time + 30.0, frame.image) for frame in world.frames()]
    for k, regions in enumerate(regions_of(world, detector, late)):
        assert len(regions) == len(world.truth().in_frame(k))


def test_live_a_ghost_is_gone_within_a_second_or_two():
    world = World((Block(walk((5, 30), (2, 0))),), count=60)
    counts = [len(regions) for regions in regions_of(world)]
    assert counts[8] == 2, "the ghost and the walker"
    assert counts[25:50] == [1] * 25


def test_what_is_taken_away_heals_and_what_is_left_behind_stays():
    left = Block(lambda k: (20, 30) if k >= 50 else None)
    taken = Block(lambda k: (80, 30) if k < 50 else None)
    found = regions_of(World((left, taken), count=100))
    assert [len(regions) for regions in found[70:]] == [1] * 30
    assert found[-1].boxes[0][0] < 40


def test_live_somebody_who_comes_and_stands_for_a_minute_is_still_seen():
    world = World((Block(lambda k: None if k < 3 else (min(5 + 2 * k, 50), 30)),), count=600)
    assert all(len(regions) == 1 for regions in regions_of(world)[4:])


def test_a_change_of_exposure_is_not_a_region():
    world = lone_walker()
    dimmed = [
        frame if k < 20 else dataclasses.replace(frame, image=(frame.image * 0.6).astype(np.uint8))
        for k, frame in enumerate(world.frames())
    ]
    assert [len(regions) for regions in regions_of(world, frames=dimmed)] == [0] * 3 + [1] * 37


def test_a_slow_change_of_light_is_not_taken_for_noise_by_the_first_look():
    world = lone_walker()
    drifting = [
        dataclasses.replace(frame, image=np.rint(frame.image * (0.6 + 0.02 * k)).astype(np.uint8))
        for k, frame in enumerate(world.frames())
    ]
    detector = Background().prepare(drifting[::2])
    assert np.sqrt(detector.first_look.variance).max() < 5
    for k, regions in enumerate(regions_of(world, detector, drifting)):
        assert len(regions) == len(world.truth().in_frame(k)), k


def test_somebody_who_stays_for_nearly_half_of_the_time_is_neither_ground_nor_noise():
    busy = np.full((25, 48, 48, 3), 90, np.uint8)
    busy[:12, 16:32, 16:32] = 200
    look = look_over(busy)
    assert np.sqrt(look.variance).max() == 0
    assert (look.mean == 90).all()


def test_a_thing_of_the_grounds_colour_keeps_its_middle():
    floor = np.full((60, 80, 3), 120, np.uint8)
    there = floor.copy()
    there[10:50, 30:50] = (200, 40, 40)
    there[20:40, 34:46] = 102  # as dark as a shadow on this floor
    detector = Background()
    state, _ = detector.step(detector.start(Scene(80, 60)), Frame(0, 0.0, floor))
    _, regions = detector.step(state, Frame(1, 0.04, there))
    assert regions.masks[0].area > 0.95 * 20 * 40


def test_exposure_is_one_on_a_still_scene_and_the_factor_otherwise():
    mean = np.full((90, 120, 3), 100.0, np.float32)
    assert exposure(np.full((90, 120, 3), 100, np.uint8), mean).tolist() == [1, 1, 1]
    assert exposure(np.full((90, 120, 3), 50, np.uint8), mean) == pytest.approx([2, 2, 2])


def test_noise_alone_is_not_a_region():
    rng = np.random.default_rng(3)
    room = [Frame(k, k / 10, rng.normal(100, 4, (80, 120, 3)).clip(0, 255).astype(np.uint8)) for k in range(40)]
    assert not any(len(regions) for regions in regions_of(lone_walker(), frames=room))


def test_somebody_who_stands_for_ten_seconds_is_still_seen():
    world = World((Block(lambda k: None if k < 3 else (min(5 + 2 * k, 50), 30)),), count=130)
    assert all(len(regions) == 1 for regions in regions_of(world)[4:])


def test_a_frame_without_a_picture_is_refused_with_what_to_do():
    detector = Background()
    with pytest.raises(ParameterError, match="--detector"):
        detector.step(detector.start(Scene(64, 48)), Frame(0, 0.0))


def test_few_frames_say_nothing_about_the_whole():
    detector = Background()
    assert detector.prepare(lone_walker().frames()[:2]) is detector


def test_a_shaking_camera_makes_no_region_and_hides_nobody():
    rng = np.random.default_rng(8)
    wall = cv2.GaussianBlur(rng.normal(0, 120, (260, 340, 3)).astype(np.float32), (0, 0), 2) + 110
    frames = []
    for k in range(60):
        image = wall.copy()
        if k >= 10:
            image[100:180, 40 + 3 * k : 80 + 3 * k] = (200, 40, 40)
        dx, dy = 3 * np.sin(1.3 * k), 2 * np.sin(0.9 * k + 1)
        image = cv2.warpAffine(image, np.float32([[1, 0, dx], [0, 1, dy]]), (340, 260))[10:250, 10:330]
        noisy = image + rng.normal(0, 1.5, image.shape)
        frames.append(Frame(k, k / 10, np.ascontiguousarray(noisy.clip(0, 255).astype(np.uint8))))
    world = World((), width=320, height=240)
    detector = Background().prepare(frames[::3])
    for frame, regions in zip(frames, regions_of(world, detector, frames), strict=True):
        assert len(regions) == (frame.index >= 10), frame.index
    still = [len(regions) for regions in regions_of(world, Background(steady=False), frames)]
    assert max(still) > 1

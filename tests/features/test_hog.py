"""HOG points on drawn people: blocks of texture that walk over a textured floor."""

from __future__ import annotations

import dataclasses
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perdure import states
from perdure.features import hog, points
from perdure.features.hog import ROOM, HogPoints
from perdure.features.pool import POOL
from perdure.types import Frame, Mask, Regions, Scene

SIZE = (90, 180)  # height, width
SCENE = Scene(SIZE[1], SIZE[0], 10.0)
PERSON = (56, 30)


@dataclasses.dataclass(frozen=True)
class _Kept:
    memory: dict[str, NDArray[Any]]


def texture(seed: int, shape: tuple[int, int]) -> np.ndarray:
    """Blots of all sizes: FAST finds corners there, and no two places look alike."""
    noise = np.random.default_rng(seed).normal(size=shape).astype(np.float32)
    blots = cv2.GaussianBlur(noise, (0, 0), 1.5)
    return np.clip(125 + 55 * blots / blots.std(), 0, 255).astype(np.uint8)


def film(count: int, left: int = 10, right: int = 140, pace: int = 3, empty: int = 0):
    """Two who walk towards each other, 0 in front of 1, after some frames without them."""
    floor = texture(9, SIZE)
    looks = [texture(1, PERSON), texture(2, PERSON)]
    for k in range(count + empty):
        picture, boxes = floor.copy(), []
        step = k - empty
        if step >= 0:
            for number, x, y in ((1, right - pace * step, 20), (0, left + pace * step, 24)):
                picture[y : y + PERSON[0], x : x + PERSON[1]] = looks[number]
                boxes.insert(0, (x, y, x + PERSON[1], y + PERSON[0]))
        yield Frame(k, k / 10, np.repeat(picture[:, :, None], 3, axis=2)), np.array(boxes, float).reshape(-1, 4)


def described(frames, feature=None, unseen=()):
    feature = HogPoints() if feature is None else feature
    memory, rows = feature.start(SCENE), []
    for frame, boxes in frames:
        regions = Regions.of(boxes if frame.index not in unseen else np.zeros((0, 4)))
        memory, row = feature.describe(memory, frame, regions)
        rows.append(row)
    return memory, rows


def alike(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Similarities (N, M) of every row to every other."""
    left, right = np.repeat(one, len(other), axis=0), np.tile(other, (len(one), 1, 1))
    return HogPoints().similarity(left, right, np.full(len(left), 0.1)).reshape(len(one), len(other))


def test_points_go_on_with_the_person_whose_they_are():
    _, rows = described(film(8))
    for gap in (1, 3):
        said = alike(rows[-1 - gap], rows[-1])
        assert np.diag(said).min() > 0.4
        assert said[0, 1] == said[1, 0] == 0


def test_points_go_on_where_no_box_is_seen_for_some_frames():
    _, rows = described(film(10), unseen=(6, 7))
    assert not len(rows[6])
    assert np.diag(alike(rows[5], rows[8])).min() > 0.3


def test_a_point_seen_less_than_three_times_scores_half():
    _, rows = described(film(4))
    for before in (0, 1):
        assert set(np.unique(rows[before][:, :-1, 1])) <= {0, 0.5}
    assert (rows[3][:, :-1, 1] > 0.9).any()


def test_a_row_tells_its_points_the_longest_followed_first():
    memory, rows = described(film(6))
    lengths = dict(zip(memory["numbers"].tolist(), memory["lengths"].tolist(), strict=True))
    for row in rows[-1]:
        numbers = [int(one) for one in row[:-1, 0] if one]
        assert row[-1, 0] == len(numbers) <= ROOM
        assert len(set(numbers)) == len(numbers)
        told = [lengths[one] for one in numbers]
        assert told == sorted(told, reverse=True)


def test_corners_of_the_floor_do_not_count_where_the_floor_was_seen():
    floor = texture(9, SIZE)
    ground = Frame(0, 0.0, np.repeat(floor[:, :, None], 3, axis=2))
    box = Regions.of([[40, 20, 80, 70]])
    for still, seen in ((8.0, False), (0.0, True)):
        feature = HogPoints(still=still)
        memory, _ = feature.describe(feature.start(SCENE), ground, Regions.empty())
        _, row = feature.describe(memory, Frame(1, 0.1, ground.image), box)
        assert bool(row.any()) == seen


def test_of_two_that_overlap_the_nearer_has_the_points_and_a_mask_tells_better_than_a_box():
    boxes = np.array([[0, 0, 20, 40], [10, 10, 30, 50]], np.float32)
    places = np.array([[5, 5], [15, 20], [25, 45], [40, 5], [15, 5]], np.float32)
    regions = Regions.of(boxes)
    assert hog.owners(regions, boxes, places).tolist() == [0, 1, 1, -1, 0]
    masks = [Mask.empty(), Mask(10, 20, np.ones((40, 10), bool))]
    assert hog.owners(Regions.of(boxes, masks=masks), boxes, places).tolist() == [0, 0, 1, -1, 0]


def test_coherence_is_a_gaussian_over_its_peak_by_hand():
    # distances 2 2 2 2 6: mean 2.8, σ 1.6; direction and likeness never change
    sums = np.array([[14.0, 4 * 4 + 36, 5.0, 0.0, 4.5, 5 * 0.81]])
    said = points.coherence(*(np.float32([one]) for one in (6.0, 0.0, 0.9)), sums, np.array([6]))
    assert said == pytest.approx((np.exp(-(3.2**2) / (2 * 1.6**2)) + 2) / 3, abs=1e-4)


def test_a_direction_is_circular_and_says_nothing_of_a_point_that_stands_still():
    turns = np.float32([np.pi - 0.02, -np.pi + 0.02])
    sums = np.array([[10.0, 50.0, np.cos(turns).sum(), np.sin(turns).sum(), 2.0, 2.0]])
    said = points.coherence(*(np.float32([one]) for one in (5.0, turns[1], 1.0)), sums, np.array([3]))
    assert said > 0.99
    still = points.coherence(
        *(np.float32([one]) for one in (0.0, 3.0, 1.0)), np.array([[0.0, 0, 4, 0.5, 5, 5]]), np.array([6])
    )
    assert still > 0.8


def test_a_descriptor_is_that_of_opencv_at_its_place_and_goes_on_beyond_the_border():
    grey = texture(3, (40, 60))
    found = points.looks(grey, np.array([[20.5, 17.5], [0.5, 0.5]], np.float32))
    patch = cv2.HOGDescriptor((16, 16), (16, 16), (16, 16), (8, 8), 9)
    own = patch.compute(grey, locations=[(12, 9)])
    np.testing.assert_allclose(found[0] / 512, own, atol=0.002)
    assert found[1].any()


def test_a_feature_saved_on_the_way_goes_on_as_if_it_had_not_been():
    whole, _ = described(film(8))
    frames = list(film(8))
    memory, _ = described(frames[:4])
    memory = states.load(states.save(_Kept(memory)), _Kept).memory
    feature = HogPoints()
    for frame, boxes in frames[4:]:
        memory, _ = feature.describe(memory, frame, Regions.of(boxes))
    assert memory.keys() == whole.keys()
    for name, values in whole.items():
        np.testing.assert_array_equal(memory[name], values, err_msg=name)


def test_numbers_of_trajectories_stay_exact_and_begin_anew_after_the_highest():
    feature = HogPoints()
    frames = list(film(3))
    memory = {**feature.start(SCENE), "following": np.array([points.HIGHEST - 1])}
    for frame, boxes in frames:
        memory, rows = feature.describe(memory, frame, Regions.of(boxes))
    assert points.HIGHEST in memory["numbers"]
    assert 1 in memory["numbers"]
    assert 0 not in memory["numbers"]
    assert set(rows[:, :-1, 0].ravel().astype(int)) <= {0, *memory["numbers"].tolist()}


def test_no_boxes_no_picture_and_boxes_of_nothing_are_values():
    feature = POOL["hog"](SCENE)
    (frame, _), *_ = film(1)
    memory = feature.start(SCENE)
    memory, none = feature.describe(memory, frame, Regions.empty())
    assert none.shape == (0, ROOM + 1, 2)
    memory, blind = feature.describe(memory, Frame(1, 0.1), Regions.of([[0, 0, 20, 40]]))
    assert not blind.any()
    flat = Regions.of([[5, 5, 5, 40], [-90, -90, -50, -40], [900, 5, 950, 60]])
    memory, rows = feature.describe(memory, Frame(2, 0.2, frame.image), flat)
    assert not rows.any()
    assert (feature.similarity(rows, rows, np.ones(3)) == 0).all()
    assert feature.similarity(rows[:0], rows[:0], np.ones(0)).shape == (0,)


def test_what_is_remembered_stays_bounded():
    memory, _ = described(film(30, pace=0))
    assert len(memory["numbers"]) <= 4 * hog.CROWD

"""The motion of an object: its similarity, and the camera's share of it."""

import numpy as np
import pytest

from perdure.maths.flow import Flow
from perdure.trackers.trackcut.moving import similarity
from perdure.trackers.trackcut.seeing import Motion
from perdure.trackers.trackcut.windows import Window


def scattered(count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    return rng.uniform(0, 50, count).astype(np.float32), rng.uniform(0, 80, count).astype(np.float32)


@pytest.mark.parametrize("count", [40, 300, 5000])
def test_a_similarity_is_found_though_a_third_moves_otherwise(count):
    x, y = scattered(count)
    across, down = x - x.mean(), y - y.mean()
    flow = np.stack([3 + 0.02 * across - 0.01 * down, -1 + 0.01 * across + 0.02 * down], 1)
    flow[np.arange(count) % 7 < 2] = (-6, 8)
    found, middle = similarity(x, y, flow.astype(np.float32))
    np.testing.assert_allclose(found, [3, -1, 0.02, 0.01], atol=0.15)
    assert middle == pytest.approx((x.mean(), y.mean()))


def test_an_object_neither_turns_nor_grows_more_than_it_may():
    x, y = scattered(100)
    flow = np.stack([0.5 * (x - x.mean()), 0.5 * (y - y.mean())], 1)
    np.testing.assert_allclose(similarity(x, y, flow)[0], [0, 0, 0.05, 0], atol=1e-3)


def test_in_one_place_nothing_turns():
    here = np.full(9, 7, np.float32)
    found, middle = similarity(here, here, np.tile(np.float32([2, -3]), (9, 1)))
    np.testing.assert_allclose(found, [2, -3, 0, 0])
    assert middle == (7, 7)


@pytest.mark.parametrize("step", [1, 2])
def test_the_camera_moves_what_stands_still(step):
    camera = np.array([[1.01, 0.02, 3.0], [-0.02, 1.01, -2.0]])
    motion = Motion(Flow(np.zeros((60, 80, 2), np.float32), np.ones((60, 80), bool)), camera, step)
    places = Window(3, 5, 43, 35, 2).grid()
    half = (step - 1) / 2
    was = (places - motion.of_camera_at(places) - half) / step
    np.testing.assert_allclose((was @ camera[:, :2].T + camera[:, 2]) * step + half, places, atol=1e-3)
    x, y = Window(3, 5, 43, 35, 2).places()
    np.testing.assert_array_equal(motion.of_camera(x, y), motion.of_camera_at(places))

"""The bench of the ground plane counts what it says."""

from __future__ import annotations

import ground as bench
import numpy as np
import pytest

from perdure.types import Rows


def test_the_published_calibration_is_the_camera_that_was_published():
    ground = bench.pets_calibration()
    plane = np.linalg.inv(ground.homography)
    projection = np.c_[plane[:, :2], ground.vertical, plane[:, 2]]
    centre = np.linalg.svd(projection)[2][-1]
    assert centre[:3] / centre[3] == pytest.approx([-28.94, -19.53, 7.066], abs=0.01)
    near = ground.places([[384, 500]])[0]
    person = ground.seen([near, near], [0.0, 1.7])
    assert ground.heights([[person[0, 0] - 9, person[1, 1], person[0, 0] + 9, person[0, 1]]]) == pytest.approx(
        [1.7], abs=0.01
    )


def test_heights_that_are_the_same_everywhere_are_even():
    ground = bench.pets_calibration()
    points = np.stack(np.meshgrid(np.linspace(100, 700, 30), np.linspace(200, 500, 20)), axis=-1).reshape(-1, 2)
    places = ground.places(points)
    foot, head = ground.seen(places), ground.seen(places, 1.7)
    boxes = np.c_[foot[:, 0] - 9, head[:, 1], foot[:, 0] + 9, foot[:, 1]]
    truth = Rows.of(frames=np.arange(len(boxes)) // 20, ids=np.arange(len(boxes)) + 1, boxes=boxes)
    found = bench.evenness(ground, truth)
    assert found["median"] == pytest.approx(1.7, abs=0.01)
    assert found["cell_largest"] < 0.01
    assert bench.distances_against(ground, ground, truth) == pytest.approx([1, 1, 1])

"""The ground estimated from people: drawn cameras as oracles, and verdicts where it cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from perdure.scene.ground import of_camera
from perdure.scene.lens import Lens
from perdure.scene.perspective import FROM_ABOVE, NOT_ENOUGH, UNLIKE, estimate
from perdure.types import Tracks

SIZE = (1280, 720)
DEEP = 0.2  # m that a head is farther away than the nearer foot


def camera(focal, height, tilt, roll):
    return of_camera(Lens(np.array([focal, focal]), np.array([640.0, 360]), np.zeros(5)), height, tilt, roll, SIZE)


def crowd(ground, *, people=30, seed=0, own=0.0, noise=0.0, strangers=0.0, near=5.0, far=60.0, body=1.7, pace=0.4):
    """People who stroll on the ground for 40 s, seen every half second."""
    generator, rows = np.random.default_rng(seed), []
    tall = body * np.exp(own * generator.normal(0, 1, people))
    start = np.stack([generator.uniform(-15, 15, people), generator.uniform(near, far, people)], axis=1)
    walk = generator.normal(0, pace, (people, 2))
    for frame in range(80):
        places = start + walk * frame / 2
        away = places / np.linalg.norm(places, axis=1, keepdims=True)
        foot, head = ground.seen(places), ground.seen(places + DEEP * away, tall)
        pixels = foot[:, 1] - head[:, 1]
        top = head[:, 1] + generator.normal(0, 1, people) * noise * pixels
        strange = generator.random(people) < strangers
        top = np.where(strange, foot[:, 1] - pixels * generator.uniform(0.3, 0.9, people), top)
        boxes = np.c_[foot[:, 0] - pixels / 6, top, foot[:, 0] + pixels / 6, foot[:, 1]]
        alone = np.array([(np.abs(places - one).max(axis=1) < 2.0).sum() == 1 for one in places])
        there = (
            np.isfinite(boxes).all(axis=1)
            & (foot[:, 1] < 760)
            & (foot[:, 1] - top > 8)
            & (places[:, 1] > 2)
            & alone
        )
        ids = np.arange(1, people + 1)
        rows.append(Tracks.of(frames=frame, times=frame / 2, ids=ids[there], boxes=boxes[there]))
    return Tracks.join(rows)


@pytest.mark.parametrize(
    ("focal", "height", "tilt", "roll"),
    [
        (1100, 5.0, 0.2, 0.0),
        (1100, 5.0, 0.2, 0.05),
        (700, 3.0, 0.05, -0.03),
        (2500, 12.0, 0.3, 0.02),
        (900, 8.0, 0.5, 0),
    ],
)
def test_people_of_one_height_give_the_camera_back(focal, height, tilt, roll):
    told = estimate(crowd(camera(focal, height, tilt, roll)), SIZE, focal=focal)
    assert told.verdict == ""
    assert (told.height, told.tilt, told.roll) == pytest.approx((height, tilt, roll), rel=1e-3, abs=1e-4)
    assert told.scatter < 1e-3


@pytest.mark.parametrize("seed", range(4))
def test_real_people_give_it_back_within_the_doubt_that_is_told(seed):
    true = camera(1300, 6.0, 0.25, 0.03)
    told = estimate(crowd(true, seed=seed, own=0.06, noise=0.03), SIZE)
    off = np.array([np.log(told.focal / 1300), told.tilt - 0.25, told.roll - 0.03, np.log(told.height / 6.0)])
    assert (np.abs(off) < 3 * np.sqrt(np.diag(told.covariance))).all()
    rows = crowd(true, seed=seed + 10)
    heights = told.ground.heights(rows.boxes)
    assert np.median(np.abs(heights / 1.7 - 1)) < 0.05
    off = told.ground.places([[640.0, 500]])[0] - true.places([[640.0, 500]])[0]
    assert off @ np.linalg.solve(told.ground.spread([[640.0, 500]])[0], off) < 9


def test_half_hidden_people_do_not_bend_it():
    told = estimate(crowd(camera(1300, 6.0, 0.25, 0.03), own=0.05, noise=0.02, strangers=0.25), SIZE, focal=1300)
    assert told.height == pytest.approx(6.0, rel=0.08)
    assert told.tilt == pytest.approx(0.25, abs=0.02)


def test_the_height_of_things_is_the_scale():
    rows = crowd(camera(1300, 6.0, 0.25, 0.0), body=0.85)
    assert estimate(rows, SIZE, focal=1300, body=0.85).height == pytest.approx(6.0, rel=0.02)


def test_too_few_are_not_enough():
    assert NOT_ENOUGH in estimate(Tracks.empty(), SIZE).verdict
    told = estimate(crowd(camera(1300, 6.0, 0.25, 0.0), people=3), SIZE)
    assert told.ground is None
    assert "5 and 40 are needed" in told.verdict


def test_from_straight_above_there_is_no_scale():
    generator, rows = np.random.default_rng(0), []
    for frame in range(60):
        corner = generator.uniform((10, 10), (1200, 600), (20, 2))
        sides = generator.normal((30, 60), 4, (20, 2))
        boxes = np.c_[corner, corner + sides]
        rows.append(Tracks.of(frames=frame, times=float(frame), ids=np.arange(1, 21), boxes=boxes))
    told = estimate(Tracks.join(rows), SIZE)
    assert told.ground is None
    assert told.verdict.startswith((FROM_ABOVE, UNLIKE))
    assert FROM_ABOVE in told.verdict


def test_things_of_many_sizes_tell_nothing():
    generator = np.random.default_rng(0)
    rows = crowd(camera(1300, 6.0, 0.25, 0.0))
    shrunk = np.exp(-generator.uniform(0, 2, len(rows)))[:, None]
    foot = np.stack([rows.boxes[:, [0, 2]].mean(axis=1), rows.boxes[:, 3]], axis=1)
    boxes = np.tile(foot, 2) + (rows.boxes - np.tile(foot, 2)) * shrunk
    told = estimate(rows.replace(boxes=boxes), SIZE)
    assert told.ground is None
    assert told.verdict.startswith(UNLIKE)


def test_people_all_at_one_distance_tell_nothing():
    told = estimate(
        crowd(camera(1300, 6.0, 0.25, 0.0), own=0.05, noise=0.03, near=20.0, far=20.5, pace=0.01), SIZE
    )
    assert told.ground is None

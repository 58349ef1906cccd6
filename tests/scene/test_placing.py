"""Rows with places and speeds on the ground."""

from __future__ import annotations

import numpy as np
import pytest

from perdure.scene.ground import of_camera
from perdure.scene.lens import Lens
from perdure.scene.placing import Paths, placed
from perdure.types import Status, Tracks

SIZE = (1280, 720)
GROUND = of_camera(Lens(np.array([900.0, 900]), np.array([640.0, 360]), np.zeros(5)), 6.0, 0.4, 0.02, SIZE)


def walk(ids, start, velocity, times):
    """Rows of people who walk on the ground, frame after frame."""
    for frame, time in enumerate(times):
        places = np.array(start, float) + np.array(velocity) * time
        foot, head = GROUND.seen(places), GROUND.seen(places, 1.7)
        boxes = np.c_[foot[:, 0] - 20, head[:, 1], foot[:, 0] + 20, foot[:, 1]]
        yield Tracks.of(frames=frame, times=time, ids=ids, boxes=boxes)


def test_a_walker_has_the_speed_at_which_she_walks_also_away_from_the_camera():
    paths, rows = Paths.none(), Tracks.empty()
    start, velocity = [[-2.0, 10], [3, 20], [0, 15]], [[1.4, 0], [0, -2.0], [0, 0]]
    for frame in walk([7, 8, 9], start, velocity, np.arange(40) / 20):
        paths, rows = placed(GROUND, paths, frame)
        early = frame.times[0] < 0.4 - 1e-9
        assert [place.speed is None for place in rows.ground] == [early] * 3
    assert [place.speed for place in rows.ground] == pytest.approx([1.4, 2.0, 0.0], abs=0.01)
    last = np.array(start) + np.array(velocity) * 39 / 20
    assert np.array([place[:2] for place in rows.ground]) == pytest.approx(last, abs=0.01)


def test_rows_said_late_get_the_speeds_of_their_own_time():
    together = Tracks.join(walk([7], [[-2.0, 10]], [[1.4, 0]], np.arange(20) / 20))
    paths, rows = placed(GROUND, Paths.none(), together)
    assert [place.speed for place in rows.ground[:8]] == [None] * 8
    assert [place.speed for place in rows.ground[8:]] == pytest.approx([1.4] * 12, abs=0.02)
    assert set(paths.of) == {7}


def test_feet_that_are_not_in_the_picture_or_above_the_horizon_have_no_place():
    horizon = -GROUND.horizon[2]
    boxes = [[600, 500, 640, 720], [600, 500, 640, 719], [600, 500, 640, 790], [600, -200, 640, horizon - 90]]
    _, rows = placed(GROUND, Paths.none(), Tracks.of(frames=0, times=0.0, ids=[1, 2, 3, 4], boxes=boxes))
    assert [place is None for place in rows.ground] == [True, True, False, True]


def test_who_is_not_seen_has_a_place_and_no_speed():
    paths = Paths.none()
    for frame in walk([7], [[-2.0, 10]], [[1.4, 0]], np.arange(20) / 20):
        paths, _ = placed(GROUND, paths, frame)
    lost = frame.replace(status=[Status.LOST], times=[1.0])
    after, rows = placed(GROUND, paths, lost)
    assert rows.ground[0].speed is None
    assert rows.ground[0].x == pytest.approx(-2 + 1.4 * 0.95, abs=0.01)
    long_after, _ = placed(GROUND, after, frame.replace(ids=[8], times=[9.0]))
    assert set(long_after.of) == {8}  # nothing is kept for ever


def test_the_speed_of_who_comes_out_again_begins_anew():
    paths, film = Paths.none(), list(walk([7], [[-2.0, 10]], [[1.4, 0]], np.arange(60) / 20))
    for frame in film:
        time = float(frame.times[0])
        if 1.0 <= time < 1.2:  # believed to stand where she went behind something
            frame = frame.replace(status=[Status.OCCLUDED], boxes=film[19].boxes)
        paths, rows = placed(GROUND, paths, frame)
        speed = rows.ground[0].speed
        if time < 0.4 - 1e-9 or 1.0 <= time < 1.6 - 1e-9:
            assert speed is None
        else:
            assert speed == pytest.approx(1.4, abs=0.02)


def test_the_table_has_columns_of_metres_where_any_are_known():
    pytest.importorskip("pandas")
    frame = next(walk([7], [[-2.0, 10]], [[1.4, 0]], [0.0]))
    assert "ground_x" not in frame.to_pandas().columns
    _, rows = placed(GROUND, Paths.none(), frame)
    table = rows.to_pandas()
    assert table["ground_x"].tolist() == pytest.approx([-2.0])
    assert np.isnan(table["ground_speed"]).all()

"""A ground from points with known places or distances."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from perdure.scene.ground import Ground, Unusable, of_camera
from perdure.scene.lens import Lens
from perdure.scene.points import of_distances, of_points

SIZE = (1280, 720)
CORNERS = np.array([[200.0, 400], [1000, 420], [1100, 700], [100, 690]])
PAIRS = list(itertools.combinations(range(4), 2))


def camera() -> Ground:
    straight = Lens(np.array([1000.0, 1000.0]), np.array([640.0, 360.0]), np.zeros(5))
    return of_camera(straight, 5.0, 0.3, 0.05, SIZE)


def lengths(places: np.ndarray) -> np.ndarray:
    return np.array([np.linalg.norm(places[one] - places[other]) for one, other in PAIRS])


@pytest.mark.parametrize("count", [4, 5, 12])
def test_points_give_the_camera_back(count):
    generator, true = np.random.default_rng(count), camera()
    points = np.concatenate([CORNERS, generator.uniform([0, 300], SIZE, (count - 4, 2))])
    found = of_points(points, true.places(points), SIZE)
    asked = generator.uniform([0, 300], SIZE, (20, 2))
    assert found.places(asked) == pytest.approx(true.places(asked), abs=1e-8)
    assert found.horizon == pytest.approx(true.horizon, abs=1e-6)
    boxes = np.array([[500.0, 300, 540, 500]])
    assert found.heights(boxes) == pytest.approx(true.heights(boxes), rel=1e-6)


def test_the_covariance_is_that_of_the_clicks():
    true, generator = camera(), np.random.default_rng(0)
    places, asked = true.places(CORNERS), [[600, 500.0]]
    drawn = [
        of_points(CORNERS + generator.normal(0, 0.5, (4, 2)), places, SIZE).places(asked)[0] for _ in range(800)
    ]
    told = of_points(CORNERS, places, SIZE, noise=0.5).spread(asked, 0.0)[0]
    assert np.cov(np.array(drawn).T) == pytest.approx(told, rel=0.25, abs=1e-5)


def test_distances_alone_give_distances_everywhere():
    true = camera()
    found = of_distances(CORNERS, PAIRS, lengths(true.places(CORNERS)), SIZE)
    asked = np.array([[300.0, 500], [900, 600]])
    between = [float(np.linalg.norm(np.diff(ground.places(asked), axis=0))) for ground in (found, true)]
    assert between[0] == pytest.approx(between[1], rel=1e-6)
    assert not found.mirrored
    assert found.has_heights


def test_five_distances_of_four_points_are_enough():
    true = camera()
    found = of_distances(CORNERS, PAIRS[:5], lengths(true.places(CORNERS))[:5], SIZE)
    assert lengths(found.places(CORNERS)) == pytest.approx(lengths(true.places(CORNERS)), rel=1e-6)


@pytest.mark.parametrize(
    ("points", "places", "words"),
    [
        (CORNERS[:3], [[0, 0], [1, 0], [1, 1]], "needs four"),
        (CORNERS, [[0, 0], [1, 0], [1, 1]], "each needs the other"),
        ([[0, 0], [1, 1], [2, 2], [3, 3]], [[0, 0], [1, 0], [1, 1], [0, 1]], "image points are on one line"),
        (CORNERS, [[0, 0], [1, 0], [2, 0], [3, 0]], "places are on one line"),
        (CORNERS, [[0, 0], [1, 0], [2, 0], [3, 4]], "three are on one line"),
        (CORNERS, [[0, 0], [1, 0], [np.inf, 1], [0, 1]], "not finite"),
        (CORNERS, [[0, 5], [5, 0], [5, 5], [0, 0]], "check their order"),
        (CORNERS, [[0, 0], [5, 0], [5, 5], [0, 5]], "exchange X and Y"),
    ],
)
def test_points_that_fix_no_plane_are_refused_with_the_remedy(points, places, words):
    with pytest.raises(Unusable, match=words):
        of_points(points, places, SIZE)


@pytest.mark.parametrize(
    ("pairs", "distances", "words"),
    [
        (PAIRS[:4], [8.0, 7, 6, 5], "give at least 5, diagonals"),
        (PAIRS, [8.0, 1, 1, 8, 8, 8], "contradict each other"),
        (PAIRS, [8.0, np.nan, 1, 8, 8, 8], "finite"),
        ([*PAIRS[:1] * 4, *PAIRS[1:2]], [8.0, 8, 8, 8, 3], "free to move"),
    ],
)
def test_distances_that_fix_no_plane_are_refused_with_the_remedy(pairs, distances, words):
    with pytest.raises(Unusable, match=words):
        of_distances(CORNERS, pairs, distances, SIZE)

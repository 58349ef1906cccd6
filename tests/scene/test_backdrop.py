"""What is behind everything is known where it was seen, and moves with the camera."""

import numpy as np

from perdure.scene.backdrop import Backdrop, carried, learn

HEIGHT, WIDTH = 40, 60
NOBODY = np.zeros((HEIGHT, WIDTH), np.bool_)


def wall(seed: int, noise: float = 2.0) -> np.ndarray:
    across = np.linspace(60, 180, WIDTH)[None, :, None] + np.zeros((HEIGHT, 1, 3))
    return np.clip(across + np.random.default_rng(seed).normal(0, noise, (HEIGHT, WIDTH, 3)), 0, 255).astype(
        np.uint8
    )


def somebody() -> np.ndarray:
    there = NOBODY.copy()
    there[10:30, 20:35] = True
    return there


def test_what_is_behind_somebody_becomes_known_when_they_leave():
    backdrop = Backdrop.unknown(HEIGHT, WIDTH)
    learn(backdrop, wall(0), somebody())
    assert np.array_equal(backdrop.known, ~somebody())
    learn(backdrop, wall(1), NOBODY)
    assert backdrop.known.all()
    np.testing.assert_allclose(backdrop.colours, wall(0, 0.0), atol=12)


def test_the_mean_of_a_noisy_wall_is_the_wall_and_its_variance_that_of_the_noise():
    backdrop = Backdrop.unknown(HEIGHT, WIDTH)
    for seed in range(80):
        learn(backdrop, wall(seed, 4.0), NOBODY)
    assert abs(backdrop.colours - wall(0, 0.0)).mean() < 1.5
    assert 12 < backdrop.variance.mean() < 20


def test_somebody_nobody_noticed_is_learnt_more_slowly_than_the_wall_behind_them():
    backdrop = Backdrop.unknown(HEIGHT, WIDTH)
    for seed in range(40):
        learn(backdrop, wall(seed), NOBODY)
    seen = wall(41)
    seen[somebody()] = 250
    for _ in range(5):
        learn(backdrop, seen, NOBODY)
    assert (
        abs(backdrop.colours - wall(0, 0.0))[somebody()].mean()
        < 0.12 * abs(seen.astype(float) - wall(0))[somebody()].mean()
    )


def test_a_backdrop_moves_with_the_camera_and_what_comes_in_is_unknown():
    backdrop = Backdrop.unknown(HEIGHT, WIDTH)
    learn(backdrop, wall(0), NOBODY)
    moved = carried(backdrop, np.array([[1.0, 0, 7], [0, 1, 0]]))
    assert not moved.known[:, :7].any()
    assert moved.known[:, 7:].all()
    np.testing.assert_allclose(moved.colours[:, 7:], backdrop.colours[:, :-7])
    assert carried(backdrop, np.eye(2, 3)) is backdrop

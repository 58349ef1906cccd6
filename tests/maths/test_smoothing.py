"""The best gain of exponential smoothing, against the errors of films that were made up."""

import numpy as np
import pytest

from perdure.maths.smoothing import best_gain


def measured(jitter: float, *, wander: float = 1.0, count: int = 20000) -> np.ndarray:
    """Measurements of a place that takes steps of a size `wander`, each off by about `jitter`."""
    rng = np.random.default_rng(5)
    return np.cumsum(rng.normal(0, wander, count)) + rng.normal(0, jitter, count)


def error(places: np.ndarray, gain: float) -> float:
    """Root mean square error of forecasts that smooth with a gain."""
    thought, sum_of_squares = places[0], 0.0
    for place in places[1:]:
        sum_of_squares += (place - thought) ** 2
        thought += gain * (place - thought)
    return float(np.sqrt(sum_of_squares / (len(places) - 1)))


@pytest.mark.parametrize("jitter", [0.3, 1.0, 3.0])
def test_no_other_gain_forecasts_better(jitter):
    places = measured(jitter)
    steps = np.diff(places)  # errors of forecasts that trust every measurement fully
    gain = float(best_gain((steps[1:] * steps[:-1]).mean() / (steps**2).mean()))
    tried = np.linspace(0.05, 1.0, 39)
    best = tried[np.argmin([error(places, one) for one in tried])]
    assert gain == pytest.approx(best, abs=0.05)


def test_without_jitter_measurements_are_trusted_fully():
    np.testing.assert_array_equal(best_gain([0.0, 0.3, 1.0]), 1.0)


def test_more_jitter_less_trust_and_never_none():
    gains = best_gain(np.linspace(0.0, -1.0, 50))
    assert (np.diff(gains) <= 0).all()
    assert gains[-1] > 0.1

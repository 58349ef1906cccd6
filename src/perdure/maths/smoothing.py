"""How far a new measurement is to be trusted: the gain of exponential smoothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

_STRONGEST = 0.49  # correlation; at a half the best gain is 0


def best_gain(correlation: ArrayLike) -> NDArray[np.float64]:
    """Return the best gain for places that wander and are measured with jitter, from the jitter's trace.

    The errors of forecasts that trust every measurement fully are then a moving average of order one, whose lag-1
    correlation is -θ / (1 + θ²); smoothing with the gain 1 - θ leaves errors that know nothing of each other (Muth,
    Optimal properties of exponentially weighted forecasts, 1960).

    Parameters
    ----------
    correlation : array
        Lag-1 correlation of the errors, in [-1, 1]. Down to -1/2 it is jitter; 0 and above there is none.

    Returns
    -------
    array of the same shape
        Gains in (0, 1].
    """
    jitter = np.clip(-np.asarray(correlation, np.float64), 0.0, _STRONGEST)
    return np.asarray(1.0 - 2.0 * jitter / (1.0 + np.sqrt(1.0 - 4.0 * jitter**2)), np.float64)

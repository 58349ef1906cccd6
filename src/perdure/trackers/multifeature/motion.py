"""Where a trajectory leads: a line through the places of its last objects.

The paper compares an object with the last one of the trajectory, wherever that went. Here a feature that says where a
thing is (`moves`) is carried on first: recent objects count most, and little way in little time is taken for jitter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Float
from perdure.trackers.multifeature.targets import Rows, Targets
from perdure.types import Boxes, Regions

Index = NDArray[np.intp]
Wide = NDArray[np.float64]


def expected(targets: Targets, time: float, inertia: float, steady: float, smooth: float = 0.5) -> Rows:
    """Return the rows (N, ...) of features that move, as they are expected at a time in seconds.

    Parameters
    ----------
    targets : Targets
        Trajectories under way, N of them.
    time : float
        In seconds.
    inertia : float
        Time in seconds after which an object counts 1/e.
    steady : float
        Time in seconds within which a speed is not believed: the observed time must be longer to count.
    smooth : float
        How far each starts from its line, in [0, 1], rather than from its last object.
    """
    age = targets.times - targets.seen[:, None]  # (N, Q), ≤ 0
    weight = np.exp(age / max(inertia, 1e-6)) * targets.filled
    weight /= weight.sum(axis=1, keepdims=True)
    middle = (weight * age).sum(axis=1)  # (N,)
    apart = age - middle[:, None]
    spread = (weight * apart**2).sum(axis=1) + steady**2  # (N,) s²
    ahead = time - targets.seen
    found = {}
    for name, places in targets.places.items():
        flat = places.reshape(*places.shape[:2], int(np.prod(places.shape[2:]))).astype(np.float64)  # (N, Q, D)
        mean = np.einsum("nq,nqd->nd", weight, flat)
        rate = np.einsum("nq,nqd->nd", weight * apart, flat - mean[:, None]) / spread[:, None]
        start = flat[:, -1] + smooth * (mean - rate * middle[:, None] - flat[:, -1])
        row = (start + rate * ahead[:, None]).reshape(places[:, -1].shape)
        found[name] = row.astype(np.float32)
    return found


def surprise(targets: Targets, pairs: Index, where: Boxes, regions: Regions) -> Wide:
    """Return how far (N, 2) each target is from where it was expected, in its sizes; NaN where it is not seen for sure."""
    found = np.full((len(targets), 2), np.nan)
    rows, columns = pairs[targets.missed[pairs[:, 0]] == 0].T
    expected, seen = where[rows], regions.boxes[columns]
    size = np.maximum(expected[:, 2:] - expected[:, :2], 1.0)
    found[rows] = (seen[:, :2] + seen[:, 2:] - expected[:, :2] - expected[:, 2:]) / 2 / size
    return found


def boxes_of(places: Float) -> Boxes:
    """Return boxes (N, 4) of centres and sizes (N, 4)."""
    half = np.maximum(places[:, 2:4], 0.0) / 2
    return np.concatenate([places[:, :2] - half, places[:, :2] + half], axis=1)

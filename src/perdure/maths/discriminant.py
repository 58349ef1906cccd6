"""Two kinds told apart by several numbers, from running moments of each: Fisher's discriminant as log odds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]
_MOST = 6.0  # log odds: however far out a number lies, more is not believed
_RIDGE = 1e-4  # added to variances
_LEAST = 1e-12  # variance along the direction


@dataclass(frozen=True, eq=False)
class Moments:
    """What is known of one kind: how often it was seen, and the sums of its numbers and of their products."""

    count: float
    total: Float  # (K,)
    products: Float  # (K, K)

    @staticmethod
    def assumed(mean: ArrayLike, deviation: ArrayLike, correlation: float, count: float) -> Moments:
        """Return what is thought before anything was seen, as if it had been seen `count` times."""
        centre, spread = np.asarray(mean, np.float64), np.asarray(deviation, np.float64)
        together = np.full((len(centre), len(centre)), correlation)
        np.fill_diagonal(together, 1.0)
        products = together * np.outer(spread, spread) + np.outer(centre, centre)
        return Moments(count, count * centre, count * products)

    def seen(self, numbers: Float, memory: float) -> Moments:
        """Return what is known after numbers (N, K) more; what is older counts less by 1/e after `memory` of them."""
        kept = np.exp(-len(numbers) / memory)
        return Moments(
            self.count * kept + len(numbers),
            self.total * kept + numbers.sum(axis=0),
            self.products * kept + numbers.T @ numbers,
        )

    @property
    def mean(self) -> Float:
        """The mean (K,)."""
        return self.total / self.count

    @property
    def covariance(self) -> Float:
        """The covariance (K, K), never singular."""
        spread = self.products / self.count - np.outer(self.mean, self.mean)
        return np.asarray(spread + _RIDGE * np.eye(len(spread)))


def log_odds(one: Moments, other: Moments, numbers: Float) -> Float:
    """Return how much likelier (P,) numbers (P, K) are of the one kind than of the other, in nats; 6 at most.

    They are projected on the direction that parts the two best (Fisher, 1936), and compared there as normal
    densities; beyond the mean of a kind nothing speaks against it.
    """
    direction = np.linalg.solve(one.covariance + other.covariance, one.mean - other.mean)  # (K,)
    place: Float = np.asarray(numbers @ direction, np.float64)
    likely = [
        _log_density(place, kind, np.asarray(direction, np.float64), beyond)
        for kind, beyond in ((one, 1.0), (other, -1.0))
    ]
    return np.clip(likely[0] - likely[1], -_MOST, _MOST)


def _log_density(place: Float, kind: Moments, direction: Float, beyond: float) -> Float:
    middle = float(kind.mean @ direction)
    variance = max(float(direction @ kind.covariance @ direction), _LEAST)  # 0 where the means are one
    off = np.where((place - middle) * beyond > 0, 0.0, place - middle)
    return np.asarray(-0.5 * (off**2 / variance + np.log(variance)), np.float64)

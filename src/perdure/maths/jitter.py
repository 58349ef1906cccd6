"""How much the detector's boxes jitter, learnt from how successive surprises of visible targets go together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.maths.smoothing import best_gain

Float = NDArray[np.float64]
_MEMORY = 2000.0  # pairs of surprises
_BEFORE = 200.0  # pairs that what is thought before counts for
_THOUGHT = -0.08  # correlation before anything was seen
_USUAL = 0.08  # target sizes of a surprise, likewise
_LAG = 0.15  # correlation that comes of motions which are known late
_LEAST = 0.4  # gain
_LARGEST = 0.3  # target sizes of a surprise; above, something else has happened


@dataclass(frozen=True, eq=False)
class Jitter:
    """Sums over pairs of successive surprises, in x and y."""

    together: Float  # (2,) of the product
    alone: Float  # (2,) of the mean square
    pairs: float

    @staticmethod
    def unknown() -> Jitter:
        """Return what is known before anything was seen."""
        return Jitter(np.zeros(2), np.zeros(2), 0.0)

    @property
    def gain(self) -> Float:
        """Share (2,) of the way from where a target was expected to where it is seen, that it is thought to be."""
        seen = np.divide(self.together, self.alone, out=np.zeros(2), where=self.alone > 0)
        correlation = (seen * self.pairs + _THOUGHT * _BEFORE) / (self.pairs + _BEFORE)
        return np.maximum(best_gain(correlation - _LAG), _LEAST)

    @property
    def spread(self) -> float:
        """Root mean square of a surprise, target sizes."""
        return float(np.sqrt((self.alone.sum() + _BEFORE * _USUAL**2) / (self.pairs + _BEFORE)))


def learnt(jitter: Jitter, before: Float, now: Float) -> Jitter:
    """Return what is known after surprises (N, 2), in target sizes, and those (N, 2) of the frame before them.

    NaN where a target was not seen by itself.
    """
    both = np.isfinite(before[:, 0]) & np.isfinite(now[:, 0])
    if not both.any():
        return jitter
    one, other = (np.clip(some[both], -_LARGEST, _LARGEST) for some in (before, now))
    kept = np.exp(-len(one) / _MEMORY)
    return Jitter(
        jitter.together * kept + (one * other).sum(axis=0),
        jitter.alone * kept + (one**2 + other**2).sum(axis=0) / 2,
        jitter.pairs * kept + len(one),
    )

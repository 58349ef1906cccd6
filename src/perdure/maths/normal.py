"""Normal distributions learnt as one goes: of several numbers along a line, forgetting, robust to strangers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]
_FLOOR = 1e-6


@dataclass(frozen=True, eq=False)
class NormalLine:
    """K numbers, each normal about a line in x: number ~ N(a + b x, deviation²)."""

    weight: float  # of all that was observed, forgetting taken off
    x: float  # weighted sums
    xx: float
    y: Float  # (K,)
    xy: Float  # (K,)
    rest: Float  # (K,) weighted squared distances from the line as it was when observed

    @staticmethod
    def unknown(count: int) -> NormalLine:
        """Return the distribution of `count` numbers before anything was observed."""
        none = np.zeros(count)
        return NormalLine(0.0, 0.0, 0.0, none, none, none)


def expect(line: NormalLine, x: ArrayLike, stiffness: float = 0.0) -> tuple[Float, Float]:
    """Return means (N, K) at places x (N,), and standard deviations (K,) ≥ 0; zeros before anything was observed.

    `stiffness` ≥ 0, in squared units of x times weight, holds the line level while x has varied little.
    """
    places = np.asarray(x, np.float64).reshape(-1, 1)
    weight = max(line.weight, _FLOOR)
    centre, level = line.x / weight, line.y / weight  # x and y of the middle
    spread = line.xx - weight * centre**2 + stiffness
    slope = (line.xy - weight * centre * level) / max(spread, _FLOOR)
    return level + slope * (places - centre), np.sqrt(line.rest / weight)


def observe(
    line: NormalLine,
    x: ArrayLike,
    numbers: ArrayLike,
    weights: ArrayLike,
    *,
    keep: float = 1.0,
    stiffness: float = 0.0,
) -> NormalLine:
    """Return the distribution after N observations.

    Parameters
    ----------
    line : NormalLine
        Of K numbers.
    x, numbers : (N,) and (N, K)
        Places and what was found there; finite.
    weights : (N,)
        ≥ 0. One that lies z deviations off counts 1 / (1 + z² / 4) of it (Student's t with few degrees of
        freedom), so that strangers do not bend the line.
    keep : float
        In (0, 1]: what is left of the weight of all before.
    stiffness : float
        As in `expect`.
    """
    places, found = np.asarray(x, np.float64).reshape(-1), np.asarray(numbers, np.float64)
    found = found.reshape(len(places), len(line.y))
    mean, deviation = expect(line, places, stiffness)
    off = (found - mean) ** 2  # (N, K)
    worth = np.asarray(weights, np.float64).reshape(-1)
    if line.weight > _FLOOR and (deviation > 0).all():
        worth = worth / (1 + (off / deviation**2).mean(axis=1) / 4)
    else:
        off = np.zeros_like(off) if line.weight <= _FLOOR else off
    return NormalLine(
        keep * line.weight + float(worth.sum()),
        keep * line.x + float(worth @ places),
        keep * line.xx + float(worth @ places**2),
        keep * line.y + worth @ found,
        keep * line.xy + (worth * places) @ found,
        keep * line.rest + worth @ off,
    )

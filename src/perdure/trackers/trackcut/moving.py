"""How an object has moved: a similarity that most of its flow agrees with (eq. 2, 15)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]
_TURN = 0.05  # rad, or share of the size, by which a shape may turn or grow from frame to frame
_STEPS = 6  # of the robust fit
_FEW = 800  # cells that it looks at, about
_LEAST = 0.3  # px by which flow errs at least


def similarity(x: Float, y: Float, flow: Float) -> tuple[NDArray[np.float64], tuple[float, float]]:
    """Return (dx, dy, growth, turn) that fit motions (N, 2) at places x, y (N,) about their middle, and the middle.

    Least squares, of which what lies far off counts little (Cauchy), as parts of an object move by themselves. In
    complex numbers a similarity is the line start + turn · place, and its fit that of a line.
    """
    step = max(1, len(x) // _FEW)
    middle = (float(x.mean()), float(y.mean()))
    place = (x[::step] - middle[0]) + 1j * (y[::step] - middle[1]).astype(np.float64)  # (n,)
    moved = flow[::step, 0] + 1j * flow[::step, 1].astype(np.float64)
    weight = np.ones(len(place))
    for _ in range(_STEPS):
        share = weight / weight.sum()
        mean_place, mean_moved = share @ place, share @ moved
        across = place - mean_place
        width = share @ _squared(across)
        turn = share @ (across.conj() * (moved - mean_moved)) / width if width > 0 else 0j
        start = mean_moved - turn * mean_place
        off = np.sqrt(_squared(moved - start - turn * place))
        weight = (1 + (off / max(1.5 * float(np.median(off)), _LEAST)) ** 2) ** -2
    growth, turned = np.clip((turn.real, turn.imag), -_TURN, _TURN)
    return np.array([start.real, start.imag, growth, turned]), middle


def _squared(numbers: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.asarray(numbers.real**2 + numbers.imag**2, np.float64)

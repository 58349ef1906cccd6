"""Polygonal paths side by side: a point more, and the motion they lead to; see `perdure.maths.polyline`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for
from perdure.maths.polyline import Polylines, reliable, velocity

Float = NDArray[np.float64]
N, TT, TX, TY, RR = range(5)  # columns of `sums`


@kernel_for(
    changed(np.float64, 3),
    changed(np.float64, 2),
    changed(np.float64, 2),
    given(np.intp),
    float,
    given(np.float64, 2),
    given(np.float64),
    float,
)
def extend(
    knots: Float,
    last: Float,
    sums: Float,
    rows: NDArray[np.intp],
    time: float,
    points: Float,
    tolerance: Float,
    longest: float,
) -> None:
    """Add a point to some paths, in place; a segment that no longer fits ends where it was.

    Parameters
    ----------
    knots, last, sums : (N, K, 3), (N, 3), (N, 5) float64, changed
        As in `polyline.Polylines`.
    rows : (M,) int
        Paths that go on, each once.
    time : float
        Seconds.
    points : (M, 2) float64
        Where they are.
    tolerance : (M,) float64
        Pixels by which a point may lie off its segment.
    longest : float
        Seconds after which a segment ends.
    """
    for place in range(len(rows)):
        row = rows[place]
        begin, x0, y0 = knots[row, -1, 0], knots[row, -1, 1], knots[row, -1, 2]
        across = sums[row, TX] / sums[row, TT] if sums[row, TT] > 0 else 0.0
        down = sums[row, TY] / sums[row, TT] if sums[row, TT] > 0 else 0.0
        x, y = points[place, 0], points[place, 1]
        off = np.hypot(x - x0 - across * (time - begin), y - y0 - down * (time - begin))
        if sums[row, N] > 1 and (off > tolerance[place] or time - begin > longest):
            for knot in range(knots.shape[1] - 1):
                for column in range(3):  # a row at once would take longer to compile than all the rest
                    knots[row, knot, column] = knots[row, knot + 1, column]
            lasted = last[row, 0] - begin
            begin, x0, y0 = last[row, 0], x0 + across * lasted, y0 + down * lasted
            knots[row, -1, 0], knots[row, -1, 1], knots[row, -1, 2] = begin, x0, y0
            for column in range(5):
                sums[row, column] = 0.0
        t, x, y = time - begin, x - x0, y - y0
        sums[row, N] += 1
        sums[row, TT] += t * t
        sums[row, TX] += t * x
        sums[row, TY] += t * y
        sums[row, RR] += x * x + y * y
        last[row, 0], last[row, 1], last[row, 2] = time, points[place, 0], points[place, 1]


def motion(knots: Float, last: Float, sums: Float, tolerance: Float, shortest: float, horizon: float) -> Float:
    """Return motion vectors (N, 2), px/s: of the last segment if it is reliable, else of more of them.

    Parameters
    ----------
    knots, last, sums : (N, K, 3), (N, 3), (N, 5) float64
        As in `polyline.Polylines`.
    tolerance : (N,) float64
        Pixels; a reliable segment fits within half of it.
    shortest, horizon : float
        Seconds that a reliable segment must have lasted, and that an unreliable path looks back.
    """
    vectors = np.zeros((len(last), 2))
    _motion(knots, last, sums, tolerance, shortest, horizon, vectors)
    return vectors


@kernel_for(
    given(np.float64, 3),
    given(np.float64, 2),
    given(np.float64, 2),
    given(np.float64),
    float,
    float,
    changed(np.float64, 2),
)
def _motion(
    knots: Float, last: Float, sums: Float, tolerance: Float, shortest: float, horizon: float, vectors: Float
) -> None:
    for row in range(len(last)):
        tt, number = sums[row, TT], sums[row, N]
        across = sums[row, TX] / tt if tt > 0 else 0.0
        down = sums[row, TY] / tt if tt > 0 else 0.0
        left = sums[row, RR] - across * sums[row, TX] - down * sums[row, TY]
        misfit = np.sqrt(left / number) if number > 0 and left > 0 else 0.0
        lasted = last[row, 0] - knots[row, -1, 0]
        if lasted >= shortest - 1e-9 and number >= 2 and misfit <= tolerance[row] / 2:
            vectors[row, 0], vectors[row, 1] = across, down
            continue
        far = 0
        for knot in range(knots.shape[1]):  # oldest first: the latest of those old enough, the first of equals
            older = last[row, 0] - knots[row, knot, 0]
            if older >= horizon and older < last[row, 0] - knots[row, far, 0]:
                far = knot
        since = last[row, 0] - knots[row, far, 0]
        if since > 0:
            vectors[row, 0] = (last[row, 1] - knots[row, far, 1]) / since
            vectors[row, 1] = (last[row, 2] - knots[row, far, 2]) / since


def extend_twin(
    knots: Float,
    last: Float,
    sums: Float,
    rows: NDArray[np.intp],
    time: float,
    points: Float,
    tolerance: Float,
    longest: float,
) -> None:
    """Do the same with whole columns: the oracle of `extend`."""
    mine = Polylines(knots[rows], last[rows], sums[rows])
    speed, begin = velocity(mine), mine.knots[:, -1]  # (M, 2), (M, 3)
    elapsed = time - begin[:, 0]
    off = np.hypot(*(points - begin[:, 1:] - speed * elapsed[:, None]).T)
    ended = (sums[rows, N] > 1) & ((off > tolerance) | (elapsed > longest))
    over = rows[ended]
    knots[over, :-1] = knots[over, 1:]
    duration = (last[rows, 0] - begin[:, 0])[ended]
    knots[over, -1, 0] = last[over, 0]
    knots[over, -1, 1:] = begin[ended, 1:] + speed[ended] * duration[:, None]
    sums[over] = 0.0
    t = time - knots[rows, -1, 0]
    x, y = (points - knots[rows, -1, 1:]).T
    sums[rows] += np.stack([np.ones(len(rows)), t * t, t * x, t * y, x * x + y * y], axis=1)
    last[rows, 0], last[rows, 1:] = time, points


def motion_twin(
    knots: Float, last: Float, sums: Float, tolerance: Float, shortest: float, horizon: float
) -> Float:
    """Do the same with whole columns: the oracle of `motion`."""
    ages = last[:, :1] - knots[:, :, 0]  # (N, K), oldest first
    far = np.argmin(np.where(ages >= horizon, ages, np.inf), axis=1)
    far = np.where((ages >= horizon).any(axis=1), far, 0)
    rows = np.arange(len(last))
    since = ages[rows, far][:, None]
    moved = last[:, 1:] - knots[rows, far, 1:]
    over = np.divide(moved, since, out=np.zeros((len(last), 2)), where=since > 0)
    lines = Polylines(knots, last, sums)
    return np.asarray(np.where(reliable(lines, tolerance, shortest)[:, None], velocity(lines), over))

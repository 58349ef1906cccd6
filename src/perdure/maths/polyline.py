"""Polygonal approximation of paths: constant speed along each segment, a new segment where that no longer fits.

N paths side by side, a row each. Of every path the last knots and the sums of the segment under way are kept, so
that a path takes the same room however long it is (Brémond & Thonnat, IV.A).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]
KNOTS = 5  # segments' beginnings that are kept
_N, _TT, _TX, _TY, _RR = range(5)  # columns of `sums`, all relative to the newest knot


@dataclass(frozen=True, eq=False)
class Polylines:
    """N paths; a path without a point does not exist."""

    knots: Float  # (N, KNOTS, 3) time, x, y of the segments' beginnings, newest last; the first repeated in front
    last: Float  # (N, 3) time, x, y of the last point
    sums: Float  # (N, 5) of the points after the newest knot: number, Σt², Σtx, Σty, Σ(x² + y²)

    def __len__(self) -> int:
        return len(self.last)

    @staticmethod
    def starting(time: float, points: ArrayLike) -> Polylines:
        """Return a path for every point (N, 2), in pixels, beginning there at a time in seconds."""
        places = np.asarray(points, np.float64).reshape(-1, 2)
        last = np.column_stack([np.full(len(places), time), places])  # (N, 3)
        return Polylines(np.repeat(last[:, None], KNOTS, axis=1), last, np.zeros((len(places), 5)))

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Polylines:
        """Return the paths on the named rows, or on those where a mask (N,) is true."""
        return Polylines(self.knots[rows], self.last[rows], self.sums[rows])

    def join(self, others: Polylines) -> Polylines:
        """Return these paths and the others after them."""
        pairs = [(getattr(self, one.name), getattr(others, one.name)) for one in fields(self)]
        return Polylines(*(np.concatenate(pair) for pair in pairs))


def velocity(lines: Polylines) -> Float:
    """Return the speed (N, 2), px/s, of the last segment: least squares through its beginning; 0 of no point."""
    tt, speed = lines.sums[:, _TT, None], np.zeros((len(lines), 2))
    np.divide(lines.sums[:, _TX : _TY + 1], tt, out=speed, where=tt > 0)
    return speed


def misfit(lines: Polylines) -> Float:
    """Return the root mean square distance (N,) of the last segment's points from its line, px; 0 of no point."""
    number, along = lines.sums[:, _N], (velocity(lines) * lines.sums[:, _TX : _TY + 1]).sum(axis=1)
    left = np.maximum(lines.sums[:, _RR] - along, 0.0)
    return np.asarray(np.sqrt(np.divide(left, number, out=np.zeros(len(lines)), where=number > 0)), np.float64)


def reliable(lines: Polylines, tolerance: ArrayLike, shortest: float) -> NDArray[np.bool_]:
    """Return whether (N,) the last segment lasted `shortest` seconds and fits in half the tolerance (N,), px."""
    lasted = lines.last[:, 0] - lines.knots[:, -1, 0]
    return (lasted >= shortest - 1e-9) & (lines.sums[:, _N] >= 2) & (misfit(lines) <= np.asarray(tolerance) / 2)


def motion(lines: Polylines, tolerance: ArrayLike, shortest: float, horizon: float) -> Float:
    """Return the motion vector (N, 2), px/s, by which a path is extended (IV.A).

    Of the last segment alone where it is reliable, else of as many of the last ones as cover `horizon` seconds.

    Parameters
    ----------
    lines : Polylines
        N paths.
    tolerance : (N,) array
        Pixels; as in `reliable`.
    shortest, horizon : float
        Seconds, ≥ 0. Where the kept segments do not reach back to the horizon, all of them count.
    """
    from perdure.maths.kernels.paths import motion as kernel  # numba: half a second that no import should cost

    limits = np.full(len(lines), tolerance, np.float64)
    return kernel(lines.knots, lines.last, lines.sums, limits, float(shortest), float(horizon))


def extend(
    lines: Polylines, rows: NDArray[np.intp], time: float, points: ArrayLike, tolerance: ArrayLike, longest: float
) -> Polylines:
    """Return the paths with a point more on `rows`; a segment that no longer fits ends where it was.

    Parameters
    ----------
    lines : Polylines
        N paths.
    rows : (K,) int
        Those that go on.
    time : float
        Seconds, after their last points.
    points : (K, 2) array
        Where they are.
    tolerance : (K,) array
        Pixels by which a point may lie off the segment's line.
    longest : float
        Seconds after which a segment ends in any case, so that an old speed is forgotten.
    """
    from perdure.maths.kernels.paths import extend as kernel  # numba: half a second that no import should cost

    places = np.ascontiguousarray(np.asarray(points, np.float64).reshape(-1, 2))
    limits = np.full(len(places), tolerance, np.float64)
    knots, last, sums = lines.knots.copy(), lines.last.copy(), lines.sums.copy()
    kernel(knots, last, sums, np.asarray(rows, np.intp), float(time), places, limits, float(longest))
    return Polylines(knots, last, sums)


def exchanged(lines: Polylines, one: int, other: int) -> Polylines:
    """Return the paths with two of them in each other's place."""
    order = np.arange(len(lines))
    order[[one, other]] = other, one
    return lines.take(order)

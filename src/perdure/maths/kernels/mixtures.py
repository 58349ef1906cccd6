"""Gaussian mixtures: densities of many points, and the sums one step of EM needs; see `perdure.maths.mixture`.

Every component comes as the logarithm of its height, its mean, and the inverse of its covariance's lower Cholesky
factor, so that log(weight · density) = height - ½ ‖factor (point - mean)‖². Points are taken a block at a time: plain
loops over a block become vector code, and the block's terms stay in the nearest cache.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel, kernel_for

Floats = NDArray[Any]  # float32 or float64, the same in all arguments of one call
Float = NDArray[np.float64]

BLOCK = 256  # points at a time
NEGLIGIBLE = -20.0  # log of a share that a float32 sum cannot feel
NOTHING = -40.0  # log of a share that a float64 sum cannot feel


@kernel
def _terms(block: Floats, count: int, heights: Floats, means: Floats, factors: Floats, out: Floats) -> None:
    """Write log(weight · density) of a block's points under every component.

    Parameters
    ----------
    block : (D, BLOCK) float
        A column each.
    count : int
        How many of the columns are points; so many are written.
    heights, means, factors : (K,), (K, D), (K, D, D) float
        Lower triangles; see above.
    out : (K, BLOCK) float, changed
        The first `count` columns are written.
    """
    half = block.dtype.type(0.5)
    for k in range(heights.shape[0]):
        height, row = heights[k], out[k]
        if block.shape[0] == 3:
            first, second, third = block[0], block[1], block[2]
            x0, y0, z0 = means[k, 0], means[k, 1], means[k, 2]
            xx, yx, yy = factors[k, 0, 0], factors[k, 1, 0], factors[k, 1, 1]
            zx, zy, zz = factors[k, 2, 0], factors[k, 2, 1], factors[k, 2, 2]
            for i in range(count):
                x, y, z = first[i] - x0, second[i] - y0, third[i] - z0
                a, b, c = xx * x, yx * x + yy * y, zx * x + zy * y + zz * z
                row[i] = height - half * (a * a + b * b + c * c)
        elif block.shape[0] == 2:
            first, second = block[0], block[1]
            x0, y0 = means[k, 0], means[k, 1]
            xx, yx, yy = factors[k, 0, 0], factors[k, 1, 0], factors[k, 1, 1]
            for i in range(count):
                x, y = first[i] - x0, second[i] - y0
                a, b = xx * x, yx * x + yy * y
                row[i] = height - half * (a * a + b * b)
        else:
            for i in range(count):
                squared = block.dtype.type(0)
                for d in range(block.shape[0]):
                    along = block.dtype.type(0)
                    for e in range(d + 1):
                        along += factors[k, d, e] * (block[e, i] - means[k, e])
                    squared += along * along
                row[i] = height - half * squared


@kernel_for(
    given(np.float32, 2, "C"),
    given(np.float32, 1, "C"),
    given(np.float32, 2, "C"),
    given(np.float32, 3, "C"),
    np.float32,
    changed(np.float32, 2),
    changed(np.float32),
)
def log_densities(
    points: NDArray[np.float32],
    heights: NDArray[np.float32],
    means: NDArray[np.float32],
    factors: NDArray[np.float32],
    least: np.float32,
    room: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Write the logarithm of the mixture's density at every point, never less than `least`.

    Parameters
    ----------
    points, heights, means, factors : float32
        As in `_terms`.
    least : float32
        Also the density of a point that is not a number.
    room : (K + 2 + D, BLOCK) float32, changed
        Scratch.
    out : (N,) float32, changed
        Every element is written.
    """
    components = heights.shape[0]
    best, total, block = room[components], room[components + 1], room[components + 2 :]
    enough = least - np.float32(np.log(max(components, 1)))  # no sum of K terms below this reaches `least`
    for begin in range(0, points.shape[0], BLOCK):
        count = min(BLOCK, points.shape[0] - begin)
        for i in range(count):
            for d in range(points.shape[1]):
                block[d, i] = points[begin + i, d]
        _terms(block, count, heights, means, factors, room)
        for i in range(count):
            best[i] = enough
        for k in range(components):
            row = room[k]
            for i in range(count):
                best[i] = row[i] if row[i] > best[i] else best[i]
        for i in range(count):
            total[i] = np.float32(0.0)
        for k in range(components):
            row = room[k]
            for i in range(count):
                total[i] += _share(row[i] - best[i])
        for i in range(count):
            found = best[i] + np.log(total[i]) if best[i] > enough else least
            out[begin + i] = found if found > least else least


@kernel_for(
    given(np.float32, 2, "C"),
    given(np.float32, 1, "C"),
    given(np.float32, 2, "C"),
    given(np.float32, 3, "C"),
    given(np.int64),
    given(np.float32),
    int,
    np.float32,
    changed(np.float32, 2),
    changed(np.float32),
)
def log_ratios(
    points: NDArray[np.float32],
    heights: NDArray[np.float32],
    means: NDArray[np.float32],
    factors: NDArray[np.float32],
    ends: NDArray[np.int64],
    least: NDArray[np.float32],
    ours: int,
    bound: np.float32,
    room: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Write the log ratio of two sums of mixtures at every point, within ± bound.

    Parameters
    ----------
    points, heights, means, factors : float32
        As in `_terms`, the components of all mixtures; what a mixture counts for is in its heights.
    ends : (M,) int64
        Where each mixture's components end.
    least : (M,) float32
        What each mixture's log density is at least, with what it counts for.
    ours : int
        So many of the mixtures, the first, are above the line, the others below; of either at least one.
    bound : float32
        ≥ 0.
    room : (K + 5 + D, BLOCK) float32, changed
        Scratch.
    out : (N,) float32, changed
        Every element is written.
    """
    components, mixtures, smallest = heights.shape[0], ends.shape[0], np.float32(0.0)
    best, part, total = room[components], room[components + 1], room[components + 2]
    ours_best, above, block = room[components + 3], room[components + 4], room[components + 5 :]
    enough = bound + np.float32(np.log(components + mixtures))
    for begin in range(0, points.shape[0], BLOCK):
        count = min(BLOCK, points.shape[0] - begin)
        for i in range(count):
            for d in range(points.shape[1]):
                block[d, i] = points[begin + i, d]
        _terms(block, count, heights, means, factors, room)
        for side in range(2):
            first, last = (0, ours) if side == 0 else (ours, mixtures)
            top = least[first]
            for m in range(first, last):
                top = max(top, least[m])
            for i in range(count):
                best[i], total[i] = top, smallest
            for k in range(ends[first - 1] if first > 0 else 0, ends[last - 1]):
                row = room[k]
                for i in range(count):
                    best[i] = row[i] if row[i] > best[i] else best[i]
            for m in range(first, last):
                for i in range(count):
                    part[i] = smallest
                for k in range(ends[m - 1] if m > 0 else 0, ends[m]):
                    row = room[k]
                    for i in range(count):
                        part[i] += _share(row[i] - best[i])
                for i in range(count):
                    lowest = _share(least[m] - best[i])
                    total[i] += part[i] if part[i] > lowest else lowest
            if side == 0:
                for i in range(count):
                    above[i], ours_best[i] = total[i], best[i]
        for i in range(count):
            ratio = ours_best[i] - best[i]  # of the largest terms; the sums are 1 to K + M times as large
            if abs(ratio) < enough:
                ratio += np.log(above[i] / total[i])
            out[begin + i] = min(max(ratio, -bound), bound)


@kernel
def _share(log: np.float32) -> np.float32:
    """Return exp of a number ≤ 0, to within 5e-6 of its value: exp(log / 64) by its series, squared six times.

    Without a branch or a call, so that a loop over it becomes vector code.
    """
    x = (log if log > np.float32(NEGLIGIBLE) else np.float32(NEGLIGIBLE)) * np.float32(1 / 64)
    one = np.float32(1.0)
    series = one + x * np.float32(1 / 7)
    series = one + x * np.float32(1 / 6) * series
    series = one + x * np.float32(1 / 5) * series
    series = one + x * np.float32(1 / 4) * series
    series = one + x * np.float32(1 / 3) * series
    series = one + x * np.float32(1 / 2) * series
    series = one + x * series
    series = series * series
    series = series * series
    series = series * series
    series = series * series
    series = series * series
    return series * series


@kernel_for(
    given(np.float64, 2, "C"),
    given(np.float64, 1, "C"),
    given(np.float64, 1, "C"),
    given(np.float64, 2, "C"),
    given(np.float64, 3, "C"),
    changed(np.float64, 2),
    changed(np.float64, 2),
)
def expect(
    points: Float, weights: Float, heights: Float, means: Float, factors: Float, room: Float, sums: Float
) -> float:
    """Add up what each component is responsible for; return Σ weight · log density (the step E of EM).

    Parameters
    ----------
    points, heights, means, factors : float64
        As in `_terms`; K ≥ 1, all finite.
    weights : (N,) float64
        How often each point counts.
    room : (K + 2 + D, BLOCK) float64, changed
        Scratch.
    sums : (K, 1 + D + D (D + 1) / 2) float64, changed
        Zeros before. Of the responsibilities r: Σ r, Σ r u, Σ r u uᵀ (lower triangle by rows), where u = point - mean.
    """
    dimensions, components, likelihood = points.shape[1], heights.shape[0], 0.0
    best, away, block = room[components], room[components + 1], room[components + 2 :]
    for begin in range(0, points.shape[0], BLOCK):
        count = min(BLOCK, points.shape[0] - begin)
        for i in range(count):
            for d in range(points.shape[1]):
                block[d, i] = points[begin + i, d]
        _terms(block, count, heights, means, factors, room)
        for i in range(count):
            best[i] = room[0, i]
        for k in range(1, components):
            row = room[k]
            for i in range(count):
                best[i] = row[i] if row[i] > best[i] else best[i]
        for i in range(count):
            total = 0.0
            for k in range(components):
                off = room[k, i] - best[i]
                share = np.exp(off) if off > NOTHING else 0.0
                room[k, i] = share
                total += share
            weight = weights[begin + i]
            likelihood += weight * (best[i] + np.log(total))
            best[i] = weight / total
        for k in range(components):
            row, sum_of = room[k], sums[k]
            for i in range(count):
                row[i] *= best[i]
            for i in range(count):
                sum_of[0] += row[i]
            place = 1 + dimensions
            for d in range(dimensions):
                one, mean, along = block[d], means[k, d], 0.0
                for i in range(count):
                    away[i] = row[i] * (one[i] - mean)
                for i in range(count):
                    along += away[i]
                sum_of[1 + d] += along
                for e in range(d + 1):
                    other, mean_of, across = block[e], means[k, e], 0.0
                    for i in range(count):
                        across += away[i] * (other[i] - mean_of)
                    sum_of[place] += across
                    place += 1
    return likelihood


def _terms_twin(block: Floats, count: int, heights: Floats, means: Floats, factors: Floats, out: Floats) -> None:
    """Do the same in NumPy: the oracle of `_terms`."""
    away = block.T[None, :count] - means[:, None]  # (K, n, D)
    along = np.einsum("kde,kne->knd", np.tril(factors), away)
    out[: len(heights), :count] = heights[:, None] - (along**2).sum(axis=2) / 2


def log_densities_twin(
    points: NDArray[np.float32],
    heights: NDArray[np.float32],
    means: NDArray[np.float32],
    factors: NDArray[np.float32],
    least: np.float32,
    room: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Do the same in NumPy: the oracle of `log_densities`."""
    every = np.full((len(heights) + 1, len(points)), -np.inf)
    _terms_twin(points.T, len(points), heights, means, factors, every)
    found = np.logaddexp.reduce(every, axis=0)
    out[...] = np.where(found > least, found, least)


def log_ratios_twin(
    points: NDArray[np.float32],
    heights: NDArray[np.float32],
    means: NDArray[np.float32],
    factors: NDArray[np.float32],
    ends: NDArray[np.int64],
    least: NDArray[np.float32],
    ours: int,
    bound: np.float32,
    room: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Do the same in NumPy: the oracle of `log_ratios`."""
    every = np.empty((len(heights), len(points)))
    _terms_twin(points.T, len(points), heights, means, factors, every)
    each = np.stack(
        [
            np.maximum(np.logaddexp.reduce(one, axis=0, initial=-np.inf), lowest)
            for one, lowest in zip(np.split(every, ends[:-1]), least, strict=True)
        ]
    )
    ratio = np.logaddexp.reduce(each[:ours], axis=0) - np.logaddexp.reduce(each[ours:], axis=0)
    out[...] = np.clip(ratio, -bound, bound)


def expect_twin(
    points: Float, weights: Float, heights: Float, means: Float, factors: Float, room: Float, sums: Float
) -> float:
    """Do the same in NumPy: the oracle of `expect`."""
    every = np.empty((len(heights), len(points)))
    _terms_twin(points.T, len(points), heights, means, factors, every)
    found = np.logaddexp.reduce(every, axis=0)
    shares = np.exp(every - found) * weights  # (K, N)
    away = points[None] - means[:, None]  # (K, N, D)
    rows, columns = np.tril_indices(points.shape[1])
    sums[:, 0] += shares.sum(axis=1)
    sums[:, 1 : 1 + points.shape[1]] += np.einsum("kn,knd->kd", shares, away)
    sums[:, 1 + points.shape[1] :] += np.einsum("kn,knm->km", shares, away[..., rows] * away[..., columns])
    return float(weights @ found)

"""Mixtures of Gaussians with full covariances: fitted by EM, frame after frame, and their log density anywhere.

Dempster, Laird & Rubin, *Maximum likelihood from incomplete data via the EM algorithm* (1977). The first mixture of
some points grows from one Gaussian, whose widest components are cut in two across their longest axes until there are
enough, with steps of EM in between (Linde, Buzo & Gray, *An algorithm for vector quantizer design*, 1980): nothing is
drawn at random. The next frame's starts from this one's.

Departure: no covariance is narrower than a floor in any direction. The step M under that condition keeps a
covariance's axes and lifts the eigenvalues that lie below it, so the likelihood never falls, as it could if the floor
were added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.errors import ParameterError

Float = NDArray[np.float64]
Single = NDArray[np.float32]
Row = TypeVar("Row", bound=np.generic)

LEAST = -60.0  # log density of whatever is less likely, and of all under a mixture without components
SUPPORT = 20  # points that a component rests on at least, on average
SETTLED = 1e-3  # nats a point: EM stops where a step gains less
_BETWEEN = 2  # steps of EM after each cutting
_EMPTY = 1e-6  # share of the points below which a component is given up
_GOLDEN = (np.sqrt(5.0) - 1) / 2


@dataclass(frozen=True, eq=False)
class Mixture:
    """K Gaussians in D dimensions; K may be 0."""

    weights: Float  # (K,) > 0, together 1
    means: Float  # (K, D)
    covariances: Float  # (K, D, D)

    def __len__(self) -> int:
        return len(self.weights)

    @staticmethod
    def empty(dimensions: int) -> Mixture:
        """Return the mixture of no components: of what nothing is known."""
        return Mixture(np.zeros(0), np.zeros((0, dimensions)), np.zeros((0, dimensions, dimensions)))


Sum = Sequence[tuple[Mixture, float]]  # of densities, each with what it counts for


def fit(
    points: ArrayLike,
    components: int,
    *,
    start: Mixture | None = None,
    iterations: int = 10,
    floor: float | ArrayLike = 1.0,
    weights: ArrayLike | None = None,
    settled: float = SETTLED,
) -> Mixture:
    """Fit a mixture to points by EM.

    Parameters
    ----------
    points : (N, D) array
        Rows that are not finite are left out.
    components : int
        ≥ 1. At most so many: of N points no more than max(1, N // SUPPORT), and none that would be narrower than
        the floor, or empty.
    start : Mixture, optional
        What to start from, as of the frame before; its widest components are cut in two where more are wanted, its
        lightest left out where fewer. Without: one Gaussian.
    iterations : int
        ≥ 0. Steps of EM at most, once there are enough components.
    floor : float or (D,) array
        > 0, squared units of the points: the least variance (for colours in 0 … 255: 1; for flow: 0.05 px²).
    weights : (N,) array, optional
        ≥ 0: how often each point counts; those that count 0 are left out.
    settled : float
        ≥ 0, in nats a point: EM stops where a step gains less.

    Returns
    -------
    Mixture
        Of finite numbers, and the same for the same input. Without points: `start`, or no components.

    Raises
    ------
    ParameterError
        A number out of its range, or shapes that do not fit.

    Examples
    --------
    >>> fit([[0, 0], [2, 0], [0, 2], [2, 2]], 10).means.tolist()
    [[1.0, 1.0]]
    """
    every, counts, unit = _checked(points, components, iterations, floor, weights, start)
    if not len(every):
        return start if start is not None else Mixture.empty(every.shape[1])
    every = np.ascontiguousarray(every / unit)  # the floor becomes 1 in every direction
    wanted = min(components, max(1, len(every) // SUPPORT))
    found = _scaled(start, 1 / unit) if start is not None and len(start) else _single(every, counts)
    found = _heaviest(found, wanted)
    while len(found) < wanted:
        grown = _cut(found, wanted)
        if len(grown) == len(found):
            break
        found = _improve(grown, every, counts, _BETWEEN, 0.0) if len(grown) < wanted else grown
    return _scaled(_improve(found, every, counts, iterations, settled), unit)


def log_density(mixture: Mixture, points: ArrayLike) -> Single:
    """Return the logarithm of the density at points.

    Parameters
    ----------
    mixture : Mixture
        Of D dimensions; one without components says LEAST of everything.
    points : (N, D) array, or a picture (H, W, D)
        Any numbers; counted in float32.

    Returns
    -------
    (N,) float32, or (H, W)
        At least LEAST; LEAST where a point is not finite.

    Raises
    ------
    ParameterError
        Points of another number of dimensions.
    """
    from perdure.maths.kernels.mixtures import BLOCK, log_densities

    places = _places(points, mixture)
    out = np.empty(len(places), np.float32)
    heights, factors = _forms(mixture)
    log_densities(
        places,
        heights.astype(np.float32),
        mixture.means.astype(np.float32),
        factors.astype(np.float32),
        np.float32(LEAST),
        np.empty((len(mixture) + 2 + places.shape[1], BLOCK), np.float32),
        out,
    )
    return out.reshape(np.shape(points)[:-1])


def log_ratio(points: ArrayLike, own: Sum, other: Sum, bound: float) -> Single:
    """Return the logarithm of the ratio of two sums of densities at points.

    Parameters
    ----------
    points : (N, D) array, or a picture (H, W, D)
        Any numbers; counted in float32.
    own, other : sequences of (Mixture, float)
        At least one of each, of D dimensions, and what it counts for, > 0. None's density is less than exp(LEAST).
    bound : float
        ≥ 0.

    Returns
    -------
    (N,) float32, or (H, W)
        Within ± bound.

    Raises
    ------
    ParameterError
        Points of another number of dimensions.

    Examples
    --------
    >>> near, far = (Mixture(np.ones(1), np.full((1, 1), x), np.ones((1, 1, 1))) for x in (0.0, 2.0))
    >>> log_ratio([[0.0], [1.0], [9.0]], [(near, 1.0)], [(far, 1.0)], 4.0).round(3).tolist()
    [2.0, 0.0, -4.0]
    """
    from perdure.maths.kernels.mixtures import BLOCK, log_ratios

    every = [*own, *other]
    mixtures, shares = [one for one, _ in every], np.log([share for _, share in every])
    sizes = [len(one) for one in mixtures]
    all_of_them = Mixture(*(np.concatenate(columns) for columns in zip(*map(_columns, mixtures), strict=True)))
    places = _places(points, all_of_them)
    heights, factors = _forms(all_of_them)
    out = np.empty(len(places), np.float32)
    log_ratios(
        places,
        (heights + np.repeat(shares, sizes)).astype(np.float32),
        all_of_them.means.astype(np.float32),
        factors.astype(np.float32),
        np.cumsum(sizes),
        (LEAST + shares).astype(np.float32),
        len(own),
        np.float32(bound),
        np.empty((len(all_of_them) + 5 + places.shape[1], BLOCK), np.float32),
        out,
    )
    return out.reshape(np.shape(points)[:-1])


def subsample(points: NDArray[Row], most: int) -> NDArray[Row]:
    """Return at most so many rows, in their order, spread evenly: one of each of `most` equal stretches.

    Where in its stretch follows the golden ratio, so that no column of a picture is met again and again.
    """
    if len(points) <= most:
        return points
    ends = np.arange(most + 1) * len(points) // max(most, 1)
    within = (np.arange(most) * _GOLDEN) % 1.0
    rows: NDArray[Row] = points[ends[:-1] + (within * np.diff(ends)).astype(np.intp)]
    return rows


def _checked(
    points: ArrayLike,
    components: int,
    iterations: int,
    floor: float | ArrayLike,
    weights: ArrayLike | None,
    start: Mixture | None,
) -> tuple[Float, Float, Float]:
    """Finite points (N, D) that count, how much (N,), and the roots (D,) of the floor."""
    every = np.asarray(points, np.float64)
    if every.ndim != 2:
        raise ParameterError(f"points have the shape {every.shape}; a mixture is fitted to (N, D)")
    if components < 1:
        raise ParameterError(f"components is {components}; a mixture has 1 or more")
    if iterations < 0:
        raise ParameterError(f"iterations is {iterations}; 0 or more would do")
    least = np.asarray(floor, np.float64)
    if least.shape not in ((), every.shape[1:]) or not (np.isfinite(least) & (least > 0)).all():
        raise ParameterError(f"floor is {floor!r}; it is one number above 0, or one for each of {every.shape[1]}")
    if start is not None and start.means.shape[1] != every.shape[1]:
        raise ParameterError(
            f"the mixture to start from has {start.means.shape[1]} dimensions, not {every.shape[1]}"
        )
    counts = np.ones(len(every)) if weights is None else np.asarray(weights, np.float64)
    if counts.shape != every.shape[:1]:
        raise ParameterError(f"weights have the shape {counts.shape}; {len(every)} points want one each")
    used = np.isfinite(every).all(axis=1) & np.isfinite(counts) & (counts > 0)
    if not used.all():
        every, counts = every[used], counts[used]
    return every, counts, np.sqrt(np.broadcast_to(least, every.shape[1:]))


def _places(points: ArrayLike, mixture: Mixture) -> Single:
    """Points (N, D) as the kernels take them; refused if the mixture has other dimensions."""
    given = np.asarray(points)
    if given.shape[-1:] != mixture.means.shape[1:]:
        raise ParameterError(
            f"points have the shape {given.shape}; the mixture has {mixture.means.shape[1]} dimensions"
        )
    return np.ascontiguousarray(given.reshape(-1, given.shape[-1]), np.float32)


def _columns(mixture: Mixture) -> tuple[Float, Float, Float]:
    return mixture.weights, mixture.means, mixture.covariances


def _scaled(mixture: Mixture, unit: Float) -> Mixture:
    """The same mixture in units (D,) times as small."""
    return Mixture(mixture.weights, mixture.means * unit, mixture.covariances * np.outer(unit, unit))


def _single(points: Float, counts: Float) -> Mixture:
    """The one Gaussian that fits best."""
    share = counts / counts.sum()
    mean = share @ points
    away = points - mean
    return Mixture(np.ones(1), mean[None], _lifted((away.T @ (away * share[:, None]))[None]))


def _heaviest(mixture: Mixture, most: int) -> Mixture:
    """The heaviest components, in their order."""
    if len(mixture) <= most:
        return mixture
    kept = np.sort(np.argsort(-mixture.weights, kind="stable")[:most])
    weights = mixture.weights[kept]
    return Mixture(weights / weights.sum(), mixture.means[kept], mixture.covariances[kept])


def _cut(mixture: Mixture, wanted: int) -> Mixture:
    """Cut components in two, the widest first, each at most once; those no wider than the floor stay whole.

    The halves are those of the Gaussian cut across its longest axis: mean and covariance of both together are as
    before.
    """
    values, vectors = np.linalg.eigh(mixture.covariances)  # ascending
    widest, axes = values[:, -1], vectors[:, :, -1]  # (K,), (K, D)
    order = np.argsort(-mixture.weights * widest, kind="stable")
    cut = order[widest[order] > 1 + 1e-9][: wanted - len(mixture)]
    if not len(cut):
        return mixture
    step = axes[cut] * np.sqrt(widest[cut] * 2 / np.pi)[:, None]  # from the mean to either half's
    weights, means, covariances = mixture.weights.copy(), mixture.means.copy(), mixture.covariances.copy()
    weights[cut] /= 2
    covariances[cut] -= step[:, :, None] * step[:, None, :]
    means[cut] -= step
    return Mixture(
        np.concatenate([weights, weights[cut]]),
        np.concatenate([means, means[cut] + 2 * step]),
        _lifted(np.concatenate([covariances, covariances[cut]])),
    )


def _improve(mixture: Mixture, points: Float, counts: Float, iterations: int, settled: float) -> Mixture:
    """Steps of EM, in units where the floor is 1."""
    from perdure.maths.kernels.mixtures import BLOCK, expect

    dimensions, before = points.shape[1], -np.inf
    lower, total = np.tril_indices(dimensions), counts.sum()
    for _ in range(iterations):
        heights, factors = _forms(mixture)
        sums = np.zeros((len(mixture), 1 + dimensions + len(lower[0])))
        room = np.empty((len(mixture) + 2 + dimensions, BLOCK))
        likelihood = expect(points, counts, heights, mixture.means, factors, room, sums) / total
        if likelihood - before < settled:
            break
        mixture, before = _maximise(mixture, sums, total, lower), likelihood
    return mixture


def _maximise(mixture: Mixture, sums: Float, total: float, lower: tuple[NDArray[np.intp], ...]) -> Mixture:
    """The step M: the mixture that the sums of `expect` make most likely; empty components are given up."""
    dimensions = mixture.means.shape[1]
    kept = sums[:, 0] > _EMPTY * total
    mass, means = sums[kept, :1], mixture.means[kept]
    step, moments = sums[kept, 1 : 1 + dimensions] / mass, sums[kept, 1 + dimensions :] / mass
    covariances = np.zeros((len(mass), dimensions, dimensions))
    covariances[:, lower[0], lower[1]] = covariances[:, lower[1], lower[0]] = moments
    covariances -= step[:, :, None] * step[:, None, :]
    return Mixture(mass[:, 0] / mass.sum(), means + step, _lifted(covariances))


def _lifted(covariances: Float) -> Float:
    """Covariances (K, D, D) with no eigenvalue below 1."""
    values, vectors = np.linalg.eigh(covariances)
    if (values >= 1).all():
        return covariances
    lifted = (vectors * np.maximum(values, 1)[:, None]) @ vectors.transpose(0, 2, 1)
    return np.where((values[:, 0] >= 1)[:, None, None], covariances, (lifted + lifted.transpose(0, 2, 1)) / 2)


def _forms(mixture: Mixture) -> tuple[Float, Float]:
    """Heights (K,) and inverse Cholesky factors (K, D, D), as the kernels take them."""
    factors = np.linalg.inv(np.linalg.cholesky(mixture.covariances)) if len(mixture) else mixture.covariances
    diagonal = np.diagonal(factors, axis1=1, axis2=2)  # (K, D)
    heights = np.log(mixture.weights) + np.log(diagonal).sum(axis=1)
    return heights - 0.5 * mixture.means.shape[1] * np.log(2 * np.pi), np.ascontiguousarray(factors)

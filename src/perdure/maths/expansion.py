"""Labellings by many labels that cost little: α-expansion and α-β swap.

Boykov, Veksler & Zabih, "Fast approximate energy minimization via graph cuts" (PAMI 2001). The energy is the sum of each
pixel's cost of its label and, for neighbours with different labels, a weight of the pair. A move takes the best of very
many labellings by one minimum cut: an expansion may give α to any pixels, a swap may exchange α and β. No expansion
left to make, the energy is at most twice the least. Two labels take one exact cut.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.errors import ParameterError
from perdure.maths.maxflow import DIRECTIONS, SCALE, STEPS, Bits, Float, Workspace, cut, neighbours

Labels = NDArray[np.int32]
OUTSIDE = -1


class Labelling(NamedTuple):
    """Labels and what they cost."""

    labels: Labels  # (H, W), from 0; OUTSIDE beyond the domain
    energy: float


OnMove = Callable[[Labelling, tuple[int, ...]], None]


class _Problem(NamedTuple):
    unary: Float  # (N, H, W) float64, 0 beyond the domain
    pairwise: Float  # (4 or 2, H, W) float64, 0 where an edge leaves the domain
    domain: Bits
    scale: float
    workspace: Workspace


def expand(
    unary: Float,
    pairwise: Float,
    *,
    domain: Bits | None = None,
    start: NDArray[np.integer[Any]] | None = None,
    scale: float = SCALE,
    on_move: OnMove | None = None,
) -> Labelling:
    """Expand one label after the other until none gains; the energy never rises.

    Parameters
    ----------
    unary : (N, H, W) float
        The cost of each label at each pixel; finite.
    pairwise : (4, H, W) or (2, H, W) float
        ≥ 0: what it costs if a pixel and its neighbour to the E, S, SE, SW (or E, S) have different labels.
    domain : (H, W) bool, optional
        The pixels that are labelled.
    start : (H, W) int, optional
        Labels to begin with; each pixel's cheapest if there are none.
    scale : float
        Of the cuts' capacities, see `maxflow.cut`.
    on_move : callable, optional
        Called after every move that gained, with the labelling and the labels moved.

    Raises
    ------
    ParameterError
        If a weight is negative or not finite, by name and place.

    Examples
    --------
    >>> unary = np.array([[[0.0, 3.0, 3.0]], [[3.0, 0.0, 3.0]], [[3.0, 2.0, 0.0]]])
    >>> expand(unary, np.full((2, 1, 3), 2.5)).labels.tolist()
    [[0, 2, 2]]
    """
    problem = _posed(unary, pairwise, domain, scale)
    labels = _begun(problem, start)
    if len(unary) <= 2:
        return _best_of_two(problem, labels, on_move)
    return _moved(problem, labels, [(one,) for one in range(len(unary))], _expanded, on_move)


def swap(
    unary: Float,
    pairwise: Float,
    *,
    domain: Bits | None = None,
    start: NDArray[np.integer[Any]] | None = None,
    scale: float = SCALE,
    on_move: OnMove | None = None,
) -> Labelling:
    """Swap labels pair by pair until no pair gains; parameters as for `expand`.

    Examples
    --------
    >>> swap(np.array([[[0.0, 3.0]], [[3.0, 0.0]], [[1.0, 1.0]]]), np.full((2, 1, 2), 5.0)).energy
    2.0
    """
    problem = _posed(unary, pairwise, domain, scale)
    labels = _begun(problem, start)
    if len(unary) <= 2:
        return _best_of_two(problem, labels, on_move)
    return _moved(problem, labels, list(combinations(range(len(unary)), 2)), _swapped, on_move)


def energy(
    labels: NDArray[np.integer[Any]], unary: Float, pairwise: Float, *, domain: Bits | None = None
) -> float:
    """Return what a labelling costs."""
    return _cost(_posed(unary, pairwise, domain, SCALE), np.asarray(labels))


def _moved(
    problem: _Problem,
    labels: Labels,
    moves: list[tuple[int, ...]],
    made: Callable[[_Problem, Labels, tuple[int, ...]], Labels],
    on_move: OnMove | None,
) -> Labelling:
    """Make moves in turn until none of them gains any more."""
    cost, idle = _cost(problem, labels), 0
    for move in _endless(moves):
        if idle == len(moves):
            break
        labels_now = made(problem, labels, move)
        cost_now = _cost(problem, labels_now)
        idle += 1
        if cost_now < cost:  # capacities are rounded: what gains nothing in the caller's numbers is not done
            labels, cost, idle = labels_now, cost_now, 1
            if on_move is not None:
                on_move(Labelling(labels, cost), move)
    return Labelling(labels, cost)


def _endless(moves: list[tuple[int, ...]]) -> Iterator[tuple[int, ...]]:
    while True:
        yield from moves


def _expanded(problem: _Problem, labels: Labels, move: tuple[int, ...]) -> Labels:
    """Give α to the pixels for which that is best.

    With 1 for a pixel that takes α: neighbours with one label pay their weight if they differ; with two labels, neither
    α, they pay it unless both take α, which is half of it if they differ less half for each that takes α; beside a
    pixel that has α already it is saved by taking α.
    """
    (alpha,) = move
    free = problem.domain & (labels != alpha)
    has = np.take_along_axis(problem.unary, np.maximum(labels, 0)[None], axis=0)[0]
    unary = problem.unary[alpha] - has
    weights = problem.pairwise.copy()
    for w, step in zip(weights, STEPS, strict=False):
        here, there = neighbours(labels.shape, step)
        saved = np.where(labels[here] == alpha, 0.0, np.where(labels[there] == alpha, w[here], 0.0))
        unary[here] -= saved
        unary[there] -= np.where(labels[there] == alpha, 0.0, np.where(labels[here] == alpha, w[here], 0.0))
        half = np.where((labels[here] != labels[there]) & free[here] & free[there], w[here] / 2, 0.0)
        unary[here] -= half
        unary[there] -= half
        w[here] -= half
    takes = cut(unary, weights, domain=free, scale=problem.scale, workspace=problem.workspace).labels
    return np.where(takes, np.int32(alpha), labels)


def _swapped(problem: _Problem, labels: Labels, move: tuple[int, ...]) -> Labels:
    """Share the pixels of α and β out between these two as is best."""
    alpha, beta = move
    free = problem.domain & ((labels == alpha) | (labels == beta))
    unary = problem.unary[beta] - problem.unary[alpha]
    takes = cut(unary, problem.pairwise, domain=free, scale=problem.scale, workspace=problem.workspace).labels
    return np.where(free, np.where(takes, np.int32(beta), np.int32(alpha)), labels)


def _best_of_two(problem: _Problem, labels: Labels, on_move: OnMove | None) -> Labelling:
    """Return the best labelling by two labels, or the one there is."""
    if len(problem.unary) < 2:
        return Labelling(labels, _cost(problem, labels))
    best, before = _swapped(problem, labels, (0, 1)), _cost(problem, labels)
    cost = _cost(problem, best)
    if cost >= before:
        return Labelling(labels, before)
    if on_move is not None:
        on_move(Labelling(best, cost), (0, 1))
    return Labelling(best, cost)


def _cost(problem: _Problem, labels: NDArray[np.integer[Any]]) -> float:
    chosen = np.take_along_axis(problem.unary, np.maximum(labels, 0)[None], axis=0)[0]
    total = float(chosen[problem.domain].sum())
    for weights, step in zip(problem.pairwise, STEPS, strict=False):
        here, there = neighbours(labels.shape, step)
        total += float(weights[here][labels[here] != labels[there]].sum())
    return total


def _begun(problem: _Problem, start: NDArray[np.integer[Any]] | None) -> Labels:
    """Labels to begin with, OUTSIDE beyond the domain."""
    count = len(problem.unary)
    if start is None:
        start = problem.unary.argmin(axis=0)
    elif start.shape != problem.domain.shape:
        raise ParameterError(f"start has the shape {start.shape}: it must be {problem.domain.shape}")
    elif problem.domain.any() and not (start[problem.domain].min() >= 0 and start[problem.domain].max() < count):
        raise ParameterError(f"start has labels that are not there: they must be 0 to {count - 1}")
    return np.where(problem.domain, start, OUTSIDE).astype(np.int32)


def _posed(unary: Float, pairwise: Float, domain: Bits | None, scale: float) -> _Problem:
    """Check shapes and weights, and leave out what lies beyond the domain."""
    unary, pairwise = np.asarray(unary, np.float64), np.asarray(pairwise, np.float64)
    if (
        unary.ndim != 3
        or not len(unary)
        or pairwise.ndim != 3
        or pairwise.shape[1:] != unary.shape[1:]
        or len(pairwise) not in (2, 4)
    ):
        raise ParameterError(
            f"pairwise has the shape {pairwise.shape} beside unary's {unary.shape}: "
            "they must be (2 or 4, H, W) and (N, H, W) with at least one label"
        )
    inside = np.ones(unary.shape[1:], np.bool_) if domain is None else domain
    if inside.shape != unary.shape[1:] or inside.dtype != np.bool_:
        raise ParameterError(f"domain is {inside.dtype} {inside.shape}: it must be bool {unary.shape[1:]}")
    costs = np.where(inside, unary, 0.0)
    _refuse(~np.isfinite(costs), unary, "unary", "finite")
    counted = np.zeros(pairwise.shape)
    for which, step in enumerate(STEPS[: len(pairwise)]):
        here, there = neighbours(inside.shape, step)
        counted[which][here] = np.where(inside[here] & inside[there], pairwise[which][here], 0.0)
    for which, name in enumerate(DIRECTIONS[: len(pairwise)]):
        wrong = ~(np.isfinite(counted[which]) & (counted[which] >= 0))
        _refuse(wrong, pairwise[which], f"pairwise ({name})", "finite and ≥ 0")
    return _Problem(costs, counted, inside, scale, Workspace())


def _refuse(wrong: Bits, weights: Float, name: str, what: str) -> None:
    if wrong.any():
        place = tuple(int(one[0]) for one in np.nonzero(wrong))
        raise ParameterError(
            f"{name}[{', '.join(map(str, place))}] = {float(weights[place])!r}: it must be {what}"
        )

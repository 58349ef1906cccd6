"""Trajectory determination: who is whose temporal father, and which links become official (section 4.3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Float

Index = NDArray[np.intp]


def greedy(score: Float) -> Index:
    """Return the official links (K, 2) of global scores (N, M) of targets and objects; -inf where there is no link.

    Every object takes the target of the highest score as its father; of several that take one the highest score is
    kept. The paper stops there; here the others try again among those left, until nothing changes: which is taking
    the highest score of all again and again.

    >>> greedy(np.array([[0.9, 0.8], [0.7, -np.inf]], np.float32)).tolist()
    [[0, 0]]
    """
    rows, columns = np.nonzero(np.isfinite(score))
    order = np.lexsort((columns, rows, -score[rows, columns]))
    taken, given = np.zeros(len(score), np.bool_), np.zeros(score.shape[1], np.bool_)
    pairs = []
    for row, column in zip(rows[order].tolist(), columns[order].tolist(), strict=True):
        if not taken[row] and not given[column]:
            taken[row] = given[column] = True
            pairs.append((row, column))
    return np.array(sorted(pairs), np.intp).reshape(-1, 2)


def once(score: Float) -> Index:
    """Return the official links (K, 2) as the paper says: fathers are chosen once, and who loses has none.

    >>> once(np.array([[0.9, 0.8], [0.7, 0.6]], np.float32)).tolist()
    [[0, 0]]
    """
    if not score.size:
        return np.zeros((0, 2), np.intp)
    father = score.argmax(axis=0)  # (M,)
    alone = np.full_like(score, -np.inf)
    columns = np.flatnonzero(np.isfinite(score[father, np.arange(score.shape[1])]))
    alone[father[columns], columns] = score[father[columns], columns]
    child = alone.argmax(axis=1)  # (N,)
    rows = np.flatnonzero(np.isfinite(alone[np.arange(len(score)), child]))
    return np.stack([rows, child[rows]], axis=1)


def optimal(score: Float) -> Index:
    """Return the official links (K, 2) of the highest total of global scores.

    >>> optimal(np.array([[0.9, 0.8], [0.7, -np.inf]], np.float32)).tolist()
    [[0, 1], [1, 0]]
    """
    from scipy.optimize import linear_sum_assignment

    linked = np.isfinite(score)
    rows, columns = np.flatnonzero(linked.any(axis=1)), np.flatnonzero(linked.any(axis=0))
    if not len(rows):
        return np.zeros((0, 2), np.intp)
    total = np.where(linked, np.maximum(score, 0.0), 0.0)[np.ix_(rows, columns)].astype(np.float64)
    one, other = linear_sum_assignment(total, maximize=True)
    pairs = np.stack([rows[one], columns[other]], axis=1)
    return np.asarray(pairs[linked[pairs[:, 0], pairs[:, 1]]])


ASSIGNMENTS: Mapping[str, Callable[[Float], Index]] = {"optimal": optimal, "greedy": greedy, "once": once}

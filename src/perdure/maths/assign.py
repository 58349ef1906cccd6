"""The assignment of rows to columns at least cost, with forbidden pairs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Assignment(NamedTuple):
    """A partition: every row and every column is in exactly one of the three."""

    pairs: NDArray[np.intp]  # (K, 2) row, column; rows ascending
    rows: NDArray[np.intp]  # rows without a column, ascending
    columns: NDArray[np.intp]  # columns without a row, ascending


def assign(cost: NDArray[np.floating]) -> Assignment:
    """Pair rows with columns: as many allowed pairs as possible, and of those the least total cost.

    Parameters
    ----------
    cost : (N, M) array
        ≥ 0; inf forbids a pair.

    Returns
    -------
    Assignment
        Pairs and what was left over. Ties go to the solver's order, the same in every run.

    Examples
    --------
    >>> assign(np.array([[0.2, np.inf], [0.1, np.inf]])).pairs.tolist()
    [[1, 0]]
    """
    cost = np.asarray(cost, np.float64)
    allowed = np.isfinite(cost)
    pairs = np.argwhere(allowed)  # (K, 2)
    if (allowed.sum(axis=0) > 1).any() or (allowed.sum(axis=1) > 1).any():
        pairs = _solve(cost, allowed)
    return Assignment(
        pairs,
        np.setdiff1d(np.arange(cost.shape[0]), pairs[:, 0]),
        np.setdiff1d(np.arange(cost.shape[1]), pairs[:, 1]),
    )


def _solve(cost: NDArray[np.floating], allowed: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Pairs (K, 2) where some row or column has a choice."""
    from scipy.optimize import linear_sum_assignment  # half a second to load; most scenes begin without a choice

    # A forbidden pair costs more than all allowed ones together: it is taken only when nothing else is left.
    ceiling = 1.0 + 2.0 * float(cost[allowed].sum())
    rows, columns = linear_sum_assignment(np.where(allowed, cost, ceiling))
    kept = allowed[rows, columns]
    return np.stack([rows[kept], columns[kept]], axis=1).astype(np.intp)

"""The assignment of rows to columns at least cost, with forbidden pairs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment


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
    # A forbidden pair costs more than all allowed ones together: it is taken only when nothing else is left.
    ceiling = 1.0 + 2.0 * float(cost[allowed].sum()) if allowed.any() else 1.0
    rows, columns = linear_sum_assignment(np.where(allowed, cost, ceiling))
    kept = allowed[rows, columns]
    pairs = np.stack([rows[kept], columns[kept]], axis=1).astype(np.intp)  # (K, 2)
    return Assignment(
        pairs,
        np.setdiff1d(np.arange(cost.shape[0]), pairs[:, 0]),
        np.setdiff1d(np.arange(cost.shape[1]), pairs[:, 1]),
    )

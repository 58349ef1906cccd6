"""Numbers that occur more than once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for

Index = NDArray[np.int64]


def sharing(numbers: Index, counted: NDArray[np.bool_]) -> Index:
    """Return how many of those counted (N,) have each one's number; 0 of a number below 0 and of one not counted."""
    found = np.zeros(len(numbers), np.int64)
    _sharing(numbers, counted, np.zeros(_most(numbers), np.int64), found)
    return found


def uncontested(rows: Index, columns: Index) -> NDArray[np.bool_]:
    """Return which entries (K,) of a matrix, each once, are alone in their row and in their column."""
    found = np.empty(len(rows), np.bool_)
    _uncontested(rows, columns, np.zeros(_most(rows), np.int64), np.zeros(_most(columns), np.int64), found)
    return found


def sharing_twin(numbers: Index, counted: NDArray[np.bool_]) -> Index:
    """Do the same with whole columns: the oracle of `sharing`."""
    known = (numbers >= 0) & counted
    counts = np.bincount(numbers[known], minlength=int(numbers.max(initial=-1)) + 2)
    return np.asarray(np.where(known, counts[numbers], 0), np.int64)


def uncontested_twin(rows: Index, columns: Index) -> NDArray[np.bool_]:
    """Do the same with whole columns: the oracle of `uncontested`."""
    return np.asarray((np.bincount(rows)[rows] == 1) & (np.bincount(columns)[columns] == 1))


def _most(numbers: Index) -> int:
    return int(numbers.max(initial=-1)) + 1


@kernel_for(given(np.int64), given(np.bool_), changed(np.int64), changed(np.int64))
def _sharing(numbers: Index, counted: NDArray[np.bool_], counts: Index, found: Index) -> None:
    for n in range(len(numbers)):
        if counted[n] and numbers[n] >= 0:
            counts[numbers[n]] += 1
    for n in range(len(numbers)):
        if counted[n] and numbers[n] >= 0:
            found[n] = counts[numbers[n]]


@kernel_for(given(np.int64), given(np.int64), changed(np.int64), changed(np.int64), changed(np.bool_))
def _uncontested(rows: Index, columns: Index, in_row: Index, in_column: Index, found: NDArray[np.bool_]) -> None:
    for k in range(len(rows)):
        in_row[rows[k]] += 1
        in_column[columns[k]] += 1
    for k in range(len(rows)):
        found[k] = in_row[rows[k]] == 1 and in_column[columns[k]] == 1

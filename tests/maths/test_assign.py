"""Assignment against every possible one."""

from itertools import permutations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from perdure.maths.assign import assign

costs = st.integers(0, 4).flatmap(
    lambda rows: st.integers(0, 4).flatmap(
        lambda columns: st.lists(
            st.one_of(st.just(np.inf), st.integers(0, 9)), min_size=rows * columns, max_size=rows * columns
        ).map(lambda flat: np.array(flat, float).reshape(rows, columns))
    )
)


def best_by_trying_all(cost: np.ndarray) -> tuple[int, float]:
    """The largest number of allowed pairs, and the least cost among assignments of that many."""
    rows, columns = cost.shape
    padded = np.full((max(rows, columns),) * 2, np.inf)
    padded[:rows, :columns] = cost
    outcomes = []
    for order in permutations(range(len(padded))):
        taken = [padded[row, column] for row, column in enumerate(order) if np.isfinite(padded[row, column])]
        outcomes.append((-len(taken), sum(taken)))
    count, total = min(outcomes)
    return -count, total


@given(costs)
def test_a_matching_is_a_partition(cost):
    pairs, rows, columns = assign(cost)
    assert sorted([*pairs[:, 0], *rows]) == list(range(cost.shape[0]))
    assert sorted([*pairs[:, 1], *columns]) == list(range(cost.shape[1]))


@given(costs)
def test_as_many_pairs_as_possible_at_the_least_cost(cost):
    pairs = assign(cost).pairs
    assert (len(pairs), sum(cost[row, column] for row, column in pairs)) == best_by_trying_all(cost)


@given(costs)
def test_a_forbidden_pair_is_never_made(cost):
    assert all(np.isfinite(cost[row, column]) for row, column in assign(cost).pairs)


def test_nothing_against_nothing_is_nothing():
    assert [part.tolist() for part in assign(np.zeros((0, 0)))] == [[], [], []]

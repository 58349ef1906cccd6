"""The bench of chunks: what counts as one identity that comes over a border."""

from __future__ import annotations

import chunks
import numpy as np
import pytest
from chunks import judged

from perdure.types import Rows


def rows(*spans: tuple[int, int, int, int]) -> Rows:
    """Rows of (identity, where it stands, first frame, frame behind the last)."""
    every = [(frame, one, at) for one, at, first, behind in spans for frame in range(first, behind)]
    every.sort()
    return Rows.of(
        frames=[frame for frame, _, _ in every],
        ids=[one for _, one, _ in every],
        boxes=np.array([[at, 0, at + 10, 20] for _, _, at in every], float),
    )


TWO = rows((1, 0, 0, 40), (2, 50, 0, 40))


def test_who_keeps_her_identity_is_joined_whatever_its_name():
    told = judged(TWO, rows((7, 0, 0, 40), (9, 50, 0, 40)), [20], fps=10.0)
    assert (told.alive, told.joined, told.wrong) == (2, 2, 0)


def test_who_has_a_new_identity_behind_the_border_is_not_joined():
    told = judged(TWO, rows((7, 0, 0, 20), (8, 0, 20, 40), (9, 50, 0, 40)), [20], fps=10.0)
    assert (told.alive, told.joined, told.wrong) == (2, 1, 0)
    assert told.misses == ((20, 1),)
    assert told.share == pytest.approx(50.0)


def test_two_who_exchange_at_a_border_are_both_wrong():
    told = judged(TWO, rows((7, 0, 0, 20), (7, 50, 20, 40), (9, 50, 0, 20), (9, 0, 20, 40)), [20], fps=10.0)
    assert (told.alive, told.joined, told.wrong) == (2, 0, 2)


def test_who_is_hidden_over_the_border_counts_by_the_rows_before_and_behind():
    told = judged(rows((1, 0, 0, 10), (1, 0, 30, 40)), rows((7, 0, 0, 12), (7, 0, 28, 40)), [20], fps=10.0)
    assert (told.alive, told.joined) == (1, 1)


def test_no_time_is_told_of_a_run_that_was_there_before():
    value = {
        "clip": "a", "tracker": "b", "chunks": "4", "borders": 1, "alive": 0, "joined": 0, "wrong": 0,
        "wall": (None, 2.0), "work": (4.0, 6.0),
    }  # fmt: skip
    (row,) = chunks.table_of([value]).rows
    assert row[-2:] == ["-", "1.50"]

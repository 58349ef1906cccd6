"""Parameters: one declaration, read by checks, command line and docs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from perdure.errors import ParameterError
from perdure.params import build, describe, parameter, values


@dataclass(frozen=True)
class Example:
    patience: float = parameter(1.0, "how long an unseen target is kept", unit="s", low=0.0, symbol="τ")
    count: int = parameter(3, "how many are kept", low=1, high=9)
    mode: str = parameter("calm", "how it moves", choices=("calm", "wild"))
    strict: bool = parameter(False, "refuse what is doubtful")


def test_help_tells_meaning_range_unit_and_symbol():
    assert describe(Example)[0].full_help == "how long an unseen target is kept (≥ 0 s; τ in the paper)"
    assert describe(Example)[1].range_text == "1 to 9"


def test_what_is_built_reads_back():
    made = build(Example, {"patience": 2, "mode": "wild"})
    assert values(made) == {"patience": 2.0, "count": 3, "mode": "wild", "strict": False}
    assert isinstance(made.patience, float)


def test_numpy_numbers_are_numbers():
    made = build(Example, {"patience": np.float32(2), "count": np.int64(4)})
    assert (type(made.patience), type(made.count)) == (float, int)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"patience": -1.0}, "patience = -1.0 is out of range: it must be ≥ 0 s"),
        ({"patience": float("nan")}, "out of range"),
        ({"patience": float("inf")}, "out of range"),
        ({"patience": 10**400}, "out of range"),
        ({"count": 10}, "count = 10 is out of range: it must be 1 to 9"),
        ({"count": 2.5}, "is not a whole number"),
        ({"count": True}, "is not a whole number"),
        ({"mode": "mad"}, "calm or wild"),
        ({"strict": 1}, "true or false"),
        ({"patiense": 1.0}, "did you mean 'patience'"),
    ],
)
def test_a_wrong_value_is_named_with_what_would_do(given, said):
    with pytest.raises(ParameterError, match=said.replace("(", r"\(")):
        build(Example, given)

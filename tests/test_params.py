"""Parameters: one declaration, read by checks, command line and docs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from perdure.errors import ParameterError
from perdure.params import Schedule, build, describe, parameter, values


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


@dataclass(frozen=True)
class Changing:
    gain: Schedule = parameter(Schedule(0.8), "how much is believed", low=0.0, high=1.0)


@pytest.mark.parametrize("given", ["0.1,0.5@40", [(0, 0.1), (40, 0.5)], ((0, np.float32(0.125)), (40, 0.5))])
def test_a_schedule_is_a_number_from_a_frame_on(given):
    gain = build(Changing, {"gain": given}).gain
    assert [gain.at(frame) for frame in (0, 39)] == [pytest.approx(0.1, abs=0.03)] * 2
    assert [gain.at(frame) for frame in (40, 10**6)] == [0.5, 0.5]


@pytest.mark.parametrize("given", [0.5, "0.5", "0.50@0", np.float64(0.5)])
def test_a_schedule_of_one_number_is_that_number(given):
    made = build(Changing, {"gain": given})
    assert values(made) == {"gain": "0.5"}
    assert made == build(Changing, values(made))
    assert made.gain.steps == ((0, 0.5),)


@pytest.mark.parametrize("given", ["0.1,2@40", -0.1, "nan", [(0, 0.1), (9, float("inf"))], 10**400])
def test_a_schedule_out_of_range_is_refused(given):
    with pytest.raises(ParameterError, match=r"gain = .*(out of range: it must be 0 to 1|is not a number)"):
        build(Changing, {"gain": given})


@pytest.mark.parametrize(
    "given", ["", "high", "0.1,0.5", "0.5@40", "0.1,0.5@9,0.6@9", "0.1@x", True, None, [3], []]
)
def test_what_is_no_schedule_is_refused(given):
    with pytest.raises(ParameterError, match=r"gain = .* is not a number, or numbers as"):
        build(Changing, {"gain": given})

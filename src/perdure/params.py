"""One declaration per parameter: default, meaning, unit, range, the paper's symbol.

A detector or tracker is a frozen dataclass whose fields are made by `parameter`. The command line,
the parameter file, the docs and the checks are all read off that one declaration.

Examples
--------
>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Example:
...     patience: float = parameter(1.0, "how long an unseen target is kept", unit="s", low=0.0)
>>> describe(Example)[0].range_text
'≥ 0 s'
>>> check(Example(patience=-1.0))
Traceback (most recent call last):
...
perdure.errors.ParameterError: patience = -1.0 is out of range: it must be ≥ 0 s (how long an unseen target is kept)
"""

from __future__ import annotations

import dataclasses
import difflib
import itertools
import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar, get_type_hints

import numpy as np

from perdure.errors import ParameterError

T = TypeVar("T")
Value = bool | int | float | str


class Schedule(str):
    """A number that may change from frame to frame: '0.1,0.5@40' is 0.1, and 0.5 from frame 40 on.

    Frames are the source's own and count from 0. It is made from such a text, a number, or pairs (frame, number).

    Raises
    ------
    ParameterError
        For what is no such text, or has frames that do not rise from 0.

    Examples
    --------
    >>> Schedule(0.5)
    '0.5'
    >>> Schedule([(0, 0.1), (40, 0.5)]).at(39)
    0.1
    """

    __slots__ = ()

    def __new__(cls, given: object) -> Schedule:
        """Return the schedule that is meant."""
        if isinstance(given, cls):
            return given
        steps = _steps(given)
        frames = [frame for frame, _ in steps]
        if not steps or frames[0] != 0 or any(late <= early for early, late in itertools.pairwise(frames)):
            raise ParameterError(f"{given!r} is not {_KIND_WORDS[cls]}: its frames must rise from 0")
        words = [f"{number:.12g}" if frame == 0 else f"{number:.12g}@{frame}" for frame, number in steps]
        return super().__new__(cls, ",".join(words))

    @property
    def steps(self) -> tuple[tuple[int, float], ...]:
        """Pairs of a frame and the number from it on, the first from frame 0."""
        return _steps(str(self))

    def at(self, frame: int) -> float:
        """Return the number of a frame; before the first one it is that of the first."""
        steps = self.steps
        return next((number for since, number in reversed(steps) if since <= frame), steps[0][1])


def _steps(given: object) -> tuple[tuple[int, float], ...]:
    """Pairs of a frame and a number, of a text, a number or pairs."""
    try:
        if isinstance(given, str):
            parts = [part.partition("@") for part in given.split(",")]
            return tuple((int(frame) if at else 0, float(number)) for number, at, frame in parts)
        if isinstance(given, Sequence):
            return tuple((int(frame), float(number)) for frame, number in given)
        if isinstance(given, numbers.Real) and not isinstance(given, (bool, np.bool_)):
            return ((0, float(given)),)
    except (TypeError, ValueError, OverflowError):
        pass
    raise ParameterError(f"{given!r} is not {_KIND_WORDS[Schedule]}")


@dataclass(frozen=True)
class Parameter:
    """The declaration of one parameter, as `describe` reads it off a dataclass."""

    name: str
    kind: type
    default: Value
    help: str
    unit: str
    low: float
    high: float
    choices: tuple[str, ...]
    symbol: str

    @property
    def range_text(self) -> str:
        """The allowed values in words, with the unit: '0 to 1', '≥ 0 s', 'a or b'."""
        if self.choices:
            return " or ".join(self.choices)
        unit = f" {self.unit}" if self.unit else ""
        if math.isfinite(self.low) and math.isfinite(self.high):
            return f"{self.low:g} to {self.high:g}{unit}"
        if math.isfinite(self.low):
            return f"≥ {self.low:g}{unit}"
        if math.isfinite(self.high):
            return f"≤ {self.high:g}{unit}"
        return unit.strip()

    @property
    def full_help(self) -> str:
        """Meaning, range with unit, and the paper's symbol, in one line."""
        notes = [text for text in (self.range_text, self.symbol and f"{self.symbol} in the paper") if text]
        return f"{self.help} ({'; '.join(notes)})" if notes else self.help


def parameter(
    default: T,
    help: str,
    *,
    unit: str = "",
    low: float = -math.inf,
    high: float = math.inf,
    choices: tuple[str, ...] = (),
    symbol: str = "",
) -> T:
    """Declare one parameter of a detector or tracker as a dataclass field.

    Parameters
    ----------
    default : bool, int, float or str
        Its value when nobody says otherwise.
    help : str
        What it means, in words a user understands.
    unit : str
        's', 'px', 'object sizes', 'grey levels', …; empty for a pure number.
    low, high : float
        Inclusive range.
    choices : tuple of str
        The allowed words, for a parameter that is a word.
    symbol : str
        The paper's letter for it.
    """
    declared = {"help": help, "unit": unit, "low": low, "high": high, "choices": choices, "symbol": symbol}
    field: T = dataclasses.field(default=default, metadata={"parameter": declared})
    return field


def describe(kind: type) -> tuple[Parameter, ...]:
    """Return the declarations of all parameters of a dataclass, in order."""
    hints = get_type_hints(kind)
    return tuple(
        Parameter(
            name=field.name,
            kind=hints[field.name],
            default=getattr(kind, field.name),
            **field.metadata["parameter"],
        )
        for field in dataclasses.fields(kind)
        if "parameter" in field.metadata
    )


def check(instance: object) -> None:
    """Refuse a detector or tracker that has a parameter out of range.

    Raises
    ------
    ParameterError
        Naming the parameter, its value and its range.
    """
    for declared in describe(type(instance)):
        check_value(declared, getattr(instance, declared.name))


def check_value(declared: Parameter, value: object) -> None:
    """Refuse one value that is not of its parameter's kind or out of its range."""
    if declared.kind is Schedule:
        _check_schedule(declared, value)
        return
    if not _is_kind(value, declared.kind):
        raise ParameterError(
            f"{declared.name} = {value!r} is not {_KIND_WORDS[declared.kind]} ({declared.full_help})"
        )
    if declared.choices:
        if value not in declared.choices:
            raise ParameterError(f"{declared.name} = {value!r} is not known: it must be {declared.range_text}")
        return
    if isinstance(value, numbers.Real) and not declared.low <= _finite(value) <= declared.high:
        span = f": it must be {declared.range_text}" if declared.range_text else ": it must be a finite number"
        raise ParameterError(f"{declared.name} = {value!r} is out of range{span} ({declared.help})")


def _check_schedule(declared: Parameter, value: object) -> None:
    """Refuse what is no schedule, or has a number out of range."""
    try:
        steps = Schedule(value).steps
    except ParameterError as error:
        raise ParameterError(f"{declared.name} = {error} ({declared.full_help})") from None
    for _, number in steps:
        if not declared.low <= number <= declared.high or math.isinf(number):
            raise ParameterError(
                f"{declared.name} = {value!r} is out of range: it must be {declared.range_text} ({declared.help})"
            )


def values(instance: object) -> dict[str, Value]:
    """Return the parameters of a detector or tracker as a plain dict, ready for JSON."""
    return {declared.name: getattr(instance, declared.name) for declared in describe(type(instance))}


def build(kind: type[T], given: Mapping[str, object]) -> T:
    """Make a detector or tracker from named values, checked; what is not given keeps its default.

    Raises
    ------
    ParameterError
        For a name that `kind` does not have (with the nearest one) or a value out of range.
    """
    declared = {one.name: one for one in describe(kind)}
    arguments: dict[str, Any] = {}
    for name, value in given.items():
        if name not in declared:
            raise ParameterError(unknown_name(f"parameter of {kind.__name__}", name, declared))
        check_value(declared[name], value)
        arguments[name] = declared[name].kind(value)  # a NumPy number becomes a plain one
    return kind(**arguments)


def unknown_name(what: str, name: str, known: Iterable[str]) -> str:
    """Say that `name` is not a known `what`, with the nearest known one or all of them."""
    known = sorted(known)
    near = difflib.get_close_matches(str(name), known, n=1)
    hint = f"did you mean {near[0]!r}?" if near else f"there are: {', '.join(known) or 'none'}"
    return f"{name!r} is not a {what}; {hint}"


_KIND_WORDS: Mapping[type, str] = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "a word",
    Schedule: "a number, or numbers as '0.1,0.5@40', each from a frame on",
}


def _finite(value: numbers.Real) -> float:
    """The number as a float; what is not finite, or larger than any, is nan: in no range."""
    try:
        number = float(value)
    except OverflowError:
        return math.nan
    return number if math.isfinite(number) else math.nan


def _is_kind(value: object, kind: type) -> bool:
    if kind is float:
        return isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_))
    if kind is int:
        return isinstance(value, numbers.Integral) and not isinstance(value, (bool, np.bool_))
    return isinstance(value, kind)

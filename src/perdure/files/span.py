"""Which part of a source is wanted: from a moment, up to a moment, every so many frames.

A moment is seconds (12.5, '12.5', '1:02', '0:01:02.5') or a frame number ('300f').
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from numbers import Integral, Rational, Real
from pathlib import Path

from perdure.errors import ParameterError

_SLACK = 1e-6  # s: timestamps are rounded to the container's own ticks
_LONGEST = 10**9  # s, or frames
_CLOCK = re.compile(r"(?:(?:(\d+):)?(\d{1,2}):)?(\d+(?:\.\d*)?|\.\d+)")


@dataclass(frozen=True)
class Moment:
    """A place in a source: a time in seconds, or a frame counted from 0."""

    seconds: float = 0.0
    frame: int | None = None

    def reached(self, index: int, time: float) -> bool:
        """Return whether the frame is at this moment or after it."""
        return time >= self.seconds - _SLACK if self.frame is None else index >= self.frame

    def number(self, fps: float) -> int:
        """Return the first frame at or after this moment, where all frames are equally long."""
        return max(0, math.ceil((self.seconds - _SLACK) * fps)) if self.frame is None else self.frame

    def __str__(self) -> str:
        return f"{self.seconds:g} s" if self.frame is None else f"frame {self.frame}"

    @property
    def given(self) -> str:
        """As the user may give it."""
        return f"{self.seconds:g}" if self.frame is None else f"{self.frame}f"


@dataclass(frozen=True)
class Span:
    """The wanted part: `start` inclusive, `end` exclusive, every `stride`-th frame from the first."""

    start: Moment | None = None
    end: Moment | None = None
    stride: int = 1

    def reached(self, index: int, time: float) -> bool:
        """Return whether the frame is not before the start."""
        return self.start is None or self.start.reached(index, time)

    def passed(self, index: int, time: float) -> bool:
        """Return whether the frame is at the end or after it."""
        return self.end is not None and self.end.reached(index, time)

    def numbers(self, count: int, fps: float) -> range:
        """Return the wanted frames of a source of `count` frames that are equally long."""
        first = 0 if self.start is None else self.start.number(fps)
        stop = count if self.end is None else min(count, self.end.number(fps))
        return range(first, max(first, stop), self.stride)


def read_span(start: str | float | None, end: str | float | None, stride: int) -> Span:
    """Read the wanted part from what the user gave.

    Raises
    ------
    ParameterError
        For a moment that is malformed, negative or beyond 10^9, a start that is not before the end, an
        end at the very beginning, or a stride below 1.
    """
    if isinstance(stride, bool) or not isinstance(stride, Integral) or stride < 1:
        raise ParameterError(f"stride = {shown(stride)} is out of range: it must be a whole number ≥ 1")
    span = Span(read_moment("start", start), read_moment("end", end), int(stride))
    if span.end is not None and not (span.end.frame or span.end.seconds):
        raise ParameterError(no_frame(Span(end=span.end)))
    if span.start is not None and span.end is not None:
        same_kind = (span.start.frame is None) == (span.end.frame is None)
        before = (span.start.frame or span.start.seconds) < (span.end.frame or span.end.seconds)
        if same_kind and not before:
            raise ParameterError(f"start ({span.start}) must lie before end ({span.end})")
    return span


def frame_of(given: str, name: str) -> int:
    """Return the number of a frame, from 0, as a user writes it: '10', or '10f' as for `--start`.

    Raises
    ------
    ParameterError
        For what is no such number.

    >>> frame_of("10", "frame"), frame_of("10f", "frame")
    (10, 10)
    """
    digits = given.strip().removesuffix("f")
    if not re.fullmatch(r"[0-9]+", digits) or _whole(digits) > _LONGEST:
        raise ParameterError(f"{name} = {shown(given)} is no number of a frame; write '10' or '10f', from 0")
    return int(digits)


def no_frame(span: Span) -> str:
    """Say that no frame lies in a span, and what would do."""
    if span.start is None and span.end is not None:
        return f"end = {span.end.given} leaves no frame: the first is at 0 s, give a later end"
    return f"no frame lies between start ({span.start}) and end ({span.end}): give a later end"


def shown(value: object) -> str:
    """Return a value as a message of one line may show it, cut where it is long.

    >>> shown(True), shown("a film"), shown({}), shown(2.5)
    ('true', "'a film'", 'a table', '2.5')
    """
    if isinstance(value, (str, Path)):
        return f"'{cut(str(value))}'"
    if isinstance(value, bool) or value is None:
        return "nothing" if value is None else str(value).lower()
    if isinstance(value, Rational) and abs(real(value)) >= 1e18:
        return "a number of more than 18 digits"
    if isinstance(value, Real):
        return str(value) if isinstance(value, Integral) else f"{float(value):g}"
    kind = "table" if isinstance(value, dict) else type(value).__name__
    return kind if kind == "bytes" else f"an {kind}" if kind[:1].lower() in "aeiou" else f"a {kind}"


def cut(text: str, most: int = 60) -> str:
    """Return a text on one line of visible letters, cut where it is longer."""
    line = "".join(one if one.isprintable() else " " for one in text[: most + 1])
    return line if len(line) <= most else line[:most] + "…"


def real(value: object) -> float:
    """Return a number as a float: infinite where it is too large, NaN for what is none, also yes and no."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.inf


def read_moment(what: str, given: str | float | None) -> Moment | None:
    """Return the moment that a user means, `what` by name; None for none.

    Raises
    ------
    ParameterError
        For what is malformed, negative or beyond 10^9.
    """
    if given is None:
        return None
    moment = _read_moment(given.strip()) if isinstance(given, str) else _seconds(given)
    if moment is None:
        raise ParameterError(
            f"{what} = {shown(given)} is not a moment: give seconds ('12.5'), a time ('1:02' or '0:01:02.5')"
            " or a frame ('300f'), not below 0, minutes and seconds up to 59"
        )
    if max(moment.seconds, moment.frame or 0) > _LONGEST:
        raise ParameterError(f"{what} = {shown(given)} is out of range: it must be up to {_LONGEST} s or frames")
    return moment


def _seconds(given: object) -> Moment | None:
    """A number of seconds; None for what is none."""
    seconds = real(given)
    return Moment(seconds) if seconds >= 0 else None


def _read_moment(text: str) -> Moment | None:
    """A time or a frame from its text; None for a text that is neither."""
    if re.fullmatch(r"\d+f", text):
        return Moment(frame=_whole(text[:-1]))
    match = _CLOCK.fullmatch(text)
    if match is None:
        return None
    hours, minutes, seconds = match.groups()
    if minutes is not None and (float(seconds) >= 60 or (hours is not None and int(minutes) >= 60)):
        return None
    return Moment(_whole(hours or "0") * 3600.0 + int(minutes or 0) * 60 + float(seconds))


def _whole(digits: str) -> int:
    """A whole number; one of very many digits only as large as shows that it is out of range."""
    return int(digits) if len(digits) <= 18 else 10**18


def seconds_of(given: str, name: str) -> float:
    """Return how many seconds a length of time is, as a user writes it: '90', '1:30', '0:01:30', '90s', '15m', '1h'.

    Raises
    ------
    ParameterError
        For what is no such time.

    >>> seconds_of("1:30", "for"), seconds_of("2h", "roll")
    (90.0, 7200.0)
    """
    unit = {"s": 1.0, "m": 60.0, "h": 3600.0, "d": 86400.0}.get(given[-1:])
    clock = _CLOCK.fullmatch(given if unit is None else given[:-1])
    if clock is None or (unit is not None and ":" in given):
        raise ParameterError(
            f"{name} = {shown(given)} is no length of time; write '90s', '15m', '1h' or '1:30:00'"
        )
    hours, minutes, seconds = (float(part or 0) for part in clock.groups())
    total = (3600 * hours + 60 * minutes + seconds) * (unit or 1.0)
    if total > _LONGEST:
        raise ParameterError(f"{name} = {shown(given)} is longer than can be")
    return total

"""Which part of a source is wanted: from a moment, up to a moment, every so many frames.

A moment is seconds (12.5, '12.5', '1:02', '0:01:02.5') or a frame number ('300f').
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from perdure.errors import ParameterError

_SLACK = 1e-6  # s: timestamps are rounded to the container's own ticks
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
        For a moment that is malformed or negative, a start that is not before the end, or a stride
        below 1.
    """
    if isinstance(stride, bool) or not isinstance(stride, int) or stride < 1:
        raise ParameterError(f"stride = {stride!r} is out of range: it must be a whole number ≥ 1")
    span = Span(_moment("start", start), _moment("end", end), stride)
    if span.start is not None and span.end is not None:
        same_kind = (span.start.frame is None) == (span.end.frame is None)
        before = (span.start.frame or span.start.seconds) < (span.end.frame or span.end.seconds)
        if same_kind and not before:
            raise ParameterError(f"start ({span.start}) must lie before end ({span.end})")
    return span


def _moment(what: str, given: str | float | None) -> Moment | None:
    if given is None:
        return None
    text = str(given).strip()
    if re.fullmatch(r"\d+f", text):
        return Moment(frame=int(text[:-1]))
    if isinstance(given, (int, float)) and math.isfinite(given) and given >= 0:
        return Moment(float(given))
    match = _CLOCK.fullmatch(text)
    if match is None:
        raise ParameterError(
            f"{what} = {given!r} is not a moment: give seconds ('12.5'), a time ('1:02' or '0:01:02.5')"
            " or a frame ('300f'), not below 0"
        )
    hours, minutes, seconds = match.groups()
    if minutes is not None and (float(seconds) >= 60 or (hours is not None and int(minutes) >= 60)):
        raise ParameterError(f"{what} = {given!r} is not a moment: minutes and seconds go up to 59")
    return Moment(int(hours or 0) * 3600 + int(minutes or 0) * 60 + float(seconds))

"""Times that increase: a source's own timestamps, made whole where they are missing or run back."""

from __future__ import annotations


class Clock:
    """Turns the timestamps of successive frames into strictly increasing seconds.

    Parameters
    ----------
    rate : float
        Nominal frames per second: how far a frame without a timestamp is from the one before it.
    origin : float or None
        The timestamp, in seconds, that is time 0; None for that of the first frame that has one.
    fixed : float or None
        Where given, the timestamps are not used: the time is index / fixed.
    warnings : list of str
        Gets one line at the first repair.
    """

    def __init__(
        self, rate: float, warnings: list[str], origin: float | None = None, fixed: float | None = None
    ) -> None:
        self.rate = rate
        self.fixed = fixed
        self.warnings = warnings
        self.origin = origin
        self.last: float | None = None

    @property
    def next_time(self) -> float:
        """When the next frame is to be expected."""
        return 0.0 if self.last is None else self.last + 1.0 / (self.fixed or self.rate)

    def time(self, index: int, seconds: float | None) -> float:
        """Return the time of the next frame, given its own timestamp or None."""
        self.last = index / self.fixed if self.fixed else self._own_time(index, seconds)
        return self.last

    def _own_time(self, index: int, seconds: float | None) -> float:
        if seconds is None:
            return index / self.rate if self.last is None else self.next_time
        if self.origin is None:
            self.origin = seconds
        time = seconds - self.origin
        if self.last is None or time > self.last:
            return max(0.0, time)
        self._warn(index)
        if self.last - time > 1.0:  # the source's clock was set back: go on from here
            self.origin = seconds - self.next_time
            return self.next_time
        return self.last + 0.25 / self.rate  # two frames changed places, or share a time

    def _warn(self, index: int) -> None:
        text = "its timestamps do not always increase"
        if not any(one.startswith(text) for one in self.warnings):
            self.warnings.append(f"{text} (first at frame {index}); they were repaired")

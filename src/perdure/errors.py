"""What can go wrong, as a tree; every message says what, why and what would do.

PerdureError
├── VideoError          a source that cannot be opened or decoded
│   └── DamagedVideo    a source that broke off: what came before it is good
├── FormatError         a file that is not what it should be (names file, line, reason)
├── ParameterError      a value out of its range, or a name that is not known
├── DetectorError       a detector of the caller's own that failed (its exception is the cause)
├── OutputError         a place that cannot be written, or that holds something already
└── StateError          a saved state of another version or another kind
"""

from __future__ import annotations


class PerdureError(Exception):
    """Root of all errors that are the caller's to mend; its text is meant to be read."""


class VideoError(PerdureError):
    """A source that cannot be opened or holds no video."""


class DamagedVideo(VideoError):
    """A source that broke off; every frame before `index` was delivered.

    Parameters
    ----------
    message : str
        What was found and where.
    index : int
        Number of the first frame that is missing, counted from 0.
    time : float
        Time in seconds where the source broke off.
    """

    def __init__(self, message: str, index: int, time: float) -> None:
        super().__init__(message)
        self.index = index
        self.time = time


class FormatError(PerdureError):
    """A file that is not what it should be."""


class ParameterError(PerdureError):
    """A value out of range, or a name that is not known."""


class DetectorError(PerdureError):
    """A detector of the caller's own that raised an exception, which is the cause of this one.

    Parameters
    ----------
    message : str
        Which detector, in which frame, where in its code, and what it raised.
    index : int
        Number of the frame, counted from 0; every frame before it was tracked.
    """

    def __init__(self, message: str, index: int) -> None:
        super().__init__(message)
        self.index = index


class OutputError(PerdureError):
    """A place that cannot be written, or that already holds something."""


class StateError(PerdureError):
    """A saved state that this version, detector or tracker cannot take up."""

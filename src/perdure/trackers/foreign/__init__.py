"""Trackers of other libraries, run in a process of their own."""

from perdure.trackers.foreign.tracker import LIBRARIES, Foreign, ForeignState

__all__ = ["LIBRARIES", "Foreign", "ForeignState"]

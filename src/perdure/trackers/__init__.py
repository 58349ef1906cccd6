"""Trackers: regions in, reports out; none imports another."""

from __future__ import annotations

from typing import Any

from perdure.trackers.compound import Compound, CompoundState
from perdure.trackers.overlap import Overlap
from perdure.trackers.trackcut import TrackCut, TrackCutState

__all__ = ["TRACKERS", "Compound", "CompoundState", "Overlap", "TrackCut", "TrackCutState"]

TRACKERS: dict[str, type[Any]] = {"compound": Compound, "overlap": Overlap, "trackcut": TrackCut}

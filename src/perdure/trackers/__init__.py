"""Trackers: regions in, reports out; none imports another."""

from __future__ import annotations

from typing import Any

from perdure.trackers.compound import Compound, CompoundState
from perdure.trackers.contour import Contour, ContourState
from perdure.trackers.multifeature import MultiFeature, MultiFeatureState
from perdure.trackers.overlap import Overlap
from perdure.trackers.trackcut import TrackCut, TrackCutState

__all__ = [
    "TRACKERS",
    "Compound",
    "CompoundState",
    "Contour",
    "ContourState",
    "MultiFeature",
    "MultiFeatureState",
    "Overlap",
    "TrackCut",
    "TrackCutState",
]

TRACKERS: dict[str, type[Any]] = {  # of those that follow marks, the first is taken where none is named
    "compound": Compound,
    "multifeature": MultiFeature,
    "overlap": Overlap,
    "trackcut": TrackCut,
    "contour": Contour,
}

"""Perdure: follow every moving thing in a video, through merges, splits and occlusions, with no training.

>>> import numpy as np
>>> import perdure
>>> blank = np.zeros((48, 64, 3), np.uint8)
>>> perdure.track([blank, blank, blank])
Tracks(no rows)
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from perdure.errors import (
        DamagedVideo,
        DetectorError,
        FormatError,
        OutputError,
        ParameterError,
        PerdureError,
        StateError,
        VideoError,
    )
    from perdure.fold import Detector, Step, Tracker, settle
    from perdure.online import Online
    from perdure.pipeline import follow, plan, track
    from perdure.states import load, save
    from perdure.types import Event, Frame, Mask, Outline, Regions, Report, Scene, Status, Tracks
    from perdure.types.detections import to_regions, to_supervision

_HOME = {
    "perdure.errors": [
        "DamagedVideo",
        "DetectorError",
        "FormatError",
        "OutputError",
        "ParameterError",
        "PerdureError",
        "StateError",
        "VideoError",
    ],
    "perdure.fold": ["Detector", "Step", "Tracker", "settle"],
    "perdure.online": ["Online"],
    "perdure.pipeline": ["follow", "plan", "track"],
    "perdure.states": ["load", "save"],
    "perdure.types.detections": ["to_regions", "to_supervision"],
    "perdure.types": ["Event", "Frame", "Mask", "Outline", "Regions", "Report", "Scene", "Status", "Tracks"],
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "DamagedVideo",
    "Detector",
    "DetectorError",
    "Event",
    "FormatError",
    "Frame",
    "Mask",
    "Online",
    "Outline",
    "OutputError",
    "ParameterError",
    "PerdureError",
    "Regions",
    "Report",
    "Scene",
    "StateError",
    "Status",
    "Step",
    "Tracker",
    "Tracks",
    "VideoError",
    "follow",
    "load",
    "plan",
    "save",
    "settle",
    "to_regions",
    "to_supervision",
    "track",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first asked for, so that `import perdure` stays light."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'perdure' has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])

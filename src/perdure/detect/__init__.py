"""Detectors: pixels in, regions out; each is a fold with a state of its own."""

from __future__ import annotations

from typing import Any

from perdure.detect.background import Background
from perdure.detect.box_masks import BoxMasks
from perdure.detect.called import Called
from perdure.detect.marked import Mark, Marked
from perdure.detect.network import Network
from perdure.detect.people import People
from perdure.detect.recorded import Recorded
from perdure.detect.with_marks import WithMarks

__all__ = [
    "DETECTORS",
    "Background",
    "BoxMasks",
    "Called",
    "Mark",
    "Marked",
    "Network",
    "People",
    "Recorded",
    "WithMarks",
]

DETECTORS: dict[str, type[Any]] = {
    "background": Background,
    "people": People,
    "recorded": Recorded,
    "marked": Marked,
    "onnx": Network,
    "openvino": Network,
    "function": Called,
}

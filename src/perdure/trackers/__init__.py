"""Trackers: regions in, reports out; none imports another."""

from __future__ import annotations

from typing import Any

from perdure.trackers.overlap import Overlap

__all__ = ["TRACKERS", "Overlap"]

TRACKERS: dict[str, type[Any]] = {"overlap": Overlap}

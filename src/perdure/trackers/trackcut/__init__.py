"""Track and Cut: tracking and segmentation in one energy (Bugeau & Pérez)."""

from perdure.trackers.trackcut.tracker import TrackCut, TrackCutState

__all__ = ["TrackCut", "TrackCutState"]

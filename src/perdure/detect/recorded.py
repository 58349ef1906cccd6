"""Regions that were recorded before: another program's detections, or a file of `perdure detect`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from perdure.detect.plausible import centred_in
from perdure.params import parameter
from perdure.types import Frame, Regions, Scene


@dataclass(frozen=True, eq=False)
class RecordedState:
    """The region of interest and where one is; all else is in the record."""

    roi: np.ndarray[tuple[int, int], np.dtype[np.bool_]] | None
    next: int = -1  # the frame after the last one; -1 before the first


@dataclass(frozen=True)
class Recorded:
    """Regions looked up by frame number; a frame that is not in the record has none.

    >>> detector = Recorded(regions={0: Regions.of([[0, 0, 9, 9]], scores=[0.2])}, least_score=0.5)
    >>> _, regions = detector.step(detector.start(Scene(64, 48)), Frame(0, 0.0))
    >>> len(regions)
    0
    """

    least_score: float = parameter(0.0, "recorded regions with a lower score are left out", low=0.0, high=1.0)
    regions: Mapping[int, Regions] = field(default_factory=dict, repr=False, compare=False)

    needs_pixels = False

    def start(self, scene: Scene) -> RecordedState:
        """Return the state before the first frame."""
        return RecordedState(scene.roi)

    def step(self, state: RecordedState, frame: Frame) -> tuple[RecordedState, Regions]:
        """Return the recorded regions of one frame whose centre lies in the roi, and events of frames that were skipped."""
        regions = self.regions.get(frame.index, Regions.empty())
        between = range(state.next if state.next >= 0 else frame.index, frame.index)
        skipped = [event for index in between if index in self.regions for event in self.regions[index].events]
        if skipped:
            regions = dataclasses.replace(regions, events=(*skipped, *regions.events))
        state = dataclasses.replace(state, next=frame.index + 1)
        kept = regions.scores >= self.least_score
        kept = kept & centred_in(regions.boxes, state.roi)
        return state, regions if kept.all() else regions.take(kept)

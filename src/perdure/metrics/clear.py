"""CLEAR counts (Bernardin & Stiefelhagen 2008): how many objects were found, how many rows were wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from perdure.features.boxes import overlaps
from perdure.maths.assign import assign
from perdure.types import Tracks


@dataclass(frozen=True)
class Clear:
    """Counts over all frames; the ratios are 1 where there was nothing to find or nothing was said."""

    truth: int  # rows of the truth
    found: int  # of those matched
    wrong: int  # rows said that match nothing
    switches: int  # an object's id differs from the one it had when last found

    @property
    def recall(self) -> float:
        """Found rows / rows of the truth."""
        return self.found / self.truth if self.truth else 1.0

    @property
    def precision(self) -> float:
        """Right rows / rows said."""
        return self.found / (self.found + self.wrong) if self.found + self.wrong else 1.0

    @property
    def mota(self) -> float:
        """1 - (missed + wrong + switches) / rows of the truth."""
        missed = self.truth - self.found
        return 1.0 - (missed + self.wrong + self.switches) / self.truth if self.truth else 1.0


def clear(said: Tracks, truth: Tracks, least_overlap: float = 0.5) -> Clear:
    """Match said rows to the truth frame by frame, keeping an object's id as long as it still overlaps.

    >>> row = Tracks.of(frames=[0, 1], times=[0, 1], ids=[7, 8], boxes=[[0, 0, 9, 9], [0, 0, 9, 9]])
    >>> clear(row, row.replace(ids=np.array([1, 1])))
    Clear(truth=2, found=2, wrong=0, switches=1)
    """
    last: dict[int, int] = {}
    found = switches = 0
    for frame in np.union1d(said.frames, truth.frames):
        here, there = said.in_frame(frame), truth.in_frame(frame)
        overlap = overlaps(there.boxes, here.boxes).astype(np.float64)  # (N, M)
        kept = np.array([[last.get(int(one)) == other for other in here.ids] for one in there.ids], bool)
        # An unbroken pair comes before any better overlap.
        cost = np.where(kept.reshape(overlap.shape), 0.0, 2.0 - overlap)
        pairs = assign(np.where(overlap >= least_overlap, cost, np.inf)).pairs
        found += len(pairs)
        for row, column in pairs:
            one, other = int(there.ids[row]), int(here.ids[column])
            switches += last.get(one, other) != other
            last[one] = other
    return Clear(len(truth), found, len(said) - found, switches)

"""What boxes of somebody else's detector can be: those that cannot are left out, and it is told how many and why."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import centres
from perdure.types import Bits, Boxes, Event
from perdure.types.regions import FARTHEST

MOST = 300  # boxes in a frame, where nobody says otherwise
MOST_HELP = "of more objects in a frame the surest are kept"
KIND = "unusable"  # of the event that tells of boxes that were left out

Rows = NDArray[np.intp]
Reasons = Mapping[str, int]  # why boxes were left out -> how many


class Sifted(NamedTuple):
    """Which rows can be, in their order, and why others cannot."""

    rows: Rows
    reasons: Reasons


def plausible(boxes: NDArray[np.floating], scores: NDArray[np.floating], most: int) -> Sifted:
    """Return which boxes (N, 4) with scores (N,) can be; of more than `most` the surest, the first of equals.

    Left out are, each for the first reason that holds, boxes with a number that is not finite, without an area (also
    when their corners are exchanged), further out than anything is, and with a score outside [0, 1].
    """
    left = np.ones(len(boxes), np.bool_)
    reasons: dict[str, int] = {}
    with np.errstate(invalid="ignore"):
        tests = {
            "with a number that is not finite": np.isfinite(boxes).all(axis=1) & np.isfinite(scores),
            "without an area": (boxes[:, 2:] > boxes[:, :2]).all(axis=1),
            f"beyond {FARTHEST:g} pixels": (np.abs(boxes) <= FARTHEST).all(axis=1),
            "with a score outside 0 to 1": (scores >= 0) & (scores <= 1),
        }
    for reason, good in tests.items():
        if wrong := int(np.count_nonzero(left & ~good)):
            reasons[reason] = wrong
        left &= good
    rows = np.flatnonzero(left)
    kept = surest(rows, scores, most)
    if len(kept) < len(rows):
        reasons[f"after the surest {most}"] = len(rows) - len(kept)
    return Sifted(kept, reasons)


def surest(rows: Rows, scores: NDArray[np.floating], most: int) -> Rows:
    """Return those `most` of the rows with the highest scores, in the rows' own order; of equals the first."""
    if len(rows) <= most:
        return rows
    order = np.argsort(-scores[rows], kind="stable")[:most]
    return np.asarray(rows[np.sort(order)], np.intp)


def told(frame: int, reasons: Reasons) -> tuple[Event, ...]:
    """Return the event that says how many boxes of a frame were left out and why; none where none was."""
    if not reasons:
        return ()
    words = ", ".join(f"{count} {reason}" for reason, count in reasons.items())
    return (Event(KIND, frame, frame, why=f"{sum(reasons.values())} boxes left out: {words}"),)


@dataclass(frozen=True)
class LeftOut:
    """What was left out so far: how many boxes, and the first event that tells of it."""

    boxes: int = 0
    first: Event | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know of it, in a sentence; nothing where nothing was left out."""
        if self.first is None:
            return ()
        first = f"in frame {self.first.begin}, {self.first.why}"
        return (f"{self.boxes} boxes that the detector gave were left out; first, {first}",)


def left_out(events: Iterable[Event], before: LeftOut | None = None) -> LeftOut:
    """Return what was left out before and by events that tell of it."""
    count, first = (before.boxes, before.first) if before is not None else (0, None)
    for event in events:
        if event.kind == KIND:
            count, first = count + int(event.why.split()[0]), first or event
    return LeftOut(count, first)


def centred_in(boxes: Boxes, roi: Bits | None) -> NDArray[np.bool_]:
    """Return whether the centre of each box (N, 4) lies in the roi (H, W), (N,); a centre outside counts at the border."""
    if roi is None or not len(boxes):
        return np.ones(len(boxes), np.bool_)
    height, width = roi.shape
    x, y = np.clip(centres(boxes), 0, (width - 1, height - 1)).astype(np.intp).T
    return np.asarray(roi[y, x], np.bool_)

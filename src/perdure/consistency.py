"""How well a run agrees with itself, where nobody knows the truth: followed backwards, and held against its regions.

Who is followed right is the same from either end of time. Of what goes wrong (a meeting after which two have changed
their names, a target lost and begun anew) the way back seldom goes wrong alike. The converse does not hold: a tracker
that says little agrees with itself, too; so it is also asked how much of what was seen its rows explain.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from perdure import fold
from perdure.detection import recorded
from perdure.errors import ParameterError
from perdure.files.video import open_source
from perdure.metrics.compared import compare
from perdure.metrics.scoring import Score, score_compared
from perdure.pipeline import Plan
from perdure.types import Frame, Regions, Rows, Status, Tracks

_AT_ONCE = 50  # frames held while a film is read backwards


@dataclass(frozen=True)
class Consistency:
    """What a run tells of itself, each in [0, 1], higher is better.

    Parameters
    ----------
    agreement : float
        IDF1 of the run forwards held against the run backwards.
    explained : float
        Share of what regions and rows cover together that both cover: intersection over union of their boxes, by
        frames, weighted by area. A region that no row rests on, and a row where nothing is seen, count alike.
    sureness : float
        Mean confidence of the rows that count; ambiguous ones count as 0.
    """

    agreement: float
    explained: float
    sureness: float

    @property
    def whole(self) -> float:
        """Agreement times what is explained, as geometric mean: neither saying little nor saying much pays."""
        return float(np.sqrt(self.agreement * self.explained))


def backwards(made: Plan, first: int, end: int, fps: float | None = None) -> Tracks:
    """Return the settled tracks of frames `first` to `end`, excluded, followed from the last to the first.

    Parameters
    ----------
    made : Plan
        Of a source that can be read again, with recorded regions.
    first, end : int
        Frames of the source.
    fps : float or None
        As given when the source was opened.
    """
    rows = fold.settle(
        step.report for step in fold.track(_from_the_end(made, first, end, fps), made.tracker, made.scene)
    )
    frames = first + end - 1 - rows.frames
    order = np.argsort(frames, kind="stable")
    return rows.replace(frames=frames).take(order) if len(rows) else rows


def agreement(forwards: Rows, back: Rows) -> Score:
    """Score a run held against the same run backwards, as if that were the truth."""
    return score_compared(compare(forwards, back))


def consistency(tracks: Tracks, back: Tracks, regions: dict[int, Regions]) -> Consistency:
    """Return what a run tells of itself: its tracks, those of the run backwards, and the regions by frame."""
    counted = tracks.counted()
    scored = agreement(Rows.of_tracks(counted), Rows.of_tracks(back.counted()))
    unsure = counted.status == Status.AMBIGUOUS
    sureness = float(np.where(unsure, 0.0, counted.confidence).mean()) if len(counted) else 0.0
    return Consistency(scored.identity.f1, explained(counted, regions), sureness)


def explained(tracks: Tracks, regions: dict[int, Regions]) -> float:
    """Return the intersection over union of rows that are seen and regions, summed over frames; 1 where neither is."""
    common = either = 0.0
    seen = tracks.take(np.isin(tracks.status, (Status.VISIBLE, Status.PARTLY_OCCLUDED, Status.AMBIGUOUS)))
    for frame in sorted({*regions, *np.unique(seen.frames).tolist()}):
        rows = seen.in_frame(frame)
        masked = np.array([mask.bits.size > 0 for mask in rows.masks], np.bool_).reshape(-1, 1)
        said = _cover(np.where(masked, rows.visible_boxes, rows.boxes))
        there = _cover(regions[frame].boxes) if frame in regions else np.zeros_like(said)
        height, width = np.maximum(said.shape, there.shape)
        both = [np.pad(one, ((0, height - one.shape[0]), (0, width - one.shape[1]))) for one in (said, there)]
        common += np.count_nonzero(both[0] & both[1])
        either += np.count_nonzero(both[0] | both[1])
    return common / either if either else 1.0


_GRAIN = 4.0  # px, the side of a cell in which boxes are painted


def _cover(boxes: np.ndarray[Any, Any]) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Which cells from the picture's corner on lie in a box."""
    corners = np.maximum(np.rint(np.asarray(boxes, np.float64) / _GRAIN), 0).astype(int).reshape(-1, 4)
    painted = np.zeros((corners[:, 3].max(initial=0), corners[:, 2].max(initial=0)), np.bool_)
    for x1, y1, x2, y2 in corners.tolist():
        painted[y1:y2, x1:x2] = True
    return painted


def _from_the_end(made: Plan, first: int, end: int, fps: float | None) -> Iterator[tuple[Frame, Regions]]:
    """The frames and their regions from the last to the first, counted and timed as if they were a film."""
    if recorded(made.detector) is None:
        raise ParameterError("only recorded regions can be followed backwards; `perdure detect` records them")
    last: float | None = None
    for begin in range(first + (end - 1 - first) // _AT_ONCE * _AT_ONCE, first - 1, -_AT_ONCE):
        until = min(end, begin + _AT_ONCE)
        source = open_source(str(made.source.origin), fps=fps, start=f"{begin}f", end=f"{until}f", stride=1)
        try:
            held = list(made.seen(source))
        finally:
            source.close()
        for frame, regions in reversed(held):
            last = frame.time if last is None else last
            yield Frame(first + end - 1 - frame.index, last - frame.time, frame.image), replace(regions, events=())

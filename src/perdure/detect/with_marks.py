"""What the user marked beside what another detector sees."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from perdure.detect.marked import Mark, Marked, MarkedState
from perdure.features.boxes import areas, intersections
from perdure.features.masks import mask_shares
from perdure.states import kind_of
from perdure.types import Frame, Regions, Report, Scene

S = TypeVar("S")
_SAME = 0.5  # share of a region from which it is what is marked


@dataclass(frozen=True, eq=False)
class WithMarksState(Generic[S]):
    """The place, and the other detector's state."""

    marked: MarkedState
    other: S


@dataclass(frozen=True)
class WithMarks:
    """Another detector's regions; in the frames in which the user marked something, what he marked goes before them.

    In such a frame `data["mark"]` holds the marks' ids, and 0 for every other region. Of the other regions those are
    left out of which half lies in one mark: of the silhouettes, or of the boxes where a region has no silhouette.

    >>> from perdure.detect import Recorded
    >>> from perdure.types import Mask
    >>> cars = {3: Regions.of([[20, 10, 28, 24], [40, 10, 52, 20]]), 4: Regions.of([[42, 10, 54, 20]])}
    >>> walker = Mark(frame=3, id=7, area=Mask(10, 20, np.ones((16, 8), bool)))
    >>> detector = WithMarks(Recorded(regions=cars), marks=(walker,))
    >>> state, regions = detector.step(detector.start(Scene(64, 48)), Frame(3, 0.12))
    >>> regions.boxes.tolist(), regions.data["mark"].tolist()
    ([[20.0, 10.0, 28.0, 26.0], [40.0, 10.0, 52.0, 20.0]], [7, 0])
    """

    detector: Any
    marks: tuple[Mark, ...] = field(default=(), repr=False)

    @property
    def needs_pixels(self) -> bool:
        """Whether the other detector needs pictures."""
        return bool(self.detector.needs_pixels)

    @property
    def state_kind(self) -> Any:
        """What its state is, with the other detector's: for `perdure.states.load`."""
        return WithMarksState[kind_of(self.detector)]  # type: ignore[misc]

    def start(self, scene: Scene) -> WithMarksState[Any]:
        """Return the state before the first frame."""
        return WithMarksState(Marked(self.marks).start(scene), self.detector.start(scene))

    def step(self, state: WithMarksState[Any], frame: Frame) -> tuple[WithMarksState[Any], Regions]:
        """Return the marks of one frame in their order, then the other regions in theirs."""
        marked, given = Marked(self.marks).step(state.marked, frame)
        other, seen = self.detector.step(state.other, frame)
        return WithMarksState(marked, other), _together(given, seen) if len(given) else seen

    def heed(self, state: WithMarksState[Any], report: Report) -> WithMarksState[Any]:
        """Tell the other detector, where it heeds it, what the tracker said."""
        heed = getattr(self.detector, "heed", None)
        return state if heed is None else WithMarksState(state.marked, heed(state.other, report))


def _together(given: Regions, seen: Regions) -> Regions:
    """What is marked, and behind it what else is seen."""
    rest = seen.take(~_is_marked(seen, given))
    count = len(given)
    more = {
        name: np.concatenate([np.zeros((count, *np.shape(values)[1:]), np.asarray(values).dtype), values])
        for name, values in rest.data.items()
    }
    ids = np.concatenate([given.data["mark"], np.zeros(len(rest), np.int64)])
    return Regions(
        np.concatenate([given.boxes, rest.boxes]),
        np.concatenate([given.scores, rest.scores]),
        np.concatenate([given.classes, rest.classes]),
        (*given.masks, *rest.masks),
        {**more, "mark": ids},
        seen.events,
        seen.blind,
    )


def _is_marked(seen: Regions, given: Regions) -> NDArray[np.bool_]:
    """Which regions (N,) are what is marked."""
    of_masks = mask_shares(seen.masks, given.masks)  # (N, M)
    whole = areas(seen.boxes)[:, None]  # (N, 1)
    of_boxes = intersections(seen.boxes, given.boxes) / np.maximum(whole, np.float32(1e-9))
    bare = np.array([not mask.area for mask in seen.masks], np.bool_)[:, None]
    return np.asarray((np.where(bare, of_boxes, of_masks) >= _SAME).any(axis=1), np.bool_)

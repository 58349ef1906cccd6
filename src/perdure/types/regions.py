"""What is seen in a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.types.arrays import Boxes, as_boxes, check_lengths, frozen, row_index, same_columns
from perdure.types.frame import Mask
from perdure.types.report import Event

FARTHEST = 1e6  # px


@dataclass(frozen=True, eq=False)
class Regions:
    """What is seen in one frame: N rows in the detector's own order.

    Parameters
    ----------
    boxes : (N, 4) float32
        Half-open pixels.
    scores : (N,) float32
        In [0, 1]; 1 where the detector gives none.
    classes : (N,) str
        Empty where not known.
    masks : N of Mask
        Empty masks where the detector gives none.
    data : mapping of str to (N, ...) arrays
        Whatever else the detector said, kept; `mark` is the id that the user gave a thing, (N,) int64.
    events : tuple of Event
        What the detector noticed of the place: the light changed, a thing was left behind.
    blind : bool
        Nothing could be seen (the light has just gone): that a thing is missing among the regions means nothing.
    """

    boxes: Boxes
    scores: NDArray[np.float32]
    classes: NDArray[np.str_]
    masks: tuple[Mask, ...]
    data: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    events: tuple[Event, ...] = ()
    blind: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "boxes", as_boxes(self.boxes))
        object.__setattr__(self, "scores", frozen(np.asarray(self.scores, np.float32)))
        object.__setattr__(self, "classes", frozen(np.asarray(self.classes, np.str_)))
        object.__setattr__(self, "masks", tuple(self.masks))
        check_lengths(len(self.boxes), {"scores": self.scores, "classes": self.classes, "masks": self.masks})
        check_lengths(len(self.boxes), self.data)
        if self.scores.ndim != 1 or self.classes.ndim != 1:
            raise ValueError(f"scores and classes must be (N,), not {self.scores.shape} and {self.classes.shape}")
        if not all(isinstance(mask, Mask) for mask in self.masks):
            raise ValueError("a region's mask must be a perdure.Mask; Mask.of_image makes one of a bool picture")
        _check_marks(self.data.get("mark"), len(self.boxes))
        if not (self.boxes[:, :2] <= self.boxes[:, 2:]).all():
            raise ValueError("a region's box must have x1 ≤ x2 and y1 ≤ y2")
        if (np.abs(self.boxes) > FARTHEST).any():
            raise ValueError(f"a region's box may reach {FARTHEST:g} pixels at most")
        if not ((self.scores >= 0) & (self.scores <= 1)).all():
            raise ValueError("a region's score must lie in [0, 1]")

    @staticmethod
    def of(
        boxes: ArrayLike,
        scores: ArrayLike | None = None,
        classes: Sequence[str] | NDArray[np.str_] | None = None,
        masks: Sequence[Mask] | None = None,
        data: Mapping[str, NDArray[Any]] | None = None,
    ) -> Regions:
        """Make regions from boxes; what is not given is filled in.

        >>> len(Regions.of([[10, 20, 30, 60]], scores=[0.9]))
        1
        """
        boxes = as_boxes(boxes)
        count = len(boxes)
        return Regions(
            boxes,
            np.ones(count, np.float32) if scores is None else np.asarray(scores, np.float32),
            np.full(count, "", dtype=np.str_) if classes is None else np.asarray(classes, np.str_),
            (Mask.empty(),) * count if masks is None else tuple(masks),
            {} if data is None else dict(data),
        )

    @staticmethod
    def empty() -> Regions:
        """Return the regions of a frame in which nothing is seen."""
        return Regions.of(np.zeros((0, 4), np.float32))

    def __len__(self) -> int:
        return len(self.boxes)

    def take(self, rows: ArrayLike) -> Regions:
        """Return the named rows (indices or a bool array), in that order."""
        index = row_index(rows, len(self))
        return Regions(
            self.boxes[index],
            self.scores[index],
            self.classes[index],
            tuple(self.masks[i] for i in index),
            {key: np.asarray(values)[index] for key, values in self.data.items()},
            self.events,
            self.blind,
        )

    def equals(self, other: Regions) -> bool:
        """Return whether both say the same, `data` apart."""
        said = self.events == other.events and self.blind == other.blind
        return said and same_columns(self, other, ("boxes", "scores", "classes", "masks"))


def _check_marks(marks: Any, count: int) -> None:
    """Refuse ids of marks that are none."""
    if marks is None:
        return
    ids = np.asarray(marks)
    if ids.shape != (count,) or not np.issubdtype(ids.dtype, np.integer) or (ids < 0).any():
        raise ValueError("data['mark'] must be (N,) whole numbers from 0 on, 0 for what nobody marked")

"""What the user marked: regions of the marked frames, and of no other."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from perdure.detect.silhouette import silhouette
from perdure.types import Bits, Frame, Mask, Regions, Scene


@dataclass(frozen=True)
class Mark:
    """A thing that the user marked in one frame.

    Parameters
    ----------
    frame : int
        Number in the source, counted from 0.
    id : int
        Which thing it is, ≥ 1; 0 before the next free one is given to it.
    area : Mask
        The pixels that were marked, tight.
    rough : bool
        They were drawn around the thing (a box, an outline); else they are its silhouette.
    """

    frame: int
    id: int
    area: Mask
    rough: bool = False

    @property
    def mask(self) -> Mask | None:
        """The silhouette; None where it is to be found in the picture, inside the area."""
        return None if self.rough else self.area

    @property
    def box(self) -> tuple[int, int, int, int]:
        """The box x1, y1, x2, y2 around what was marked."""
        return self.area.box


@dataclass(frozen=True, eq=False)
class MarkedState:
    """The place, as the scene tells it."""

    width: int
    height: int
    roi: np.ndarray[tuple[int, int], np.dtype[np.bool_]] | None


@dataclass(frozen=True)
class Marked:
    """Regions of what the user marked, in the frames in which he did; `data["mark"]` holds the marks' ids, (N,) int64.

    Boxes are tight on the silhouettes, which share no pixel; scores are 1, classes empty. Where only an area was
    drawn around a thing its silhouette is found in the picture; without a picture, or where its colours are those of
    the ground, it is all of the area.

    >>> walker = Mark(frame=3, id=7, area=Mask(10, 20, np.ones((16, 8), bool)))
    >>> detector = Marked(marks=(walker,))
    >>> state, regions = detector.step(detector.start(Scene(64, 48)), Frame(3, 0.12))
    >>> regions.boxes.tolist(), regions.data["mark"].tolist()
    ([[20.0, 10.0, 28.0, 26.0]], [7])
    """

    marks: tuple[Mark, ...] = field(default=(), repr=False)

    needs_pixels = False

    def start(self, scene: Scene) -> MarkedState:
        """Return the state before the first frame."""
        return MarkedState(scene.width, scene.height, scene.roi)

    def step(self, state: MarkedState, frame: Frame) -> tuple[MarkedState, Regions]:
        """Return the regions of the marks of one frame, in their order, as far as they lie in the roi and in sight."""
        here = [mark for mark in self.marks if mark.frame == frame.index]
        if not here:
            return state, Regions.empty()
        free = np.ones((state.height, state.width), np.bool_) if state.roi is None else state.roi.copy()
        masks = [Mask.empty()] * len(here)
        for number in in_order(here):
            masks[number] = _cut_out(here[number], frame, free)
            _take(free, masks[number])
        seen = [(mark.id, mask) for mark, mask in zip(here, masks, strict=True) if mask.area]
        ids = np.array([identity for identity, _ in seen], np.int64)  # (N,)
        boxes = np.array([mask.box for _, mask in seen], np.float32).reshape(-1, 4)
        return state, Regions.of(boxes, masks=[mask for _, mask in seen], data={"mark": ids})


def in_order(marks: Iterable[Mark]) -> list[int]:
    """Return in which order the marks of a frame get their pixels: silhouettes first, then small areas before large."""
    ranks = [(mark.rough, mark.area.area if mark.rough else 0, number) for number, mark in enumerate(marks)]
    return [number for *_, number in sorted(ranks)]


def _cut_out(mark: Mark, frame: Frame, free: Bits) -> Mask:
    """The silhouette of a mark in the pixels that are still free; empty only where none of its area is."""
    height, width = free.shape
    allowed = mark.area.to_image(height, width) & free
    if not mark.rough or frame.image is None:
        return Mask.of_image(allowed)
    found = silhouette(frame.image, mark.area).to_image(height, width) & free
    return Mask.of_image(found if found.any() else allowed)


def _take(free: Bits, mask: Mask) -> None:
    """Take the pixels of a mask that lies in the picture out of the free ones; in place."""
    x1, y1, x2, y2 = mask.box
    free[y1:y2, x1:x2] &= ~mask.bits

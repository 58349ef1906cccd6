"""Silhouettes for a detector that gives boxes: by the background model, or cut out of the picture."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from perdure.detect.background import Background, BackgroundState
from perdure.detect.silhouette import silhouette
from perdure.states import kind_of
from perdure.types import Bits, Boxes, Frame, Image, Mask, Regions, Report, Scene

S = TypeVar("S")
KINDS = ("none", "background", "cut")
_LEAST = 0.05  # of a box: where fewer pixels are found there is no silhouette


@dataclass(frozen=True, eq=False)
class BoxMasksState(Generic[S]):
    """The other detector's state, and that of the background model where there is one."""

    other: S
    background: BackgroundState | None


@dataclass(frozen=True)
class BoxMasks:
    """Another detector's regions; of those that have no silhouette, the pixels in their boxes.

    With a background model, those that differ from the background; without one, those that their colours tell from
    what lies around the box (GrabCut). A pixel in several boxes is that of the one to whose middle it is nearest, in
    sizes of the boxes. Where less than a twentieth of a box is found it stays without a silhouette.
    """

    detector: Any
    background: Background | None = None

    @property
    def needs_pixels(self) -> bool:
        """Silhouettes are of pixels."""
        return True

    @property
    def state_kind(self) -> Any:
        """What its state is, with the other detector's: for `perdure.states.load`."""
        return BoxMasksState[kind_of(self.detector)]  # type: ignore[misc]

    def prepare(self, frames: Sequence[Frame]) -> BoxMasks:
        """Return this detector with the first looks taken: that of the background model, and the other detector's."""
        prepare = getattr(self.detector, "prepare", None)
        return dataclasses.replace(
            self,
            detector=self.detector if prepare is None else prepare(frames),
            background=None if self.background is None else self.background.prepare(frames),
        )

    def start(self, scene: Scene) -> BoxMasksState[Any]:
        """Return the state before the first frame."""
        model = self.background
        return BoxMasksState(self.detector.start(scene), None if model is None else model.start(scene))

    def step(self, state: BoxMasksState[Any], frame: Frame) -> tuple[BoxMasksState[Any], Regions]:
        """Return the other detector's regions of one frame in their order, with silhouettes."""
        other, regions = self.detector.step(state.other, frame)
        background, moving = state.background, None
        if self.background is not None and background is not None:
            background, seen = self.background.step(background, frame)
            moving = seen.masks
        state = BoxMasksState(other, background)
        bare = [k for k, mask in enumerate(regions.masks) if not mask.area]
        if frame.image is None or not bare:
            return state, regions
        masks = list(regions.masks)
        for k, mask in zip(bare, self._found(frame.image, regions, bare, moving), strict=True):
            masks[k] = mask
        return state, dataclasses.replace(regions, masks=tuple(masks))

    def heed(self, state: BoxMasksState[Any], report: Report) -> BoxMasksState[Any]:
        """Tell the background model, and the other detector where it heeds it, what the tracker said."""
        heed = getattr(self.detector, "heed", None)
        other = state.other if heed is None else heed(state.other, report)
        background = state.background
        if self.background is not None and background is not None:
            background = self.background.heed(background, report)
        return BoxMasksState(other, background)

    def _found(
        self, image: Image, regions: Regions, bare: Sequence[int], moving: Sequence[Mask] | None
    ) -> list[Mask]:
        """The silhouettes of the regions without one; what those that have one cover is taken."""
        height, width = image.shape[:2]
        free = np.ones((height, width), np.bool_)
        for mask in regions.masks:
            free &= ~mask.to_image(height, width) if mask.area else free
        boxes = regions.boxes[bare]
        areas = [whole_pixels(box, height, width) for box in boxes]
        if moving is None:
            parts = [silhouette(image, area) if area.area else area for area in areas]
        else:
            seen = np.zeros((height, width), np.bool_)
            for mask in moving:
                seen |= mask.to_image(height, width)
            parts = [_crop(seen, area) for area in areas]
        owners = nearest(boxes, parts, free)
        return [
            found if found.area >= max(1.0, _LEAST * area.area) else Mask.empty()
            for area, found in zip(areas, (_owned(part, owners, k) for k, part in enumerate(parts)), strict=True)
        ]


def whole_pixels(box: NDArray[np.floating], height: int, width: int) -> Mask:
    """Return the pixels of a picture that lie wholly in a box (4,), which a box of edges between pixels may cut."""
    x1, y1, x2, y2 = (float(side) for side in box)
    left, top = max(math.ceil(x1), 0), max(math.ceil(y1), 0)
    right, bottom = min(math.floor(x2), width), min(math.floor(y2), height)
    if left >= right or top >= bottom:
        return Mask.empty()
    return Mask(top, left, np.ones((bottom - top, right - left), np.bool_))


def nearest(boxes: Boxes, parts: Sequence[Mask], free: Bits) -> NDArray[np.int32]:
    """Return whose each pixel of a picture is (H, W): the number of a part that has it, -1 for nobody's.

    Of several that of the box to whose middle it is nearest, in half sizes of the box; the first of equals.
    """
    owners = np.full(free.shape, -1, np.int32)
    best = np.full(free.shape, np.inf, np.float32)
    for k, (box, part) in enumerate(zip(boxes, parts, strict=True)):
        if not part.area:
            continue
        x1, y1, x2, y2 = part.box
        middle, half = (box[:2] + box[2:]) / 2, np.maximum((box[2:] - box[:2]) / 2, 0.5)
        across = (np.arange(x1, x2, dtype=np.float32) + 0.5 - middle[0]) / half[0]
        down = (np.arange(y1, y2, dtype=np.float32) + 0.5 - middle[1]) / half[1]
        far = across[None] ** 2 + down[:, None] ** 2  # (h, w)
        nearer = part.bits & free[y1:y2, x1:x2] & (far < best[y1:y2, x1:x2])
        owners[y1:y2, x1:x2][nearer] = k
        best[y1:y2, x1:x2][nearer] = far[nearer]
    return owners


def _crop(picture: Bits, area: Mask) -> Mask:
    """The true pixels of a picture in an area that lies in it."""
    x1, y1, x2, y2 = area.box
    return Mask(area.y, area.x, picture[y1:y2, x1:x2] & area.bits)


def _owned(part: Mask, owners: NDArray[np.int32], number: int) -> Mask:
    """The pixels of a part that are its own, tight."""
    x1, y1, x2, y2 = part.box
    return Mask.of_image(part.bits & (owners[y1:y2, x1:x2] == number), part.y, part.x)

"""One picture of a source, and a silhouette in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from perdure.types.arrays import Bits, Image, frozen


@dataclass(frozen=True)
class Frame:
    """One picture of a source.

    Parameters
    ----------
    index : int
        Number in the source, counted from 0.
    time : float
        Seconds, by the source's own timestamps.
    image : (H, W, 3) uint8 array or None
        RGB; None where only detections exist.
    """

    index: int
    time: float
    image: Image | None = None

    def __post_init__(self) -> None:
        if self.image is not None:
            if self.image.ndim != 3 or self.image.shape[2] != 3 or self.image.dtype != np.uint8:
                raise ValueError(
                    f"a frame's image must be (H, W, 3) uint8, not {self.image.shape} {self.image.dtype}"
                )
            object.__setattr__(self, "image", frozen(self.image))


@dataclass(frozen=True, eq=False)
class Mask:
    """A silhouette: a crop of bits and its upper left corner (x, y) in the frame.

    >>> Mask(y=2, x=5, bits=np.ones((3, 4), bool)).box
    (5, 2, 9, 5)
    """

    y: int
    x: int
    bits: Bits  # (h, w)

    def __post_init__(self) -> None:
        object.__setattr__(self, "bits", frozen(np.asarray(self.bits, dtype=np.bool_)))

    @staticmethod
    def empty() -> Mask:
        """Return the mask of nothing."""
        return _NOTHING

    @staticmethod
    def of_image(bits: Bits, y: int = 0, x: int = 0) -> Mask:
        """Return the tight mask of the true pixels of a picture whose corner is (x, y)."""
        rows, columns = np.flatnonzero(bits.any(axis=1)), np.flatnonzero(bits.any(axis=0))
        if not rows.size:
            return Mask.empty()
        top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
        return Mask(int(y + top), int(x + left), bits[top:bottom, left:right].copy())

    @property
    def box(self) -> tuple[int, int, int, int]:
        """The crop's own box x1, y1, x2, y2; tight if the mask was made by `of_image`."""
        height, width = self.bits.shape
        return self.x, self.y, self.x + width, self.y + height

    @property
    def area(self) -> int:
        """The number of true pixels."""
        return int(np.count_nonzero(self.bits))

    def to_image(self, height: int, width: int) -> Bits:
        """Return the (height, width) bool picture with this mask in it; what lies outside is cut."""
        picture = np.zeros((height, width), np.bool_)
        x1, y1, x2, y2 = self.box
        left, top, right, bottom = max(x1, 0), max(y1, 0), min(x2, width), min(y2, height)
        if left < right and top < bottom:
            picture[top:bottom, left:right] = self.bits[top - y1 : bottom - y1, left - x1 : right - x1]
        return picture

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Mask)
            and (self.y, self.x) == (other.y, other.x)
            and np.array_equal(self.bits, other.bits)
        )

    __hash__ = None  # type: ignore[assignment]


_NOTHING = Mask(0, 0, np.zeros((0, 0), np.bool_))

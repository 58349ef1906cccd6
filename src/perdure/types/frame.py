"""One picture of a source, a silhouette in it and its run lengths, and a contour between its pixels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

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


def run_lengths(mask: Mask) -> list[int]:
    """Return lengths of alternating runs of false and true, column by column, beginning with false."""
    flat = mask.bits.ravel(order="F")
    if not flat.size:
        return []
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    runs = np.diff(np.concatenate([[0], changes, [flat.size]]))
    return ([0] if flat[0] else []) + [int(run) for run in runs]


def of_run_lengths(runs: Sequence[int], y: int, x: int, height: int, width: int) -> Mask:
    """Return the mask whose `run_lengths` these are.

    Raises
    ------
    ValueError
        If the runs are negative or do not fill the crop.
    """
    counts = np.asarray(runs, np.int64)
    if (counts < 0).any() or int(counts.sum()) != height * width:
        raise ValueError(f"runs of {int(counts.sum())} pixels do not fill a crop of {width}x{height}")
    flat: NDArray[np.bool_] = np.repeat(np.arange(len(counts)) % 2 == 1, counts)
    return Mask(y, x, flat.reshape((height, width), order="F"))


@dataclass(frozen=True, eq=False)
class Outline:
    """The contour of a silhouette, between pixels: closed lines, whose first point is not said again at the end.

    Pixel (0, 0) reaches from 0 to 1, as in boxes: its middle is at .5, .5. Outer lines run with the clock as one sees
    them, y downwards, and holes against it, so that x dy - y dx is above 0 around what is inside. Places are kept to
    1 / PER_PIXEL of a pixel.

    >>> Outline.of([[[0, 0], [4, 0], [4, 2], [0, 2]]]).area
    8.0
    """

    rings: tuple[NDArray[np.float64], ...]  # each (n, 2) x, y; n >= 3

    def __post_init__(self) -> None:
        kept = []
        for ring in self.rings:
            places = np.rint(np.asarray(ring, np.float64) * PER_PIXEL) / PER_PIXEL  # (n, 2)
            if places.ndim != 2 or places.shape[1] != 2 or len(places) < 3 or not np.isfinite(places).all():
                raise ValueError(
                    f"a ring must be (n, 2) finite numbers of three points or more, not {places.shape}"
                )
            kept.append(frozen(places + 0.0))  # no -0
        object.__setattr__(self, "rings", tuple(kept))

    @staticmethod
    def of(rings: Iterable[ArrayLike]) -> Outline:
        """Return the outline of closed lines (n, 2); what is no area when places are kept is left out."""
        kept = []
        for ring in rings:
            places = np.rint(np.asarray(ring, np.float64) * PER_PIXEL) / PER_PIXEL
            places = places[(places != np.roll(places, 1, axis=0)).any(axis=1)]  # no point twice in a row
            if len(places) >= 3 and _signed_area(places):
                kept.append(places)
        return Outline(tuple(kept))

    @property
    def area(self) -> float:
        """Square pixels inside."""
        return sum(_signed_area(ring) for ring in self.rings)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Outline)
            and len(self.rings) == len(other.rings)
            and all(np.array_equal(one, two) for one, two in zip(self.rings, other.rings, strict=True))
        )

    __hash__ = None  # type: ignore[assignment]


PER_PIXEL = 64  # places of an outline


def _signed_area(ring: NDArray[np.float64]) -> float:
    x, y = ring.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


_NOTHING = Mask(0, 0, np.zeros((0, 0), np.bool_))

"""The DAVIS measures of silhouettes: region similarity J and contour accuracy F.

Perazzi et al. 2016, "A benchmark dataset and evaluation methodology for video object segmentation"; the
assignment of several objects as in the unsupervised challenge (Caelles et al. 2019). J is the intersection over
union of two silhouettes. F is the harmonic mean of two shares: of the said contour's pixels, those near the true
contour (precision), and of the true contour's pixels, those near the said one (recall); near is within 0.8 % of
the picture's diagonal, rounded up to whole pixels. Both are 1 in a frame where nothing is to be found and nothing
is said. Objects said beyond those of the truth cost nothing.

A contour's pixels are those that differ from their neighbour to the right, below, or both; the picture's rim is
no contour. That is half a pixel towards the origin from the silhouette's edge, the same for both sides.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError
from perdure.features.masks import crops, disjoint, mask_overlaps, part, touching
from perdure.maths.assign import assign
from perdure.types import Mask, Rows, Use
from perdure.types.arrays import Bits, frozen

TOLERANCE = 0.008  # of the picture's diagonal

_Float = NDArray[np.float64]
_Index = NDArray[np.intp]
_Size = tuple[int, int]  # height, width


@dataclass(frozen=True, eq=False)
class DavisScore:
    """Region similarity and contour accuracy, means over objects of means over frames.

    Parameters
    ----------
    objects : int
        How many the truth has.
    j, f : float
        Means over the objects, in [0, 1]. Without an object: 1 where nothing was said either, else 0.
    j_by_object, f_by_object : (objects,) float64
        Means over the frames, in the order of the objects' ids.
    """

    objects: int
    j: float
    f: float
    j_by_object: _Float
    f_by_object: _Float

    @property
    def jf(self) -> float:
        """The mean of J and F."""
        return (self.j + self.f) / 2.0

    @staticmethod
    def together(scores: Iterable[DavisScore]) -> DavisScore:
        """Return the score over all objects of several films; of none, the score of having nothing to find."""
        scores = list(scores)
        j = np.concatenate([np.zeros(0), *(one.j_by_object for one in scores)])
        f = np.concatenate([np.zeros(0), *(one.f_by_object for one in scores)])
        return _score(j, f, without=min((one.j for one in scores), default=1.0))


def jaccard_and_boundary(said: Rows, truth: Rows, frames: Collection[int] | None = None) -> DavisScore:
    """Return J and F of what was said, each true object compared with the id that is assigned to it.

    The assignment is the best one for the mean of J and F over all frames. Where fewer ids were said than there
    are objects, an object without one is compared with nothing: 1 in frames in which it is not, else 0. Pixels in
    an area of the truth that is no object (`Use.REGION`; void in DAVIS) are taken from what was said.

    Parameters
    ----------
    said, truth : Rows
        With masks; one row at most per frame and id.
    frames : collection of int, or None
        Those that have a picture in the truth; None for all from its first object's row to the last.

    Raises
    ------
    FormatError
        If the pictures of both differ in size.
    ValueError
        If a side that has rows has no masks, or neither tells the size of the pictures.
    """
    size = _size(said, truth)
    areas, truth = truth.take(truth.use == Use.REGION), truth.take(truth.use == Use.SCORED)
    if frames is None:
        frames = range(int(truth.frames[0]), int(truth.frames[-1]) + 1) if len(truth) else ()
    pictures = np.unique(np.array(list(frames), np.int64))
    truth, areas, said = (rows.take(np.isin(rows.frames, pictures)) for rows in (truth, areas, said))
    objects, there = np.unique(truth.ids, return_inverse=True)
    names, here = np.unique(said.ids, return_inverse=True)
    region, contour = (_Means(len(objects), max(len(objects), len(names))) for _ in range(2))
    for frame in np.union1d(truth.frames, said.frames):
        rows, columns, void = (_rows_in(table, frame) for table in (truth, said, areas))
        true = _outlines(truth.masks[rows], (), size)
        ours = _outlines(said.masks[columns], areas.masks[void], size)
        ids = there[rows], here[columns]
        region.add(
            *ids, _present([one.mask.area for one in true], [one.mask.area for one in ours]), _jaccards(true, ours)
        )
        contour.add(
            *ids, _present([one.length for one in true], [one.length for one in ours]), _accuracies(true, ours)
        )
    j, f = region.over(len(pictures)), contour.over(len(pictures))  # (objects, names)
    pairs = assign(1.0 - (j + f) / 2.0).pairs
    row, column = pairs[:, 0], pairs[:, 1]
    return _score(j[row, column], f[row, column], without=0.0 if len(names) else 1.0)


@dataclass(frozen=True)
class _Outline:
    """A silhouette, its contour, and the pixels near that."""

    mask: Mask
    contour: Mask
    length: int  # pixels of the contour
    near: Mask


class _Means:
    """Means over frames of a measure of every pair that is 1 in frames in which both have nothing."""

    def __init__(self, objects: int, names: int) -> None:
        self._sums = np.zeros((objects, names))
        self._objects, self._names = np.zeros(objects), np.zeros(names)  # frames in which each has something
        self._both = np.zeros((objects, names))

    def add(self, rows: _Index, columns: _Index, present: tuple[Bits, Bits], values: _Float) -> None:
        """Add the values (N, M) of a frame, 0 where one of the two has nothing; `present` tells which have something."""
        pairs = np.ix_(rows, columns)
        self._sums[pairs] += values
        self._both[pairs] += np.outer(*present)
        self._objects[rows] += present[0]
        self._names[columns] += present[1]

    def over(self, frames: int) -> _Float:
        """Return the means (objects, names)."""
        neither = frames - self._objects[:, None] - self._names[None, :] + self._both
        return np.asarray((self._sums + neither) / max(frames, 1))


def _present(true: list[int], ours: list[int]) -> tuple[Bits, Bits]:
    """Where there is a pixel, (N,) and (M,)."""
    return np.array(true, np.int64) > 0, np.array(ours, np.int64) > 0


def _outlines(masks: Sequence[Mask], areas: Sequence[Mask], size: _Size) -> list[_Outline]:
    """The outlines of masks cut to the picture and outside the areas."""
    cut = [disjoint([*areas, mask], *size)[-1] for mask in masks]
    reach = math.ceil(TOLERANCE * math.hypot(*size))
    found = []
    for mask in cut:
        contour = _contour(mask, size)
        found.append(_Outline(mask, contour, contour.area, _near(contour, reach)))
    return found


def _contour(mask: Mask, size: _Size) -> Mask:
    """The pixels that differ from their neighbour to the right, below, or both."""
    if not mask.bits.size:
        return Mask.empty()
    framed = np.pad(mask.bits, 1)  # (h + 2, w + 2)
    x1, y1, x2, y2 = mask.box
    if x2 == size[1]:  # beyond the rim everything goes on
        framed[:, -1] = framed[:, -2]
    if y2 == size[0]:
        framed[-1] = framed[-2]
    here = framed[:-1, :-1]
    edge = (here != framed[:-1, 1:]) | (here != framed[1:, :-1]) | (here != framed[1:, 1:])  # (h + 1, w + 1)
    return Mask(max(y1 - 1, 0), max(x1 - 1, 0), edge[y1 == 0 :, x1 == 0 :])


def _near(contour: Mask, reach: int) -> Mask:
    """The pixels at most `reach` away from a contour."""
    if not contour.bits.any():
        return Mask.empty()
    import cv2

    apart = np.pad(~contour.bits, reach, constant_values=True).astype(np.uint8)
    distance = cv2.distanceTransform(apart, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    # Squared distances are whole numbers: half a unit more keeps float32's last digit from deciding.
    return Mask(contour.y - reach, contour.x - reach, distance <= math.sqrt(reach**2 + 0.5))


def _jaccards(true: Sequence[_Outline], ours: Sequence[_Outline]) -> _Float:
    """Region similarity J (N, M)."""
    return mask_overlaps([one.mask for one in true], [one.mask for one in ours])


def _accuracies(true: Sequence[_Outline], ours: Sequence[_Outline]) -> _Float:
    """Contour accuracy F (N, M); 0 where a side has no contour."""
    precision = _share([one.near for one in true], ours)
    recall = _share([one.near for one in ours], true).T
    total = precision + recall
    return np.divide(2.0 * precision * recall, total, out=np.zeros_like(total), where=total > 0)


def _share(near: Sequence[Mask], outlines: Sequence[_Outline]) -> _Float:
    """Which share (N, M) of each contour lies near."""
    shares = np.zeros((len(near), len(outlines)))
    for row, column, box in touching(crops(near), crops([one.contour for one in outlines])):
        one = outlines[column]
        shares[row, column] = np.count_nonzero(part(near[row], box) & part(one.contour, box)) / max(one.length, 1)
    return shares


def _rows_in(rows: Rows, frame: int) -> slice:
    return slice(*np.searchsorted(rows.frames, [frame, frame + 1]).tolist())


def _size(said: Rows, truth: Rows) -> _Size:
    """The size of the pictures, on which both agree."""
    for name, rows in (("said", said), ("truth", truth)):
        if len(rows) and not rows.masks:
            raise ValueError(f"{name} has no masks; J and F compare silhouettes")
    sizes = [rows.size for rows in (said, truth) if rows.size is not None]
    if not sizes and (len(said) or len(truth)):
        raise ValueError("neither said nor truth tells the size of the pictures")
    if len(set(sizes)) > 1:
        (height, width), (high, wide) = sizes
        raise FormatError(f"the result's pictures are {width}x{height}, the truth's {wide}x{high}")
    return sizes[0] if sizes else (0, 0)


def _score(j: _Float, f: _Float, without: float) -> DavisScore:
    """The score of objects; that `without` any."""
    mean_j, mean_f = (float(one.mean()) if len(one) else without for one in (j, f))
    return DavisScore(len(j), mean_j, mean_f, frozen(j), frozen(f))

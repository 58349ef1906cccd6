"""Pieces of one thing that were found apart become one region.

Wang, Doherty, Van Dyck, *Moving object tracking in video* (2000), the "gap/mountain" method by which Bugeau and Pérez'
*Track and Cut* gets its observations: foreground is projected on an axis; the profile has mountains, the pieces, and
gaps between them, and mountains are merged over gaps that are small. Departures: two pieces are looked at where they
face each other, not all of the picture at once; and as two people side by side leave a small gap too, a gap is bridged
only where something is known to hide the thing. A post, a trunk, a sign or a bar cuts both pieces along a cliff of
their borders' profile, and at both cliffs the background model has an edge. The picture's own border cuts what
enters. Without an occluder only specks join, a wheel or a foot of the body that they lie at.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.types import Bits, Mask

Single = NDArray[np.float32]
Columns = NDArray[np.intp]


def joined(masks: Sequence[Mask], mean: Single | None, slack: int) -> list[Mask]:
    """Return the regions of one frame with the pieces of one thing joined: the union of their pixels, gaps left open.

    A union is looked at again beside the rest, until nothing more joins. It stands where its first piece stood;
    what stays alone is returned as it is.

    Parameters
    ----------
    masks : N of Mask
        Not empty, tight, without shared pixels.
    mean : (H, W, 3) float32 or None
        The background model's mean picture, grey levels. None: no occluder is known, only specks join.
    slack : int
        Pixels by which cleaning and closing may have moved a border.
    """
    regions, fresh = list(masks), [True] * len(masks)
    while True:
        pieces = [_Piece.of(mask) for mask in regions]
        pairs = [
            (i, j)
            for i, j in _neighbours(pieces)
            if (fresh[i] or fresh[j]) and _of_one_thing(pieces[i], pieces[j], mean, slack)
        ]
        if not pairs:
            return regions
        groups = _connected(len(regions), pairs)
        regions = [
            _union([regions[i] for i in group]) if len(group) > 1 else regions[group[0]] for group in groups
        ]
        fresh = [len(group) > 1 for group in groups]


class _Piece(NamedTuple):
    """A mask with its box and area at hand; pixels."""

    y1: int
    x1: int
    y2: int
    x2: int
    bits: Bits  # (y2 - y1, x2 - x1)
    area: int

    @staticmethod
    def of(mask: Mask) -> _Piece:
        x1, y1, x2, y2 = mask.box
        return _Piece(y1, x1, y2, x2, mask.bits, mask.area)

    @property
    def turned(self) -> _Piece:
        """Rows and columns exchanged."""
        return _Piece(self.x1, self.y1, self.x2, self.y2, self.bits.T, self.area)

    @property
    def height(self) -> int:
        return self.y2 - self.y1

    @property
    def width(self) -> int:
        return self.x2 - self.x1


class _Bounds(NamedTuple):
    """What an occluder may hide."""

    gap: float  # of the extent of both pieces and the gap
    shorter: float  # how much of the shorter piece's height must end at the occluder
    taller: float  # of the taller one's


# Things stand beside each other often: little is bridged. One above the other and cut to a like width they stand
# seldom: a third of the thing must be seen.
_UPRIGHT = _Bounds(0.25, 0.5, 0.0)
_LEVEL = _Bounds(0.67, 0.5, 0.3)
_SPECK = 0.1  # of the large piece's area
_GROWTH = 0.3  # of the large piece's box: more than this is no wheel or foot
_ENTERING = 0.3  # gap between pieces of what enters, of the height of both and the gap
_LEAST_SLOPE = 5.0  # grey levels a pixel that make an edge: a step of three times the least noise, smoothed


def _neighbours(pieces: Sequence[_Piece]) -> list[tuple[int, int]]:
    """Pairs (i, j), i < j, that no gap divides which is too wide to be bridged."""
    if len(pieces) < 2:
        return []
    boxes = np.array([piece[:4] for piece in pieces])  # (N, 4) y1 x1 y2 x2
    low, high = boxes[:, None, :2], boxes[:, None, 2:]
    gap = np.maximum(low, low.swapaxes(0, 1)) - np.minimum(high, high.swapaxes(0, 1))  # (N, N, 2)
    extent = np.maximum(high, high.swapaxes(0, 1)) - np.minimum(low, low.swapaxes(0, 1))
    near = (gap <= extent * (_LEVEL.gap, _UPRIGHT.gap)).all(axis=2)
    first, second = np.nonzero(np.triu(near, 1))
    return list(zip(first.tolist(), second.tolist(), strict=True))


def _of_one_thing(a: _Piece, b: _Piece, mean: Single | None, slack: int) -> bool:
    if _is_speck(a, b, slack):
        return True
    if mean is None:
        return False
    return (
        _enters(a, b, mean.shape[1], slack)
        or _is_cut(a, b, mean, slack, _UPRIGHT)
        or _is_cut(a.turned, b.turned, mean.swapaxes(0, 1), slack, _LEVEL)
    )


def _is_speck(a: _Piece, b: _Piece, slack: int) -> bool:
    """Whether one is a small part of the other: near, and in its lower half, as above may be another one's head."""
    small, large = (a, b) if a.area <= b.area else (b, a)
    away = max(large.x1 - small.x2, small.x1 - large.x2, large.y1 - small.y2, small.y1 - large.y2)
    width, height = max(a.x2, b.x2) - min(a.x1, b.x1), max(a.y2, b.y2) - min(a.y1, b.y1)
    return (
        small.area <= _SPECK * large.area
        and away <= slack
        and small.y1 + small.y2 >= large.y1 + large.y2
        and width * height <= (1.0 + _GROWTH) * large.width * large.height
    )


def _enters(a: _Piece, b: _Piece, picture: int, slack: int) -> bool:
    """Whether both lie at the same side of a picture so wide, one above the other, as limbs of what passes it do.

    Not at the lower or upper side, where people stand beside each other; nor if one reaches past the other's end:
    what was not parted by rows was told apart for a reason.
    """
    gap = max(a.y1, b.y1) - min(a.y2, b.y2)
    height, width = max(a.y2, b.y2) - min(a.y1, b.y1), max(a.x2, b.x2) - min(a.x1, b.x1)
    at_side = a.x1 == b.x1 == 0 or a.x2 == b.x2 == picture
    return at_side and -slack < gap <= _ENTERING * height and width <= height


def _is_cut(a: _Piece, b: _Piece, mean: Single, slack: int, bounds: _Bounds) -> bool:
    """Whether a straight occluder, its two edges across the rows, cuts one thing into a and b."""
    left, right = (a, b) if a.x1 + a.x2 <= b.x1 + b.x2 else (b, a)
    top, bottom = max(a.y1, b.y1), min(a.y2, b.y2)
    widest = bounds.gap * (right.x2 - left.x1)
    least = max(
        2 * slack,  # what is shorter is straight by chance
        math.ceil(bounds.shorter * min(a.height, b.height)),
        math.ceil(bounds.taller * max(a.height, b.height)),
    )
    if bottom - top < least or right.x1 - left.x2 > widest:
        return False
    one, two = left.bits[top - left.y1 : bottom - left.y1], right.bits[top - right.y1 : bottom - right.y1]
    ends = left.x2 - 1 - one[:, ::-1].argmax(axis=1)  # last column of the left piece, (bottom - top,)
    starts = right.x1 + two.argmax(axis=1)  # first column of the right one
    gaps = starts - ends - 1
    facing = one.any(axis=1) & two.any(axis=1) & (gaps >= -slack) & (gaps <= widest + 2 * slack)
    rows = np.flatnonzero(facing)
    if rows.size < least:
        return False
    cut = _straight_cut(rows, ends[rows], starts[rows], slack)
    if cut.rows.size < least or not -slack <= cut.start - cut.end - 1 <= widest:
        return False
    lean = np.rint(cut.tilt * cut.rows).astype(np.intp)
    return (
        _slope(mean, top + cut.rows, cut.end + lean, 1, slack) >= _LEAST_SLOPE
        and _slope(mean, top + cut.rows, cut.start + lean, -1, slack) >= _LEAST_SLOPE
    )


class _Cut(NamedTuple):
    """Two parallel cliffs."""

    tilt: float  # columns a row
    end: int  # outermost column of the left cliff, at row 0
    start: int  # of the right one
    rows: Columns  # those in which both pieces reach their cliff


def _straight_cut(rows: Columns, ends: Columns, starts: Columns, slack: int) -> _Cut:
    """Return the cut, upright or as the gap's middle leans, in which more rows take part."""
    cuts = []
    for tilt in dict.fromkeys((0.0, _tilt(rows, ends + starts) / 2)):
        lean = np.rint(tilt * rows).astype(np.intp)
        end, at_end = _cliff(ends - lean, slack)
        start, at_start = _cliff(lean - starts, slack)
        cuts.append(_Cut(tilt, end, -start, rows[at_end & at_start]))
    return max(cuts, key=lambda cut: cut.rows.size)  # the first of equals


def _tilt(rows: Columns, columns: Columns) -> float:
    """Columns a row: the median over pairs of rows half the height apart (after Theil and Sen)."""
    half = rows.size // 2
    if not half:
        return 0.0
    slopes = np.sort((columns[-half:] - columns[:half]) / (rows[-half:] - rows[:half]))
    return float(slopes[(half - 1) // 2] + slopes[half // 2]) / 2


def _cliff(columns: Columns, slack: int) -> tuple[int, NDArray[np.bool_]]:
    """Return the column within which and `slack` before which most rows' borders lie, and which rows those are."""
    least = int(columns.min())
    profile = np.convolve(np.bincount(columns - least), np.ones(slack + 1, np.intp))
    last = least + int(profile.argmax())
    return last, (columns <= last) & (columns >= last - slack)


def _slope(mean: Single, rows: Columns, columns: Columns, outward: int, slack: int) -> float:
    """Grey levels a pixel of the steepest edge along a cliff; the mean over its rows, so that texture cancels out."""
    around = outward * np.arange(-slack - slack // 2 - 1, slack // 2 + 2)  # the cliff is as wide as the slack
    x = np.clip(columns[:, None] + around, 0, mean.shape[1] - 1)  # (rows, around)
    profile = mean[rows[:, None], x].mean(axis=0)  # (around, 3)
    return float(np.abs(profile[2:] - profile[:-2]).max()) / 2


def _connected(count: int, pairs: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Return who hangs together with whom, by the first of each group."""
    first = list(range(count))
    for i, j in pairs:
        kept, lost = sorted((first[i], first[j]))
        first = [kept if one == lost else one for one in first]
    return [[i for i in range(count) if first[i] == one] for one in sorted(set(first))]


def _union(masks: Sequence[Mask]) -> Mask:
    boxes = np.array([mask.box for mask in masks])  # (N, 4)
    (left, top), (right, bottom) = boxes[:, :2].min(axis=0).tolist(), boxes[:, 2:].max(axis=0).tolist()
    bits = np.zeros((bottom - top, right - left), np.bool_)
    for mask in masks:
        x1, y1, x2, y2 = mask.box
        bits[y1 - top : y2 - top, x1 - left : x2 - left] |= mask.bits
    return Mask(top, left, bits)

"""How long what covers a place has not stirred: tells a thing left behind from somebody who stands.

Whoever stands shifts his weight, breathes, turns his head; a suitcase does not. So for each place that a region
covers the time is kept since its colour last changed; a region that hardly changed anywhere for long is a thing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.types import Bits, Image, Mask, Regions


@dataclass(frozen=True, eq=False)
class Stillness:
    """Cells of a grid over the picture, each for one pixel; `watch` writes into it."""

    cell: int  # pixels between two of them
    seen: NDArray[np.int16]  # (h, w, 3) grey levels last taken in
    since: NDArray[np.float64]  # (h, w) s, when that was, or when the place was last free
    gone: NDArray[np.float64]  # (h, w) s, since when a thing here is found to be gone; inf once that was told
    lately: NDArray[np.float64]  # (h, w) s, when it was last found so


def no_stillness(height: int, width: int) -> Stillness:
    """Return the state before the first frame of pictures of this size."""
    cell = max(1, round(min(height, width) / _GRID))
    shape = -(-height // cell), -(-width // cell)
    return Stillness(cell, np.zeros((*shape, 3), np.int16), np.zeros(shape), *np.full((2, *shape), -np.inf))


def watch(
    still: Stillness, regions: Regions, image: Image, exposure: NDArray[np.float32], time: float, tolerance: float
) -> None:
    """Take in a frame; in place.

    Parameters
    ----------
    still : Stillness, changed
        As of the frame before.
    regions : Regions
        With masks inside the picture.
    image : (H, W, 3) uint8
        The picture.
    exposure : (3,) float32
        What each channel is multiplied by, so that a change of light is none of the thing's.
    time : float
        Of the frame, s.
    tolerance : float
        Grey levels by which a place at rest may differ.
    """
    free = np.ones(still.since.shape, np.bool_)
    for mask in regions.masks:
        part, bits = _on_grid(mask, still.cell)
        if not bits.size:
            continue
        free[part] &= ~bits
        now = (image[:: still.cell, :: still.cell][part] * exposure).astype(np.int16)
        stirred = bits & (np.abs(now - still.seen[part]).max(axis=2, initial=0) > tolerance)
        still.seen[part][stirred] = now[stirred]
        still.since[part][stirred] = time
    still.since[free] = time


def rested(still: Stillness, regions: Regions, time: float, least: float) -> Bits:
    """Return which regions, (N,) bool, have hardly changed anywhere for `least` seconds."""
    found = np.zeros(len(regions), np.bool_)
    for number, mask in enumerate(regions.masks):
        part, bits = _on_grid(mask, still.cell)
        count = np.count_nonzero(bits)
        asleep = np.count_nonzero(bits & (still.since[part] <= time - least))
        found[number] = count > 0 and asleep >= _ASLEEP * count
    return found


def is_gone(still: Stillness, mask: Mask, time: float) -> bool:
    """Return whether a thing has been found to be gone from here for long enough to be told, and was not yet."""
    x1, y1, x2, y2 = mask.box
    part = np.s_[y1 // still.cell : -(-y2 // still.cell), x1 // still.cell : -(-x2 // still.cell)]
    fresh = still.lately[part] < time - _SAME
    told = bool((still.gone[part][~fresh] == np.inf).any())
    still.gone[part][fresh] = time
    still.lately[part] = time
    if told:  # another piece of it
        still.gone[part] = np.inf
    since = float(still.gone[part].min(initial=np.inf))
    if not since <= time - _LASTING:
        return False
    still.gone[part] = np.inf
    return True


def _on_grid(mask: Mask, cell: int) -> tuple[tuple[slice, slice], Bits]:
    """The cells of a mask, as a part of the grid and their bits."""
    top, left = -(-mask.y // cell), -(-mask.x // cell)
    bits = mask.bits[top * cell - mask.y :: cell, left * cell - mask.x :: cell]
    return np.s_[top : top + bits.shape[0], left : left + bits.shape[1]], bits


_SAME = 5.0  # s within which what is gone from one place is the same thing
_LASTING = 0.25  # s for which it is gone before that is told
_GRID = 288  # cells along the shorter side
_ASLEEP = 0.9  # of a region's cells: a head that turns is more than the rest

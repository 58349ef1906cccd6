"""What a thing looks like: colour and share seen on a grid laid over its box, and how alike two such looks are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.types import Image, Mask

Float = NDArray[np.float32]
GRID = (24, 12)  # cells down and across a box


def look(image: Image, mask: Mask, box: tuple[float, float, float, float]) -> Float:
    """Return the look (*GRID, 4) of a box x1 y1 x2 y2 in a picture (H, W, 3): colours 0 to 255, and 1 where seen.

    Cells outside the mask or the picture are 0; an empty mask covers nothing up.
    """
    x1, y1, x2, y2 = box
    rows = np.floor(y1 + (np.arange(GRID[0]) + 0.5) * (y2 - y1) / GRID[0]).astype(np.intp)
    columns = np.floor(x1 + (np.arange(GRID[1]) + 0.5) * (x2 - x1) / GRID[1]).astype(np.intp)
    found = np.zeros((*GRID, 4), np.float32)
    height, width = image.shape[:2]
    down, across = (rows >= 0) & (rows < height), (columns >= 0) & (columns < width)
    found[np.ix_(down, across)] = np.dstack(
        [image[np.ix_(rows[down], columns[across])], np.ones((down.sum(), across.sum()), np.float32)]
    )
    if mask.bits.size:
        found *= _on(mask, rows, columns)[:, :, None]
    return found


def blended(old: Float, new: Float, share: float) -> Float:
    """Return looks (..., *GRID, 4) moved towards new ones by a share in [0, 1]; colours only where now seen."""
    seen = new[..., 3:] > 0
    first = old[..., 3:] == 0
    weight = np.where(first, 1.0, share) * seen
    colours = old[..., :3] + weight * (new[..., :3] - old[..., :3])
    known = old[..., 3:] + share * (new[..., 3:] - old[..., 3:])
    known = np.where((old[..., 3:].sum(axis=(-3, -2), keepdims=True) == 0), new[..., 3:], known)
    return np.asarray(np.concatenate([colours, known], axis=-1), np.float32)


def signature(looks: Float, bands: int = 3, bins: int = 6) -> Float:
    """Return a colour histogram of each horizontal band (bands * bins³,) of a look (*GRID, 4).

    Each cell counts as much as it was seen, shared by the bins about its colour. A band sums to 1, or 0 if unseen.
    """
    rows = np.array_split(looks, bands, axis=0)
    return np.concatenate([_histogram(one.reshape(-1, 4), bins) for one in rows])


def alike(one: Float, other: Float, bands: int = 3) -> float:
    """Return the similarity in [0, 1] of two signatures: mean Bhattacharyya coefficient of the bands both have.

    Half where they have none in common.
    """
    mine, theirs = one.reshape(bands, -1), other.reshape(bands, -1)
    both = (mine.sum(axis=1) > 0) & (theirs.sum(axis=1) > 0)
    return min(1.0, float(np.sqrt(mine * theirs).sum(axis=1)[both].mean())) if both.any() else 0.5


def _histogram(cells: Float, bins: int) -> Float:
    weight = cells[:, 3]
    place = cells[:, :3] / 256.0 * bins - 0.5
    low = np.floor(place).astype(np.int64)
    part = place - low
    total = np.zeros(bins**3)
    for corner in range(8):
        up = np.array([corner >> 2 & 1, corner >> 1 & 1, corner & 1])
        share = np.where(up, part, 1 - part).prod(axis=1) * weight
        bin_ = np.clip(low + up, 0, bins - 1) @ np.array([bins * bins, bins, 1])
        total += np.bincount(bin_, share, bins**3)
    return np.asarray(total / max(float(total.sum()), 1e-9), np.float32)


def _on(mask: Mask, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.bool_]:
    y, x = rows - mask.y, columns - mask.x
    inside = ((y >= 0) & (y < mask.bits.shape[0]))[:, None] & ((x >= 0) & (x < mask.bits.shape[1]))
    bits = mask.bits[np.ix_(np.clip(y, 0, mask.bits.shape[0] - 1), np.clip(x, 0, mask.bits.shape[1] - 1))]
    return np.asarray(bits & inside)

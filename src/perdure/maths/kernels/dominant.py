"""The colours that most of a cell's pixels have, and how far apart two such descriptions are (Yang et al. 2008)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for, part

Bytes = NDArray[np.uint8]
Bools = NDArray[np.bool_]
Float = NDArray[np.float64]
Single = NDArray[np.float32]
Ints = NDArray[np.int32]
Index = NDArray[np.int64]

SHIFT = 5  # bits of a channel that do not count for the bin
LEVELS = 256 >> SHIFT
BINS = LEVELS**3


@kernel_for(given(np.uint8, 3), given(np.bool_, 2), given(np.int64), given(np.int64), changed(np.int32, 3))
def tally(colours: Bytes, bits: Bools, rows: Index, columns: Index, sums: Ints) -> None:
    """Add to sums (cells, BINS, 4) how many pixels each bin of colour has in each cell, and their colours.

    Pixels are those of colours (h, w, 3) with a bit; pixel (r, c) is of cell rows[r] + columns[c].
    """
    for r in range(bits.shape[0]):
        for c in range(bits.shape[1]):
            if bits[r, c]:
                red, green, blue = (
                    np.int64(colours[r, c, 0]),
                    np.int64(colours[r, c, 1]),
                    np.int64(colours[r, c, 2]),
                )
                place = ((red >> SHIFT) * LEVELS + (green >> SHIFT)) * LEVELS + (blue >> SHIFT)
                cell = rows[r] + columns[c]
                sums[cell, place, 0] += 1
                sums[cell, place, 1] += red
                sums[cell, place, 2] += green
                sums[cell, place, 3] += blue


def tally_twin(colours: Bytes, bits: Bools, rows: Index, columns: Index, sums: Ints) -> None:
    """Do the same in NumPy: the oracle of `tally`."""
    y, x = np.nonzero(bits)
    own = colours[y, x].astype(np.int32)
    places = (own >> SHIFT) @ (LEVELS * LEVELS, LEVELS, 1)
    np.add.at(sums, (rows[y] + columns[x], places), np.column_stack([np.ones(len(own), np.int32), own]))


@kernel_for(
    given(np.int32, 3), int, float, int, changed(np.float64, 2), changed(np.float64, 2), changed(np.float32, 3)
)
def dominant(
    sums: Ints, fewest: int, apart: float, rounds: int, points: Float, found: Float, colours: Single
) -> None:
    """Write the dominant colours of each cell; zeros for cells of fewer pixels than `fewest`.

    Seeds are the fullest bins that lie `apart`; they move to the means of those nearest to them (Lloyd), `rounds`
    times; then the nearest two are joined until all are `apart`.

    Parameters
    ----------
    sums : (M, BINS, 4) int32
        As `tally` makes them.
    fewest : int
        At least 1.
    apart : float
        In grey levels, Euclidean over the channels.
    rounds : int
        At least 1.
    points : (BINS, 4) float64, changed
        Scratch.
    found : (2 A, 4) float64, changed
        Scratch.
    colours : (M, A, 4) float32, changed
        Every element is written: R, G, B, 0 to 255, and the share of the pixels; the shares of a cell sum to 1.
    """
    most = colours.shape[1]
    for m in range(len(sums)):
        count, total = _points(sums, m, points)
        for a in range(most):
            for k in range(4):
                colours[m, a, k] = 0.0
        if total < fewest:
            continue
        seeds = _seeds(points, count, apart, most, found)
        for _ in range(rounds):
            _means(points, count, seeds, most, found)
        seeds = _joined(seeds, apart, found)
        for a in range(seeds):
            for k in range(3):
                colours[m, a, k] = found[a, k]
            colours[m, a, 3] = found[a, 3] / total


@part
def _points(sums: Ints, m: int, points: Float) -> tuple[int, float]:
    """Gather the mean colours and counts of the bins that have pixels; return how many, and of how many pixels."""
    count, total = 0, 0.0
    for place in range(BINS):
        if sums[m, place, 0] > 0:
            points[count, 3] = sums[m, place, 0]
            for k in range(3):
                points[count, k] = sums[m, place, k + 1] / points[count, 3]
            total += points[count, 3]
            count += 1
    return count, total


@part
def _seeds(points: Float, count: int, apart: float, most: int, found: Float) -> int:
    """Choose the fullest bins that lie apart, the first of equals."""
    seeds = 0
    while seeds < most:
        best, fullest = -1, 0.0
        for n in range(count):
            if points[n, 3] > fullest:
                near = False
                for a in range(seeds):
                    if _squared(points, n, found, a) < apart * apart:
                        near = True
                if not near:
                    best, fullest = n, points[n, 3]
        if best < 0:
            break
        for k in range(4):
            found[seeds, k] = points[best, k]
        seeds += 1
    return seeds


@part
def _means(points: Float, count: int, seeds: int, most: int, found: Float) -> None:
    """Move colours to the means of the points that are nearest to them; one without points stays, with a count of 0."""
    for a in range(seeds):
        for k in range(4):
            found[most + a, k] = 0.0
    for n in range(count):
        nearest, least = 0, np.inf
        for a in range(seeds):
            away = _squared(points, n, found, a)
            if away < least:
                nearest, least = a, away
        weight = points[n, 3]
        for k in range(3):
            found[most + nearest, k] += weight * points[n, k]
        found[most + nearest, 3] += weight
    for a in range(seeds):
        found[a, 3] = found[most + a, 3]
        if found[a, 3] > 0.0:
            for k in range(3):
                found[a, k] = found[most + a, k] / found[a, 3]


@part
def _joined(seeds: int, apart: float, found: Float) -> int:
    """Join the nearest two colours into their mean until all lie apart; return how many are left."""
    while seeds > 1:
        first, second, least = 0, 0, apart * apart
        for a in range(seeds):
            for b in range(a + 1, seeds):
                away = _squared(found, a, found, b)
                if away < least:
                    first, second, least = a, b, away
        if second == 0:
            break
        both = found[first, 3] + found[second, 3]
        share = found[second, 3] / both if both > 0.0 else 0.5
        for k in range(3):
            found[first, k] += share * (found[second, k] - found[first, k])
        found[first, 3] = both
        seeds -= 1
        for k in range(4):
            found[second, k] = found[seeds, k]
    return seeds


@part
def _squared(one: Float, a: int, other: Float, b: int) -> float:
    red, green, blue = one[a, 0] - other[b, 0], one[a, 1] - other[b, 1], one[a, 2] - other[b, 2]
    return float(red * red + green * green + blue * blue)


def dominant_twin(
    sums: Ints, fewest: int, apart: float, rounds: int, points: Float, found: Float, colours: Single
) -> None:
    """Do the same in NumPy, cell by cell: the oracle of `dominant`."""
    most = colours.shape[1]
    colours[...] = 0.0
    for m in range(len(sums)):
        own = sums[m][sums[m, :, 0] > 0].astype(np.float64)
        weights, places = own[:, 0], own[:, 1:] / np.maximum(own[:, :1], 1)
        if weights.sum() < fewest:
            continue
        centres: Float = np.zeros((0, 3))
        free = np.ones(len(own), np.bool_)
        while len(centres) < most and free.any():
            best = int(np.argmax(np.where(free, weights, 0.0)))
            centres = np.concatenate([centres, places[best : best + 1]])
            free &= ((places - places[best]) ** 2).sum(axis=1) >= apart * apart
        counts = np.zeros(len(centres))
        for _ in range(rounds):
            away = ((places[:, None] - centres) ** 2).sum(axis=2)  # (n, A)
            mine = away.argmin(axis=1) == np.arange(len(centres))[:, None]  # (A, n)
            counts = mine @ weights
            means = mine @ (weights[:, None] * places) / np.maximum(counts, 1)[:, None]
            centres = np.where(counts[:, None] > 0, means, centres)
        while len(centres) > 1:
            away = ((centres[:, None] - centres) ** 2).sum(axis=2)
            away[np.tril_indices(len(centres))] = np.inf
            first, second = np.unravel_index(away.argmin(), away.shape)
            if away[first, second] >= apart * apart:
                break
            both = counts[first] + counts[second]
            share = counts[second] / both if both else 0.5
            centres[first] += share * (centres[second] - centres[first])
            counts[first] = both
            centres[second], counts[second] = centres[-1], counts[-1]
            centres, counts = centres[:-1], counts[:-1]
        colours[m, : len(centres)] = np.column_stack([centres, counts / weights.sum()])


@kernel_for(given(np.float32, 3), given(np.float32, 3), float, float, changed(np.float32))
def unlikeness(one: Single, other: Single, apart: float, span: float, distances: Single) -> None:
    """Write 1 - Σ a S of two cells' dominant colours, within [0, 1]; inf where one has none.

    Parameters
    ----------
    one, other : (M, A, 4) float32
        As `dominant` makes them.
    apart : float
        T_d: colours at a distance d of more have nothing in common.
    span : float
        d_max ≥ `apart`: a = 1 - d / d_max.
    distances : (M,) float32, changed
        Every element is written.
    """
    most = one.shape[1]
    for m in range(len(one)):
        alike, mine, theirs = 0.0, 0.0, 0.0
        for i in range(most):
            share = float(one[m, i, 3])
            mine += share
            theirs += other[m, i, 3]
            if share > 0.0:
                for j in range(most):
                    least = min(share, float(other[m, j, 3]))
                    if least > 0.0:
                        red = one[m, i, 0] - other[m, j, 0]
                        green = one[m, i, 1] - other[m, j, 1]
                        blue = one[m, i, 2] - other[m, j, 2]
                        away = np.sqrt(float(red * red + green * green + blue * blue))
                        if away <= apart:
                            alike += (1.0 - away / span) * (1.0 - abs(share - other[m, j, 3])) * least
        distances[m] = 1.0 - min(alike, 1.0) if mine > 0.0 and theirs > 0.0 else np.inf


def unlikeness_twin(one: Single, other: Single, apart: float, span: float, distances: Single) -> None:
    """Do the same in NumPy: the oracle of `unlikeness`."""
    away = np.sqrt(
        ((one[:, :, None, :3] - other[:, None, :, :3]).astype(np.float64) ** 2).sum(axis=-1)
    )  # (M, A, A)
    mine, theirs = one[:, :, None, 3].astype(np.float64), other[:, None, :, 3].astype(np.float64)
    common = (1.0 - np.abs(mine - theirs)) * np.minimum(mine, theirs)
    alike = (np.where(away <= apart, 1.0 - away / span, 0.0) * common).sum(axis=(1, 2))
    there = (one[:, :, 3] > 0).any(axis=1) & (other[:, :, 3] > 0).any(axis=1)
    distances[...] = np.where(there, 1.0 - np.minimum(alike, 1.0), np.inf)

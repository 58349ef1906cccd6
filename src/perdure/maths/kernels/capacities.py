"""Whole capacities of a flow problem from the weights of an energy; see `perdure.maths.maxflow`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for
from perdure.maths.kernels.ibfs import LINKED

Float = NDArray[np.float64]
Ints = NDArray[np.int32]

MOST = 2**29 - 1  # an arc holds up to twice its capacity, an excess what is added to it later


def fill(
    unary: Float, pairwise: Float, scale: float, residual: Ints, excess: Ints, width: int
) -> tuple[int, bool]:
    """Write capacities of arcs and excesses of pixels; return the sum of the unaries below 0, and whether all fit.

    Parameters
    ----------
    unary, pairwise : (H, W), (D / 2, H, W) float64
        D is 4 or 8: weights to the neighbours E, S, SE, SW. Weights of edges that leave the picture are not read.
    scale : float
        Capacities a unit of weight.
    residual, excess : (≥ P * 8,), (≥ P,) int32, changed
        Of a grid with a border; only what lies in the picture is written.
    width : int
        Pixels from a row of the grid to the next.
    """
    below, wrong = _fill(
        unary, pairwise, scale, residual, excess, width, np.zeros(8 * (unary.shape[1] + 2), np.int32)
    )
    return below, wrong == 0


@kernel_for(
    given(np.float64, 2, "C"),
    given(np.float64, 3, "C"),
    float,
    changed(np.int32),
    changed(np.int32),
    int,
    changed(np.int32),
)
def _fill(
    unary: Float, pairwise: Float, scale: float, residual: Ints, excess: Ints, width: int, room: Ints
) -> tuple[int, int]:
    """Return how many do not fit; `room` is scratch for the capacities of two rows, (8 * (W + 2),), 0 before.

    A row's weights are rounded in loops that become vector code, and a pixel's eight capacities written together.
    """
    height, wide = unary.shape
    below: Any = 0
    wrong, step = 0, wide + 2
    for y in range(height):
        row, here, before = (y + 1) * width + 1, (y & 1) * 4 * step + 1, (1 - (y & 1)) * 4 * step + 1
        for x in range(wide):
            value = unary[y, x] * scale
            fits = abs(value) <= MOST
            wrong += 0 if fits else 1
            whole = np.int32(np.floor(value + 0.5)) if fits else np.int32(0)
            below += whole if whole < 0 else 0
            excess[row + x] = -whole
        for d in range(pairwise.shape[0]):
            last = d > 0 and y == height - 1
            begin = 1 if d == 3 else 0
            end = wide - 1 if d == 0 or d == 2 else wide
            if last:
                for x in range(wide):
                    room[here + d * step + x] = 0
                continue
            for x in range(begin, end):
                value = pairwise[d, y, x] * scale
                fits = (value >= 0.0) & (value <= MOST)
                wrong += 0 if fits else 1
                room[here + d * step + x] = np.int32(value + 0.5) if fits else np.int32(0)
        for x in range(wide):
            place = (row + x) * 8
            residual[place] = room[here + x]
            residual[place + 1] = room[here + x - 1]
            residual[place + 2] = room[here + step + x]
            residual[place + 3] = room[before + step + x]
            residual[place + 4] = room[here + 2 * step + x]
            residual[place + 5] = room[before + 2 * step + x - 1]
            residual[place + 6] = room[here + 3 * step + x]
            residual[place + 7] = room[before + 3 * step + x + 1]
    return below, wrong


@kernel_for(given(np.bool_, 2, "C"), changed(np.int32), changed(np.int32), int)
def forbid(domain: NDArray[np.bool_], residual: Ints, excess: Ints, width: int) -> int:
    """Take the pixels outside a domain (H, W) out of the problem; return the sum of their unaries below 0."""
    offsets = (1, -1, width, -width, width + 1, -width - 1, width - 1, -width + 1)
    below = 0
    for y in range(domain.shape[0]):
        for x in range(domain.shape[1]):
            if domain[y, x]:
                continue
            pixel = (y + 1) * width + 1 + x
            below += min(-excess[pixel], 0)
            excess[pixel] = 0
            for j in range(8):
                residual[pixel * 8 + j] = residual[(pixel + offsets[j]) * 8 + (j ^ 1)] = 0
    return below


@kernel_for(given(np.float64, 2, "C"), given(np.bool_, 2, "C"), float, changed(np.int32), int, int)
def shift(
    change: Float, domain: NDArray[np.bool_], scale: float, excess: Ints, height: int, wide: int
) -> tuple[int, bool]:
    """Add to the unaries of a problem that was solved; return by how much its constant grows, and whether all fit.

    Parameters
    ----------
    change : (H, W) float, or (1, 1) for all pixels alike
        What is added to the unaries.
    domain : (H, W) bool, or (0, 0)
        Only these pixels; (0, 0) for all.
    scale, excess
        As in `fill`. Nothing is written if something does not fit.
    height, wide : int
        Of the picture.
    """
    width = wide + 1
    grown: Any = 0
    good: Any = True
    one = change.shape[0] == 1 and change.shape[1] == 1
    for turn in range(2):
        if turn == 1 and not good:
            break
        for y in range(height):
            for x in range(wide):
                if domain.shape[0] > 0 and not domain[y, x]:
                    continue
                value = (change[0, 0] if one else change[y, x]) * scale
                fits = abs(value) <= MOST
                pixel = (y + 1) * width + 1 + x
                before: Any = np.int64(excess[pixel])
                after: Any = before - (int(np.floor(value + 0.5)) if fits else 0)
                if turn == 0:
                    good = good and fits and abs(after) <= 2 * MOST
                else:
                    excess[pixel] = after
                    grown += max(before, 0) - max(after, 0)
    return grown, good


@kernel_for(
    given(np.int64),
    given(np.int64),
    given(np.float64),
    float,
    int,
    int,
    int,
    changed(np.int32),
    changed(np.uint8),
    changed(np.int32),
    changed(np.int32),
    changed(np.uint32),
    changed(np.int32),
    changed(np.int32),
    changed(np.int32),
)
def join(
    places: NDArray[np.int64],
    ends: NDArray[np.int64],
    weights: Float,
    scale: float,
    first: int,
    width: int,
    wide: int,
    residual: Ints,
    mark: NDArray[np.uint8],
    pixels: Ints,
    nodes: Ints,
    bits: NDArray[np.uint32],
    ranks: Ints,
    begins: Ints,
    ways: Ints,
) -> int:
    """Write the links of nodes, and order them by their pixels; return how many weights do not fit.

    Parameters
    ----------
    places, ends, weights : (L,), (K,), (L,)
        As in `maxflow.Nodes`.
    scale : float
        Capacities a unit of weight.
    first : int
        The first node: how many pixels there are.
    width, wide : int
        Pixels from a row of the grid to the next, and in a row of the picture.
    residual, mark : (≥ P * 8 + 2 * L,), (≥ P,), changed
        Capacities of the links, there and back; which pixels have any: LINKED.
    pixels, nodes : (≥ L,) int32, changed
        The ends of each link.
    bits, ranks : (P / 32,), changed
        Which pixels have links, and how many before.
    begins, ways : (≥ L + 1,), (≥ L,), changed
        Where each such pixel's links begin in `ways`, and the links in this order.
    """
    count, node, wrong = len(places), 0, 0
    for word in range(len(bits)):
        bits[word] = 0
    for link in range(count):
        while link >= ends[node]:
            node += 1
        pixel: Any = (places[link] // wide + 1) * width + 1 + places[link] % wide
        value = weights[link] * scale
        fits = value >= 0.0 and value <= MOST
        wrong += 0 if fits else 1
        capacity = np.int32(value + 0.5) if fits else np.int32(0)
        residual[first * 8 + 2 * link] = capacity
        residual[first * 8 + 2 * link + 1] = capacity
        pixels[link] = pixel
        nodes[link] = first + node
        mark[pixel] = LINKED
        bits[pixel >> 5] |= np.uint32(1) << np.uint32(pixel & 31)
    linked = 0
    for word in range(len(bits)):
        ranks[word] = linked
        left = bits[word]
        while left != 0:
            left &= left - np.uint32(1)
            linked += 1
    for rank in range(linked + 1):
        begins[rank] = 0
    for turn in range(2):  # first how many links each pixel has, then which
        for link in range(count):
            pixel = pixels[link]
            left = bits[pixel >> 5] & ((np.uint32(1) << np.uint32(pixel & 31)) - np.uint32(1))
            place: Any = np.int64(ranks[pixel >> 5])
            while left != 0:
                left &= left - np.uint32(1)
                place += 1
            if turn == 0:
                begins[place] += 1
            else:
                begins[place] -= 1
                ways[begins[place]] = link
        if turn == 0:
            for rank in range(1, linked + 1):
                begins[rank] += begins[rank - 1]
    return wrong

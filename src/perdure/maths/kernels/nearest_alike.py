"""The two sets of points that look most alike within reach of where each is expected: mutual best of both.

Looks are bytes, so that sums of their products are whole numbers: exact, in any order and fast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for

Bytes = NDArray[np.uint8]
Float = NDArray[np.float32]
Ints = NDArray[np.int64]


@kernel_for(
    given(np.float32, 2),
    given(np.float32),
    given(np.uint8, 2, "C"),
    given(np.float32, 2),
    given(np.uint8, 2, "C"),
    float,
    changed(np.int64),
    changed(np.float32),
    changed(np.int64),
    changed(np.float32),
    changed(np.int64),
)
def nearest_alike(
    expected: Float,
    reach: Float,
    before: Bytes,
    places: Float,
    now: Bytes,
    least: float,
    found: Ints,
    alike: Float,
    finder: Ints,
    likest: Float,
    squares: Ints,
) -> None:
    """Write for each point which of the new ones it is: the likest within reach, if it is the likest for that one too.

    Parameters
    ----------
    expected : (P, 2) float32
        x, y where each point should be.
    reach : (P,) float32
        How far from there it may be, pixels.
    before : (P, D) uint8
        What it looked like; vectors whose cosine is compared, D ≤ 33 000.
    places : (N, 2) float32
        x, y of new points, in the order of y.
    now : (N, D) uint8
        What they look like.
    least : float
        What is not as alike is no match.
    found : (P,) int64, changed
        The row of the new point; -1 for none.
    alike : (P,) float32, changed
        How alike the two are, in [0, 1]; 0 for none.
    finder, likest, squares : (N,) int64, float32 and int64, changed
        Scratch.
    """
    for j in range(len(places)):
        finder[j], likest[j] = -1, -1.0
        square = np.int32(0)
        for one in range(now.shape[1]):
            square += np.int32(now[j, one]) * np.int32(now[j, one])
        squares[j] = square
    for i in range(len(expected)):
        found[i], alike[i] = -1, 0.0
        low, high = 0, len(places)  # the first new point that is not too far up
        while low < high:
            middle = (low + high) // 2
            if places[middle, 1] < expected[i, 1] - reach[i]:
                low = middle + 1
            else:
                high = middle
        own = np.int32(0)
        for one in range(before.shape[1]):
            own += np.int32(before[i, one]) * np.int32(before[i, one])
        for j in range(low, len(places)):
            across, down = places[j, 0] - expected[i, 0], places[j, 1] - expected[i, 1]
            if down > reach[i]:
                break
            if across * across + down * down > reach[i] * reach[i]:
                continue
            if own == 0 or squares[j] == 0:
                continue
            both = np.int32(0)
            for one in range(before.shape[1]):
                both += np.int32(before[i, one]) * np.int32(now[j, one])
            cosine = np.float32(both / np.sqrt(float(own) * float(squares[j])))
            if cosine < least:
                continue
            if cosine > alike[i]:
                found[i], alike[i] = j, cosine
            if cosine > likest[j]:
                finder[j], likest[j] = i, cosine
    for i in range(len(expected)):
        if found[i] >= 0 and finder[found[i]] != i:
            found[i], alike[i] = -1, 0.0


def nearest_alike_twin(
    expected: Float,
    reach: Float,
    before: Bytes,
    places: Float,
    now: Bytes,
    least: float,
    found: Ints,
    alike: Float,
    finder: Ints,
    likest: Float,
    squares: Ints,
) -> None:
    """Do the same with every pair: the oracle of `nearest_alike`."""
    found[:], alike[:] = -1, 0.0
    if not len(expected) or not len(places):
        return
    away = places[None] - expected[:, None]  # (P, N, 2)
    low, high = expected[:, None, 1] - reach[:, None], reach[:, None]
    near = (away[..., 0] ** 2 + away[..., 1] ** 2 <= reach[:, None] ** 2) & (away[..., 1] <= high)
    near &= places[None, :, 1] >= low
    one, other = before.astype(np.int64), now.astype(np.int64)
    both = one @ other.T  # (P, N)
    size = np.sqrt((one**2).sum(axis=1)[:, None] * (other**2).sum(axis=1)[None].astype(np.float64))
    cosine = np.divide(both, size, out=np.zeros(both.shape), where=size > 0).astype(np.float32)
    cosine = np.where(near & (cosine >= least) & (cosine > 0), cosine, np.float32(-1.0))
    best, back = cosine.argmax(axis=1), cosine.argmax(axis=0)
    rows = np.arange(len(expected))
    good = (cosine[rows, best] > 0) & (back[best] == rows)
    found[good], alike[good] = best[good], np.minimum(cosine[rows, best][good], 1.0)

"""Cast shadows: what is darker than the ground by one factor, texture and all (after Rosin & Ellis 1995)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for
from perdure.maths.kernels.gaussian import DARKENED, MOVING

Single = NDArray[np.float32]

REACH, STRIDE = 4, 2  # pixels: a neighbourhood is 9x9, of which every second pixel is read
LEAST_DARKENED = 8  # of these 25: fewer say nothing
MOST_MOVING = 0.2  # of the darkened: among more of a thing's pixels it is the thing's


@kernel_for(
    given(np.uint8, 3),
    given(np.float32),
    given(np.float32, 3),
    given(np.float32, 2),
    given(np.uint8, 2),
    changed(np.uint8, 2),
    np.float32,
    np.float32,
)
def evenly_darker(
    image: NDArray[np.uint8],
    exposure: Single,
    mean: Single,
    variance: Single,
    foreground: NDArray[np.uint8],
    even: NDArray[np.uint8],
    least_variance: np.float32,
    most_uneven: np.float32,
) -> None:
    """Mark in `even` (255 or 0) which DARKENED pixels are, with those around them, the model's times one factor.

    A cast shadow multiplies the ground, its texture and all, by one factor; a dark thing has a relief of its own. The
    factor is the least squares one over the DARKENED pixels of the neighbourhood, which must not be few, nor have many
    MOVING ones among them.

    Parameters
    ----------
    image : (H, W, 3) uint8
        The picture.
    exposure : (3,) float32
        What each channel is multiplied by before it is compared.
    mean : (H, W, 3) float32
        Grey levels.
    variance : (H, W) float32
        Mean over the channels, in squared grey levels.
    foreground : (H, W) uint8
        Marks of `compare_and_learn`.
    even : (H, W) uint8, changed
        Every element is written.
    least_variance : float32
        Squared grey levels.
    most_uneven : float32
        Even where the mean squared rest <= most_uneven * max(variance, least_variance).
    """
    height, width = foreground.shape
    red, green, blue = exposure[0], exposure[1], exposure[2]
    for y in range(height):
        for x in range(width):
            even[y, x] = 0
            if foreground[y, x] != DARKENED:
                continue
            count, moving, seen2, both, known2 = 0, 0, 0.0, 0.0, 0.0
            for v in range(max(y - REACH, (y - REACH) % STRIDE), min(y + REACH + 1, height), STRIDE):
                for u in range(max(x - REACH, (x - REACH) % STRIDE), min(x + REACH + 1, width), STRIDE):
                    if foreground[v, u] == DARKENED:
                        seen = (
                            np.float64(image[v, u, 0]) * red
                            + np.float64(image[v, u, 1]) * green
                            + np.float64(image[v, u, 2]) * blue
                        )
                        known = np.float64(mean[v, u, 0]) + mean[v, u, 1] + mean[v, u, 2]
                        count += 1
                        seen2 += seen * seen
                        both += seen * known
                        known2 += known * known
                    elif foreground[v, u] == MOVING:
                        moving += 1
            if count < LEAST_DARKENED or moving > MOST_MOVING * count:
                continue
            rest = (seen2 - both * both / max(known2, 1.0)) / (9.0 * count)
            if rest <= most_uneven * max(variance[y, x], least_variance):
                even[y, x] = 255


def evenly_darker_twin(
    image: NDArray[np.uint8],
    exposure: Single,
    mean: Single,
    variance: Single,
    foreground: NDArray[np.uint8],
    even: NDArray[np.uint8],
    least_variance: np.float32,
    most_uneven: np.float32,
) -> None:
    """Do the same in NumPy, pixel by pixel: the oracle of `evenly_darker`."""
    seen = (image.astype(np.float64) * exposure).sum(axis=2)  # (H, W)
    known = mean.astype(np.float64).sum(axis=2)
    rows, columns = np.indices(foreground.shape)
    even[...] = 0
    for y, x in np.argwhere(foreground == DARKENED).tolist():
        down, right = np.abs(rows - y), np.abs(columns - x)
        near = (down <= REACH) & (right <= REACH) & (down % STRIDE == 0) & (right % STRIDE == 0)
        here = near & (foreground == DARKENED)
        if here.sum() < LEAST_DARKENED or (near & (foreground == MOVING)).sum() > MOST_MOVING * here.sum():
            continue
        one, other = seen[here], known[here]
        factor = (one @ other) / max(other @ other, 1.0)
        rest = np.square(one - factor * other).mean() / 9.0
        even[y, x] = 255 if rest <= most_uneven * max(variance[y, x], least_variance) else 0

"""One running Gaussian per pixel: compare, label, learn, in one pass (Wren et al. 1997)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import kernel

Single = NDArray[np.float32]


@kernel
def compare_and_learn(
    image: NDArray[np.uint8],
    exposure: Single,
    mean: Single,
    variance: Single,
    foreground: NDArray[np.uint8],
    squared_threshold: np.float32,
    least_variance: np.float32,
    rate: np.float32,
    foreground_rate: np.float32,
) -> None:
    """Mark the pixels far from their mean in `foreground` (255 or 0) and let the model learn in place.

    Parameters
    ----------
    image : (H, W, 3) uint8
        The picture.
    exposure : (3,) float32
        What each channel is multiplied by before it is compared.
    mean : (H, W, 3) float32, changed
        Grey levels.
    variance : (H, W) float32, changed
        Mean over the channels, in squared grey levels.
    foreground : (H, W) uint8, changed
        Every element is written.
    squared_threshold, least_variance : float32
        Foreground where the mean squared difference > squared_threshold * max(variance, least_variance).
    rate, foreground_rate : float32
        In [0, 1]: how far background and foreground pixels move towards what they see.
    """
    third = np.float32(1.0) / np.float32(3.0)
    for y in range(image.shape[0]):
        for x in range(image.shape[1]):
            red = np.float32(image[y, x, 0]) * exposure[0] - mean[y, x, 0]
            green = np.float32(image[y, x, 1]) * exposure[1] - mean[y, x, 1]
            blue = np.float32(image[y, x, 2]) * exposure[2] - mean[y, x, 2]
            squared = (red * red + green * green + blue * blue) * third
            if squared > squared_threshold * max(variance[y, x], least_variance):
                foreground[y, x] = 255
                step = foreground_rate
            else:
                foreground[y, x] = 0
                step = rate
                variance[y, x] += rate * (squared - variance[y, x])
            mean[y, x, 0] += step * red
            mean[y, x, 1] += step * green
            mean[y, x, 2] += step * blue


def compare_and_learn_twin(
    image: NDArray[np.uint8],
    exposure: Single,
    mean: Single,
    variance: Single,
    foreground: NDArray[np.uint8],
    squared_threshold: np.float32,
    least_variance: np.float32,
    rate: np.float32,
    foreground_rate: np.float32,
) -> None:
    """Do the same in NumPy: the oracle of `compare_and_learn`."""
    third = np.float32(1.0) / np.float32(3.0)
    difference = image.astype(np.float32) * exposure - mean  # (H, W, 3)
    red, green, blue = difference[..., 0], difference[..., 1], difference[..., 2]
    squared = (red * red + green * green + blue * blue) * third  # (H, W)
    moving = squared > squared_threshold * np.maximum(variance, least_variance)
    foreground[...] = np.where(moving, 255, 0)
    variance += np.where(moving, np.float32(0.0), rate * (squared - variance))
    mean += np.where(moving, foreground_rate, rate)[..., None] * difference

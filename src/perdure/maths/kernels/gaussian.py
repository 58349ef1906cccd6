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
    darkest_shadow: np.float32,
    rate: np.float32,
    foreground_rate: np.float32,
) -> None:
    """Mark the pixels far from their mean in `foreground` (255; 127 for shadow; or 0) and let the model learn in place.

    Parameters
    ----------
    image : (H, W, 3) uint8
        The picture; this and the other arrays contiguous.
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
    darkest_shadow : float32
        In [0, 1]: a pixel as bright as this share of its mean or brighter, but no brighter than it, and
        of its colour within the same threshold, is shadow: it learns like background (Horprasert et al. 1999).
        1: no shadows.
    rate, foreground_rate : float32
        In [0, 1]: how far background and foreground pixels move towards what they see.
    """
    third = np.float32(1.0) / np.float32(3.0)
    first, second, last = exposure[0], exposure[1], exposure[2]
    colours, means = image.reshape(-1), mean.reshape(-1)  # (3 H W,), views: one flat loop becomes vector code
    variances, marks = variance.reshape(-1), foreground.reshape(-1)  # (H W,)
    for i in range(variances.shape[0]):
        red = np.float32(colours[3 * i]) * first - means[3 * i]
        green = np.float32(colours[3 * i + 1]) * second - means[3 * i + 1]
        blue = np.float32(colours[3 * i + 2]) * last - means[3 * i + 2]
        squared = (red * red + green * green + blue * blue) * third
        known = variances[i]
        limit = squared_threshold * max(known, least_variance)
        # Brightness: the multiple of the mean that is nearest; colour: what is left beside it.
        along = red * means[3 * i] + green * means[3 * i + 1] + blue * means[3 * i + 2]
        length = (
            means[3 * i] * means[3 * i] + means[3 * i + 1] * means[3 * i + 1] + means[3 * i + 2] * means[3 * i + 2]
        )
        beside = squared - along * along / max(length, np.float32(1.0)) * third
        shadow = (along <= 0) & (along >= (darkest_shadow - np.float32(1.0)) * length) & (beside <= limit)
        far = squared > limit
        moving = far & ~shadow
        marks[i] = 255 if moving else (127 if far else 0)
        step = foreground_rate if moving else rate
        variances[i] = known + (np.float32(0.0) if moving else rate * (squared - known))
        means[3 * i] += step * red
        means[3 * i + 1] += step * green
        means[3 * i + 2] += step * blue


def compare_and_learn_twin(
    image: NDArray[np.uint8],
    exposure: Single,
    mean: Single,
    variance: Single,
    foreground: NDArray[np.uint8],
    squared_threshold: np.float32,
    least_variance: np.float32,
    darkest_shadow: np.float32,
    rate: np.float32,
    foreground_rate: np.float32,
) -> None:
    """Do the same in NumPy: the oracle of `compare_and_learn`."""
    third = np.float32(1.0) / np.float32(3.0)
    difference = image.astype(np.float32) * exposure - mean  # (H, W, 3)
    red, green, blue = difference[..., 0], difference[..., 1], difference[..., 2]
    squared = (red * red + green * green + blue * blue) * third  # (H, W)
    limit = squared_threshold * np.maximum(variance, least_variance)
    along = (difference * mean).astype(np.float32)
    along = along[..., 0] + along[..., 1] + along[..., 2]  # (H, W)
    length = mean[..., 0] * mean[..., 0] + mean[..., 1] * mean[..., 1] + mean[..., 2] * mean[..., 2]
    beside = squared - along * along / np.maximum(length, np.float32(1.0)) * third
    shadow = (along <= 0) & (along >= (darkest_shadow - np.float32(1.0)) * length) & (beside <= limit)
    far = squared > limit
    moving = far & ~shadow
    foreground[...] = np.where(moving, 255, np.where(far, 127, 0))
    variance += np.where(moving, np.float32(0.0), rate * (squared - variance))
    mean += np.where(moving, foreground_rate, rate)[..., None] * difference

"""One running Gaussian per pixel: compare, label, learn, in one pass (Wren et al. 1997)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for

Single = NDArray[np.float32]

MOVING, DARKENED, SHADOW, WEAK = 255, 191, 127, 63  # marks of pixels; 0 is background
SHADOW_COLOUR = 0.25  # of the squared threshold: a shadow keeps the ground's colour better than its brightness
WEAK_SHARE = 0.25  # of the squared threshold: half as far from the mean as what is foreground


@kernel_for(
    given(np.uint8, 3, "C"),
    given(np.float32),
    changed(np.float32, 3),
    changed(np.float32, 2),
    given(np.uint8, 2, "C"),
    changed(np.uint8, 2),
    changed(np.uint8, 2),
    np.float32,
    np.float32,
    np.float32,
    np.float32,
    np.float32,
    np.float32,
)
def compare_and_learn(
    image: NDArray[np.uint8],
    exposure: Single,
    mean: Single,
    variance: Single,
    held: NDArray[np.uint8],
    foreground: NDArray[np.uint8],
    contrast: NDArray[np.uint8],
    squared_threshold: np.float32,
    least_variance: np.float32,
    faintest_shadow: np.float32,
    darkest_shadow: np.float32,
    rate: np.float32,
    foreground_rate: np.float32,
) -> None:
    """Mark each pixel in `foreground`, and let the model learn in place.

    MOVING: far from the mean. SHADOW: as far, but a little darker than the ground and of its colour. DARKENED: the
    same, but much darker, so that only its neighbourhood can tell (`evenly_darker`). WEAK: half as far. 0: background.

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
    held : (H, W) uint8
        Where it is not 0 the model learns nothing.
    foreground : (H, W) uint8, changed
        Every element is written.
    contrast : (H, W) uint8, changed
        Every element is written: how far from the mean, root mean square over the channels, in whole grey levels.
    squared_threshold, least_variance : float32
        Foreground where the mean squared difference > squared_threshold * max(variance, least_variance).
    faintest_shadow, darkest_shadow : float32
        In [0, 1]: a pixel of its mean's colour (within SHADOW_COLOUR of the threshold) and no brighter than it is
        SHADOW if it is as bright as the first share of its mean or brighter, and learns like background
        (Horprasert et al. 1999); DARKENED if at least as bright as the second. 1: none.
    rate, foreground_rate : float32
        In [0, 1]: how far background and foreground pixels move towards what they see.
    """
    third = np.float32(1.0) / np.float32(3.0)
    first, second, last = exposure[0], exposure[1], exposure[2]
    colours, means = image.reshape(-1), mean.reshape(-1)  # (3 H W,), views: one flat loop becomes vector code
    variances, marks, contrasts = variance.reshape(-1), foreground.reshape(-1), contrast.reshape(-1)  # (H W,)
    closed = held.reshape(-1)
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
        coloured = (along <= 0) & (beside <= np.float32(SHADOW_COLOUR) * limit)
        shadow = coloured & (along >= (faintest_shadow - np.float32(1.0)) * length)
        darkened = coloured & (along >= (darkest_shadow - np.float32(1.0)) * length)
        far, weak = squared > limit, squared > np.float32(WEAK_SHARE) * limit
        moving = far & ~shadow
        marks[i] = (DARKENED if darkened else MOVING) if moving else (SHADOW if far else (WEAK if weak else 0))
        contrasts[i] = np.uint8(min(np.sqrt(squared), np.float32(255.0)))
        usual = np.float32(0.0) if closed[i] else rate
        step = (np.float32(0.0) if closed[i] else foreground_rate) if moving else usual
        variances[i] = known + (np.float32(0.0) if moving else usual * (squared - known))
        means[3 * i] += step * red
        means[3 * i + 1] += step * green
        means[3 * i + 2] += step * blue


def compare_and_learn_twin(
    image: NDArray[np.uint8],
    exposure: Single,
    mean: Single,
    variance: Single,
    held: NDArray[np.uint8],
    foreground: NDArray[np.uint8],
    contrast: NDArray[np.uint8],
    squared_threshold: np.float32,
    least_variance: np.float32,
    faintest_shadow: np.float32,
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
    coloured = (along <= 0) & (beside <= np.float32(SHADOW_COLOUR) * limit)
    shadow = coloured & (along >= (faintest_shadow - np.float32(1.0)) * length)
    darkened = coloured & (along >= (darkest_shadow - np.float32(1.0)) * length)
    far, weak = squared > limit, squared > np.float32(WEAK_SHARE) * limit
    moving = far & ~shadow
    foreground[...] = np.select([moving & darkened, moving, far, weak], [DARKENED, MOVING, SHADOW, WEAK])
    contrast[...] = np.minimum(np.sqrt(squared), np.float32(255.0)).astype(np.uint8)
    usual = np.where(held != 0, np.float32(0.0), rate)
    variance += np.where(moving, np.float32(0.0), usual * (squared - variance))
    mean += np.where(moving & (held == 0), foreground_rate, usual)[..., None] * difference

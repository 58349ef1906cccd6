"""Motion between two pictures: of pixels with contrast, of all pixels, and of the camera.

Flow is stored on the current picture: vectors[y, x] = (dx, dy) says that what is now at (x, y) was at
(x - dx, y - dy) in the previous one. So it is computed backwards, from current to previous, and negated. A vector is
valid if the way there and back again ends where it began.

`sparse`: Lucas & Kanade (1981) on pyramids (Bouguet, 2000), where both directions have contrast (Shi & Tomasi,
*Good features to track*, 1994). `dense`: Kroeger et al., *Fast optical flow using dense inverse search* (2016).
`global_motion`: an affine map by least median of squares (Rousseeuw, 1984), then Tukey's biweight; its samples are the
same in every call, and no global generator is drawn from.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from perdure.errors import ParameterError

Bits = NDArray[np.bool_]
Float = NDArray[np.float64]
Grey = NDArray[np.uint8]
Single = NDArray[np.float32]

_WINDOW = 11  # pixels across that Lucas-Kanade compares
_LEVELS = 3  # halvings of the picture at most: motions up to some 60 px a frame are found
_SMALL = 45  # pixels a side that halving leaves at least: in less, a window sees several things at once
_STEPS, _CLOSE = 10, 0.03  # iterations of Lucas-Kanade at most; px below which it stops
_STRONG = 0.99  # quantile of contrast; one black corner must not silence the rest of the picture
_NOISE = 2.0  # squared grey levels a pixel: what noise alone has for contrast
_ASTRAY = 1.0  # pixels by which there and back may differ
_CORNERS, _QUALITY = 400, 0.005  # of global motion: how many at most, and of what share of the best one's contrast
_FEWEST = 8  # corners that must agree before a motion of the camera is believed
_SAMPLES = 200  # of three corners: with half of them astray, one in eight is good
_FIRST = 16  # of these are measured first
_STILL = 0.1  # pixels: a camera that seems to move less stands still
_SMALLEST = 12  # pixels a side: less has no room for patches and pyramids
_STIFF = 9.0  # pixels²: how much corners must spread before anything but a translation is believed


@dataclass(frozen=True, eq=False)
class Flow:
    """Where what is now seen has come from; zeros where that is not known."""

    vectors: Single  # (H, W, 2) dx, dy in pixels a frame, of the pixels of the current picture
    valid: Bits  # (H, W)


def sparse(
    previous: Grey,
    current: Grey,
    *,
    contrast: float = 0.02,
    step: int = 4,
    where: Bits | None = None,
    astray: float = _ASTRAY,
) -> Flow:
    """Track what has contrast, on a lattice (pyramidal Lucas-Kanade).

    Parameters
    ----------
    previous, current : (H, W) uint8
        Grey levels.
    contrast : float
        In [0, 1]: a lattice point is tracked if the smaller eigenvalue of the structure tensor around it is at least
        this share of what the strongest hundredth of the points has, and more than noise.
    step : int
        ≥ 1, pixels between lattice points; each speaks for the square of so many pixels around it.
    where : (H, W) bool, optional
        Where flow is wanted, if not everywhere.
    astray : float
        Pixels by which there and back may differ.

    Returns
    -------
    Flow
        Without a valid vector where nothing has contrast.

    Raises
    ------
    ParameterError
        Pictures of different sizes or kinds; a number out of its range.
    """
    _check(previous, current, where)
    if not 0 <= contrast <= 1:
        raise ParameterError(f"contrast is {contrast}; it lies in [0, 1]")
    if step < 1:
        raise ParameterError(f"step is {step}; a lattice has steps of 1 pixel or more")
    on_lattice = np.s_[step // 2 :: step, step // 2 :: step]
    strength = _contrast(current)[on_lattice]  # (h, w)
    if not strength.size:
        return _nothing(current.shape)
    enough = strength >= max(contrast * float(np.quantile(strength, _STRONG)), _NOISE)
    rows, columns = np.nonzero(enough if where is None else enough & where[on_lattice])
    if not len(rows):
        return _nothing(current.shape)
    points = np.stack([columns, rows], axis=1).astype(np.float32) * step + step // 2  # (N, 2) x, y
    there, good = _tracked(current, previous, points, astray)
    vectors, valid = np.zeros((*strength.shape, 2), np.float32), np.zeros(strength.shape, np.bool_)
    vectors[rows[good], columns[good]] = (points - there)[good]
    valid[rows[good], columns[good]] = True
    vectors, valid = _spread(vectors, step, current.shape), _spread(valid, step, current.shape)
    if where is not None:
        valid &= where
        vectors[~valid] = 0
    return Flow(vectors, valid)


def dense(
    previous: Grey, current: Grey, *, preset: Literal["fast", "medium"] = "fast", astray: float = _ASTRAY
) -> Flow:
    """Find the motion of every pixel (dense inverse search), valid where there and back agree.

    Parameters
    ----------
    previous, current : (H, W) uint8
        Grey levels.
    preset : {'fast', 'medium'}
        OpenCV's: 'medium' is finer and takes several times as long.
    astray : float
        Pixels by which there and back may differ; what has come into sight or gone out of it is not valid. `inf`
        asks for no way back, in half the time: valid is what comes from inside the picture.

    Returns
    -------
    Flow
        Flat parts move as what is around them. Pictures of one grey level, or of less than 12 pixels a side, have no
        valid vector.

    Raises
    ------
    ParameterError
        Pictures of different sizes or kinds; a preset that is not known.
    """
    import cv2

    _check(previous, current, None)
    presets = {"fast": cv2.DISOPTICAL_FLOW_PRESET_FAST, "medium": cv2.DISOPTICAL_FLOW_PRESET_MEDIUM}
    if preset not in presets:
        raise ParameterError(f"preset is {preset!r}; 'fast' and 'medium' are known")
    height, width = current.shape
    if min(height, width) < _SMALLEST or current.min() == current.max():
        return _nothing(current.shape)
    search = cv2.DISOpticalFlow.create(presets[preset])
    before, now = np.ascontiguousarray(previous), np.ascontiguousarray(current)
    there = search.calc(now, before, None)  # type: ignore[call-overload]
    x = there[..., 0] + np.arange(width, dtype=np.float32)
    y = there[..., 1] + np.arange(height, dtype=np.float32)[:, None]
    valid: Bits = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
    if np.isfinite(astray):
        back = search.calc(before, now, None)  # type: ignore[call-overload]
        back = cv2.remap(back, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # on the current picture
        off = there + back
        valid &= off[..., 0] ** 2 + off[..., 1] ** 2 < astray**2
    vectors = np.negative(there)
    vectors[~valid] = 0
    return Flow(vectors, valid)


def global_motion(previous: Grey, current: Grey, exclude: Bits | None = None) -> Float:
    """Find how the camera's motion displaces the picture.

    Parameters
    ----------
    previous, current : (H, W) uint8
        Grey levels.
    exclude : (H, W) bool, optional
        Of the previous picture: what moves by itself. Less than half of the rest may.

    Returns
    -------
    (2, 3) float64
        The affine map from previous pixel coordinates (x, y, 1) to current ones. Exactly the identity if the pictures
        are equal, if too few corners agree, or if it would move those that agree by less than a tenth of a pixel.

    Raises
    ------
    ParameterError
        Pictures of different sizes or kinds.
    """
    import cv2

    _check(previous, current, exclude)
    identity = np.eye(2, 3)
    if min(previous.shape) < _SMALLEST or np.array_equal(previous, current):
        return identity
    free = None
    if exclude is not None:  # a corner's window must not touch what moves by itself
        free = 1 - np.asarray(
            cv2.dilate(exclude.astype(np.uint8), np.ones((_WINDOW, _WINDOW), np.uint8)), np.uint8
        )
    apart = max(3.0, max(previous.shape) / 60)  # so that no spot has more than its share
    corners = cv2.goodFeaturesToTrack(np.ascontiguousarray(previous), _CORNERS, _QUALITY, apart, mask=free)
    if corners is None:
        return identity
    points = np.asarray(corners.reshape(-1, 2), np.float32)
    there, good = _tracked(previous, current, points, _ASTRAY)
    begin, end = points[good].astype(np.float64), there[good].astype(np.float64)
    if len(begin) < _FEWEST:
        return identity
    found, agree = _robust(begin, end)
    moved = _off(found, begin[agree], begin[agree])
    return found if len(moved) >= _FEWEST and np.sqrt((moved**2).mean()) >= _STILL else identity


def warp(image: NDArray[Any], affine: Float) -> NDArray[Any]:
    """Return a picture (H, W) or (H, W, C), or a mask (H, W) bool, as an affine map of pixel coordinates moves it.

    Pictures are interpolated, masks take the nearest pixel; 0 or False comes in from outside.
    """
    import cv2

    size = image.shape[1], image.shape[0]
    if not image.size:
        return image.copy()
    if image.dtype == np.bool_:
        bits = cv2.warpAffine(image.view(np.uint8), affine, size, flags=cv2.INTER_NEAREST)
        return bits.astype(np.bool_)
    return cv2.warpAffine(image, affine, size, flags=cv2.INTER_LINEAR)


def _check(previous: Grey, current: Grey, mask: Bits | None) -> None:
    for name, image in (("previous", previous), ("current", current)):
        if image.ndim != 2 or image.dtype != np.uint8:
            raise ParameterError(
                f"{name} is {image.dtype} of the shape {image.shape}; grey levels are uint8 (H, W)"
            )
    if previous.shape != current.shape:
        raise ParameterError(f"previous is {previous.shape} and current {current.shape}; one size would do")
    if mask is not None and mask.shape != current.shape:
        raise ParameterError(f"the mask is {mask.shape} and the pictures {current.shape}; one size would do")


def _nothing(shape: tuple[int, ...]) -> Flow:
    """No flow anywhere."""
    return Flow(np.zeros((*shape, 2), np.float32), np.zeros(shape, np.bool_))


def _contrast(image: Grey) -> Single:
    """Smaller eigenvalue (H, W) of the mean structure tensor of 5x5 pixels, in squared grey levels a pixel."""
    import cv2

    if not image.size:
        return np.zeros(image.shape, np.float32)
    scale = 255.0**2 / 4  # OpenCV sums over the window slopes that it divided by 255 · window / 2
    return np.asarray(cv2.cornerMinEigenVal(np.ascontiguousarray(image), 5, ksize=3) * scale, np.float32)


def _tracked(source: Grey, target: Grey, points: Single, astray: float) -> tuple[Single, Bits]:
    """Where points (N, 2) of a picture are in another, and whether they come back to where they were."""
    import cv2

    options: dict[str, Any] = {
        "winSize": (_WINDOW, _WINDOW),
        "maxLevel": min(_LEVELS, max(0, int(np.log2(max(min(source.shape), 1) / _SMALL)))),
        "criteria": (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, _STEPS, _CLOSE),
    }
    one, other = np.ascontiguousarray(source), np.ascontiguousarray(target)
    nowhere: Any = None  # OpenCV's stubs know no "begin where they are"
    there, found, _ = cv2.calcOpticalFlowPyrLK(one, other, points, nowhere, **options)
    again, back, _ = cv2.calcOpticalFlowPyrLK(other, one, there, nowhere, **options)
    height, width = target.shape
    inside = ((there >= 0) & (there <= (width - 1, height - 1))).all(axis=1)
    near = ((again - points) ** 2).sum(axis=1) < astray**2
    return np.asarray(there, np.float32), np.asarray(inside & near & (found[:, 0] == 1) & (back[:, 0] == 1))


def _spread(lattice: NDArray[Any], step: int, shape: tuple[int, ...]) -> NDArray[Any]:
    """A picture in which each lattice point fills its square; the last ones fill what is left over."""
    for axis in (0, 1):
        nearest = np.minimum(np.arange(shape[axis]) // step, lattice.shape[axis] - 1)
        lattice = np.take(lattice, nearest, axis=axis)
    return lattice


def _robust(begin: Float, end: Float) -> tuple[Float, Bits]:
    """The affine map (2, 3) that most of N ≥ 3 pairs of points (N, 2) agree on, and which do (N,)."""
    triples = np.random.default_rng(0).integers(
        0, len(begin), (_SAMPLES, 3)
    )  # its own generator, the same each time
    tried = np.concatenate([_affine(begin[triples], end[triples], np.ones((_SAMPLES, 3))), np.eye(2, 3)[None]])
    off = _off(tried, begin, end)  # (S, N)
    good = np.median(off[:_FIRST], axis=1).min()  # who has a smaller median has half of the points within it
    tried, off = (each[np.count_nonzero(off <= good, axis=1) >= len(begin) // 2] for each in (tried, off))
    medians = np.median(off, axis=1)
    found, spread = tried[int(medians.argmin())], float(medians.min())
    for _ in range(10):
        scale = max(4.685 * 1.4826 * spread / np.sqrt(2), 0.5)  # of Tukey's biweight, in pixels
        off = _off(found, begin, end)
        weights = np.maximum(1 - (off / scale) ** 2, 0) ** 2
        if weights.sum() < 3:
            break
        found = _affine(begin, end, weights)
        spread = float(np.median(_off(found, begin, end)))
    return found, _off(found, begin, end) < scale


def _off(affine: Float, begin: Float, end: Float) -> Float:
    """Distances (..., N) in pixels of points from where affine maps (..., 2, 3) take them."""
    (x, y), goals = begin.T, end.T
    squared: Any = 0.0
    for axis in (0, 1):
        across, down, shift = (affine[..., axis, column, None] for column in range(3))  # (..., 1) each
        squared = squared + (across * x + down * y + (shift - goals[axis])) ** 2
    return np.asarray(np.sqrt(squared), np.float64)


def _affine(begin: Float, end: Float, weights: Float) -> Float:
    """The affine maps (..., 2, 3) by least squares; the less the points spread, the nearer to a translation."""
    share = (weights / weights.sum(axis=-1, keepdims=True))[..., None, :]  # (..., 1, N)
    middle, goal = share @ begin, share @ end  # (..., 1, 2)
    x, y = begin - middle, end - goal - (begin - middle)  # what is beyond a translation
    weighted = (x * weights[..., None]).swapaxes(-1, -2)  # (..., 2, N)
    turned = np.linalg.solve(weighted @ x + _STIFF * np.eye(2), weighted @ y)  # (..., 2, 2), its columns
    linear = np.eye(2) + turned.swapaxes(-1, -2)
    return np.concatenate([linear, (goal - middle @ linear.swapaxes(-1, -2)).swapaxes(-1, -2)], axis=-1)

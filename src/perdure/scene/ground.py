"""The ground plane: from pixels to metres and back, and how surely.

A point (u, v) of the picture, straightened if the lens bends, lies on the ground at (X, Y) where

    w (X, Y, 1) = H (u, v, 1)        w > 0: in front of the camera and below the horizon

H is known up to a factor; its sign is chosen so that w > 0 where the ground is seen. w = 0 is the horizon. Where the
camera is known, a point at height Z over (X, Y) is seen at P (X, Y, Z, 1), and H is the inverse of the columns 1, 2, 4
of P; column 3 is where the vertical leads, which gives heights in metres. Points count from the corner of the picture,
as boxes do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.scene.lens import Float, Lens

PIXEL = 1.0  # px: how surely a foot is placed, where nobody says
_STEP = 1e-5  # of numeric derivatives
_EDGE = 1e-9  # of the largest w in the picture, below which a point counts as on the horizon


class Unusable(ValueError):
    """A plane that no camera sees; the text says what is wrong and what would do."""


@dataclass(frozen=True, eq=False)
class Ground:
    """The ground plane of a camera that stands still.

    Parameters
    ----------
    homography : (3, 3)
        From straightened pixels to metres.
    size : (int, int)
        Width and height of the pictures that it holds for.
    covariance : (9, 9)
        Of the homography's entries, row by row; zeros where it is exact.
    vertical : (3,)
        Column 3 of the projection whose columns 1, 2, 4 are the homography's inverse; zeros where it is not known.
    lens : Lens or None
        What bends the picture.
    origin : str
        'homography', 'camera', 'points', 'distances' or 'video'.
    body : float
        Metres that things here were taken to be high; 0 where nothing was assumed.
    """

    homography: Float
    size: tuple[int, int]
    covariance: Float
    vertical: Float
    lens: Lens | None = None
    origin: str = "homography"
    body: float = 0.0

    @property
    def has_heights(self) -> bool:
        """Whether heights over the ground are known."""
        return bool(self.vertical.any())

    @property
    def mirrored(self) -> bool:
        """Whether, seen from above, the metres run the other way round: Y to the right of X."""
        return bool(np.linalg.det(self.homography) > 0)

    @property
    def horizon(self) -> Float:
        """The line (a, b, c) of straightened pixels with a x + b y + c = 0, a² + b² = 1; positive on the ground's side.

        (0, 0, 1) where there is none in reach: seen from straight above.
        """
        line = self.homography[2]
        length = float(np.hypot(line[0], line[1]))
        width, height = self.size
        if length * max(width, height) < 1e-9 * abs(float(line[2])):
            return np.array([0.0, 0.0, 1.0])
        return np.asarray(line / length, np.float64)

    def places(self, points: ArrayLike) -> Float:
        """Return the places (N, 2) in metres of points (N, 2) in pixels; NaN for points above the horizon."""
        return _projected(self.homography, self._straight(points))

    def seen(self, places: ArrayLike, heights: ArrayLike = 0.0) -> Float:
        """Return the pixels (N, 2) where places (N, 2) are seen, or points at some height over them; NaN where not."""
        where = np.asarray(places, np.float64).reshape(-1, 2)
        columns = np.linalg.inv(self.homography)
        found = np.c_[where, np.ones(len(where))] @ columns.T  # (N, 3)
        found = found + np.asarray(heights, np.float64).reshape(-1, 1) * self.vertical
        points = _divided(found, 0.0)
        return points if self.lens is None else self.lens.bent(points)

    def spread(self, points: ArrayLike, noise: ArrayLike = PIXEL) -> Float:
        """Return the covariances (N, 2, 2) in m² of the places of points (N, 2); NaN above the horizon.

        `noise` is the standard deviation of the points in pixels, a number, (N,), or (N, 2) for x and y; the
        homography's own covariance is added.
        """
        own = self._entries(self._straight(points))  # (N, 2, 9)
        return np.asarray(self.jitter(points, noise) + own @ self.covariance @ own.transpose(0, 2, 1))

    def jitter(self, points: ArrayLike, noise: ArrayLike = PIXEL) -> Float:
        """Return the part (N, 2, 2) of `spread` that comes of the pixels: all that counts between two near points."""
        straight = self._straight(points)
        across = self._slopes(straight)  # (N, 2, 2): metres a pixel
        if self.lens is not None:
            across = across @ self.lens.slopes(straight)
        given = np.asarray(noise, np.float64)
        deviation = np.broadcast_to(given if given.ndim == 2 else given.reshape(-1, 1), (len(straight), 2))
        scaled = across * deviation[:, None, :]
        return np.asarray(scaled @ scaled.transpose(0, 2, 1), np.float64)

    def heights(self, boxes: ArrayLike) -> Float:
        """Return how high (N,) in metres the things in boxes (N, 4) are that stand on the ground.

        NaN where the verticals are not known, and for feet above the horizon.
        """
        edges = np.asarray(boxes, np.float64).reshape(-1, 4)
        if not self.has_heights:
            return np.full(len(edges), np.nan)
        middle = (edges[:, 0] + edges[:, 2]) / 2
        foot = self.places(feet(edges))
        top = self._straight(np.stack([middle, edges[:, 1]], axis=1))[:, 1]
        base = np.c_[foot, np.ones(len(foot))] @ np.linalg.inv(self.homography).T
        # (base + Z vertical) is seen in the row `top`
        with np.errstate(all="ignore"):
            height = (top * base[:, 2] - base[:, 1]) / (self.vertical[1] - top * self.vertical[2])
        return np.where(np.isfinite(height) & (height >= 0), height, np.nan)

    def about(self) -> dict[str, object]:
        """Return what a run notes of the ground."""
        return {
            "origin": self.origin,
            "homography": self.homography.tolist(),
            "horizon": self.horizon.tolist(),
            "heights": self.has_heights,
        }

    def _straight(self, points: ArrayLike) -> Float:
        given = np.asarray(points, np.float64).reshape(-1, 2)
        return given if self.lens is None else self.lens.straightened(given)

    def _slopes(self, straight: Float) -> Float:
        """How places move with straightened pixels (N, 2, 2)."""
        place = _projected(self.homography, straight)
        weight = _weights(self.homography, straight)
        rows = self.homography[None, :2, :2] - place[:, :, None] * self.homography[None, 2:, :2]
        with np.errstate(all="ignore"):
            return np.asarray(rows / weight[:, None, None], np.float64)

    def _entries(self, straight: Float) -> Float:
        """How places move with the homography's entries (N, 2, 9)."""
        place = _projected(self.homography, straight)
        with np.errstate(all="ignore"):
            ray = np.c_[straight, np.ones(len(straight))] / _weights(self.homography, straight)[:, None]
        found = np.zeros((len(straight), 2, 9))
        found[:, 0, 0:3] = found[:, 1, 3:6] = ray
        found[:, :, 6:9] = -place[:, :, None] * ray[:, None, :]
        return found


def feet(boxes: NDArray[np.floating]) -> Float:
    """Return where things in boxes (N, 4) stand: the middle of the lower edge (N, 2)."""
    wide = np.asarray(boxes, np.float64)
    return np.stack([(wide[:, 0] + wide[:, 2]) / 2, wide[:, 3]], axis=1)


def of_homography(
    matrix: ArrayLike,
    size: tuple[int, int],
    *,
    on_ground: tuple[float, float] | None = None,
    covariance: ArrayLike | None = None,
    origin: str = "homography",
) -> Ground:
    """Make a ground of a matrix (3, 3) from pixels to metres.

    Parameters
    ----------
    matrix : (3, 3)
        Known up to a factor.
    size : (int, int)
        Width and height of the picture.
    on_ground : (float, float) or None
        A point of the picture where the ground is; None for the middle of its lower edge.
    covariance : (9, 9) or None
        Of the matrix's entries as given.
    origin : str
        What it is made of.

    Heights are known where the matrix can be a camera with square pixels and its centre in the picture's.

    Raises
    ------
    Unusable
        If the matrix is singular, not finite, or has its horizon at `on_ground`.
    """
    given = np.asarray(matrix, np.float64)
    if given.shape != (3, 3) or not np.isfinite(given).all():
        raise Unusable("a homography is 3 rows of 3 finite numbers")
    width, height = size
    frame = np.array([[1.0 / width, 0, 0], [0, 1.0 / height, 0], [0, 0, 1]])
    shape = np.linalg.svd(given @ np.linalg.inv(frame), compute_uv=False)
    if shape[2] <= 1e-12 * shape[0]:
        raise Unusable(
            "the homography is singular: it brings the whole picture onto a line; take points that are not on one line"
        )
    x, y = on_ground if on_ground is not None else (width / 2, float(height))
    corners = np.array([[0, 0, 1], [width, 0, 1], [0, height, 1], [width, height, 1.0]]) @ given[2]
    weight = float(given[2] @ (x, y, 1.0))
    if abs(weight) <= _EDGE * float(np.abs(corners).max()):
        raise Unusable(f"the horizon goes through ({x:g}, {y:g}), which must be on the ground; name another point")
    factor = np.sign(weight) / float(np.abs(corners).max())
    spread = np.zeros((9, 9)) if covariance is None else np.asarray(covariance, np.float64) * factor**2
    ground = Ground(given * factor, size, spread, np.zeros(3), None, origin)
    return replace(ground, vertical=_vertical(ground))


def of_projection(
    matrix: ArrayLike, size: tuple[int, int], lens: Lens | None = None, origin: str = "camera"
) -> Ground:
    """Make a ground of a camera's projection (3, 4) from metres (X, Y, Z, 1) to straightened pixels.

    Its factor must be such that what lies in front of the camera has a positive third coordinate.

    Raises
    ------
    Unusable
        If the camera lies in the ground.
    """
    projection = np.asarray(matrix, np.float64)
    plane = projection[:, [0, 1, 3]]
    if np.linalg.matrix_rank(plane) < 3:
        raise Unusable("the camera lies in the ground itself; its height must be above 0")
    homography = np.linalg.inv(plane)
    factor = 1.0 / float(np.abs(homography).max())  # P (X, Y, Z, 1) keeps its sign
    return Ground(
        np.asarray(homography * factor, np.float64),
        size,
        np.zeros((9, 9)),
        projection[:, 2] / factor,
        lens or None,
        origin,
    )


def of_camera(
    lens: Lens,
    height: float,
    tilt: float,
    roll: float,
    size: tuple[int, int],
    *,
    covariance: ArrayLike | None = None,
    origin: str = "camera",
) -> Ground:
    """Make a ground of a camera over it.

    X goes to the right and Y ahead from the point beneath the camera.

    Parameters
    ----------
    lens : Lens
        Of the camera.
    height : float
        Metres above the ground, > 0.
    tilt : float
        Radians that it looks down, from 0 (level) to π/2 (straight down).
    roll : float
        Radians that it is turned clockwise about its axis: the horizon then rises to the right.
    covariance : (4, 4) or None
        Of log focal length, tilt, roll and log height; None where they are exact.
    size : (int, int)
        Width and height of the picture.
    origin : str
        What it is made of.

    Raises
    ------
    Unusable
        For a camera that is not over the ground.
    """
    if not height > 0:
        raise Unusable(f"a camera {height:g} m high sees no ground; its height must be above 0")
    bent = None if lens.straight else lens
    ground = of_projection(lens.matrix @ _pose(height, tilt, roll), size, bent, origin)
    if covariance is None:
        return ground
    moved = np.stack([_entries_of(lens, height, tilt, roll, step) for step in _STEP * np.eye(4)])
    back = np.stack([_entries_of(lens, height, tilt, roll, step) for step in -_STEP * np.eye(4)])
    slopes = (moved - back).T / (2 * _STEP)  # (9, 4)
    scale = float(
        np.abs(ground.homography).max() / np.abs(_entries_of(lens, height, tilt, roll, np.zeros(4))).max()
    )
    spread = scale**2 * slopes @ np.asarray(covariance, np.float64) @ slopes.T
    return replace(ground, covariance=spread)


def _entries_of(lens: Lens, height: float, tilt: float, roll: float, step: Float) -> Float:
    """The homography's entries (9,) of a camera a little off: log focal length, tilt, roll, log height."""
    moved = replace(lens, focal=lens.focal * np.exp(step[0]))
    pose = _pose(height * float(np.exp(step[3])), tilt + step[1], roll + step[2])
    return np.asarray(np.linalg.inv((moved.matrix @ pose)[:, [0, 1, 3]]).reshape(-1), np.float64)


def _pose(height: float, tilt: float, roll: float) -> Float:
    """The pose (3, 4): from metres (X, Y, Z, 1) to the camera's axes right, down, ahead."""
    sine, cosine = np.sin(tilt), np.cos(tilt)
    level = np.array(
        [[1, 0, 0], [0, -sine, -cosine], [0, cosine, -sine]]
    )  # columns: X, Y and Z seen by the camera
    turned = np.array([[np.cos(roll), np.sin(roll), 0], [-np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    axes = turned @ level
    return np.concatenate([axes, -height * axes[:, 2:]], axis=1)


def _weights(homography: Float, straight: Float) -> Float:
    """Return w (N,) of points (N, 2); NaN on the horizon and above it."""
    weight = np.asarray(straight @ homography[2, :2] + homography[2, 2])
    least = _EDGE * float(np.abs(homography[2]).max())
    with np.errstate(invalid="ignore"):
        return np.where(weight > least, weight, np.nan)


def _projected(homography: Float, straight: Float) -> Float:
    ray = np.c_[straight, np.ones(len(straight))] @ homography[:2].T
    with np.errstate(all="ignore"):
        return np.asarray(ray / _weights(homography, straight)[:, None], np.float64)


def _divided(found: Float, least: float) -> Float:
    with np.errstate(all="ignore"):
        return np.where(found[:, 2:] > least, found[:, :2] / found[:, 2:], np.nan)


def _vertical(ground: Ground) -> Float:
    """The vertical's column of a plane seen by a camera with square pixels and its centre in the middle; else zeros.

    Columns a, b of the plane's projection are f-scaled axes: with the centre at 0, and 1/f² = q,
    q (a1 b1 + a2 b2) + a3 b3 = 0 and q (a1² + a2² - b1² - b2²) + a3² - b3² = 0.
    """
    width, height = ground.size
    middle = np.array([[1, 0, -width / 2], [0, 1, -height / 2], [0, 0, 1]])
    plane = middle @ np.linalg.inv(ground.homography)
    a, b, _ = plane.T
    left = np.array([a[:2] @ b[:2], a[:2] @ a[:2] - b[:2] @ b[:2]])
    right = -np.array([a[2] * b[2], a[2] ** 2 - b[2] ** 2])
    scale = float(left @ left)
    inverse = float(left @ right) / scale if scale > 0 else 0.0
    side = max(width, height)
    if not (1 / (20 * side) ** 2 < inverse < 1 / (0.2 * side) ** 2):  # from above: nothing tells the focal length
        return np.zeros(3)
    rays = np.diag([np.sqrt(inverse), np.sqrt(inverse), 1.0]) @ plane
    lengths = np.linalg.norm(rays[:, :2], axis=0)
    skew = abs(float(rays[:, 0] @ rays[:, 1])) / float(lengths.prod())
    if skew > _SKEW or abs(np.log(lengths[0] / lengths[1])) > _SKEW:
        return np.zeros(3)
    up = np.cross(rays[:, 0], rays[:, 1]) / float(np.sqrt(lengths.prod()))
    up = up if float(up @ rays[:, 2]) < 0 else -up  # the camera lies on the upper side
    focal = 1 / np.sqrt(inverse)
    return np.asarray(np.linalg.inv(middle) @ (np.diag([focal, focal, 1.0]) @ up), np.float64)


_SKEW = 0.05  # of axes that are thought to be of one length and at right angles

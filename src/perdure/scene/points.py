"""A ground from points of the picture whose places in metres, or whose distances from each other, are known.

The projection of the plane is fitted so that the squared errors in the picture are least: the direct linear
transformation with normalised points, then Gauss and Newton's steps (Hartley and Zisserman, chapter 4). Its covariance
is that of the fit, with the pixels' noise or the errors that are left, whichever is larger.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.scene.ground import PIXEL, Ground, Unusable, of_homography
from perdure.scene.lens import Float

_THIN = 0.01  # of their length, less than which points spread across a line
_MISFIT = 0.05  # of a distance, more than which distances contradict each other
_STARTS = 16
_STEPS = 20


class Fit(NamedTuple):
    """A projection of the plane fitted to points."""

    plane: Float  # (3, 3) from metres to straightened pixels
    by_plane: Float  # (2N, 9) how the pixels move with its entries
    by_place: Float  # (2N, 2N) how they move with the places
    errors: Float  # (N, 2) px


def of_points(
    points: ArrayLike,
    places: ArrayLike,
    size: tuple[int, int],
    *,
    noise: float = PIXEL,
    covariance: ArrayLike | None = None,
    mirrored: bool = False,
    origin: str = "points",
) -> Ground:
    """Make a ground of four or more points.

    Parameters
    ----------
    points, places : (N, 2)
        Pixels and metres.
    size : (int, int)
        Width and height of the picture.
    noise : float
        Standard deviation of a pixel.
    covariance : (2N, 2N) or None
        Of the places, x and y in turn; None where they are exact.
    mirrored : bool
        Whether the metres are meant to run the other way round.
    origin : str
        What it is made of.

    Raises
    ------
    Unusable
        For points from which no camera's plane follows.
    """
    image, metres = np.asarray(points, np.float64).reshape(-1, 2), np.asarray(places, np.float64).reshape(-1, 2)
    _refuse_unfit(image, metres)
    fit = _fitted(image, metres)
    homography = np.linalg.inv(fit.plane)
    weights = np.c_[image, np.ones(len(image))] @ homography[2]
    if (weights > 0).any() and (weights < 0).any():
        raise Unusable(
            "no camera sees these points so: some would be behind it; check their order, each image point beside its own place"
        )
    free = 2 * len(image) - 8
    left = float(np.sqrt((fit.errors**2).sum() / free)) if free > 0 else 0.0
    inverse = np.linalg.pinv(fit.by_plane)  # (9, 2N)
    entries = max(noise, left) ** 2 * inverse @ inverse.T
    if covariance is not None:
        moved = inverse @ fit.by_place
        entries = entries + moved @ np.asarray(covariance, np.float64) @ moved.T
    turned = -np.kron(homography, homography.T)  # d(inverse) = -H dP H, row by row
    centre = image.mean(axis=0)
    ground = of_homography(
        homography,
        size,
        on_ground=(float(centre[0]), float(centre[1])),
        covariance=turned @ entries @ turned.T,
        origin=origin,
    )
    if ground.mirrored != mirrored:
        raise Unusable(_mirror_words(mirrored))
    return ground


def of_distances(
    points: ArrayLike,
    pairs: Sequence[tuple[int, int]],
    distances: ArrayLike,
    size: tuple[int, int],
    *,
    noise: float = PIXEL,
    tape: float = 0.01,
) -> Ground:
    """Make a ground of four or more points and distances between them.

    The first point becomes (0, 0), and Y points away from the camera as near as the second point lets it.

    Parameters
    ----------
    points : (N, 2)
        Pixels.
    pairs : K of (int, int)
        Which points each distance is between.
    distances : (K,)
        Metres.
    size : (int, int)
        Width and height of the picture.
    noise : float
        Standard deviation of a pixel.
    tape : float
        Standard deviation of a distance, as a share of it.

    Raises
    ------
    Unusable
        For distances that do not fix the places, contradict each other, or fit several arrangements.
    """
    image, lengths = np.asarray(points, np.float64).reshape(-1, 2), np.asarray(distances, np.float64)
    if not np.isfinite(lengths).all() or (lengths <= 0).any():
        raise Unusable("a distance must be a finite number of metres above 0")
    if len(image) < 4:
        raise Unusable(f"{len(image)} points are not enough: a plane needs four")
    wanted = 2 * len(image) - 3
    if len(lengths) < wanted:
        raise Unusable(
            f"{len(lengths)} distances do not fix {len(image)} points: give at least {wanted}, diagonals among them"
        )
    found = [
        ground
        for places, covariance in _arrangements(len(image), np.asarray(pairs, np.intp), lengths, tape)
        if (ground := _try(image, places, covariance, size, noise)) is not None
    ]
    if not found:
        raise Unusable(
            "no camera sees points at these distances so; check which points each distance is between, and their order"
        )
    corner = [ground.places(image) for ground in found]
    if any(np.abs(_between(one) - _between(corner[0])).max() > _MISFIT * lengths.max() for one in corner):
        raise Unusable("the distances fit several arrangements of the points; add one more, such as a diagonal")
    return found[0]


def _try(image: Float, places: Float, covariance: Float, size: tuple[int, int], noise: float) -> Ground | None:
    """The ground of an arrangement or of its mirror image, whichever a camera sees; None for neither."""
    for side in (1.0, -1.0):
        signs = np.tile([side, 1.0], len(places))
        try:
            return of_points(
                image,
                places * (side, 1.0),
                size,
                noise=noise,
                covariance=covariance * signs * signs[:, None],
                origin="distances",
            )
        except Unusable:
            continue
    return None


def _arrangements(count: int, pairs: NDArray[np.intp], lengths: Float, tape: float) -> list[tuple[Float, Float]]:
    """Places (N, 2) that fit the distances, each once up to mirroring, with their covariances (2N, 2N)."""
    from scipy.optimize import least_squares

    one, other = pairs.T

    def errors(flat: Float) -> Float:
        places = flat.reshape(-1, 2)
        return np.asarray((np.linalg.norm(places[one] - places[other], axis=1) / lengths - 1) / tape)

    generator = np.random.default_rng(0)
    kept: list[tuple[Float, Float]] = []
    worst = np.inf
    for _ in range(_STARTS):
        solved = least_squares(errors, generator.normal(0, lengths.mean(), 2 * count), xtol=1e-12, ftol=1e-12)
        worst = min(worst, float(np.abs(solved.fun).max()) * tape)
        if np.abs(solved.fun).max() * tape > _MISFIT:
            continue
        places = solved.x.reshape(-1, 2)
        slopes = np.asarray(solved.jac, np.float64)
        if np.linalg.matrix_rank(slopes, tol=1e-6 * np.linalg.norm(slopes)) < 2 * count - 3:
            raise Unusable(
                "the distances leave a point free to move; give every point at least two, and diagonals"
            )
        if any(np.abs(_between(places) - _between(there)).max() < 1e-3 * lengths.max() for there, _ in kept):
            continue
        inverse = np.linalg.pinv(slopes, rcond=1e-6)
        kept.append((places, inverse @ inverse.T))
    if not kept:
        raise Unusable(
            f"the distances contradict each other by {100 * worst:.0f} %; measure again, or check the names"
        )
    return [_laid(places, covariance) for places, covariance in kept]


def _laid(places: Float, covariance: Float) -> tuple[Float, Float]:
    """Places turned and moved so that the first is (0, 0) and the second lies along X."""
    along = places[1] - places[0]
    along = along / np.linalg.norm(along)
    turn = np.array([[along[0], along[1]], [-along[1], along[0]]])
    every = np.kron(np.eye(len(places)), turn)
    return (places - places[0]) @ turn.T, every @ covariance @ every.T


def _between(places: Float) -> Float:
    return np.asarray(np.linalg.norm(places[:, None] - places[None], axis=2))


def _refuse_unfit(image: Float, metres: Float) -> None:
    if len(image) != len(metres):
        raise Unusable(f"there are {len(image)} image points and {len(metres)} places; each needs the other")
    if len(image) < 4:
        raise Unusable(f"{len(image)} points are not enough: a plane needs four, no three of them on one line")
    for what, where in (("image points", image), ("places", metres)):
        if not np.isfinite(where).all():
            raise Unusable(f"the {what} hold a number that is not finite")
        if _thin(where):
            raise Unusable(f"the {what} are on one line; take points that enclose an area")
    if all(_three_in_line(image, left) or _three_in_line(metres, left) for left in _fours(len(image))):
        raise Unusable("of every four points three are on one line; take four of which no three are")


def _fours(count: int) -> list[tuple[int, ...]]:
    return list(itertools.islice(itertools.combinations(range(count), 4), 5000))


def _three_in_line(where: Float, four: tuple[int, ...]) -> bool:
    return any(_thin(where[list(three)]) for three in itertools.combinations(four, 3))


def _thin(where: Float) -> bool:
    spread = np.linalg.svd(where - where.mean(axis=0), compute_uv=False)
    return bool(spread[1] <= _THIN * spread[0])


def _fitted(image: Float, metres: Float) -> Fit:
    """The projection of the plane by which the places are seen at the image points."""
    to_image, to_metres = _normaliser(image), _normaliser(metres)
    seen, there = _applied(to_image, image), _applied(to_metres, metres)
    ones = np.c_[there, np.ones(len(there))]
    none = np.zeros_like(ones)
    rows = np.concatenate([np.c_[ones, none, -seen[:, :1] * ones], np.c_[none, ones, -seen[:, 1:] * ones]])
    plane = np.linalg.svd(rows)[2][-1].reshape(3, 3)
    for _ in range(_STEPS):
        errors, by_plane, _ = _errors(plane, seen, there)
        step = np.linalg.lstsq(by_plane, errors.reshape(-1), rcond=1e-12)[0]
        plane = plane - step.reshape(3, 3)
        if np.abs(step).max() < 1e-13:
            break
    plane = np.linalg.inv(to_image) @ plane @ to_metres
    plane = plane / np.linalg.norm(plane)
    errors, by_plane, by_place = _errors(plane, image, metres)
    return Fit(plane, by_plane, by_place, errors)


def _errors(plane: Float, image: Float, metres: Float) -> tuple[Float, Float, Float]:
    """Errors (N, 2) in the picture, and how they move with the entries (2N, 9) and with the places (2N, 2N)."""
    count = len(image)
    ones = np.c_[metres, np.ones(count)]
    ray = ones @ plane.T
    seen = ray[:, :2] / ray[:, 2:]
    weight = ones / ray[:, 2:]
    by_plane = np.zeros((count, 2, 9))
    by_plane[:, 0, 0:3] = by_plane[:, 1, 3:6] = weight
    by_plane[:, :, 6:9] = -seen[:, :, None] * weight[:, None, :]
    slopes = (plane[None, :2, :2] - seen[:, :, None] * plane[None, 2:, :2]) / ray[:, 2, None, None]
    by_place = np.zeros((count, 2, count, 2))
    by_place[np.arange(count), :, np.arange(count), :] = slopes
    return seen - image, by_plane.reshape(-1, 9), by_place.reshape(2 * count, 2 * count)


def _normaliser(where: Float) -> Float:
    centre = where.mean(axis=0)
    scale = np.sqrt(2) / np.linalg.norm(where - centre, axis=1).mean()
    return np.array([[scale, 0, -scale * centre[0]], [0, scale, -scale * centre[1]], [0, 0, 1]])


def _applied(matrix: Float, where: Float) -> Float:
    return np.asarray(where * matrix[[0, 1], [0, 1]] + matrix[:2, 2])


def _mirror_words(wanted: bool) -> str:
    if wanted:
        return 'the places are not mirrored; leave out "mirrored"'
    return (
        "seen from above the places run the other way round than in the picture: exchange X and Y, or check the order "
        'of the points; if the metres are meant so (a plan whose Y points down), add "mirrored": true'
    )

"""Shapes as level sets: a picture of signed distances, below 0 inside, whose zero is the contour between pixels.

Osher & Sethian, *Fronts propagating with curvature-dependent speed* (1988): a contour that moves, splits and joins is
phi_t = F |grad phi|. F above 0 pushes the contour inwards, so that with F = force + curvature · κ the motion is the
steepest descent of the sum of `force` over the inside plus `curvature` times the contour's length (`energy`).

Only a band about the contour is followed (Adalsteinsson & Sethian, *A fast level set method*, 1995), and every few
steps phi is made a distance again.

Departure: distances are those from the polygon of marching squares, exactly, and not the steady state of another
equation (Sussman, Smereka & Osher, 1994). Beside the contour they are phi / |grad phi| (Russo & Smereka, *A remark on
computing distance functions*, 2000), so that redistancing leaves it where it is between pixels.

A point (x, y) has its pixel phi[y, x] at whole numbers; lengths are in pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.errors import ParameterError
from perdure.maths import lie

Float = NDArray[np.float64]
Bits = NDArray[np.bool_]

BAND = 4.0  # pixels to each side of the contour that are followed
_SMOOTH = 1.5  # pixels to each side of the contour over which what is inside fades out
_CELL = 1.5  # pixels from a contour within which the corners of its cells lie
_STRAIGHT = 1e-12  # squared slope below which nothing is curved


@dataclass(frozen=True, eq=False)
class Evolution:
    """Where a contour has come to."""

    phi: Float  # (H, W) signed distances
    steps: int  # that were made
    time: float  # that has passed; at a speed of 1 the contour has moved so many pixels
    moved: float  # pixels by which some point of the contour moved between the last two redistancings; inf of none


@dataclass(frozen=True, eq=False)
class Moments:
    """How much is inside, and where."""

    area: float  # square pixels
    centroid: Float  # (2,) x, y
    spread: Float  # (2, 2) covariance about the centroid, square pixels


def signed_distance(mask: Bits) -> Float:
    """Return distances (H, W) float64 of pixels from the border between a mask (H, W) bool and the rest.

    The border runs half a pixel from the pixels on both of its sides, so the distance of the nearest pixel of the other
    kind counts, less a half: the mask's complement has the same distances with the other sign. A mask without a border
    has the picture's diagonal everywhere, below 0 if all is inside.

    Raises
    ------
    ParameterError
        A mask that is not (H, W) bool, or has no pixels.

    Examples
    --------
    >>> signed_distance(np.array([[False, True, True, False]])).tolist()
    [[0.5, -0.5, -0.5, 0.5]]
    """
    from perdure.maths.kernels.narrow_band import borders

    if mask.ndim != 2 or mask.dtype != np.bool_ or not mask.size:
        raise ParameterError(f"mask is {mask.dtype} of the shape {mask.shape}; it must be bool (H, W) with pixels")
    if mask.all() or not mask.any():
        return np.full(mask.shape, np.hypot(*mask.shape) * (-1 if mask.any() else 1))
    found = np.empty(mask.shape)
    borders(np.ascontiguousarray(mask), np.empty((3, mask.shape[1] + 3)), found)
    return found


def redistance(phi: ArrayLike, *, band: float = BAND) -> Float:
    """Return distances (H, W) from the contour of any phi (H, W), which stays where it is.

    Within `band` of the contour they are those from the polygon that `contour` returns, but for what that closes along
    the picture's border; beyond, those of `signed_distance`, within half a pixel. Signs stay, but for what is inside by less than a thousandth
    of a pixel, and so do distances in the band that are off by less than a 25th: a distance remains as it is.

    Raises
    ------
    ParameterError
        A phi that is not (H, W), not finite or without pixels; a band that is not above 0.
    """
    if not 0 < band < np.inf:
        raise ParameterError(f"band = {band!r} must be a finite number of pixels above 0")
    return _whole(_Band(_picture(phi, "phi"), float(band)))


def blend(predicted: ArrayLike, measured: ArrayLike, gain: float) -> Float:
    """Return the shape (H, W) between two: distances from the zero of (1 - gain) · predicted + gain · measured.

    Parameters
    ----------
    predicted, measured : (H, W) float
        Signed distances.
    gain : float
        In [0, 1]: 0 for the predicted shape, 1 for the measured one.

    Raises
    ------
    ParameterError
        A gain out of its range; shapes that differ; what `redistance` refuses.
    """
    if not 0 <= gain <= 1:
        raise ParameterError(f"gain = {gain!r} is out of range: it must lie in [0, 1]")
    one, other = _picture(predicted, "predicted"), _picture(measured, "measured")
    _alike(one, other, "measured")
    return redistance((1 - gain) * one + gain * other)


def carried(phi: ArrayLike, motion: ArrayLike, shape: tuple[int, int] | None = None) -> Float:
    """Return a shape after a motion g, phi(g⁻¹ x), in pixels of where it goes.

    Parameters
    ----------
    phi : (H, W) float
        Signed distances; beyond the picture all is farther away by as much as it lies beyond.
    motion : (3, 3) float
        From (x, y, 1) in phi to (x, y, 1) in the result; see `perdure.maths.lie`.
    shape : (int, int), optional
        Height and width of the result; those of phi if not said.

    Returns
    -------
    (h, w) float64
        Multiplied by the root of the determinant of g: distances still where g keeps angles, and where it does not,
        `redistance` makes them so.

    Raises
    ------
    ParameterError
        A phi that is not (H, W), not finite or without pixels; a motion that mirrors or flattens.
    """
    from perdure.maths.kernels.narrow_band import carry

    given = _picture(phi, "phi")
    back, found = lie.inverse(motion), np.empty(given.shape if shape is None else shape)
    if back.ndim != 2:
        raise ParameterError(f"motion has the shape {back.shape}; one of (3, 3) would do")
    carry(given, back, float(np.sqrt(lie.determinant(motion))), found)
    return found


def sample(field: ArrayLike, points: ArrayLike) -> Float:
    """Return the values (N,) of a picture (H, W) at points (N, 2) x, y: bilinear; beyond it those of its border.

    Raises
    ------
    ParameterError
        A picture that is not (H, W), not finite or without pixels; points that are not (N, 2) or not finite.
    """
    from perdure.maths.kernels.narrow_band import (
        sample as kernel,
    )  # numba: half a second that no import should cost

    given, places = _picture(field, "field"), np.ascontiguousarray(points, np.float64)
    if places.ndim != 2 or places.shape[1] != 2 or not np.isfinite(places).all():
        raise ParameterError(f"points of the shape {places.shape} must be (N, 2) and finite")
    found = np.empty(len(places))
    kernel(given, places, found)
    return found


def curvature(phi: ArrayLike) -> Float:
    """Return the curvature κ (H, W) of the level set through each pixel, in 1 / px: 1 / r on a disc of radius r.

    κ = div(grad phi / |grad phi|) by central differences, within [-1, 1]; 0 where phi is flat.
    """
    at = np.pad(_picture(phi, "phi"), 1, mode="edge")
    west, east, north, south = at[1:-1, :-2], at[1:-1, 2:], at[:-2, 1:-1], at[2:, 1:-1]
    x, y, twice = (east - west) / 2, (south - north) / 2, 2 * at[1:-1, 1:-1]
    cross = (at[2:, 2:] - at[2:, :-2] - at[:-2, 2:] + at[:-2, :-2]) / 4
    bent = (east - twice + west) * y**2 - 2 * x * y * cross + (south - twice + north) * x**2
    squared = x**2 + y**2
    found = np.divide(bent, squared**1.5, out=np.zeros(bent.shape), where=squared > _STRAIGHT)
    return np.asarray(np.clip(found, -1, 1), np.float64)


def evolve(
    phi: ArrayLike,
    force: ArrayLike,
    *,
    curvature: float = 0.0,
    steps: int,
    band: float = BAND,
    cfl: float = 0.5,
    redistance_every: int = 5,
    until: float = 0.0,
    domain: Bits | None = None,
    on_iteration: Callable[[int, Float], None] | None = None,
) -> Evolution:
    """Move a contour by phi_t = (force + curvature · κ) |grad phi|: down the slope of `energy`.

    One step lets so much time pass that no point moves by more than `cfl` pixels: cfl / max(1, greatest speed), and at
    most cfl / (2 curvature), beyond which curves would grow. So speeds up to 1 are pixels per unit of time, and larger
    forces are all brought down together.

    Parameters
    ----------
    phi : (H, W) float
        Below 0 inside; made a distance first.
    force : (H, W) float, or float
        What it costs that a pixel is inside: above 0 the contour leaves it outside, below 0 takes it in.
    curvature : float
        ≥ 0, pixels: the weight of the contour's length.
    steps : int
        ≥ 0, at most.
    band : float
        Pixels to each side that are followed, ≥ cfl · redistance_every + 1.5.
    cfl : float
        In (0, 0.5].
    redistance_every : int
        ≥ 1, steps.
    until : float
        Pixels: stop where the contour has moved by less between two redistancings; 0 makes all the steps.
    domain : (H, W) bool, optional
        The contour moves where this is true, and stays elsewhere.
    on_iteration : function, optional
        Called after each step with its number from 1 on and phi (H, W), which is read-only, changes later, and is
        about `band` or -`band` beyond the band. What it raises passes through.

    Returns
    -------
    Evolution
        Where the inside has vanished, or grown over all, phi is the picture's diagonal, or less it.

    Raises
    ------
    ParameterError
        A number out of its range, shapes that differ, a phi or force that is not finite.
    """
    from perdure.maths.kernels.narrow_band import rates

    given = _picture(phi, "phi")
    push, where = _pushed(given, force, domain)
    _check(curvature, steps, band, cfl, redistance_every, until)
    near, out = _Band(given, float(band)), np.empty(given.size)
    time, done, way, shown = 0.0, 0, np.inf, near.phi.view()
    shown.flags.writeable = False
    while done < steps and near.count:
        pixels, change = near.pixels[: near.count], out[: near.count]
        fastest = rates(near.phi, pixels, push, where, float(curvature), change)
        lapse = min(cfl / max(1.0, fastest), cfl / max(2 * curvature, 1.0))
        near.phi.reshape(-1)[pixels] += lapse * change
        time, done = time + lapse, done + 1
        if done % redistance_every == 0 or done == steps:
            way = near.measure()
        if on_iteration is not None:
            on_iteration(done, shown)
        if done % redistance_every == 0 and way < until:
            break
    return Evolution(_whole(near), done, time, way)


def energy(phi: ArrayLike, force: ArrayLike, *, curvature: float = 0.0) -> float:
    """Return what `evolve` makes less: the sum of the force over the inside + curvature · length of the contour."""
    given = _picture(phi, "phi")
    push, _ = _pushed(given, force, None)
    return float((inside(given) * push).sum() + curvature * length(contour(given)))


def contour(phi: ArrayLike) -> list[Float]:
    """Return the closed polylines (N, 2) float64 x, y where phi (H, W) is 0, between pixels (marching squares).

    The first vertex is not repeated at the end. Outlines run with the clock as one sees them, y downwards, and holes
    against it: x dy - y dx is above 0 around an outline. Where two inside pixels touch by their corners only, they are
    joined if the mean of the four is below 0. What reaches the border of the picture is closed half a pixel beyond it.

    Raises
    ------
    ParameterError
        A phi that is not (H, W), not finite or without pixels.

    Examples
    --------
    >>> [line.tolist() for line in contour([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0]])]
    [[[0.5, 1.0], [1.0, 0.5], [1.5, 1.0], [1.0, 1.5]]]
    """
    given = _picture(phi, "phi")
    outside = np.pad(np.abs(given), 1, mode="edge")  # as far outside as the border is inside
    outside[1:-1, 1:-1] = given
    ends, edges = _pieces(outside, _crossed(outside))
    return [ends[rows, :2] - 1 for rows in _rounds(edges)]


def length(lines: Sequence[Float]) -> float:
    """Return the length, in pixels, of closed polylines (N, 2) together."""
    return float(sum(np.hypot(*(line - np.roll(line, 1, axis=0)).T).sum() for line in lines))


def inside(phi: ArrayLike) -> Float:
    """Return which share (H, W) of each pixel is inside, in [0, 1]: a smooth step, 3 pixels wide.

    (1 - phi / ε - sin(π phi / ε) / π) / 2 for ε = 1.5 (Zhao, Chan, Merriman & Osher, 1996).
    """
    given = _picture(phi, "phi")
    shares = (given < 0).astype(np.float64)
    near = np.abs(given) < _SMOOTH  # a sine for the rest would cost more than all else
    part = given[near] / _SMOOTH
    shares[near] = np.clip((1 - part - np.sin(np.pi * part) / np.pi) / 2, 0, 1)
    return shares


def moments(phi: ArrayLike) -> Moments:
    """Return area, centroid and spread of the inside of signed distances (H, W), by `inside`.

    Raises
    ------
    ParameterError
        A phi with nothing inside, or that is not (H, W), not finite or without pixels.
    """
    shares = inside(phi)
    area = float(shares.sum())
    if area <= 0:
        raise ParameterError("phi has nothing inside: there is no centroid")
    rows, columns = shares.sum(axis=1), shares.sum(axis=0)  # (H,), (W,)
    y, x = np.arange(len(rows)), np.arange(len(columns))
    middle_x, middle_y = columns @ x / area, rows @ y / area
    xy = (y - middle_y) @ shares @ (x - middle_x)
    spread = np.array([[columns @ (x - middle_x) ** 2, xy], [xy, rows @ (y - middle_y) ** 2]]) / area
    return Moments(area, np.array([middle_x, middle_y]), spread)


class _Band:
    """Distances about a contour, and which pixels they are of; -band or band beyond."""

    def __init__(self, phi: Float, band: float) -> None:
        from perdure.maths.kernels.narrow_band import measure

        ends, _ = _pieces(phi, _crossed(phi))
        self.phi, self.pixels = np.where(phi < 0, -band, band), np.empty(phi.size, np.int64)
        self.count = measure(self.phi, phi, ends, band, self.pixels, 0)
        self.band = band
        self._moved, self._measured = self.phi.copy(), self.phi.copy()  # before the last measuring, and after it

    def measure(self) -> float:
        """Make phi a distance again; return by how many pixels the contour has moved since the last time."""
        from perdure.maths.kernels.narrow_band import measure

        phi, moved, measured = (one.reshape(-1) for one in (self.phi, self._moved, self._measured))
        left = self.pixels[: self.count].copy()
        moved[left] = phi[left]
        ends, _ = _pieces(self.phi, left)
        self.count = measure(self.phi, self._moved, ends, self.band, self.pixels, self.count)
        pixels = self.pixels[: self.count]
        now = phi[pixels]
        way = np.abs(now - measured[pixels])[np.abs(now) < 1].max(initial=0.0)
        moved[left] = measured[left] = phi[left]  # of what has left the band, too; nothing else costs time
        measured[pixels] = now
        return float(way) if self.count else self.band


def _whole(near: _Band) -> Float:
    """Distances in the band, and beyond it those from the pixels' borders."""
    far = signed_distance(near.phi < 0)
    if not near.count:
        return far
    beyond = np.abs(near.phi) >= near.band
    return np.where(beyond & (np.abs(far) > near.band), far, near.phi)


def _crossed(phi: Float) -> NDArray[np.int64]:
    """Flat places of the pixels whose cell, to the right and down, the contour crosses."""
    below = phi < 0
    across = below[:, :-1] != below[:, 1:]
    crossed = np.zeros(phi.shape, np.bool_)
    crossed[:-1, :-1] = across[:-1] | across[1:] | (below[:-1, :-1] != below[1:, :-1])
    return np.flatnonzero(crossed)


def _pieces(phi: Float, pixels: NDArray[np.int64]) -> tuple[Float, NDArray[np.int64]]:
    """Pieces (N, 4) of the contour in the cells of pixels, and keys (N, 2) of the edges at which they meet."""
    from perdure.maths.kernels.narrow_band import PIECES, pieces

    ends, edges = np.empty((PIECES * len(pixels), 4)), np.empty((PIECES * len(pixels), 2), np.int64)
    found = pieces(phi, pixels, ends, edges)
    return ends[:found], edges[:found]


def _rounds(edges: NDArray[np.int64]) -> list[list[int]]:
    """Rows of pieces (N, 2) in the order in which one ends where the next begins; one list for each closed line."""
    order = np.argsort(edges[:, 0])
    following = order[np.searchsorted(edges[order, 0], edges[:, 1])].tolist()
    rounds, seen = [], [False] * len(following)
    for first in range(len(following)):
        line, row = [], first
        while not seen[row]:
            seen[row] = True
            line.append(row)
            row = following[row]
        if line:
            rounds.append(line)
    return rounds


def _pushed(phi: Float, force: ArrayLike, domain: Bits | None) -> tuple[Float, Bits]:
    """Force and domain, for each pixel of phi."""
    push = np.asarray(force, np.float64)
    if push.ndim:
        _alike(phi, push, "force")
    if not np.isfinite(push).all():
        raise ParameterError("force is not finite everywhere")
    if domain is None:
        where = np.ones(phi.shape, np.bool_)
    else:
        where = np.ascontiguousarray(domain)
        _alike(phi, where, "domain")
        if where.dtype != np.bool_:
            raise ParameterError(f"domain is {where.dtype}; it must be bool")
    return np.ascontiguousarray(np.broadcast_to(push, phi.shape)), where


def _check(curvature: float, steps: int, band: float, cfl: float, redistance_every: int, until: float) -> None:
    for name, value, right, range_ in (
        ("curvature", curvature, 0 <= curvature < np.inf, "≥ 0 and finite"),
        ("steps", steps, steps >= 0, "≥ 0"),
        ("cfl", cfl, 0 < cfl <= 0.5, "in (0, 0.5]"),
        ("redistance_every", redistance_every, redistance_every >= 1, "≥ 1"),
        ("until", until, until >= 0, "≥ 0"),
    ):
        if not right:
            raise ParameterError(f"{name} = {value!r} is out of range: it must be {range_}")
    least = cfl * redistance_every + _CELL
    if not least <= band < np.inf:
        raise ParameterError(
            f"band = {band!r} is out of range: the contour may move by {cfl * redistance_every:g} pixels until it is "
            f"measured again, so it must be {least:g} or more, and finite"
        )


def _picture(values: ArrayLike, name: str) -> Float:
    given = np.ascontiguousarray(values, np.float64)
    if given.ndim != 2 or not given.size:
        raise ParameterError(f"{name} has the shape {np.shape(values)}; it must be (H, W) with pixels")
    if not np.isfinite(given).all():
        raise ParameterError(f"{name} is not finite everywhere")
    return given


def _alike(phi: Float, other: NDArray[Any], name: str) -> None:
    if other.shape != phi.shape:
        raise ParameterError(f"{name} has the shape {other.shape} beside {phi.shape}; one size would do")

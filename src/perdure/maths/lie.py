"""Motions of the plane as Lie groups: rigid, similar and affine ones, and the algebras in which velocities live.

An element g of a group is a matrix (3, 3) that takes (x, y, 1) to (gx, gy, 1); a velocity v is a vector of coordinates
in the algebra, and one step of motion is exp(v) g. After Hall, *Lie Groups, Lie Algebras, and Representations* (2015),
ch. 2 and 3, and Eade, *Lie Groups for 2D and 3D Transformations* (2017).

The three algebras are nested: SE2 has the first 3 of the coordinates below, SIMILARITY the first 4, AFFINE all 6, so
that a velocity goes over from a smaller group to a larger one with zeros behind it.

    x, y       translation, in pixels
    angle      rotation about the origin, in radians, from the x axis to the y axis
    growth     logarithm of the scale
    stretch    along x, and as much narrower along y
    shear      along the diagonal x = y, and as much narrower across it

With x + iy for a point, exp of the first four is closed: e^z turns and scales, for z = growth + i angle, and the
translation is multiplied by (e^z - 1) / z. For affine motions the series of exp is summed for a small part of the
matrix and squared (scaling and squaring; Moler & Van Loan, *Nineteen dubious ways*, 2003), and the logarithm of the
(2, 2) part is closed (Bernstein & So, *Some explicit formulas for the matrix exponential*, 1993).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.errors import ParameterError

Float = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

_ALIKE = 1e-6  # by which a matrix may miss its group, relative to its scale: what thousands of products round off
_TURNED = (
    1e-12  # of stretch and shear that a half turn may have by rounding: a true one would have no logarithm near
)
_SMALL = 2.0**-2  # norm up to which the series of exp is summed
_TERMS = 12  # of that series: the next one is below 3e-18

_GENERATORS = np.zeros((6, 3, 3))  # x, y, angle, growth, stretch, shear
_GENERATORS[0, 0, 2] = _GENERATORS[1, 1, 2] = 1.0
_GENERATORS[2, :2, :2] = (0, -1), (1, 0)
_GENERATORS[3, :2, :2] = (1, 0), (0, 1)
_GENERATORS[4, :2, :2] = (1, 0), (0, -1)
_GENERATORS[5, :2, :2] = (0, 1), (1, 0)
_GENERATORS.flags.writeable = False


@dataclass(frozen=True)
class Group:
    """A group of motions of the plane; `SE2`, `SIMILARITY` and `AFFINE` are all there are.

    Every method takes any number of leading axes, shown as `...`; they are broadcast.
    """

    name: str
    coordinates: tuple[str, ...]  # what each coordinate of the algebra does
    _exp: Callable[[Float], Float]
    _log: Callable[[Float], Float]

    @property
    def dimension(self) -> int:
        """Return the number D of coordinates: 3, 4 or 6."""
        return len(self.coordinates)

    def hat(self, velocity: ArrayLike) -> Float:
        """Return the matrices (..., 3, 3) of velocities (..., D); their last rows are 0.

        >>> SE2.hat([5.0, 6.0, 1.0]).tolist()
        [[0.0, -1.0, 5.0], [1.0, 0.0, 6.0], [0.0, 0.0, 0.0]]
        """
        return np.asarray(np.tensordot(self._velocity(velocity), _GENERATORS[: self.dimension], axes=1))

    def vee(self, matrix: ArrayLike) -> Float:
        """Return the coordinates (..., D) of matrices (..., 3, 3); what lies outside the algebra is left out."""
        return _coordinates(_matrices(matrix, "matrix"))[..., : self.dimension]

    def exp(self, velocity: ArrayLike) -> Float:
        """Return the motions (..., 3, 3) after a unit of time at velocities (..., D).

        Raises
        ------
        ParameterError
            A velocity of another length, not finite, or so large that the motion is not finite.
        """
        given = self._velocity(velocity)
        with np.errstate(over="ignore", invalid="ignore"):
            found = self._exp(given)
        return _finite(found, "the motion of this velocity")

    def log(self, motion: ArrayLike) -> Float:
        """Return the velocities (..., D) of motions (..., 3, 3): exp(log(g)) = g, the angle in (-π, π].

        Raises
        ------
        ParameterError
            A matrix that is no motion of this group, or one without a real logarithm in it: a mirror image, or an
            affine map that reverses some direction and is no half turn with a scale.
        """
        return self._log(_motions(motion))[..., : self.dimension]

    def adjoint(self, motion: ArrayLike) -> Float:
        """Return Ad_g (..., D, D) of motions (..., 3, 3): hat(Ad_g v) = g hat(v) g⁻¹, so g exp(v) = exp(Ad_g v) g."""
        given = _motions(motion)[..., None, :, :]  # (..., 1, 3, 3)
        moved = given @ _GENERATORS[: self.dimension] @ inverse(given)  # (..., D, 3, 3)
        return np.asarray(np.swapaxes(self.vee(moved), -1, -2))

    def bracket(self, velocity: ArrayLike) -> Float:
        """Return ad_v (..., D, D) of velocities (..., D): hat(ad_v w) = hat(v) hat(w) - hat(w) hat(v)."""
        given, basis = self.hat(velocity)[..., None, :, :], _GENERATORS[: self.dimension]
        return np.asarray(np.swapaxes(self.vee(given @ basis - basis @ given), -1, -2))

    def left_jacobian(self, velocity: ArrayLike) -> Float:
        """Return J (..., D, D) of velocities v (..., D): exp(v + dv) = exp(J dv) exp(v), to first order in dv.

        J = 1 + ad_v / 2! + ad_v² / 3! + …
        """
        return _finite(_integral(self.bracket(velocity)), "the Jacobian of this velocity")

    def jacobian(self, points: ArrayLike) -> Float:
        """Return the derivative (..., 2, D) of exp(v) x by v at v = 0, for points x (..., 2)."""
        x, y = np.moveaxis(_points(points), -1, 0)
        one, zero = np.ones_like(x), np.zeros_like(x)
        rows = [one, zero, -y, x, x, y], [zero, one, x, y, -y, x]
        return np.stack([np.stack(row[: self.dimension], axis=-1) for row in rows], axis=-2)

    def jacobian_at(self, velocity: ArrayLike, points: ArrayLike) -> Float:
        """Return the derivative (..., N, 2, D) of exp(v) x by v, for velocities v (..., D) and points x (..., N, 2)."""
        moved = act(self.exp(velocity), points)  # (..., N, 2)
        return np.asarray(self.jacobian(moved) @ self.left_jacobian(velocity)[..., None, :, :])

    def _velocity(self, velocity: ArrayLike) -> Float:
        given = np.asarray(velocity, np.float64)
        if given.shape[-1:] != (self.dimension,):
            raise ParameterError(
                f"velocity has the shape {given.shape}; {self.name} has {self.dimension} coordinates: "
                + ", ".join(self.coordinates)
            )
        return _finite(given, "velocity")


def identity() -> Float:
    """Return the motion (3, 3) that moves nothing."""
    return np.eye(3)


def compose(*motions: ArrayLike) -> Float:
    """Return the motion (..., 3, 3) that does these (..., 3, 3) one after the other, the last named first.

    >>> compose(SE2.exp([1, 0, 0]), SE2.exp([0, 0, np.pi / 2])).round(6).tolist()
    [[0.0, -1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    made = identity()
    for motion in motions:
        made = made @ _motions(motion)
    return made


def inverse(motion: ArrayLike) -> Float:
    """Return the motions (..., 3, 3) that undo these; a ParameterError where one flattens the plane or mirrors it."""
    given = _motions(motion)
    (a, b), (c, d) = given[..., 0, :2].T, given[..., 1, :2].T
    undone = np.zeros(given.shape)
    undone[..., 0, :2], undone[..., 1, :2] = np.stack([d, -b]).T, np.stack([-c, a]).T
    undone[..., :2, :2] /= _upright(given)[..., None, None]
    undone[..., :2, 2] = -(undone[..., :2, :2] @ given[..., :2, 2:])[..., 0]
    undone[..., 2, 2] = 1.0
    return undone


def determinant(motion: ArrayLike) -> Float:
    """Return by how much (...,) areas grow under motions (..., 3, 3); negative for mirror images."""
    linear = _motions(motion)[..., :2, :2]
    return np.asarray(linear[..., 0, 0] * linear[..., 1, 1] - linear[..., 0, 1] * linear[..., 1, 0])


def act(motion: ArrayLike, points: ArrayLike) -> Float:
    """Return where motions (..., 3, 3) take points (..., N, 2)."""
    given = _motions(motion)
    return np.asarray(_points(points) @ np.swapaxes(given[..., :2, :2], -1, -2) + given[..., None, :2, 2])


# Closed forms: translation, turning and growth ----------------------------------------------------------------


def _similar_exp(velocity: Float) -> Float:
    """Motions of (..., 3) or (..., 4) coordinates."""
    growth = velocity[..., 3] if velocity.shape[-1] > 3 else np.zeros(velocity.shape[:-1])
    z = growth + 1j * velocity[..., 2]
    turned, shift = np.exp(z), _mean_power(z) * (velocity[..., 0] + 1j * velocity[..., 1])
    motion = np.zeros((*z.shape, 3, 3))
    motion[..., 0, 0] = motion[..., 1, 1] = turned.real
    motion[..., 1, 0], motion[..., 0, 1] = turned.imag, -turned.imag
    motion[..., 0, 2], motion[..., 1, 2], motion[..., 2, 2] = shift.real, shift.imag, 1.0
    return motion


def _rigid_log(motion: Float) -> Float:
    """Coordinates (..., 6) of rigid motions."""
    gram = motion[..., :2, :2] @ np.swapaxes(motion[..., :2, :2], -1, -2)
    if (np.abs(gram - np.eye(2)) > _ALIKE).any():
        raise ParameterError(
            f"motion is {_first(motion, np.abs(gram - np.eye(2)) > _ALIKE)}: it is no rigid motion"
        )
    velocity = _similar_log(motion)
    shift = (motion[..., 0, 2] + 1j * motion[..., 1, 2]) / _mean_power(1j * velocity[..., 2])
    velocity[..., 0], velocity[..., 1], velocity[..., 3] = shift.real, shift.imag, 0.0
    return velocity


def _similar_log(motion: Float) -> Float:
    """Coordinates (..., 6) of motions that keep angles."""
    _upright(motion)
    (_, _, turn, scale, stretch, shear) = np.moveaxis(_coordinates(motion), -1, 0)
    size = np.hypot(turn, scale)
    bent = np.hypot(stretch, shear) > _ALIKE * size
    if bent.any():
        raise ParameterError(f"motion is {_first(motion, bent[..., None, None])}: it does not keep angles")
    z = np.log(size) + 1j * np.arctan2(turn, scale)
    shift = (motion[..., 0, 2] + 1j * motion[..., 1, 2]) / _mean_power(z)
    zero = np.zeros_like(size)
    return np.stack([shift.real, shift.imag, z.imag, z.real, zero, zero], axis=-1)


def _mean_power(z: Complex) -> Complex:
    """Mean of e^(tz) over t in [0, 1]: (e^z - 1) / z, and 1 + z / 2 near 0; it is 0 only at 2πik, k ≠ 0."""
    near = np.abs(z) < 1e-8
    away = np.where(near, 1.0, z)
    return np.where(near, 1 + z / 2, np.expm1(away) / away)


# Affine motions -------------------------------------------------------------------------------------------------


def _affine_exp(velocity: Float) -> Float:
    """Motions of (..., 6) coordinates."""
    return _matrix_exp(np.tensordot(velocity, _GENERATORS, axes=1))


def _affine_log(motion: Float) -> Float:
    """Coordinates (..., 6) of affine motions."""
    growth = np.log(_upright(motion)) / 2
    (_, _, turn, scale, stretch, shear) = np.moveaxis(_coordinates(motion), -1, 0) * np.exp(-growth)
    bent = np.hypot(stretch, shear)  # M = scale · 1 + B of det 1, where B² = (bent² - turn²) 1 = (scale² - 1) 1
    half_turn = (scale < 0) & (bent <= _TURNED)
    squared = np.where(half_turn, -(turn**2), (bent - turn) * (bent + turn))
    wrong = (scale < 0) & (squared >= 0) & ~half_turn
    if wrong.any():
        raise ParameterError(
            f"motion is {_first(motion, wrong[..., None, None])}: it reverses a direction and has no real logarithm"
        )
    root = np.sqrt(np.abs(squared))
    angle = np.where(squared < 0, np.arctan2(root, scale), np.arcsinh(root))
    ratio = np.where(root > 0, angle, 1.0) / np.where(root > 0, root, 1.0)
    turned = np.where(half_turn, np.arctan2(turn, scale), ratio * turn)
    bends = np.where(half_turn, 0.0, ratio * np.stack([stretch, shear]))
    velocity = np.stack([np.zeros_like(growth)] * 2 + [turned, growth, *bends], axis=-1)
    linear = np.tensordot(velocity, _GENERATORS, axes=1)[..., :2, :2]
    velocity[..., :2] = np.linalg.solve(_integral(linear), motion[..., :2, 2:])[..., 0]
    return velocity


def _matrix_exp(matrices: Float) -> Float:
    """e^M of matrices M (..., n, n): every one by itself, so that none depends on what lies beside it."""
    norm = np.abs(matrices).sum(axis=-1).max(axis=-1)
    doublings = np.maximum(np.ceil(np.log2(np.maximum(norm, _SMALL) / _SMALL)), 0.0)[..., None, None]
    small, unit = matrices * np.exp2(-doublings), np.eye(matrices.shape[-1])
    made = np.broadcast_to(unit, matrices.shape)
    for term in range(_TERMS, 0, -1):
        made = unit + small @ made / term
    for done in range(int(doublings.max(initial=0))):
        made = np.where(doublings > done, made @ made, made)
    return made


def _integral(matrices: Float) -> Float:
    """Integral (..., n, n) of e^(tM) over t in [0, 1]: a corner of e^((M, 1), (0, 0)) (Van Loan, 1978)."""
    size = matrices.shape[-1]
    double = np.zeros((*matrices.shape[:-2], 2 * size, 2 * size))
    double[..., :size, :size], double[..., :size, size:] = matrices, np.eye(size)
    with np.errstate(over="ignore", invalid="ignore"):
        return _matrix_exp(double)[..., :size, size:]


# What is refused ------------------------------------------------------------------------------------------------


def _coordinates(matrices: Float) -> Float:
    """All six coordinates (..., 6) of matrices (..., 3, 3)."""
    (a, b), (c, d) = np.moveaxis(matrices[..., :2, :2], (-2, -1), (0, 1))
    linear = [(c - b) / 2, (a + d) / 2, (a - d) / 2, (b + c) / 2]
    return np.stack([matrices[..., 0, 2], matrices[..., 1, 2], *linear], axis=-1)


def _motions(motion: ArrayLike) -> Float:
    given = _matrices(motion, "motion")
    wrong = (given[..., 2, :] != (0, 0, 1)).any(axis=-1)
    if wrong.any():
        raise ParameterError(f"motion is {_first(given, wrong[..., None, None])}: its last row must be 0, 0, 1")
    return given


def _upright(motion: Float) -> Float:
    """Determinants (...,), refused where they are 0, or negative: no way leads there from the identity."""
    areas = determinant(motion)
    wrong = ~(areas > 0)
    if wrong.any():
        raise ParameterError(
            f"motion is {_first(motion, wrong[..., None, None])}: its determinant is {areas[wrong].flat[0]:g}, not above 0"
        )
    return areas


def _matrices(matrix: ArrayLike, name: str) -> Float:
    given = np.asarray(matrix, np.float64)
    if given.shape[-2:] != (3, 3):
        raise ParameterError(f"{name} has the shape {given.shape}; it must be (..., 3, 3)")
    return _finite(given, name)


def _points(points: ArrayLike) -> Float:
    given = np.asarray(points, np.float64)
    if given.shape[-1:] != (2,):
        raise ParameterError(f"points have the shape {given.shape}; they must be (..., 2): x, y")
    return _finite(given, "points")


def _finite(values: Float, name: str) -> Float:
    if not np.isfinite(values).all():
        raise ParameterError(f"{name} is not finite")
    return values


def _first(motions: Float, wrong: NDArray[np.bool_]) -> str:
    """The first of the wrong ones (..., 1, 1) or (..., 2, 2), to be read."""
    which = wrong.any(axis=(-2, -1))
    return str(motions[which][0].round(6).tolist())


SE2 = Group("SE(2)", ("x", "y", "angle"), _similar_exp, _rigid_log)
SIMILARITY = Group("the similarities", ("x", "y", "angle", "growth"), _similar_exp, _similar_log)
AFFINE = Group("Aff(2)", ("x", "y", "angle", "growth", "stretch", "shear"), _affine_exp, _affine_log)
GROUPS = {"se2": SE2, "similarity": SIMILARITY, "affine": AFFINE}

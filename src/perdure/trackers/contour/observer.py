"""The observer of a deforming shape: state {μ, g, v, α}, prediction, window energy, its gradients, the update (§III, §IV).

Nothing here knows of pictures or targets. μ is a picture of signed distances about an origin of its own; g takes it into
the picture. A velocity is an element of the algebra about where the object is, not about the picture's corner: with
c = g 0, the pose after a frame is T_c exp(v) T_c⁻¹ g, so that a thing that turns while it walks goes straight on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.maths import levelset, lie
from perdure.trackers.contour.measuring import Measured, Single

Float = NDArray[np.float64]
Motion = Callable[[Float], Float]  # velocities of the window (k, D), the newest last -> the next one (D,)

MARGIN = 8  # cells that μ's picture is wider than μ, at least
_ROOM = 0.2  # of μ's sides, that it is wider
_ABOUT = 0.25  # cells by which the gauge may be off before μ is drawn anew
_TRUST = 0.9  # share of the whole contour's moments in the preconditioner, where part of it says nothing
_STILL = 0.01  # pixels below which a correction is none
_MOST = 0.25  # radians, or logarithm of a scale, a frame
_CUT = 2.0  # cells beyond which distances count no more where shapes are blended
_EVERYTHING = 2.0  # no pull is more


@dataclass(frozen=True, eq=False)
class State:
    """What is believed of one object: {μ, g, v, α} and the window in which it was measured."""

    shape: Float  # (h, w) μ: signed distances in cells, below 0 inside, the origin in the middle
    base: Float  # (3, 3) g before the window: from cells about the origin to pixels
    velocities: Float  # (k, D) of the window's frames, the newest last
    measurements: tuple[Measured, ...]  # as many
    velocity: Float  # (D,) v, with which the next frame is predicted
    acceleration: Float  # (D,) α

    @property
    def area(self) -> float:
        """Square cells inside μ."""
        return float(levelset.inside(self.shape).sum())


@dataclass(frozen=True)
class Gains:
    """How much of a correction is believed, each in [0, 1]."""

    shape: float  # L_μ
    motion: float  # L_v


# State and prediction -------------------------------------------------------------------------------------------


def initial(mask: NDArray[np.bool_], x: int, y: int, group: lie.Group, cell: float = 1.0) -> State:
    """Return the state {μ(0), g(0), 0, 0} of a silhouette (h, w) whose first pixel is at x, y (§III).

    `cell` is the side of μ's cells in pixels.
    """
    room = int(np.ceil(MARGIN * max(cell, 1.0)))
    sides = [side + 2 * room for side in mask.shape]
    wide = np.zeros(sides, np.bool_)
    wide[room:-room, room:-room] = mask
    phi = levelset.signed_distance(wide)
    middle = levelset.moments(phi).centroid
    pose = np.eye(3)
    pose[:2, :2] *= cell
    pose[:2, 2] = middle[0] + x - room, middle[1] + y - room
    shape = (int(np.ceil(sides[0] / cell)) | 1, int(np.ceil(sides[1] / cell)) | 1)
    to_cells = about(shape) @ lie.inverse(pose) @ _shift(np.array([x - room, y - room], np.float64))
    drawn = levelset.redistance(levelset.carried(phi, to_cells, shape))
    still = np.zeros(group.dimension)
    return gauged(State(drawn, pose, np.zeros((0, group.dimension)), (), still, still), group=group)


def poses(base: Float, velocities: Float, group: lie.Group) -> Float:
    """Return g(τ) (k, 3, 3) of the window's frames: e^{v_τ} … e^{v_1} g_0, the newest leftmost (2)."""
    steps, out = group.exp(velocities), np.empty((len(velocities), 3, 3))
    pose = base
    for number, step in enumerate(steps):
        turned = step[:2, :2] @ pose[:2, :2]
        out[number] = pose
        out[number, :2, 2] += step[:2, 2]
        out[number, :2, :2] = turned
        pose = out[number]
    return out


def pose_of(state: State, group: lie.Group) -> Float:
    """Return g (3, 3) of the newest frame."""
    return np.asarray(poses(state.base, state.velocities, group)[-1]) if len(state.velocities) else state.base


def predicted(state: State, group: lie.Group) -> Float:
    """Return g(t+1) = exp(v) g(t) (3, 3), μ(t+1) being μ(t) (§III)."""
    return np.asarray(poses(pose_of(state, group), state.velocity[None], group)[-1])


def constant_position(velocities: Float) -> Float:
    """Return no velocity: the object stays where it is."""
    return np.zeros(velocities.shape[1])


def constant_velocity(velocities: Float) -> Float:
    """Return the window's mean velocity (D,)."""
    return np.asarray(velocities.mean(axis=0), np.float64)


def constant_acceleration(velocities: Float) -> Float:
    """Return the velocity (D,) that the line through the window's velocities comes to next."""
    count = len(velocities)
    if count < 2:
        return constant_velocity(velocities)
    when = np.arange(count) - (count - 1) / 2
    slope = (when[:, None] * velocities).sum(axis=0) / (when**2).sum()
    return np.asarray(velocities.mean(axis=0) + slope * (count + 1) / 2, np.float64)


MOTIONS: dict[str, Motion] = {
    "position": constant_position,
    "velocity": constant_velocity,
    "acceleration": constant_acceleration,
}


# Energy and gradients -------------------------------------------------------------------------------------------


def energy(
    shape: Float, base: Float, velocities: Float, measurements: Sequence[Measured], group: lie.Group
) -> float:
    """Return φ(v_1, …, v_k, Ω, μ) (2): the sum over the window of what `discrepancy` says."""
    every = poses(base, velocities, group)
    return sum(discrepancy(shape, pose, one) for pose, one in zip(every, measurements, strict=True))


def discrepancy(shape: Float, pose: Float, one: Measured) -> float:
    """Return E(h_τ) (3): f_in over the inside of g μ and f_out over the rest, in square pixels."""
    there = one.to_cells() @ pose @ lie.inverse(about(shape.shape))
    inside = levelset.inside(levelset.carried(shape, there, one.pull.shape))
    return float((inside * one.loss_inside() + (1 - inside) * one.loss_outside()).sum()) * one.step**2


def shape_gradient(shape: Float, every: Float, measurements: Sequence[Measured]) -> Float:
    """Return ∇_μ φ (5) as a field (h, w) over μ's picture: Σ_τ |J_g(τ)| (f_in - f_out)(g(τ) x), along the normal."""
    total = np.zeros(shape.shape)
    for pose, one in zip(every, measurements, strict=True):
        there = one.to_cells() @ pose @ lie.inverse(about(shape.shape))
        total += abs(float(lie.determinant(pose))) * _seen_from(there, one.pull, shape.shape)
    return total


def velocity_gradient(
    edges: Float, base: Float, velocities: Float, measurements: Sequence[Measured], group: lie.Group
) -> Float:
    """Return ∇_{v_i} φ (k, D) (6), over the contour ∂μ with (f_in - f_out)."""
    every, none = poses(base, velocities, group), np.zeros(len(edges))
    slopes = np.stack(
        [_forces(edges, g, one.pull, one, none, group)[0] for g, one in zip(every, measurements, strict=True)]
    )
    return _drawn_back(slopes, velocities, group)


def edges_of(shape: Float) -> Float:
    """Return the edges (M, 4) x, y, x, y of the contour ∂μ, about the origin."""
    middle = about(shape.shape)[:2, 2]
    lines = [np.hstack([line, np.roll(line, -1, axis=0)]) for line in levelset.contour(shape)]
    return np.concatenate(lines) - np.tile(middle, 2) if lines else np.zeros((0, 4))


# Update ---------------------------------------------------------------------------------------------------------


def updated(
    state: State,
    new: Measured,
    gains: Gains,
    group: lie.Group,
    *,
    window: int,
    steps: int,
    motion: Motion,
    reach: int,
    curvature: float,
    robust: float = _EVERYTHING,
    free: int = 6,
    force: Callable[[Float, Float], Float] | None = None,
    least: bool = False,
) -> State:
    """Return the state at t+1, from a measurement (4).

    The velocities of the whole window are corrected and integrated again, then the shape.

    Parameters
    ----------
    state : State
        At t.
    new : Measured
        y(t+1).
    gains : Gains
        L_μ and L_v.
    group : Group
        Of the motions.
    window : int
        k ≥ 1, frames.
    steps : int
        Of each gradient.
    motion : function
        From the window's velocities to the next one.
    reach : int
        Cells to each side within which edges were looked for.
    curvature : float
        ≥ 0, cells.
    robust : float
        Parts of the contour that see no edge within reach, so that the mean of f_in - f_out over it is more, are not heard.
    free : int
        Of the group's coordinates the first so many are corrected.
    force : function, optional
        What is made of (5) (h, w) and μ before the contour is moved.
    least : bool
        Whether μ goes to where (3) is least near it, and not down its gradient (5) for some steps.
    """
    base, velocities, seen = _next_window(state, new, window, group)
    edges = edges_of(state.shape)
    own = own_pull(state.shape, edges, reach)
    velocities = corrected_velocities(
        edges, own, base, velocities, seen, gains.motion, group, steps, reach, robust, free
    )
    every = poses(base, velocities, group)
    if least:
        shape = towards_least(state.shape, every[-1:], seen[-1:], gains.shape, reach, force)
    else:
        shape = corrected_shape(state.shape, every, seen, gains.shape, steps, curvature, force)
    expected = motion(velocities)
    after = State(shape, base, velocities, seen, expected, expected - velocities[-1])
    return gauged(after, group=group)


def coasted(state: State, new: Measured, group: lie.Group, *, window: int) -> State:
    """Return the state at t+1 where nothing is seen: v goes on, μ is rigid."""
    base, velocities, seen = _next_window(state, new, window, group)
    return replace(state, base=base, velocities=velocities, measurements=seen, velocity=velocities[-1])


def own_pull(shape: Float, edges: Float, reach: int) -> Float:
    """Return f_in - f_out averaged over the reach (M,) at the middles of edges, as it would be were μ itself measured.

    On a straight contour it is 0; the average round a thin part, or a corner, is not.
    """
    wide = cv2.blur(
        1 - 2 * levelset.inside(shape), (2 * reach + 1, 2 * reach + 1), borderType=cv2.BORDER_REPLICATE
    )
    return levelset.sample(wide, (edges[:, :2] + edges[:, 2:]) / 2 + about(shape.shape)[:2, 2])


def corrected_velocities(
    edges: Float,
    own: Float,
    base: Float,
    velocities: Float,
    seen: Sequence[Measured],
    gain: float,
    group: lie.Group,
    steps: int,
    reach: int,
    robust: float = _EVERYTHING,
    free: int = 6,
) -> Float:
    """Return v_i + L_v ∇_{v_i} φ (k, D), in several steps down the slope (4).

    The slope is that of f averaged over the reach, so that it tells how far away an edge is, less what μ's own would be
    (M,), so that it is 0 at the truth. It is divided by the contour's second moments: translation, turning and growth
    have one scale, and L_v = 1 would go the whole way.
    """
    count = len(velocities)
    if gain <= 0 or not len(edges):
        return velocities
    rows = np.arange(count)
    shares = (count - np.maximum(rows[:, None], rows)).sum(
        axis=1
    )  # how far all corrections together move what v_i moves
    velocities = velocities.copy()
    for _ in range(steps):
        every = poses(base, velocities, group)
        found = [_forces(edges, g, one.wide, one, own, group, robust) for g, one in zip(every, seen, strict=True)]
        slopes = np.stack([slope for slope, _, _ in found])
        moments = np.sum([(1 - _TRUST) * heard + _TRUST * whole for _, heard, whole in found], axis=0) / count
        moments = moments + 1e-3 * np.diag(np.diag(moments)) + 1e-9 * np.eye(len(moments))
        gradient = _drawn_back(slopes, velocities, group)
        move = np.linalg.solve(moments, gradient.T).T * reach * seen[-1].step / shares[:, None]
        move[:, free:] = 0.0
        velocities = bounded(velocities - gain * bounded(move, reach * seen[-1].step), np.inf)
        if np.abs(move[:, :2]).max() < _STILL:
            break
    return velocities


def towards(state: State, pose: Float, group: lie.Group) -> State:
    """Return the state whose velocity leads to a pose (3, 3) in the next frame."""
    was = pose_of(state, group)
    step = np.eye(3)
    step[:2, :2] = pose[:2, :2] @ lie.inverse(was)[:2, :2]
    step[:2, 2] = pose[:2, 2] - was[:2, 2]
    return replace(state, velocity=group.log(step))


def bounded(velocities: Float, far: float) -> Float:
    """Return velocities (k, D) that move by no more than `far`, and turn, grow or bend by no more than a quarter."""
    kept = np.clip(velocities, -_MOST, _MOST)
    kept[:, :2] = np.clip(velocities[:, :2], -far, far)
    return kept


def corrected_shape(
    shape: Float,
    every: Float,
    seen: Sequence[Measured],
    gain: float,
    steps: int,
    curvature: float,
    force: Callable[[Float, Float], Float] | None = None,
) -> Float:
    """Return μ ⊕ L_μ ∇_μ φ (4): the distances between μ and where the gradient flow of (5) has it after some steps."""
    if gain <= 0:
        return shape
    areas = sum(abs(float(lie.determinant(pose))) for pose in every)
    push = shape_gradient(shape, every, seen) / areas
    if force is not None:
        push = force(push, shape)
    flowed = levelset.evolve(shape, push, curvature=curvature, steps=steps).phi
    if not (flowed < 0).any():
        return shape
    return levelset.blend(shape, flowed, gain)


def towards_least(
    shape: Float,
    every: Float,
    seen: Sequence[Measured],
    gain: float,
    reach: int,
    force: Callable[[Float, Float], Float] | None = None,
) -> Float:
    """Return μ ⊕ L_μ of the shape near it for which (3) is least: what (5) comes to when parts may also appear and vanish.

    That is where f_in < f_out within reach, as far as it hangs together with μ. Distances are cut off, so that thin
    parts count as much as thick ones.
    """
    if gain <= 0:
        return shape
    push = shape_gradient(shape, every, seen)
    if force is not None:
        push = force(push, shape)
    push = np.where(shape < reach, push, np.maximum(push, 0.1))
    inside = (push < 0).astype(np.uint8)
    count, labels = cv2.connectedComponents(inside, connectivity=8)
    hangs = np.zeros(count, np.bool_)
    hangs[np.unique(labels[shape < 0])] = True
    hangs[0] = False
    push = np.where(hangs[labels] | (push >= 0), push, 0.1)
    if not (push < 0).any():
        return shape
    found = levelset.redistance(push)
    return levelset.blend(np.clip(shape, -_CUT, _CUT), np.clip(found, -_CUT, _CUT), gain)


def settled_shape(state: State, one: Measured, curvature: float, group: lie.Group, steps: int = 60) -> State:
    """Return the state whose μ is steady under (5) of one frame (§III: the initialisation phase)."""
    pose = pose_of(state, group)[None]
    push = shape_gradient(state.shape, pose, [one]) / abs(float(lie.determinant(pose[0])))
    flowed = levelset.evolve(state.shape, push, curvature=curvature, steps=steps, until=0.05).phi
    if not (flowed < 0).any():
        return state
    return gauged(replace(state, shape=flowed), group=group)


def gauged(state: State, *, group: lie.Group) -> State:
    """Return the same contour with its centroid at μ's origin: (g h⁻¹, h μ) is as good as (g, μ)."""
    there = levelset.moments(state.shape)
    off = there.centroid - about(state.shape.shape)[:2, 2]
    need = _fitting(state.shape)
    if np.abs(off).max() <= _ABOUT and _fits(state.shape.shape, need):
        return state
    moved = about(need) @ _shift(-off) @ lie.inverse(about(state.shape.shape))
    shape = levelset.redistance(levelset.carried(state.shape, moved, need))
    base = state.base @ _shift(off)
    if len(state.velocities):
        base, velocities = _with_origin(state, off, group)
        return replace(state, shape=shape, base=base, velocities=velocities)
    return replace(state, shape=shape, base=base)


# The parts of it --------------------------------------------------------------------------------------------------


def _with_origin(state: State, off: Float, group: lie.Group) -> tuple[Float, Float]:
    """The window's first pose and velocities of the same motion, said about another point of the object."""
    old = [state.base, *poses(state.base, state.velocities, group)]
    new = [pose @ _shift(off) for pose in old]
    velocities = state.velocities.copy()
    steps = group.exp(velocities)
    for number, step in enumerate(steps):
        step[:2, 2] = new[number + 1][:2, 2] - new[number][:2, 2]
    return new[0], group.log(steps)


def _next_window(
    state: State, new: Measured, window: int, group: lie.Group
) -> tuple[Float, Float, tuple[Measured, ...]]:
    velocities = np.vstack([state.velocities, state.velocity])  # (k + 1, D)
    seen = (*state.measurements, new)
    extra = len(seen) - window
    base = state.base
    if extra > 0:
        base = poses(base, velocities[:extra], group)[-1]
        velocities, seen = velocities[extra:], seen[extra:]
    return base, velocities, seen


def _forces(
    edges: Float,
    pose: Float,
    field: Single,
    one: Measured,
    less: Float,
    group: lie.Group,
    most: float = _EVERYTHING,
) -> tuple[Float, Float, Float]:
    """Slope (D,) by a motion about the object's origin, second moments (D, D) of what is heard and of all."""
    from perdure.maths.kernels.contour_forces import forces

    size = group.dimension
    slope, heard, whole = np.empty(size), np.empty((size, size)), np.empty((size, size))
    forces(edges, pose, np.ascontiguousarray(field), one.to_cells(), less, most, slope, heard, whole)
    return slope, heard, whole


def _drawn_back(slopes: Float, velocities: Float, group: lie.Group) -> Float:
    """∂φ / ∂v_i (k, D) from the slopes (k, D) of every pose by a motion about its own origin."""
    steps, out = group.exp(velocities), np.zeros_like(slopes)
    turned = steps.copy()
    turned[:, :2, 2] = 0.0
    bent, spread = group.adjoint(turned), group.left_jacobian(velocities)  # (k, D, D)
    about = group.jacobian(
        steps[:, :2, 2]
    )  # (k, 2, D): turning about the origin before a step moves the one after it
    carried = np.zeros(slopes.shape[1])  # by a motion right after frame i, of everything from i on
    for i in range(len(slopes) - 1, -1, -1):
        carried = carried + slopes[i]
        pulled = carried.copy()
        pulled[2:] += about[i, :, 2:].T @ carried[:2]
        out[i] = spread[i].T @ pulled
        carried[2:] = bent[i, 2:, 2:].T @ carried[2:]
    return out


def _seen_from(there: Float, field: NDArray[np.float32], shape: tuple[int, int]) -> Float:
    """A field as it lies under a picture (h, w) that `there` (3, 3) takes into it."""
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(field, there[:2], (shape[1], shape[0]), flags=flags, borderMode=cv2.BORDER_REPLICATE),
        np.float64,
    )


def about(shape: tuple[int, int]) -> Float:
    """From coordinates about the origin to columns and rows of μ's picture."""
    return _shift(np.array([(shape[1] - 1) / 2, (shape[0] - 1) / 2]))


def _shift(by: Float) -> Float:
    motion = np.eye(3)
    motion[:2, 2] = by
    return motion


def _fitting(phi: Float) -> tuple[int, int]:
    """Rows and columns of a picture that has room about the centroid for a shape and for what it may become."""
    inside = phi < 0
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    middle = levelset.moments(phi).centroid
    half_h = max(rows[-1] - middle[1], middle[1] - rows[0])
    half_w = max(columns[-1] - middle[0], middle[0] - columns[0])
    return tuple(2 * int(np.ceil(half * (1 + _ROOM) + MARGIN)) + 1 for half in (half_h, half_w))  # type: ignore[return-value]


def _fits(shape: tuple[int, ...], need: tuple[int, int]) -> bool:
    """Whether a picture is neither too small nor far too large."""
    return all(0 <= have - want + MARGIN <= 3 * MARGIN + want // 3 for have, want in zip(shape, need, strict=True))

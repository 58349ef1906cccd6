"""The update (4) as the tracker asks for it: gains and forces that go by what is seen of an object."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from perdure.trackers.contour import observer
from perdure.trackers.contour.measuring import Measured, Single, of_evidence
from perdure.trackers.contour.observer import Float, Gains, State
from perdure.trackers.contour.rules import Rules
from perdure.trackers.contour.seeing import Window
from perdure.types import Bits


def evident(by: Rules, window: Window, found: Single, known: Bits) -> Measured:
    """Return what evidence (h, w) measures, where it is known (h, w)."""
    return of_evidence(found, known, by.reach, window.x, window.y, window.step)


def registered(by: Rules, state: State, one: Measured, edge: float, whole: bool) -> Float:
    """Return the pose (3, 3) of the contour in this frame alone."""
    alone = replace(
        state, velocities=state.velocities[:0], measurements=(), base=observer.pose_of(state, by.group)
    )
    after = observed(by, alone, one, Gains(0.0, 1.0), edge, whole)
    return observer.pose_of(after, by.group)


def observed(
    by: Rules, state: State, one: Measured, gains: Gains, edge: float, whole: bool = True, *, least: bool = False
) -> State:
    """Return the state at t + 1 (4); of what is not seen `whole` a shift alone is believed."""
    automatic = by.automatic
    return observer.updated(
        state, one, gains, by.group,
        window=by.window, steps=by.iterations, motion=by.motion, reach=by.reach,
        curvature=by.curvature, robust=edge if automatic else 2.0,
        force=_force(by, whole, least) if automatic else None, free=6 if whole or not automatic else 2,
        least=automatic and whole and least,
    )  # fmt: skip


def steadied(by: Rules, state: State, steady: Float, share: float) -> State:
    """Return the state with a prediction that is the steadier, the less is seen; it turns and grows by half at most."""
    if not by.automatic:
        return state
    velocity = share * state.velocity + (1 - share) * steady
    velocity[2:] = share * state.velocity[2:] / 2
    return replace(state, velocity=velocity)


def _force(by: Rules, whole: bool, least: bool) -> Callable[[Float, Float], Float] | None:
    """Return what is made of (5)."""
    if whole and least:
        return None
    return partial(_slower, by) if whole else partial(_heard, by)


def _heard(by: Rules, push: Float, shape: Float) -> Float:
    """Return (5) of an object that is partly hidden: where nothing within reach looks like it, μ is rigid."""
    own = ((push < -0.2) & (shape < by.reach)).astype(np.uint8)
    side = 2 * by.reach + 1
    near = cv2.dilate(own, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)))
    return np.where(np.asarray(near) > 0, _slower(by, push, shape), 0.0)


def _slower(by: Rules, push: Float, shape: Float) -> Float:
    """Return (5), weaker where μ gives up pixels: what is hidden looks as if it were no more."""
    return np.where(push > 0, by.giving * push, push)

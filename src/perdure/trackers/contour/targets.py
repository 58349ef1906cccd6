"""Targets: what is believed of each object, and of the place behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.maths.mixture import Mixture
from perdure.scene.whereabouts import NOWHERE, Whereabouts
from perdure.trackers.contour.observer import State
from perdure.trackers.contour.recalling import Shape
from perdure.types import Mask


@dataclass(frozen=True, eq=False)
class Layer:
    """A picture of the object as last seen, in cells of `step` pixels, and with which pose."""

    x: int
    y: int
    step: int
    colours: NDArray[np.float32]  # (h, w, 3)
    known: NDArray[np.float32]  # (h, w) in [0, 1]
    pose: NDArray[np.float64]  # (3, 3) g then


@dataclass(frozen=True, eq=False)
class Looks:
    """What the object and its surroundings look like: mixtures of colours, at first and at last; and the object itself."""

    first_own: Mixture
    first_other: Mixture
    last_own: Mixture
    last_other: Mixture
    layer: Layer


@dataclass(frozen=True, eq=False)
class Target:
    """One object."""

    key: int  # never used twice
    id: int
    state: State  # {μ, g, v, α}
    looks: Looks
    seen: Mask  # pixels seen in this frame
    visible: float  # share of the usual support that is there
    usual: float  # square pixels that look like it, in its silhouette and near it
    steady: NDArray[np.float64]  # (D,) velocity of late while it was seen whole
    past: tuple[Shape, ...]  # shapes that were seen in full
    recalled: int  # while it is hidden: how old it was when it had the shape that it has now; -1: it is rigid
    restless: float  # share of its outline that is another in every frame, of late
    drift: NDArray[np.float64]  # (2,) px by which it was found off its path since it is hidden
    straying: NDArray[np.float64]  # (2,) px/frame by which that grows
    age: int  # frames since it was found
    frames: int  # in which it was measured
    missed: float  # s for which it was not seen
    born: float  # s
    score: float
    class_: str
    links: tuple[int, ...]
    marked: bool
    last_seen: Whereabouts = NOWHERE


@dataclass(frozen=True, eq=False)
class Place:
    """What stands still, as far as it has been seen: no target was there."""

    colours: NDArray[np.uint8]  # (H, W, 3) Lab
    known: NDArray[np.bool_]  # (H, W)
    covered: NDArray[
        np.bool_
    ]  # (H, W) a target has been seen there: nothing that stands there comes before targets
    grey: NDArray[np.uint8]  # (h, w) of the frame before, smaller by `step`
    step: int

"""Weights of the features: the user's, those learnt for a context, or equal ones; and the features that they ask for."""

from __future__ import annotations

import math

from perdure.errors import ParameterError
from perdure.features.embedding import Network
from perdure.features.feature import Feature
from perdure.features.pool import EMBEDDING, POOL, made
from perdure.params import unknown_name
from perdure.scene.context import Context
from perdure.types import Scene

GATE = "displacement_2d"  # always described: pairs that it says nothing for are not compared at all
DEFAULT = (
    Context(  # chosen on MOT17-02, -04, -10, TUD-Campus and PETS09-S2L1, by means over detections and settings
        "default",
        {"displacement_2d": 0.25, "shape_ratio": 0.1, "area": 0.3, "dominant": 0.3, "overlap": 1.0},
        similar=0.31,
    )
)
LOOKS = ("histogram", "covariance", "dominant")  # by which who was lost, or met somebody, is known again


def weights_of(text: str) -> dict[str, float]:
    """Return the weights that a text such as 'displacement_2d=1,area=0.5' names.

    Raises
    ------
    ParameterError
        For an unknown feature, one named twice, a weight that is no number ≥ 0, or weights that are all 0.

    >>> weights_of("area=0.5, shape_ratio=1")
    {'area': 0.5, 'shape_ratio': 1.0}
    """
    found: dict[str, float] = {}
    for part in filter(None, (one.strip() for one in text.split(","))):
        name, _, number = (one.strip() for one in part.partition("="))
        if name not in (*POOL, EMBEDDING):
            raise ParameterError(f"weights = {text!r}: {unknown_name('feature', name, [*POOL, EMBEDDING])}")
        if name in found:
            raise ParameterError(f"weights = {text!r}: {name} is named twice; leave out one")
        try:
            found[name] = float(number)
        except ValueError:
            found[name] = math.nan
        if not (math.isfinite(found[name]) and found[name] >= 0):
            raise ParameterError(
                f"weights = {text!r}: the weight of {name} must be a number ≥ 0, as in '{name}=1'"
            )
    if not any(found.values()):
        raise ParameterError(
            f"weights = {text!r}: all are 0; at least one feature must have a weight above 0 (eq. 10)"
        )
    return found


def features_for(context: Context, scene: Scene, network: Network | None = None) -> list[Feature]:
    """Return the features of some weight, and the one that gates pairs; what weighs nothing is not computed."""
    wanted = {name for name, weight in context.weights.items() if weight > 0} | {GATE}
    return list(made(wanted, scene, network).values())


def looks_for(scene: Scene, network: Network | None = None) -> list[Feature]:
    """Return the features of looks: those of colour, and the network's where there is one."""
    wanted = (*LOOKS, *(() if network is None else (EMBEDDING,)))
    return list(made(wanted, scene, network).values())

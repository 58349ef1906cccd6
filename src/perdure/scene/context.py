"""A context: what a scene is like, and how things are best told apart in it (section 3; its future work).

Weights of the features (eq. 10), the least similarity of a link (Th1), and what they were learnt from. Of several
contexts the nearest to a video is chosen by its measures.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.pool import EMBEDDING, POOL
from perdure.params import Value, unknown_name
from perdure.scene.measuring import Measures, difference
from perdure.types import Scene

MOST_KNOWN, OTHER_PICTURES = 3.0, 1.0  # distance of a context of which nothing can be used; of pictures unused
ON_GROUND = "displacement_3d"


@dataclass(frozen=True)
class Alone:
    """What one feature tells by itself, in the samples that a context was learnt from."""

    separation: float  # how often a same pair is more alike than a different one: the area under its curve
    threshold: float  # of least error, or Th1
    error: float  # there, of the samples as they weighed at first
    rounds: int  # that chose it
    known: float  # share of the samples in which it is known


@dataclass(frozen=True)
class Training:
    """What a context was learnt from."""

    sources: tuple[str, ...] = ()
    same: int = 0  # pairs of one object
    different: int = 0  # pairs of two
    separation: float = 0.5  # of the link similarity (eq. 10)
    notes: tuple[str, ...] = ()
    options: Mapping[str, Value] = field(default_factory=dict)
    alone: Mapping[str, Alone] = field(default_factory=dict)


@dataclass(frozen=True)
class Context:
    """How things are told apart in scenes of a kind.

    Parameters
    ----------
    name : str
    weights : feature → w_k (eq. 10)
        ≥ 0, one of them above 0; features that are not named weigh nothing.
    similar : float
        Th1: two things may be linked from this link similarity on.
    levels : feature → (low, high)
        A similarity counts as (s - low) / (high - low), from 0 to 1; ours. Empty as in the paper.
    measures : Measures
        What the scene was like that it was learnt from.
    training : Training
        What it was learnt from.

    Raises
    ------
    ValueError
        For a feature that is not in the pool, a weight that is negative or no number, only zeros, levels that do not
        rise.
    """

    name: str
    weights: Mapping[str, float]
    similar: float = 0.5
    levels: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    measures: Measures = field(default_factory=Measures)
    training: Training = field(default_factory=Training)

    def __post_init__(self) -> None:
        for name, weight in self.weights.items():
            if name not in (*POOL, EMBEDDING):
                raise ValueError(unknown_name("feature", name, (*POOL, EMBEDDING)))
            if not (math.isfinite(weight) and weight >= 0):
                raise ValueError(f"the weight of {name} is {weight:g}; it must be a number ≥ 0")
        if not any(self.weights.values()):
            raise ValueError("all weights are 0; one at least must be above 0")
        if not 0 <= self.similar <= 1:
            raise ValueError(f"similar = {self.similar:g} is out of range: it must be 0 to 1")
        for name, (low, high) in self.levels.items():
            if name not in (*POOL, EMBEDDING):
                raise ValueError(unknown_name("feature", name, (*POOL, EMBEDDING)))
            if not 0 <= low < high <= 1:
                raise ValueError(f"the levels of {name} are {low:g} and {high:g}; they must rise, from 0 to 1")

    @property
    def used(self) -> tuple[str, ...]:
        """The features that weigh anything, in the order of the pool."""
        return tuple(name for name in (*POOL, EMBEDDING) if self.weights.get(name, 0.0) > 0)

    def levelled(self, name: str, similarity: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return a feature's similarities as they count: brought to the levels, where there are any.

        >>> context = Context("street", {"area": 1.0}, levels={"area": (0.25, 0.75)})
        >>> context.levelled("area", np.array([0.1, 0.5, 0.9])).tolist()
        [0.0, 0.5, 1.0]
        """
        if name not in self.levels:
            return similarity
        low, high = self.levels[name]
        return np.asarray(np.clip((similarity - low) / (high - low), 0.0, 1.0))


class Nearest(NamedTuple):
    """The context nearest to a video, how far it is, and the next one."""

    context: Context
    distance: float
    runner_up: Context | None = None
    runner_up_distance: float = math.inf


def nearest(contexts: Sequence[Context], measures: Measures) -> Nearest:
    """Return the context nearest to a video's measures, and the runner-up.

    Raises
    ------
    ValueError
        If there are no contexts.
    """
    if not contexts:
        raise ValueError("there is no context to choose from")
    ranked = ranking(contexts, measures)
    return Nearest(*ranked[0], *(ranked[1] if len(ranked) > 1 else ()))


def ranking(contexts: Sequence[Context], measures: Measures) -> list[tuple[Context, float]]:
    """Return all contexts with their distances, the nearest first; of equals the first by name."""
    found = [(context, distance(context, measures)) for context in contexts]
    return sorted(found, key=lambda one: (one[1], one[0].name))


def distance(context: Context, measures: Measures) -> float:
    """Return how far a context is from a video, ≥ 0.

    The difference of the measures that both know, in their scales, and as much more as the context rests on what the
    video cannot tell: colours without pictures, metres without a ground plane. One that uses no picture, where there
    are pictures, is farther by one, if it knew none.
    """
    lost = sum(
        weight
        for name, weight in context.weights.items()
        if weight > 0
        and ((not measures.pictures and needs_pixels(name)) or (not measures.ground and name == ON_GROUND))
    )
    blind = OTHER_PICTURES if measures.pictures and not context.measures.pictures else 0.0
    return difference(context.measures, measures) + MOST_KNOWN * lost / sum(context.weights.values()) + blind


@functools.cache
def needs_pixels(name: str) -> bool:
    """Return whether a feature of the pool says nothing without pictures."""
    return name == EMBEDDING or POOL[name](Scene(1, 1)).needs_pixels

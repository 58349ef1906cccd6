"""Samples in, a context out: weights, levels and the least similarity of what is the same (eq. 11-14)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from perdure import params
from perdure.errors import ParameterError
from perdure.features import pool
from perdure.features.pool import POOL
from perdure.learn.learning import Learning
from perdure.learn.samples import NEAR, Bits, Drawn, Film, Float, Samples, watch
from perdure.maths.boost import Boosted, best_thresholds, boost_at, boost_stumps, errors_at, separation
from perdure.scene.context import ON_GROUND, Alone, Context, Training
from perdure.scene.measuring import Measures

SPREAD = (0.05, 0.95)  # quantiles: levels are that of different pairs and that of same ones


class Learnt(NamedTuple):
    """A context, the samples that it was learnt from, and the rounds."""

    context: Context
    samples: Samples
    boosted: Boosted


def learn(films: Iterable[Film], learning: Learning | None = None, name: str = "learnt") -> Learnt:
    """Learn a context from films with their truths.

    Raises
    ------
    ParameterError
        If there is no pair of one object in all of them: nothing can be learnt.
    """
    learning = Learning() if learning is None else learning
    params.check(learning)
    drawn = Drawn.none()
    sources, measured = [], []
    for film in films:
        drawn, measures = watch(film, learning, drawn)
        sources.append(film.name)
        measured.append(measures)
    samples = drawn.samples()
    _refuse_nothing(samples, sources)
    found = context_of(samples, learning, name)
    told = replace(found.context.training, sources=tuple(sources))
    context = replace(found.context, measures=_mean(measured), training=told)
    return found._replace(context=context)


def context_of(samples: Samples, learning: Learning, name: str) -> Learnt:
    """Learn a context from samples, of which some are of the same object."""
    boosted, notes = _boosted(samples, learning)
    names = tuple(POOL)
    heavy = boosted.weights >= min(max(learning.least_weight, 1e-12), float(boosted.weights.max()))
    rest = np.where(heavy, boosted.weights, 0.0) / boosted.weights[heavy].sum()
    weights = {one: float(weight) for one, weight in zip(names, rest, strict=True) if weight > 0}
    levels = _levels(samples, weights) if learning.levels else {}
    context = Context(name, weights, levels=levels)
    link, told = link_similarity(context, samples)
    similar = learning.similar
    if not similar:
        same = link[samples.same & told]
        similar = float(np.quantile(same, 1.0 - learning.kept)) if len(same) else 0.0
    training = Training(
        same=round(float(samples.weights[samples.same].sum())),
        different=round(float(samples.weights[~samples.same].sum())),
        separation=float(separation(link[:, None], told[:, None], samples.labels)[0]),
        notes=notes,
        options=params.values(learning),
        alone=_alone(samples, learning, boosted),
    )
    return Learnt(replace(context, similar=similar, training=training), samples, boosted)


def link_similarity(context: Context, samples: Samples) -> tuple[Float, Bits]:
    """Return LS (N,) of samples (eq. 10), over the features known of each, and where any is (N,)."""
    total, share = np.zeros(len(samples.labels)), np.zeros(len(samples.labels))
    for k, name in enumerate(POOL):
        weight = context.weights.get(name, 0.0)
        if weight > 0:
            there = samples.known[:, k]
            total += weight * np.where(there, context.levelled(name, samples.similarities[:, k]), 0.0)
            share += weight * there
    return np.divide(total, share, out=np.zeros_like(total), where=share > 0), np.asarray(share > 0)


# Boosting ---------------------------------------------------------------------------------------------------


def _initial(samples: Samples, learning: Learning) -> Float:
    """What each sample weighs at first (N,): as the films have them, or both kinds the same."""
    if not learning.balanced or samples.same.all():
        return samples.weights
    shares = np.where(samples.same, samples.weights[samples.same].sum(), samples.weights[~samples.same].sum())
    return np.asarray(samples.weights / shares)


def _boosted(samples: Samples, learning: Learning) -> tuple[Boosted, tuple[str, ...]]:
    """The rounds and weights; displacement alone where there is nothing to tell apart, and a note why."""
    if samples.same.all():
        return _by_displacement(samples), ("nothing else is near the objects: displacement alone",)
    allowed = np.array([learning.ours or name in pool.PAPER for name in POOL])
    known = samples.known & allowed
    given = samples.similarities, known, samples.labels, _initial(samples, learning), learning.rounds
    found = boost_at(learning.similar, *given) if learning.similar else boost_stumps(*given)
    if not found.rounds:
        return _by_displacement(samples), ("no feature tells the pairs apart: displacement alone",)
    return found, ()


def _by_displacement(samples: Samples) -> Boosted:
    """All weight on displacement: on the ground if that is known of half the pairs at least, else in the picture."""
    names = tuple(POOL)
    on_ground = samples.known[:, names.index(ON_GROUND)].mean() >= 0.5
    weights = np.zeros(len(names))
    weights[names.index(ON_GROUND if on_ground else NEAR)] = 1.0
    return Boosted((), weights)


def _levels(samples: Samples, weights: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """What is usual for different pairs and for same ones, of features that weigh anything and where it rises."""
    found = {}
    for k, name in enumerate(POOL):
        of_kind = [samples.similarities[samples.known[:, k] & kind, k] for kind in (~samples.same, samples.same)]
        if name in weights and all(len(one) for one in of_kind):
            low, high = (float(np.quantile(one, share)) for one, share in zip(of_kind, SPREAD, strict=True))
            if high - low > 1e-3:
                found[name] = (low, high)
    return found


def _alone(samples: Samples, learning: Learning, boosted: Boosted) -> dict[str, Alone]:
    """What each feature tells by itself, of those that are known of any pair."""
    given = samples.similarities, samples.known, samples.labels, _initial(samples, learning)
    if learning.similar:
        thresholds, errors = np.full(len(POOL), learning.similar), errors_at(learning.similar, *given)
    else:
        thresholds, errors = best_thresholds(*given)
    areas, shares = separation(*given[:3]), samples.known.mean(axis=0)
    chosen = np.bincount([one.feature for one in boosted.rounds], minlength=len(POOL))
    return {
        name: Alone(float(areas[k]), float(thresholds[k]), float(errors[k]), int(chosen[k]), float(shares[k]))
        for k, name in enumerate(POOL)
        if shares[k] > 0
    }


def _refuse_nothing(samples: Samples, sources: list[str]) -> None:
    if not samples.same.any():
        where = ", ".join(sources) or "no film"
        what = "no object is seen twice" if not len(samples.labels) else "no two things seen are the same object"
        raise ParameterError(
            f"nothing can be learnt from {where}: {what} near where it was; check that the truth and the detections "
            "are of this film, its frames and its size"
        )


def _mean(measured: list[Measures]) -> Measures:
    """What the films are like on the mean."""
    values: dict[str, float | bool | None] = {}
    for name in ("objects", "cover", "occlusion", "depth", "illumination", "contrast", "fps"):
        there = [value for one in measured if (value := getattr(one, name)) is not None]
        values[name] = sum(there) / len(there) if there else None
    flags = {name: all(getattr(one, name) for one in measured) for name in ("pictures", "ground")}
    return Measures(**values, **flags)  # type: ignore[arg-type]

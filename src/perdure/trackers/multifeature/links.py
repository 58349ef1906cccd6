"""Links between trajectories and new objects: link, long-term and global similarity (sections 2.2, 4.1, 4.2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Feature, Float
from perdure.features.pool import known
from perdure.scene.context import Context
from perdure.trackers.multifeature.targets import Rows, Targets, is_number
from perdure.types import Frame, Regions, Scene

Index = NDArray[np.intp]
_LEAST = 0.05  # deviation of a similarity below which none is believed (eq. 15)


class Links(NamedTuple):
    """Pairs of a target and a new object, and how alike the two are."""

    target: Index  # (P,)
    region: Index  # (P,)
    elapsed: NDArray[np.float64]  # (P,) s
    link: Mapping[str, Float]  # (P,) by feature; 0 where not known
    known: Mapping[str, NDArray[np.bool_]]  # (P,) by feature
    long: Mapping[str, Float]  # (P,) by feature (eq. 15)
    trust: Float  # (P,) the weight of the long-term similarity (eq. 18)

    def at(self, pairs: Index) -> dict[str, Float]:
        """Return the link similarities (K,) of official links (K, 2), by feature."""
        order = {
            both: number
            for number, both in enumerate(zip(self.target.tolist(), self.region.tolist(), strict=True))
        }
        numbers = np.array([order.get((one, other), -1) for one, other in pairs.tolist()], np.intp)
        return {name: np.append(value, np.float32(0))[numbers] for name, value in self.link.items()}


def weighted(
    values: Mapping[str, Float], there: Mapping[str, NDArray[np.bool_]], weights: Mapping[str, float]
) -> Float:
    """Return the weighted mean (P,) of similarities by feature (eq. 10, eq. 16); 0 where no feature is known."""
    count = len(next(iter(values.values()), ()))
    total, weight = np.zeros(count, np.float32), np.zeros(count, np.float32)
    for name, value in values.items():
        part = np.where(there[name], np.float32(weights.get(name, 0.0)), np.float32(0.0))
        total += part * value
        weight += part
    return np.divide(total, weight, out=np.zeros_like(total), where=weight > 0)


def global_similarity(links: Links) -> dict[str, Float]:
    """Return GS_k = (1 - β) LS_k + β LT_k (P,) by feature (eq. 17)."""
    return {
        name: (1 - links.trust) * value + links.trust * links.long[name] if name in links.long else value
        for name, value in links.link.items()
    }


def compare(
    features: list[Feature],
    targets: Targets,
    rows: Rows,
    pairs: tuple[Index, Index],
    elapsed: NDArray[np.float64],
    most: float,
    context: Context,
) -> Links:
    """Return the links (P,) of pairs of a target and a region, with `rows` the features of all regions.

    `most` is Th4, the highest weight of the long-term similarity. Features that a target was never described by, since
    another context was in force, are not known of it.
    """
    one, other = pairs
    link: dict[str, Float] = {}
    there: dict[str, NDArray[np.bool_]] = {}
    long: dict[str, Float] = {}
    for feature in features:
        name = feature.name
        mine, theirs = targets.rows[name], rows[name]
        both = known(mine)[one] & known(theirs)[other]
        alike = np.zeros(len(one), np.float32)
        alike[both] = context.levelled(
            name, feature.similarity(mine[one[both]], theirs[other[both]], elapsed[both])
        )
        link[name], there[name] = alike, both
        if feature.varies:
            long[name] = long_term(targets, one, name, theirs[other], alike)
    trust = np.minimum(targets.length[one], most).astype(np.float32)
    return Links(one, other, elapsed, link, there, long, trust)


def long_term(targets: Targets, one: Index, name: str, new: Float, alike: Float) -> Float:
    """Return how well a new object fits the last Q objects of a trajectory (P,) (eq. 15), with peak-normalised density.

    The value of a feature that is more than a number is how like the object before each object is.
    """
    values = targets.values[name]  # (N, Q)
    number = is_number(new)
    filled = targets.filled  # (N, Q)
    if not number:  # the first object has none before it
        filled = filled & (np.arange(filled.shape[1]) > filled.shape[1] - targets.count[:, None])
    count = np.maximum(filled.sum(axis=1), 1)
    mean = (values * filled).sum(axis=1) / count
    spread = np.sqrt((((values - mean[:, None]) ** 2) * filled).sum(axis=1) / count)
    value = new[:, 0] if number else alike
    floor = np.maximum(_LEAST * np.abs(mean) * 2 if number else _LEAST, 1e-6)
    deviation = np.maximum(spread, floor)
    off = (value - mean[one]) / deviation[one]
    return np.asarray(np.exp(-0.5 * off**2) * targets.length[one], np.float32)


def described(
    features: list[Feature],
    memories: Mapping[str, Mapping[str, NDArray[Any]]],
    frame: Frame,
    regions: Regions,
    scene: Scene,
) -> tuple[dict[str, dict[str, NDArray[Any]]], Rows]:
    """Return what features carry on, and the rows of all regions by feature; one that is new begins here."""
    carried, rows = {}, {}
    for one in features:
        before = memories[one.name] if one.name in memories else one.start(scene)
        memory, rows[one.name] = one.describe(before, frame, regions)
        carried[one.name] = dict(memory)
    return carried, rows

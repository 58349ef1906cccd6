"""Why a link was made: how alike the two are by feature, what each weighed, and who else it might have been."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Float
from perdure.scene.context import Context
from perdure.trackers.multifeature.links import Links, global_similarity
from perdure.trackers.multifeature.targets import Targets
from perdure.types import Explanation, Regions

Index = NDArray[np.intp]
RIVAL, ELSEWHERE = "runner_up", "other_region"


def explained(
    targets: Targets, links: Links, score: Float, pairs: Index, regions: Regions, context: Context
) -> list[Explanation]:
    """Return the reason of every official link (K, 2) of a target with an id.

    Figures are, by feature, `link:NAME` (eq. 10), `global:NAME` (eq. 17) and `weight:NAME`, of those that are known;
    `score`, the global similarity (eq. 16) less what it has waned by; `region`; `id`s of who else might have been it,
    `runner_up:ID`, and of what else it might have been, `other_region:ROW`, with their scores.
    """
    order = {both: k for k, both in enumerate(zip(links.target.tolist(), links.region.tolist(), strict=True))}
    numbers = np.array([order.get((row, column), -1) for row, column in pairs.tolist()], np.intp)
    told = (numbers >= 0) & (targets.ids[pairs[:, 0]] > 0)
    pairs, numbers = pairs[told], numbers[told]
    rows, columns = pairs.T
    figures: list[dict[str, float]] = [
        {"score": one, "region": float(column)}
        for one, column in zip(_short(score[rows, columns]), columns.tolist(), strict=True)
    ]
    every = global_similarity(links)
    for name in links.link:
        weight = round(float(context.weights.get(name, 0.0)), 4)
        there = links.known[name][numbers] & (weight > 0)
        values = zip(_short(links.link[name][numbers]), _short(every[name][numbers]), strict=True)
        for own, known, (link, whole) in zip(figures, there.tolist(), values, strict=True):
            if known:
                own |= {f"link:{name}": link, f"global:{name}": whole, f"weight:{name}": weight}
    _add_rivals(figures, targets, score, rows, columns)
    why = f"highest global similarity under the context {context.name!r}"
    return [Explanation(one, why, own) for one, own in zip(targets.ids[rows].tolist(), figures, strict=True)]


def restated(
    explanations: Iterable[Explanation], ids: Mapping[int, int], numbers: Index | None = None
) -> tuple[Explanation, ...]:
    """Return the reasons with other ids, where `ids` has any, and with the `numbers` of regions among all of them.

    One whose id is 0 now has none any more, and nothing is said of it.
    """
    if numbers is None and all(old == new for old, new in ids.items()):
        return tuple(explanations)
    found = []
    for one in explanations:
        figures = {}
        for key, value in one.figures.items():
            name, _, which = key.partition(":")
            if name == RIVAL:
                if not ids.get(int(which), int(which)):
                    continue
                key = f"{RIVAL}:{ids.get(int(which), int(which))}"
            elif name == ELSEWHERE and numbers is not None:
                key = f"{ELSEWHERE}:{numbers[int(which)]}"
            figures[key] = float(numbers[int(value)]) if name == "region" and numbers is not None else value
        found.append(replace(one, id=ids.get(one.id, one.id), figures=figures))
    return tuple(one for one in found if one.id)


def _add_rivals(
    figures: list[dict[str, float]], targets: Targets, score: Float, rows: Index, columns: Index
) -> None:
    """Add to the figures of each link the best other target of its object, and the best other object of its target."""
    if not len(rows):
        return
    links = np.arange(len(rows))
    others = np.where(targets.ids[:, None] > 0, score[:, columns], -np.inf)  # (N, K)
    others[rows, links] = -np.inf
    regions = score[rows]  # (K, M)
    regions[links, columns] = -np.inf
    first, elsewhere = others.argmax(axis=0), regions.argmax(axis=1)
    for key, names, values in (
        (RIVAL, targets.ids[first], others[first, links]),
        (ELSEWHERE, elsewhere, regions[links, elsewhere]),
    ):
        there = np.isfinite(values).tolist()
        for own, known, name, value in zip(figures, there, names.tolist(), _short(values), strict=True):
            if known:
                own[f"{key}:{name}"] = value


def _short(values: Float) -> list[float]:
    """Values (K,) as figures of four digits."""
    return [round(one, 4) for one in values.tolist()]

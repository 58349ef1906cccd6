"""Why a link was made: how alike the two are by feature, what each weighed, and who else it might have been."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Float
from perdure.scene.context import Context
from perdure.trackers.multifeature.links import Links, global_similarity
from perdure.trackers.multifeature.targets import Targets
from perdure.types import Explanation, Regions

Index = NDArray[np.intp]
RIVAL = "runner_up"


def explained(
    targets: Targets, links: Links, score: Float, pairs: Index, regions: Regions, context: Context
) -> list[Explanation]:
    """Return the reason of every official link (K, 2) of a target with an id.

    Figures are, by feature, `link:NAME` (eq. 10), `global:NAME` (eq. 17) and `weight:NAME`, of those that are known;
    `score`, the global similarity (eq. 16) less what it has waned by; `region`; `id`s of who else might have been it,
    `runner_up:ID`, and of what else it might have been, `other_region:ROW`, with their scores.
    """
    order = {both: k for k, both in enumerate(zip(links.target.tolist(), links.region.tolist(), strict=True))}
    every = global_similarity(links)
    found = []
    for row, column in pairs.tolist():
        number = order.get((row, column))
        if targets.ids[row] == 0 or number is None:
            continue
        figures = {"score": float(score[row, column]), "region": float(column)}
        for name, value in links.link.items():
            weight = context.weights.get(name, 0.0)
            if weight > 0 and links.known[name][number]:
                figures[f"link:{name}"] = float(value[number])
                figures[f"global:{name}"] = float(every[name][number])
                figures[f"weight:{name}"] = float(weight)
        figures |= _rivals(targets, score, row, column)
        why = f"highest global similarity under the context {context.name!r}"
        found.append(Explanation(int(targets.ids[row]), why, {key: round(one, 4) for key, one in figures.items()}))
    return found


def _rivals(targets: Targets, score: Float, row: int, column: int) -> dict[str, float]:
    """The best other target of the same object, and the best other object of the same target."""
    figures = {}
    others = np.where(targets.ids > 0, score[:, column], -np.inf)
    others[row] = -np.inf
    if np.isfinite(others).any():
        best = int(others.argmax())
        figures[f"{RIVAL}:{int(targets.ids[best])}"] = float(others[best])
    regions = score[row].copy()
    regions[column] = -np.inf
    if np.isfinite(regions).any():
        best = int(regions.argmax())
        figures[f"other_region:{best}"] = float(regions[best])
    return figures

"""The pool of features: what two seen things can be compared by (section 2.1 of the multi-feature tracker).

A feature is a file of its own (`perdure.features.feature` says what it must offer) and a row in POOL. A weight of 0
leaves it out: it is then not computed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from perdure.errors import ParameterError
from perdure.features.area import Area
from perdure.features.covariance import ColourCovariance
from perdure.features.displacement import Displacement
from perdure.features.dominant import DominantColours
from perdure.features.embedding import Embedding, Network
from perdure.features.feature import Feature, Float
from perdure.features.ground_displacement import GroundDisplacement
from perdure.features.histogram import ColourHistogram
from perdure.features.hog import HogPoints
from perdure.features.overlap import Overlap
from perdure.features.shape_ratio import ShapeRatio
from perdure.params import unknown_name
from perdure.types import Scene

POOL: Mapping[str, Callable[[Scene], Feature]] = {  # in the paper's order, k = 1 … 8; then ours
    "displacement_3d": lambda scene: GroundDisplacement(scene.ground),
    "displacement_2d": lambda scene: Displacement(),
    "shape_ratio": lambda scene: ShapeRatio(),
    "area": lambda scene: Area(),
    "histogram": lambda scene: ColourHistogram(),
    "hog": lambda scene: HogPoints(),
    "covariance": lambda scene: ColourCovariance(),
    "dominant": lambda scene: DominantColours(),
    "overlap": lambda scene: Overlap(),
}
PAPER = tuple(POOL)[:8]
EMBEDDING = "embedding"  # the ninth, there where a network is named


def made(names: Iterable[str], scene: Scene, network: Network | None = None) -> dict[str, Feature]:
    """Return the named features for a scene, in the pool's order; 'embedding' needs a network.

    Raises
    ------
    ParameterError
        For a name that is not in the pool, and for an embedding without a network.
    """
    wanted = set(names)
    for name in sorted(wanted - {*POOL, EMBEDDING}):
        raise ParameterError(unknown_name("feature", name, [*POOL, EMBEDDING]))
    found = {name: make(scene) for name, make in POOL.items() if name in wanted}
    if EMBEDDING in wanted:
        if network is None:
            raise ParameterError(
                "the feature 'embedding' needs a network; name an ONNX file of one, or leave it out"
            )
        found[EMBEDDING] = Embedding(network)
    return found


def known(rows: Float) -> NDArray[np.bool_]:
    """Return of which rows (N, ...) of a feature something is known (N,): those that are not all zeros."""
    return np.asarray(rows.any(axis=tuple(range(1, rows.ndim))))

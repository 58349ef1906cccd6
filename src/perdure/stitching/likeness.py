"""How alike identities of two parts are: by their places and sizes, and by their looks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Feature
from perdure.features.pool import made
from perdure.looks import telling
from perdure.maths.discriminant import log_odds
from perdure.stitching.parts import Part
from perdure.trackers.multifeature.links import weighted
from perdure.trackers.multifeature.recalling import alike
from perdure.trackers.multifeature.targets import NEVER
from perdure.trackers.multifeature.weights import DEFAULT, GATE
from perdure.types import Boxes, Frame, Regions, Scene

LEAST = DEFAULT.similar  # global similarity from which two may be one (Th1)
_PLACES = (
    "displacement_2d",
    "shape_ratio",
    "area",
    "overlap",
)  # of the pool: what two rows tell without a picture
_POSITION = 10.0  # nats that places tell at most


def nats(similar: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return how much a global similarity of places tells, as log odds: 0 at Th1, 10 where all is alike."""
    return np.asarray(_POSITION * (np.asarray(similar, np.float64) - LEAST) / (1 - LEAST))


def similarity(one: Boxes, other: Boxes, elapsed: float, scene: Scene) -> NDArray[np.float32]:
    """Return the global similarity (A, B) of boxes, `elapsed` seconds apart, by their places and sizes (eq. 10, eq. 16).

    It is 0 for those that are too far apart.
    """
    rows, columns = (part.ravel() for part in np.indices((len(one), len(other))))
    here, there = Regions.of(boxes=one), Regions.of(boxes=other)
    blank, between = Frame(0, 0.0), np.full(len(rows), elapsed)
    values = {}
    for name, feature in made(_PLACES, scene).items():
        mine, theirs = (feature.describe({}, blank, some)[1] for some in (here, there))
        values[name] = feature.similarity(mine[rows], theirs[columns], between)
    known = dict.fromkeys(values, np.ones(len(rows), np.bool_))
    score = np.where(values[GATE] > 0, weighted(values, known, DEFAULT.weights), 0.0)
    return np.asarray(score.reshape(len(one), len(other)), np.float32)


class Likeness:
    """How likely looks of identities of two parts are of one, as far as anything is known of them."""

    def __init__(self, kinds: Sequence[Feature], parts: Sequence[Part]) -> None:
        self._kinds, self._parts = kinds, parts
        self._telling = telling(kinds, [part.looks for part in parts])

    def odds(self, one: tuple[int, Sequence[int]], other: tuple[int, Sequence[int]]) -> NDArray[np.float64]:
        """Return the log odds (P,) that identities of one part are those of another; NaN where a look is missing."""
        found = np.full(len(one[1]), np.nan)
        sides = [self._parts[part].looks.of(ids) for part, ids in (one, other)]
        if not len(found) or not self._kinds or not all(rows for _, rows in sides):
            return found
        there, here = (times > NEVER for times, _ in sides)
        some = np.flatnonzero(there.any(axis=1) & here.any(axis=1))
        mine, theirs = ({name: rows[some] for name, rows in side.items()} for _, side in sides)
        numbers = alike(self._kinds, mine, there[some], theirs, here[some]).astype(np.float64)
        if len(some):
            found[some] = log_odds(self._telling.same, self._telling.other, numbers)
        return found

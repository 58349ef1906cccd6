"""How large a whole thing is at each place of the picture, learnt from those seen alone: one body, or several?"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import sizes
from perdure.maths.normal import NormalLine, expect, observe
from perdure.types import Boxes

_KNOWN = 4.0  # s of observation, from which the sizes are trusted
_ALIKE = 0.2  # relative deviation, above which things are too unlike for a rule
_FLOOR = 0.12  # relative deviation that is allowed in any case
_STIFF = 2000.0  # px² s: rows must differ by more than its root for sizes to depend on them
_STRANGE = 16.0  # squared deviations, more than which mean nothing


@dataclass(frozen=True, eq=False)
class Bodies:
    """Width and height along the row in which things stand (perspective: both grow in proportion)."""

    line: NormalLine

    @staticmethod
    def unknown() -> Bodies:
        """Return what is known before anything was seen."""
        return Bodies(NormalLine.unknown(2))

    @property
    def known(self) -> bool:
        """Whether things here are alike enough, and enough of them were seen."""
        if self.line.weight < _KNOWN:
            return False
        _, deviation = expect(self.line, [0.0], _STIFF)
        mean = self.line.y / self.line.weight
        return bool((deviation <= _ALIKE * mean).any())

    def expected(self, foot: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return expected width and height (N, 2) of things whose lower edge is at `foot` (N,), and deviations (N, 2)."""
        mean, deviation = expect(self.line, foot, _STIFF)
        middle = self.line.y / max(self.line.weight, 1e-6)
        mean = np.maximum(mean, 0.2 * middle)
        relative = np.maximum(deviation / np.maximum(middle, 1e-6), _FLOOR)
        return mean, mean * relative

    def strangeness(self, boxes: Boxes) -> NDArray[np.float64]:
        """Return how unlike one body (N,) boxes (N, 4) are: mean squared deviations, bounded."""
        mean, deviation = self.expected(boxes[:, 3])
        off = np.minimum(((sizes(boxes) - mean) / deviation) ** 2, _STRANGE)
        return np.asarray(off.mean(axis=1), np.float64)


def learnt(bodies: Bodies, boxes: Boxes, seconds: float, memory: float) -> Bodies:
    """Return what is known after bodies seen alone at boxes (N, 4) for a while."""
    keep = float(np.exp(-seconds * len(boxes) / memory))
    return replace(
        bodies,
        line=observe(
            bodies.line, boxes[:, 3], sizes(boxes), np.full(len(boxes), seconds), keep=keep, stiffness=_STIFF
        ),
    )

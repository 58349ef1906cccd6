"""What interpretation tells a tracker (IV.D, the feedback): whom not to lose, and whom not to wait for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class Advice:
    """How many times as long targets are kept when they are not seen.

    Parameters
    ----------
    ids : (A,) int64
    times : (A,) float64
        ≥ 0: above 1 for who does something of interest, 0 for who is taken for noise.
    """

    ids: NDArray[np.int64]
    times: NDArray[np.float64]

    @staticmethod
    def none() -> Advice:
        """Return the advice to go on as ever."""
        return Advice(np.zeros(0, np.int64), np.zeros(0))

    def of(self, ids: ArrayLike) -> NDArray[np.float64]:
        """Return how many times as long (N,) targets of these ids (N,) are kept: 1 for who is not spoken of."""
        wanted = np.asarray(ids, np.int64)
        found = np.ones(wanted.shape)
        if len(self.ids) and wanted.size:
            order = np.argsort(self.ids, kind="stable")
            place = np.minimum(np.searchsorted(self.ids[order], wanted), len(order) - 1)
            known = self.ids[order][place] == wanted
            found[known] = self.times[order][place][known]
        return found

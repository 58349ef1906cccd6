"""What everything that is done to an object goes by: the parameters, and when an object counts as seen."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from perdure.maths import lie
from perdure.trackers.contour.observer import Float
from perdure.trackers.contour.targets import Target

HIDDEN = 0.15  # share of a silhouette that is seen, below which nothing is
TELLING = 0.35  # share seen from which flow tells how the whole moves
WHOLE = 0.9  # below which it is only shifted: no turn or growth is believed
RESTLESS = 0.12  # share of an outline that is another in every frame, from which it is
AGO = 8  # frames ago, with which what is seen is compared
_WIDER = 3.0  # by which the search grows in a second


class Rules(NamedTuple):
    """The parameters of the tracker, as the functions of its steps ask for them."""

    automatic: bool  # whether gains go by the share that is seen
    group: lie.Group
    motion: Callable[[Float], Float]
    own_motion: bool  # whether the motion model is the user's
    degree: int  # of the polynomial of the motion model
    window: int
    iterations: int
    reach: int
    giving: float
    search: float
    curvature: float
    components: int
    trust: float
    place: float
    bound: float
    ring: float
    cells: int
    smallest: float
    flow: bool

    def searched(self, target: Target) -> float:
        """Return how far an object is looked for, pixels: the farther, the longer it has not been seen."""
        return self.search * (1 + _WIDER * target.missed)

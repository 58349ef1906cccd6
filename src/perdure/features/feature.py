"""What a feature is: a number of each seen thing, and how alike two of them are in it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from perdure.types import Frame, Regions, Scene

Float = NDArray[np.float32]
Memory = Mapping[str, NDArray[Any]]
"""What a feature carries from frame to frame: arrays by name, so that it can be saved."""


class Feature(Protocol):
    """One way to compare two seen things: a frozen dataclass of its parameters, with a fold over the frames.

    A row of zeros means that nothing is known of a region in this respect: nothing was seen of it, or the place is not
    measured. A comparison with it says nothing, and its weight does not count (`perdure.features.pool.known`).
    """

    @property
    def name(self) -> str:
        """The name by which weights, contexts and explanations call it."""

    @property
    def needs_pixels(self) -> bool:
        """Whether nothing can be said of frames without a picture."""

    @property
    def moves(self) -> bool:
        """Whether rows are of where a thing is: they are carried on along a trajectory before they are compared."""

    @property
    def varies(self) -> bool:
        """Whether its long-term similarity is of its own (eq. 15) rather than that of the link."""

    def start(self, scene: Scene) -> Memory:
        """Return what is carried along before the first frame; most features carry nothing."""

    def describe(self, memory: Memory, frame: Frame, regions: Regions) -> tuple[Memory, Float]:
        """Return what is carried on, and a row (N, ...) for each region; zeros where nothing is known."""

    def similarity(self, one: Float, other: Float, elapsed: NDArray[np.floating]) -> Float:
        """Return how alike (P,) in [0, 1] rows (P, ...) of earlier things and rows (P, ...) of later ones are.

        `elapsed` (P,) is the time between the two, in seconds, above 0.
        """

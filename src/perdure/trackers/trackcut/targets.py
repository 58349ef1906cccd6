"""Targets: what is believed of each object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.maths.mixture import Mixture
from perdure.scene.whereabouts import NOWHERE, Whereabouts
from perdure.types import Mask

RECENT = 15  # frames whose motions are remembered: longer than a stride
LATEST = 5  # of them, that tell where an object goes of which only flow is known (eq. 16)


@dataclass(frozen=True, eq=False)
class Shape:
    """A remembered silhouette: how surely each pixel of a crop is the object's, were nothing before it."""

    y: float  # of the crop's first row, pixels
    x: float
    belief: NDArray[np.float32]  # (h, w) in [0, 1]

    @property
    def box(self) -> tuple[float, float, float, float]:
        """x1, y1, x2, y2 of the pixels that are believed rather than not."""
        rows, columns = np.nonzero(self.belief > 0.5)
        if not len(rows):
            return self.x, self.y, self.x + self.belief.shape[1], self.y + self.belief.shape[0]
        return (
            self.x + float(columns.min()),
            self.y + float(rows.min()),
            self.x + float(columns.max()) + 1,
            self.y + float(rows.max()) + 1,
        )

    @property
    def area(self) -> float:
        """Pixels."""
        return float((self.belief > 0.5).sum())

    def to_mask(self) -> Mask:
        """Return the silhouette."""
        return Mask.of_image(self.belief > 0.5, round(self.y), round(self.x))


@dataclass(frozen=True, eq=False)
class Colours:
    """What an object and its surroundings look like (eq. 6): mixtures of colours."""

    own: Mixture
    other: Mixture


@dataclass(frozen=True, eq=False)
class Target:
    """One object."""

    key: int  # never used twice
    id: int  # what it is called; 0 until confirmed
    mask: Mask  # pixels seen when it was last seen: O at t-1
    shape: Shape  # the whole of it, as remembered
    first: Colours  # when it came in
    last: Colours  # when it was last seen whole
    motions: NDArray[np.float64]  # (RECENT, 2) px a frame, beyond the camera's, the newest last (eq. 2)
    mean: float  # of its size, pixels (§3.3)
    variance: float
    seen_frames: int
    born: float  # s
    missed: float  # s for which nothing of it was seen
    missing: float  # s of them for which nothing that is seen was before it
    partly: bool  # whether it is thought to be partially occluded
    small: float  # s for which it has been
    together: bool  # whether others touch it or share an observation with it
    score: float
    class_: str
    links: tuple[int, ...]  # observations that were matched with it in this frame
    unseen: int  # frames for which nothing of it was seen
    doubted: float  # s for which no observation was its own, though there were others
    company: tuple[int, ...]  # keys of those it has been together with, and may be mistaken for
    alone: int  # frames for which it has been seen by itself since
    pieces: float  # frames for which it has held several regions
    squeezed: int  # frames for which it has had a small share of what is another's silhouette
    marked: bool  # whether the user marked it, so that its first looks are surely its own
    last_seen: Whereabouts = NOWHERE

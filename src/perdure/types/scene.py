"""What is known of the place before the first frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from perdure.types.arrays import Bits, frozen


@dataclass(frozen=True, eq=False)
class Scene:
    """What is known of the place before the first frame.

    Parameters
    ----------
    width, height : int
        Pixels.
    fps : float
        Nominal frames per second; times come with the frames.
    zones : tuple of Zone
        Polygons with a kind and a name (`perdure.scene.zones`).
    ground : perdure.scene.ground.Ground or None
        The ground plane, where it is known.
    roi : (H, W) bool array or None
        True where something may be seen; None for everywhere.
    rules : tuple of Rule
        Who is lost in which zone may be found again in which (`perdure.scene.zones`).
    """

    width: int
    height: int
    fps: float = 25.0
    zones: tuple[Any, ...] = ()
    ground: Any = None
    roi: Bits | None = None
    rules: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        if self.roi is not None:
            if self.roi.shape != (self.height, self.width):
                raise ValueError(
                    f"the roi is {self.roi.shape[1]}x{self.roi.shape[0]}, the scene {self.width}x{self.height}"
                )
            object.__setattr__(self, "roi", frozen(np.asarray(self.roi, np.bool_)))

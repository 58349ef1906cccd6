"""What is measured of the shape y(t) in a frame: how much is lost where a pixel is inside the contour, or outside it.

Every measurement is a field `pull` = f_in - f_out in [-1, 1], below 0 where a pixel looks like the object, so that gains
have no unit. For binary shapes f_in = 1 - χ and f_out = χ, and the energy (3) is the area between the two shapes; signed
distances and colours lie in between.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.errors import ParameterError

Float = NDArray[np.float64]
Bits = NDArray[np.bool_]
Single = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Measured:
    """What one frame says of a shape, in cells of `step` x `step` pixels."""

    x: int  # of the first cell's first pixel
    y: int
    step: int
    pull: Single  # (h, w) f_in - f_out
    wide: Single  # (h, w) its mean over the reach: how far away the edge is

    def to_cells(self) -> Float:
        """Return the motion (3, 3) from pixels of the picture to columns and rows of cells."""
        half = (self.step - 1) / 2
        return np.array(
            [
                [1 / self.step, 0.0, -(self.x + half) / self.step],
                [0.0, 1 / self.step, -(self.y + half) / self.step],
                [0.0, 0.0, 1.0],
            ]
        )

    def loss_inside(self) -> Float:
        """Return f_in (h, w)."""
        return (1 + self.pull.astype(np.float64)) / 2

    def loss_outside(self) -> Float:
        """Return f_out (h, w)."""
        return (1 - self.pull.astype(np.float64)) / 2


def measured(pull: NDArray[np.floating], reach: int, x: int = 0, y: int = 0, step: int = 1) -> Measured:
    """Return a measurement of f_in - f_out (h, w), which is kept within [-1, 1].

    Parameters
    ----------
    pull : (h, w) float
        Finite.
    reach : int
        ≥ 0, cells to each side over which an edge is looked for.
    x, y, step : int
        Where the cells are in the picture, and how large.
    """
    kept = np.asarray(np.clip(pull, -1, 1), np.float32)
    side = 2 * reach + 1
    wide = cv2.blur(kept, (side, side), borderType=cv2.BORDER_REPLICATE) if reach else kept
    return Measured(x, y, step, kept, np.asarray(wide, np.float32))


def of_shape(shape: Bits, reach: int = 6) -> Measured:
    """Return the measurement of a binary shape (H, W) bool: f_in = 1 - χ, f_out = χ."""
    if shape.ndim != 2 or shape.dtype != np.bool_:
        raise ParameterError(f"the shape is {shape.dtype} of {shape.shape}; it must be bool (H, W)")
    return measured(1.0 - 2.0 * shape, reach)


def of_distance(distance: NDArray[np.floating], reach: int = 6) -> Measured:
    """Return the measurement of a signed-distance score (H, W), below 0 inside: it counts in full from `reach` on."""
    if distance.ndim != 2 or not np.isfinite(distance).all():
        raise ParameterError(f"the distances have the shape {distance.shape}; they must be (H, W) and finite")
    kept = np.asarray(np.clip(distance / max(reach, 1), -1, 1), np.float32)
    return Measured(0, 0, 1, kept, kept)


def of_evidence(
    evidence: NDArray[np.floating], known: Bits, reach: int, x: int = 0, y: int = 0, step: int = 1
) -> Measured:
    """Return the measurement of ln p_in / p_out (h, w): f_in = -ln p_in and f_out = -ln p_out, squashed by tanh.

    So f_out - f_in = tanh(ln(p_in / p_out) / 2) = p(in) - p(out). Where nothing is known (h, w) it is 0.
    """
    pull = np.where(known, -np.tanh(np.asarray(evidence, np.float32) / 2), np.float32(0))
    return measured(pull, reach, x, y, step)

"""A lens: what it bends, and straightened pixels (Brown's model: three radial terms, two tangential ones).

    x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)
    y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y        r² = x² + y²

with x, y on the plane at distance 1. Where the model folds back on itself no pixel has a direction: NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
_STEPS = 15
_EXACT = 1e-9  # of the focal length, to which a pixel is straightened


@dataclass(frozen=True, eq=False)
class Lens:
    """A focal length, a centre and five coefficients."""

    focal: Float  # (2,) px, along x and y
    centre: Float  # (2,) px
    bend: Float  # (5,) k1, k2, p1, p2, k3

    @property
    def matrix(self) -> Float:
        """The camera's matrix (3, 3)."""
        (fx, fy), (cx, cy) = self.focal, self.centre
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])

    @property
    def straight(self) -> bool:
        """Whether it bends nothing."""
        return not self.bend.any()

    def bent(self, points: Float) -> Float:
        """Return the pixels (N, 2) where straight pixels (N, 2) are seen; NaN beyond the fold."""
        if self.straight:
            return points
        flat = np.clip((points - self.centre) / self.focal, -_FARTHEST, _FARTHEST)
        return np.where(self._unfolded(flat)[:, None], self._bent(flat) * self.focal + self.centre, np.nan)

    def straightened(self, points: Float) -> Float:
        """Return the pixels (N, 2) where points (N, 2) would be without the bending; NaN where there is none."""
        if self.straight or not len(points):
            return points
        seen = (points - self.centre) / self.focal
        flat = seen.copy()
        with np.errstate(all="ignore"):
            for _ in range(_STEPS):
                slopes, off = self._slopes(flat), self._bent(flat) - seen
                back = np.stack([_cross(off, slopes[..., 1]), _cross(slopes[..., 0], off)], axis=-1)
                flat = flat - back / _cross(slopes[..., 0], slopes[..., 1])[:, None]  # Cramer's rule
                flat = np.clip(np.nan_to_num(flat), -_FARTHEST, _FARTHEST)
            there = (np.abs(self._bent(flat) - seen) < _EXACT).all(axis=1) & self._unfolded(flat)
        return np.where(there[:, None], flat * self.focal + self.centre, np.nan)

    def slopes(self, points: Float) -> Float:
        """Return how straight pixels move with bent ones, (N, 2, 2), at straight pixels (N, 2)."""
        if self.straight:
            return np.broadcast_to(np.eye(2), (len(points), 2, 2))
        bent = self._slopes(np.nan_to_num((points - self.centre) / self.focal))
        scale = self.focal[:, None] / self.focal
        return np.asarray(np.linalg.inv(bent * scale), np.float64)

    def _bent(self, flat: Float) -> Float:
        k1, k2, p1, p2, k3 = self.bend
        x, y = flat.T
        square = x**2 + y**2
        radial = 1 + square * (k1 + square * (k2 + square * k3))
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (square + 2 * x**2),
                y * radial + p1 * (square + 2 * y**2) + 2 * p2 * x * y,
            ],
            axis=1,
        )

    def _slopes(self, flat: Float) -> Float:
        """The derivative (N, 2, 2) of `_bent`."""
        k1, k2, p1, p2, k3 = self.bend
        x, y = flat.T
        square = x**2 + y**2
        radial = 1 + square * (k1 + square * (k2 + square * k3))
        growth = 2 * (k1 + square * (2 * k2 + 3 * square * k3))
        cross = x * y * growth + 2 * p1 * x + 2 * p2 * y
        across = radial + x**2 * growth + 2 * p1 * y + 6 * p2 * x
        down = radial + y**2 * growth + 6 * p1 * y + 2 * p2 * x
        return np.stack([np.stack([across, cross], axis=-1), np.stack([cross, down], axis=-1)], axis=-2)

    def _unfolded(self, flat: Float) -> NDArray[np.bool_]:
        """Which directions (N,) lie where further out is seen further out, all the way from the centre."""
        on_the_way = flat[:, None] * np.linspace(0.05, 1.0, 20)[:, None]  # (N, 20, 2)
        slopes = self._slopes(on_the_way.reshape(-1, 2))  # (20 N, 2, 2)
        with np.errstate(invalid="ignore"):
            upright = (_cross(slopes[..., 0], slopes[..., 1]) > 0) & (slopes[:, 0, 0] > 0)
        return np.asarray(upright.reshape(-1, 20).all(axis=1), np.bool_)


def _cross(one: Float, other: Float) -> Float:
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0], np.float64)


_FARTHEST = 20.0  # focal lengths from the centre

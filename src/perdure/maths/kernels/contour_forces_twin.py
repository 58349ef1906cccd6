"""The twin of `contour_forces` in NumPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths import levelset, lie

Float = NDArray[np.float64]
Single = NDArray[np.float32]


def forces(
    edges: Float,
    pose: Float,
    field: Single,
    to_field: Float,
    less: Float,
    most: float,
    slope: Float,
    seen: Float,
    every: Float,
) -> None:
    """See `contour_forces.forces`."""
    middles, way = (edges[:, :2] + edges[:, 2:]) / 2, edges[:, 2:] - edges[:, :2]  # (M, 2)
    linear = pose[:2, :2]
    away, tangent = middles @ linear.T, way @ linear.T
    normals = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    lengths = np.hypot(*normals.T)
    some = lengths > 0
    away, normals, lengths = away[some], normals[some], lengths[some]
    values = levelset.sample(field, lie.act(to_field, away + pose[:2, 2])) - less[some]
    motions = (normals[:, None] @ lie.AFFINE.jacobian(away))[:, 0, : len(slope)]  # (M, D)
    heard = np.abs(values) <= most
    slope[:] = values[heard] @ motions[heard]
    every[:] = motions.T @ (motions / lengths[:, None])
    seen[:] = motions[heard].T @ (motions[heard] / lengths[heard, None])

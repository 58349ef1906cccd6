"""How a contour that is moved as a whole is pushed: sums over its edges. The twin is in `contour_forces_twin`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for, part
from perdure.maths.kernels.narrow_band import value_at

Float = NDArray[np.float64]
Single = NDArray[np.float32]


@kernel_for(
    given(np.float64, 2, "C"),
    given(np.float64, 2, "C"),
    given(np.float32, 2, "C"),
    given(np.float64, 2, "C"),
    given(np.float64),
    float,
    changed(np.float64),
    changed(np.float64, 2),
    changed(np.float64, 2),
)
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
    """Add up, over the edges of a contour, (field - less) · ⟨J, n⟩ and ⟨J, n⟩ ⟨J, n⟩ᵀ, J being the motion of a point.

    Parameters
    ----------
    edges : (M, 4) float64
        x, y, x, y of begin and end; the inside lies to the right of the way, as seen with y downwards.
    pose : (3, 3) float64
        Takes them into the picture. Motions turn about where it takes (0, 0).
    field : (H, W) float32
        What is summed at the middle of each edge.
    to_field : (3, 3) float64
        From the picture to the field's columns and rows; beyond the field, its border counts.
    less : (M,) float64
        What is taken off it there.
    most : float
        Edges where |field - less| is more count in `every` alone.
    slope : (D,) float64, changed
        D is 3, 4 or 6: x, y, angle, growth, stretch, shear, as in `perdure.maths.lie`. Set, as what follows.
    seen, every : (D, D) float64, changed
        Second moments of what an edge's normal motion is, by length.
    """
    size = len(slope)
    slope[:] = 0.0
    seen[:] = 0.0
    every[:] = 0.0
    for n in range(len(edges)):
        x, y = (edges[n, 0] + edges[n, 2]) / 2, (edges[n, 1] + edges[n, 3]) / 2
        along, down = edges[n, 2] - edges[n, 0], edges[n, 3] - edges[n, 1]
        away_x, away_y = pose[0, 0] * x + pose[0, 1] * y, pose[1, 0] * x + pose[1, 1] * y
        normal_x, normal_y = pose[1, 0] * along + pose[1, 1] * down, -(pose[0, 0] * along + pose[0, 1] * down)
        length = np.sqrt(normal_x * normal_x + normal_y * normal_y)
        if length == 0.0:
            continue
        at_x, at_y = away_x + pose[0, 2], away_y + pose[1, 2]
        value = value_at(
            field,
            to_field[0, 0] * at_x + to_field[0, 1] * at_y + to_field[0, 2],
            to_field[1, 0] * at_x + to_field[1, 1] * at_y + to_field[1, 2],
        )
        value -= less[n]
        heard = abs(value) <= most
        for i in range(size):
            one = _motion(i, normal_x, normal_y, away_x, away_y)
            if heard:
                slope[i] += value * one
            for j in range(size):
                both = one * _motion(j, normal_x, normal_y, away_x, away_y) / length
                every[i, j] += both
                if heard:
                    seen[i, j] += both


@part
def _motion(which: int, normal_x: float, normal_y: float, x: float, y: float) -> float:
    """How fast a point moves along a normal, for one coordinate of the algebra."""
    if which == 0:
        return normal_x
    if which == 1:
        return normal_y
    if which == 2:
        return x * normal_y - y * normal_x
    if which == 3:
        return x * normal_x + y * normal_y
    if which == 4:
        return x * normal_x - y * normal_y
    return y * normal_x + x * normal_y

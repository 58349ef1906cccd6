"""The kernel of forces on a contour, beside its twin."""

from __future__ import annotations

import numpy as np
import pytest

from perdure.maths.kernels import contour_forces, contour_forces_twin


@pytest.mark.parametrize("size", [3, 4, 6])
def test_the_kernel_of_forces_and_its_twin_agree(size: int):
    rng = np.random.default_rng(size)
    edges = rng.normal(0, 12, (60, 4))
    edges[7, 2:] = edges[7, :2]  # a point
    pose = np.array([[1.1, 0.2, 30.0], [-0.1, 0.9, 25.0], [0, 0, 1]])
    to_field = np.array([[0.5, 0, -2.0], [0, 0.5, -1.0], [0, 0, 1]])
    field, less = rng.uniform(-1, 1, (30, 40)).astype(np.float32), rng.uniform(-0.3, 0.3, 60)
    sums = []
    for one in (contour_forces, contour_forces_twin):
        slope, seen, every = np.empty(size), np.empty((size, size)), np.empty((size, size))
        one.forces(edges, pose, field, to_field, less, 0.7, slope, seen, every)
        sums.append((slope, seen, every))
    for found, expected in zip(*sums, strict=True):
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)

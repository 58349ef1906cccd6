"""The contour that is said of an object lies between pixels."""

from __future__ import annotations

import numpy as np
import pytest

from perdure.maths import lie
from perdure.trackers.contour import measuring, observer
from perdure.trackers.contour.saying import outline_of
from perdure.types import PER_PIXEL, Outline


def centre_and_radius(outline: Outline) -> tuple[float, float, float]:
    (ring,) = outline.rings
    x, y = ring.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    area = cross.sum() / 2
    middle = [((one + np.roll(one, -1)) * cross).sum() / (6 * area) for one in (x, y)]
    return middle[0], middle[1], float(np.sqrt(area / np.pi))


@pytest.mark.parametrize("group", ["se2", "similarity", "affine"])
@pytest.mark.parametrize("radius", [9.4, 20.75])
def test_a_disc_is_said_between_pixels_wherever_it_goes(group, radius):
    x, y = np.meshgrid(np.arange(110) + 0.5, np.arange(90) + 0.5)  # the middles of pixels
    shapes = []
    for frame in range(8):
        middle = 40.3 + 1.37 * frame, 44.6 - 0.45 * frame
        shapes.append((middle, np.hypot(x - middle[0], y - middle[1]) < radius))
    kind = lie.GROUPS[group]
    state = observer.initial(shapes[0][1], 0, 0, kind)
    for middle, shape in shapes[1:]:
        state = observer.updated(
            state,
            measuring.of_shape(shape),
            observer.Gains(shape=0.6, motion=0.6),
            kind,
            window=4,
            steps=10,
            motion=observer.constant_velocity,
            reach=6,
            curvature=0.02,
        )
        found = centre_and_radius(outline_of(state, kind))
        assert np.abs(np.subtract(found, (*middle, radius))).max() < 0.15
    (ring,) = outline_of(state, kind).rings
    assert (ring * PER_PIXEL == np.rint(ring * PER_PIXEL)).all()
    assert (ring != np.rint(ring)).any()

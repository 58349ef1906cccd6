"""Shadows and halos, in drawn places."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from perdure.detect import Background
from perdure.types import Frame, Scene


def ground(seed: int = 0) -> np.ndarray:
    """A coloured place with a texture of a few grey levels, (120, 160, 3)."""
    rng = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(rng.normal(0, 18, (120, 160)).astype(np.float32), (0, 0), 1.0)
    return np.float32([130, 120, 100]) + texture[..., None]


def picture(image: np.ndarray, seed: int) -> Frame:
    noisy = image + np.random.default_rng(seed).normal(0, 1.5, image.shape)
    return Frame(seed, seed / 10, noisy.clip(0, 255).astype(np.uint8))


def area_of(image: np.ndarray, detector: Background | None = None) -> int:
    """Pixels of all regions in a picture that follows five of the empty place."""
    detector = detector or Background()
    state = detector.start(Scene(160, 120, 10))
    for k in range(5):
        state, _ = detector.step(state, picture(ground(), k))
    _, regions = detector.step(state, picture(image, 5))
    return sum(mask.area for mask in regions.masks)


def shadowed(share: float, softness: float = 0.0) -> np.ndarray:
    shade = np.ones((120, 160), np.float32)
    cv2.ellipse(shade, (80, 60), (40, 15), 0, 0, 360, share, -1)
    if softness:
        shade = cv2.GaussianBlur(shade, (0, 0), softness)
    return ground() * shade[..., None]


@pytest.mark.parametrize("softness", [0.0, 2.0])
@pytest.mark.parametrize("share", [0.5, 0.65, 0.85])
def test_cast_shadows_deep_and_faint_hard_and_soft_are_next_to_nothing(share, softness):
    assert area_of(shadowed(share, softness)) < 20
    assert area_of(shadowed(share, softness), Background(darkest_shadow=1.0)) > 1000


def test_a_dark_thing_of_the_grounds_colour_with_a_texture_of_its_own_is_a_region():
    image = ground()
    relief = cv2.GaussianBlur(np.random.default_rng(9).normal(0, 40, (50, 40)), (0, 0), 1.0)[..., None]
    image[40:90, 60:100] = np.float32([130, 120, 100]) * (0.6 + relief / 130)
    assert area_of(image) > 0.9 * 50 * 40


def test_a_thing_on_its_own_shadow_is_seen_and_the_shadow_is_not():
    image = shadowed(0.6)
    image[20:60, 70:90] = (220, 60, 60)
    assert abs(area_of(image) - 40 * 20) < 0.12 * 40 * 20


def test_a_border_drawn_out_by_the_lens_is_not_part_of_the_thing():
    sharp = ground()
    sharp[30:90, 60:100] = (230, 40, 40)
    share = np.zeros((120, 160), np.float32)
    share[30:90, 60:100] = 1
    share = cv2.sepFilter2D(share, -1, np.float32([0.25, 0.5, 0.25]), np.float32([0.25, 0.5, 0.25]))[..., None]
    drawn_out = ground() * (1 - share) + np.float32([230, 40, 40]) * share
    assert abs(area_of(drawn_out) - area_of(sharp)) <= 0.02 * 60 * 40


def test_a_hole_that_is_small_for_its_thing_is_filled_and_a_large_one_stays_open():
    def ring(side: int) -> np.ndarray:
        image = ground()
        image[20:100, 40:120] = (230, 40, 40)
        place = np.s_[60 - side // 2 : 60 + side // 2, 80 - side // 2 : 80 + side // 2]
        image[place] = ground()[place]
        return image

    assert area_of(ring(12)) > 0.98 * 80 * 80
    assert area_of(ring(40)) < 0.85 * 80 * 80


def test_what_hardly_differs_from_the_ground_is_kept_where_the_thing_encloses_it():
    image = ground()
    image[20:100, 60:110] = (230, 40, 40)
    image[40:80, 60:72] = ground()[40:80, 60:72] + 10  # a pale sleeve, its outer border free
    image[40:80, 80:95] = ground()[40:80, 80:95] + 10  # a pale bag before the body
    assert area_of(image) > 0.9 * (80 * 50 - 40 * 12)

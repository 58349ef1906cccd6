"""Ghosts are told from things by whose edges are where the region ends."""

from __future__ import annotations

import numpy as np
import pytest

from perdure.detect.ghosts import ghosts
from perdure.types import Mask, Regions

RNG = np.random.default_rng(5)
PLAIN = np.full((60, 80, 3), 90, np.uint8)
TEXTURED = np.kron(RNG.integers(60, 120, (15, 20, 3)), np.ones((4, 4, 1))).astype(np.uint8)


def with_thing(ground: np.ndarray, x: int = 30, y: int = 20) -> np.ndarray:
    picture = ground.copy()
    picture[y : y + 20, x : x + 12] = (200, 40, 40)
    return picture


def region(x: int = 30, y: int = 20) -> Regions:
    mask = Mask(y, x, np.ones((20, 12), bool))
    return Regions.of([mask.box], masks=[mask])


@pytest.mark.parametrize("ground", [PLAIN, TEXTURED], ids=["plain", "textured"])
def test_what_is_gone_is_a_ghost_and_what_is_there_is_none(ground: np.ndarray):
    there, empty = with_thing(ground), ground.astype(np.float32)
    assert ghosts(region(), there, empty).tolist() == [False]
    assert ghosts(region(), ground, there.astype(np.float32)).tolist() == [True]


def test_a_thing_of_the_floors_brightness_has_edges_in_its_colour():
    assert with_thing(PLAIN).mean(axis=2).std() < 1.0
    assert ghosts(region(), PLAIN, with_thing(PLAIN).astype(np.float32)).tolist() == [True]


def test_a_thing_that_moved_a_little_is_there():
    known = with_thing(PLAIN, x=33).astype(np.float32)  # it stood there when the model learnt
    assert ghosts(region(), with_thing(PLAIN), known).tolist() == [False]


def test_at_the_rim_of_the_picture_and_without_regions_it_is_told_too():
    assert ghosts(region(0, 0), PLAIN, with_thing(PLAIN, 0, 0).astype(np.float32)).tolist() == [True]
    assert ghosts(region(68, 40), PLAIN, with_thing(PLAIN, 68, 40).astype(np.float32)).tolist() == [True]
    assert ghosts(Regions.empty(), PLAIN, PLAIN.astype(np.float32)).tolist() == []


def test_a_picture_without_any_edge_has_no_ghost():
    assert ghosts(region(), PLAIN, PLAIN.astype(np.float32)).tolist() == [False]

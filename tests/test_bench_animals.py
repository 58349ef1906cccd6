"""bench/animals.py on a drawn dish."""

from __future__ import annotations

import animals
import cv2
import numpy as np

from perdure.files.film import Film


def dish(k: int) -> np.ndarray:
    """One fly sleeps, another walks by; a crumb lies between them."""
    image = np.full((240, 320, 3), 12, np.uint8)
    cv2.ellipse(image, (90, 70), (24, 12), 30, 0, 360, (200, 200, 200), -1)
    cv2.ellipse(image, (40 + 6 * k, 160), (24, 12), 0, 0, 360, (200, 200, 200), -1)
    cv2.circle(image, (200, 60), 5, (200, 200, 200), -1)
    return image


def test_what_is_bright_and_large_enough_is_an_animal():
    film = animals.Film("dish.mp4", 2, True, 40, 400)
    found = film.regions(dish(10))
    assert sorted(mask.area > 800 for mask in found.masks) == [True, True]
    assert len(animals.Film("dish.mp4", 2, False, 5, 400).regions(dish(10))) == 0


def test_a_fly_that_sleeps_is_there_by_its_grey_level_only(tmp_path, monkeypatch):
    with Film(tmp_path / "dish.mp4", 320, 240, fps=25) as written:
        for k in range(30):
            written.write(dish(k), k / 25)
    monkeypatch.setitem(animals.FILMS, "dish", animals.Film("dish.mp4", 2, True, 100, 400))
    grey, background = (animals.measure(tmp_path, "dish", way, "compound") for way in ("grey", "background"))
    assert (grey.ids, grey.all_there) == (2, 1.0)
    assert (background.ids, background.all_there) == (1, 0.0)
    assert animals.table([grey]).rows == [["dish", "grey", "compound", "2", "2", "100 %", "–", "–", "–"]]

"""Regions of what the user marked, in drawn pictures."""

from __future__ import annotations

import threading

import cv2
import numpy as np
import pytest

from perdure.detect import Mark, Marked
from perdure.detect.silhouette import silhouette
from perdure.features.masks import mask_overlaps
from perdure.types import Frame, Mask, Scene

SCENE = Scene(160, 120, 10)


def disc(x: int, y: int, radius: int) -> np.ndarray:
    rows, columns = np.mgrid[:120, :160]
    return (columns - x) ** 2 + (rows - y) ** 2 <= radius**2


def place(*things: tuple[np.ndarray, tuple[int, int, int]]) -> np.ndarray:
    """Grass with things of a colour on it, noise over all."""
    rng = np.random.default_rng(0)
    image = np.tile(np.float32([70, 120, 60]), (120, 160, 1))
    for bits, colour in things:
        image[bits] = colour
    return (image + rng.normal(0, 6, image.shape)).clip(0, 255).astype(np.uint8)


def box(x1: int, y1: int, x2: int, y2: int) -> Mask:
    return Mask(y1, x1, np.ones((y2 - y1, x2 - x1), bool))


def seen(marks, image: np.ndarray | None, scene: Scene = SCENE):
    detector = Marked(marks=tuple(marks))
    return detector.step(detector.start(scene), Frame(0, 0.0, image))[1]


def alike(one: Mask, other: np.ndarray) -> float:
    return float(mask_overlaps([one], [Mask.of_image(other)])[0, 0])


RED = disc(60, 60, 20)


def test_marked_frames_have_regions_and_no_others():
    masks = [Mask.of_image(RED), Mask.of_image(disc(120, 60, 10))]
    detector = Marked(marks=(Mark(2, 5, masks[0]), Mark(2, 3, masks[1]), Mark(4, 5, masks[0])))
    state, found = detector.start(SCENE), []
    for k in range(6):
        state, regions = detector.step(state, Frame(k, k / 10))
        found.append(regions)
    assert [regions.data["mark"].tolist() if len(regions) else [] for regions in found] == [
        [], [], [5, 3], [], [5], [],
    ]  # fmt: skip
    assert found[2].masks == tuple(masks)
    assert found[2].boxes.tolist() == [list(mask.box) for mask in masks]
    assert found[2].scores.tolist() == [1, 1]
    assert found[2].take([1]).data["mark"].tolist() == [3]


def test_the_silhouette_of_a_boxed_thing_is_found_in_the_picture():
    found = seen([Mark(0, 1, box(36, 36, 86, 86), rough=True)], place((RED, (190, 50, 40))))
    assert alike(found.masks[0], RED) > 0.95
    assert found.boxes[0].tolist() == list(found.masks[0].box)


def test_the_silhouette_of_a_large_thing_is_found_in_a_smaller_picture():
    large = cv2.resize(place((RED, (190, 50, 40))), None, fx=8, fy=8, interpolation=cv2.INTER_NEAREST)
    found = silhouette(large, box(300, 300, 700, 700))
    assert alike(found, np.kron(RED, np.ones((8, 8), bool))) > 0.95


@pytest.mark.parametrize("image", [np.full((120, 160, 3), 90, np.uint8), None], ids=["one colour", "no picture"])
def test_where_nothing_tells_the_thing_from_the_ground_it_is_all_of_the_box(image):
    found = seen([Mark(0, 1, box(30, 30, 90, 90), rough=True)], image)
    assert found.masks == (box(30, 30, 90, 90),)


def test_a_long_box_around_nothing_is_all_of_it_and_no_line_through_its_middle():
    plain = np.full((120, 160, 3), 90, np.uint8)
    assert seen([Mark(0, 1, box(10, 30, 150, 50), rough=True)], plain).masks == (box(10, 30, 150, 50),)


def test_a_silhouette_is_believed_as_it_was_drawn():
    traced = Mark(0, 1, Mask.of_image(RED))
    assert seen([traced], place((RED, (190, 50, 40)))).masks == (Mask.of_image(RED),)


def test_a_thing_before_another_keeps_its_pixels():
    body, bag = disc(60, 60, 30), disc(60, 60, 8)
    image = place((body, (190, 50, 40)), (bag, (40, 60, 220)))
    marks = [Mark(0, 1, box(28, 28, 92, 92), rough=True), Mark(0, 2, box(50, 50, 71, 71), rough=True)]
    found = seen(marks, image)
    assert found.data["mark"].tolist() == [1, 2]
    assert alike(found.masks[1], bag) > 0.9
    assert alike(found.masks[0], body & ~bag) > 0.9
    assert not (found.masks[0].to_image(120, 160) & found.masks[1].to_image(120, 160)).any()


def test_what_lies_outside_the_roi_is_cut():
    roi = np.zeros((120, 160), bool)
    roi[:60] = True
    marks = [Mark(0, 1, Mask.of_image(RED)), Mark(0, 2, Mask.of_image(disc(100, 100, 10)))]
    found = seen(marks, place((RED, (190, 50, 40))), Scene(160, 120, 10, roi=roi))
    assert found.data["mark"].tolist() == [1]
    assert found.boxes[0, 3] == 60


def test_the_same_picture_gives_the_same_silhouette_whatever_was_drawn_before_and_in_any_thread():
    image, outline = place((RED, (150, 90, 50))), box(30, 30, 95, 95)
    cv2.setRNGSeed(7)
    draws = cv2.randu(np.zeros((1, 3)), 0, 1).tolist()
    cv2.setRNGSeed(7)
    found = [silhouette(image, outline)]
    assert cv2.randu(np.zeros((1, 3)), 0, 1).tolist() == draws, "somebody else's draws were changed"
    before = cv2.getNumThreads()
    for threads in (1, 2):
        cv2.setNumThreads(threads)
        cv2.setRNGSeed(threads)
        worker = threading.Thread(target=lambda: found.append(silhouette(image, outline)))
        worker.start()
        worker.join()
    cv2.setNumThreads(before)
    assert found == [found[0]] * 3

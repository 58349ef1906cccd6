"""Films of textured things, drawn in the test, for trackers that look at pictures."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

from perdure.fold import settle
from perdure.trackers.trackcut import TrackCut
from perdure.types import Frame, Mask, Regions, Report, Scene, Tracks

HEIGHT, WIDTH = 120, 200
Place = tuple[int, int]


def texture(
    seed: int, colour: tuple[int, int, int], height: int, width: int, contrast: float = 25.0
) -> np.ndarray:
    """A patch (height, width, 3) uint8 with something on it that flow can hold on to."""
    rng = np.random.default_rng(seed)
    rough = cv2.GaussianBlur(rng.normal(0, 1, (height, width)), (0, 0), 1.5)
    rough *= contrast / max(float(rough.std()), 1e-9)
    return np.clip(np.array(colour) + rough[..., None], 0, 255).astype(np.uint8)


GROUND = texture(1, (90, 110, 90), HEIGHT + 80, WIDTH + 200)


class Thing(NamedTuple):
    """An ellipse with a texture; `path(k)` is its middle, or None."""

    path: Callable[[int], Place | None]
    colour: tuple[int, int, int]
    size: tuple[int, int] = (28, 44)  # width, height

    def bits(self, k: int) -> np.ndarray:
        found = np.zeros((HEIGHT, WIDTH), np.uint8)
        middle = self.path(k)
        if middle is not None:
            cv2.ellipse(found, middle, (self.size[0] // 2, self.size[1] // 2), 0, 0, 360, 1, -1)
        return found > 0

    def paint(self, picture: np.ndarray, k: int) -> None:
        middle = self.path(k)
        if middle is None:
            return
        skin = _skin(self.colour)
        moved = np.roll(skin, (middle[1] - HEIGHT // 2, middle[0] - WIDTH // 2), axis=(0, 1))
        picture[self.bits(k)] = moved[self.bits(k)]


@functools.cache
def _skin(colour: tuple[int, int, int]) -> np.ndarray:
    return texture(7 + colour[0], colour, HEIGHT, WIDTH)


def film(*things: Thing, count: int, pan: int = 0, post: tuple[int, int] | None = None) -> list[Frame]:
    """Frames of things, later ones in front, on a ground that moves left by `pan` px a frame; a post before all."""
    frames = []
    for k in range(count):
        picture = GROUND[40 : 40 + HEIGHT, pan * k : pan * k + WIDTH].copy()
        for thing in things:
            thing.paint(picture, k)
        if post:
            picture[:, post[0] : post[1]] = (235, 235, 235)
        frames.append(Frame(k, k / 10, picture))
    return frames


def marked(*things: Thing) -> Regions:
    """What a user marks in the first frame."""
    masks = [Mask.of_image(thing.bits(0)) for thing in things]
    return Regions.of([mask.box for mask in masks], masks=masks, data={"mark": np.arange(1, len(things) + 1)})


def seen(things: tuple[Thing, ...], k: int) -> Regions:
    """What a detector sees: what touches is one region."""
    together = np.zeros((HEIGHT, WIDTH), bool)
    for thing in things:
        together |= thing.bits(k)
    count, parts = cv2.connectedComponents(together.astype(np.uint8))
    masks = [Mask.of_image(parts == part) for part in range(1, count)]
    return Regions.of([mask.box for mask in masks], masks=masks) if masks else Regions.empty()


def followed(
    frames: list[Frame], regions: Callable[[int], Regions], **parameters: float
) -> tuple[Tracks, list[Report]]:
    tracker = TrackCut(**parameters)
    state, reports = tracker.start(Scene(WIDTH, HEIGHT, 10.0)), []
    for frame in frames:
        state, report = tracker.step(state, frame, regions(frame.index))
        reports.append(report)
    reports.append(tracker.finish(state))
    return settle(reports), reports


def only_first(*things: Thing) -> Callable[[int], Regions]:
    return lambda k: marked(*things) if k == 0 else Regions.empty()


def overlap(tracks: Tracks, k: int, identity: int, bits: np.ndarray) -> float:
    """Intersection over union of what is said and what is there."""
    rows = tracks.in_frame(k)
    place = np.flatnonzero(rows.ids == identity)
    said = rows.masks[int(place[0])].to_image(HEIGHT, WIDTH) if len(place) else np.zeros_like(bits)
    return float((said & bits).sum() / max((said | bits).sum(), 1))


def walker(x: int = 40, y: int = 60, step: int = 3, colour: tuple[int, int, int] = (170, 60, 60)) -> Thing:
    return Thing(lambda k: (x + step * k, y), colour)

"""Drawn worlds for tests: coloured blocks on a plain floor, their regions, their truth."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from perdure.detect.components import components
from perdure.scene.zones import Rule, Zone
from perdure.types import Frame, Regions, Scene, Tracks

Path = Callable[[int], "tuple[int, int] | None"]


@dataclass(frozen=True)
class Block:
    """A block of one colour; `path(k)` is its upper left corner (x, y) in frame k, or None."""

    path: Path
    size: tuple[int, int] = (10, 16)  # width, height
    colour: tuple[int, int, int] = (200, 40, 40)


@dataclass(frozen=True)
class World:
    """Blocks on a floor of brightness 90; later blocks are in front."""

    blocks: tuple[Block, ...]
    count: int = 40
    width: int = 120
    height: int = 80
    fps: float = 10.0
    zones: tuple[Zone, ...] = ()
    rules: tuple[Rule, ...] = ()

    @property
    def scene(self) -> Scene:
        return Scene(self.width, self.height, self.fps, zones=self.zones, rules=self.rules)

    def frames(self) -> list[Frame]:
        return [Frame(k, k / self.fps, self._picture(k)) for k in range(self.count)]

    def seen(self) -> list[tuple[Frame, Regions]]:
        """The frames with what a perfect background subtraction sees: blocks that touch are one region."""
        return list(_seen(self))

    def truth(self) -> Tracks:
        rows = [
            (k, number, self._box(block, k))
            for k in range(self.count)
            for number, block in enumerate(self.blocks, 1)
            if block.path(k) is not None
        ]
        frames = np.array([k for k, _, _ in rows], int)
        return Tracks.of(
            frames=frames,
            times=frames / self.fps,
            ids=[number for _, number, _ in rows],
            boxes=np.array([box for _, _, box in rows], np.float32),
        )

    def _box(self, block: Block, k: int) -> tuple[int, int, int, int]:
        x, y = block.path(k)
        return x, y, x + block.size[0], y + block.size[1]

    def _picture(self, k: int) -> np.ndarray:
        picture = np.full((self.height, self.width, 3), 90, np.uint8)
        for block in self.blocks:
            if block.path(k) is not None:
                x1, y1, x2, y2 = (max(0, side) for side in self._box(block, k))
                picture[y1:y2, x1:x2] = block.colour
        return picture


@functools.lru_cache(maxsize=8)
def _seen(world: World) -> tuple[tuple[Frame, Regions], ...]:
    """Frames and regions are never changed (a law of its own), so that several tests may have them."""
    return tuple(
        (frame, components(np.uint8(255) * (frame.image != 90).any(axis=2), least_area=4))
        for frame in world.frames()
    )


def walk(start: tuple[int, int], step: tuple[int, int], begin: int = 0, end: int = 10**6) -> Path:
    """A straight walk from `start`, by `step` pixels a frame, present in frames begin .. end - 1."""
    return lambda k: (
        (start[0] + step[0] * (k - begin), start[1] + step[1] * (k - begin)) if begin <= k < end else None
    )


def lone_walker(**changes: int) -> World:
    return World((Block(walk((5, 30), (2, 0), begin=3)),), **changes)


def two_apart() -> World:
    return World(
        (
            Block(walk((5, 10), (2, 0), begin=2)),
            Block(walk((100, 50), (-2, 0), begin=4), colour=(40, 60, 220)),
        )
    )


def crossing() -> World:
    """Two who meet in the middle, are one region for a while, and part."""
    return World(
        (
            Block(walk((5, 30), (2, 0), begin=2)),
            Block(walk((105, 34), (-2, 0), begin=2), colour=(40, 60, 220)),
        ),
        count=55,
    )


def flicker() -> World:
    """One who walks, and specks that live for one frame."""
    specks = tuple(Block(walk((11 * n, 5), (0, 0), begin=3 * n, end=3 * n + 1), size=(4, 4)) for n in range(1, 9))
    return World((Block(walk((5, 30), (2, 0), begin=3)), *specks))


WORLDS = {"lone walker": lone_walker, "two apart": two_apart, "crossing": crossing, "flicker": flicker}

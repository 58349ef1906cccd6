"""Drawn films with their own truth: who walks where and when, in what place.

Pictures and truth come from the same raster, so the truth is exact to the pixel. Two boxes on a plain ground
are a film too:

>>> box = Walker("box", path=((0.0, 5, 20), (1.0, 55, 20)), width=8, height=12)
>>> world = World(64, 48, fps=10, count=11, walkers=(box,))
>>> world.truth().boxes[0].tolist()
[1.0, 8.0, 9.0, 20.0]
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from perdure import scenery
from perdure.errors import ParameterError
from perdure.figures import LOOKS, Clothes, Colour, Point, Pose
from perdure.staging import SIDES, Stage
from perdure.types import Frame, Mask, Scene, Tracks

_PLAIN = Clothes()


class Waypoint(NamedTuple):
    """Where the foot is at a time: seconds, pixels."""

    time: float
    x: float
    y: float


@dataclass(frozen=True)
class Walker:
    """Something that moves: what it looks like, and where its foot is when.

    Parameters
    ----------
    look : str
        'box', 'ellipse', 'person', 'cyclist' or 'dog'.
    path : tuple of Waypoint or (time, x, y)
        In order of time; it is there from the first to the last, and stands where two agree.
    width, height : float
        Pixels, at the lower edge of the picture where the world has a horizon, anywhere else.
    clothes : Clothes
        Its colours.
    smooth : float
        Seconds over which turns are rounded; 0 for straight lines from point to point.
    """

    look: str
    path: tuple[tuple[float, float, float], ...]
    width: float
    height: float
    clothes: Clothes = _PLAIN
    smooth: float = 0.0

    def __post_init__(self) -> None:
        if self.look not in LOOKS:
            raise ParameterError(f"a walker's look must be one of {', '.join(LOOKS)}, not {self.look!r}")
        times = [time for time, _, _ in self.path]
        if not times or any(later <= earlier for earlier, later in pairwise(times)):
            raise ParameterError(f"a walker's path must have waypoints at growing times, not at {times}")

    @property
    def begin(self) -> float:
        """When it is first there, in seconds."""
        return self.path[0][0]

    @property
    def end(self) -> float:
        """When it is last there, in seconds."""
        return self.path[-1][0]

    def foot(self, time: float) -> Point:
        """Return where its foot is, x and y in pixels."""
        times, x, y = np.array(self.path, np.float64).T
        at = time + self.smooth * np.linspace(-0.5, 0.5, 9) if self.smooth else np.array([time])
        return float(np.interp(at, times, x).mean()), float(np.interp(at, times, y).mean())

    def pose(self, time: float, height: float) -> Pose:
        """Return what its limbs do, by the way it has gone and its speed, for its height in pixels."""
        points = np.array(self.path, np.float64)
        gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, 1:], axis=0).T))])
        way = float(np.interp(time, points[:, 0], gone))
        before, after = self.foot(time - 0.04), self.foot(time + 0.04)
        speed = math.hypot(after[0] - before[0], after[1] - before[1]) / 0.08
        forward = self._facing(time)
        turn = 1.0 if self.look != "person" else max(0.35, min(1.0, 0.35 + speed / (0.5 * height)))
        return Pose(forward, 2 * math.pi * way / (0.82 * height), min(1.0, speed / (0.55 * height)), turn)

    def _facing(self, time: float) -> float:
        """1 to the right, -1 to the left: as in the last stretch on which it went sideways, else the next one."""
        stretches = list(pairwise(self.path))
        sideways = [(begin[0], end[1] - begin[1]) for begin, end in stretches if end[1] != begin[1]]
        if not sideways:
            return 1.0
        latest = [step for since, step in sideways if since <= time] or [sideways[0][1]]
        return math.copysign(1.0, latest[-1])


@dataclass(frozen=True)
class Occluder:
    """A thing that stands: 'box', 'trunk', 'kiosk', 'hedge' or 'lamp'; x and y are the middle of its foot."""

    look: str
    x: float
    y: float
    width: float
    height: float
    colour: Colour = (90, 90, 90)

    def __post_init__(self) -> None:
        if self.look not in scenery.THINGS:
            raise ParameterError(
                f"an occluder's look must be one of {', '.join(scenery.THINGS)}, not {self.look!r}"
            )


@dataclass(frozen=True)
class World:
    """A film that can be drawn again and again, each time the same.

    Parameters
    ----------
    width, height : int
        Pixels.
    fps : float
        Frames per second.
    count : int
        Number of frames.
    walkers : tuple of Walker
        Their ids are 1, 2, … in this order. Who has the lower foot is in front.
    occluders : tuple of Occluder
        Ordered in depth with the walkers, by the foot.
    backdrop : str
        'plain' (one colour) or 'square'.
    ground : (red, green, blue)
        The plain backdrop's colour.
    horizon : float or None
        The height y at which walkers shrink to nothing; None where they keep their size.
    noise : float
        Standard deviation of the sensor's noise, grey levels.
    flicker : float
        Largest share by which the light of a frame differs.
    shadows : bool
        Whether walkers throw a faint shadow.
    seed : int
        Of noise and textures.
    flipped : bool
        Whether left and right are exchanged, exactly.
    """

    width: int
    height: int
    fps: float = 25.0
    count: int = 30
    walkers: tuple[Walker, ...] = ()
    occluders: tuple[Occluder, ...] = ()
    backdrop: str = "plain"
    ground: Colour = (120, 120, 120)
    horizon: float | None = None
    noise: float = 0.0
    flicker: float = 0.0
    shadows: bool = False
    seed: int = 0
    flipped: bool = False

    def __post_init__(self) -> None:
        if self.backdrop not in ("plain", "square"):
            raise ParameterError(f"a world's backdrop must be plain or square, not {self.backdrop!r}")

    @property
    def scene(self) -> Scene:
        """What a tracker is told of the place."""
        return Scene(self.width, self.height, self.fps)

    def frames(self) -> Iterator[Frame]:
        """Draw the film from its first frame on."""
        stage = Stage.of(self)
        for index in range(self.count):
            picture = stage.picture(index)
            if self.flipped:
                picture = np.ascontiguousarray(picture[:, ::-1])
            yield Frame(index, index / self.fps, picture)

    def truth(self) -> Tracks:
        """Return a row for each walker in each frame into which its silhouette reaches.

        `boxes` and `believed` are whole, hidden parts and parts outside the picture included; `masks` the
        pixels seen. A row is VISIBLE if at least 0.8 of the silhouette is seen, PARTLY_OCCLUDED from 0.15 on,
        OCCLUDED else: also where the rest is outside the picture. Rows are ordered by frame, then id.
        """
        stage = Stage.of(self)
        rows = Tracks.join(stage.rows(index) for index in range(self.count))
        return _mirrored(rows, self.width) if self.flipped else rows

    def mirrored(self) -> World:
        """Return the same film with left and right exchanged, to the pixel."""
        return dataclasses.replace(self, flipped=not self.flipped)

    def shifted(self, right: int, down: int) -> World:
        """Return the world with all that walks and stands moved by whole pixels; textures stay."""
        right = -right if self.flipped else right
        return dataclasses.replace(
            self,
            walkers=tuple(
                dataclasses.replace(one, path=tuple((t, x + right, y + down) for t, x, y in one.path))
                for one in self.walkers
            ),
            occluders=tuple(dataclasses.replace(one, x=one.x + right, y=one.y + down) for one in self.occluders),
            horizon=None if self.horizon is None else self.horizon + down,
        )


def _mirrored(rows: Tracks, width: int) -> Tracks:
    def flip(mask: Mask) -> Mask:
        return Mask(mask.y, width - mask.box[2], mask.bits[:, ::-1].copy())

    boxes = rows.boxes.copy()
    boxes[:, [0, 2]] = width - boxes[:, [2, 0]]
    swapped = {"left": "right", "right": "left"}
    sides = [
        "+".join(sorted((swapped.get(side, side) for side in str(sides).split("+")), key=_rank))
        for sides in rows.hidden_side
    ]
    return rows.replace(
        boxes=boxes,
        masks=tuple(flip(mask) for mask in rows.masks),
        believed=tuple(None if mask is None else flip(mask) for mask in rows.believed),
        hidden_side=np.array(sides, np.str_),
    )


def _rank(side: str) -> int:
    return SIDES.index(side) if side in SIDES else -1

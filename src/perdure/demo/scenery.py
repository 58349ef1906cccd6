"""The place of a drawn film: what stands in it, its ground and its light.

All is drawn from numbers: the same seed gives the same place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.demo.figures import Colour, Polygon, Shape, capsule, ellipse
from perdure.types import Image

_WIDE, _TALL, _FINE = 640, 480, 2  # the square is drawn for this size, enlarged, and shrunk
_HORIZON = 40.0
_WALL_END, _GRASS_END = 150, 206

Light = NDArray[np.float32]
_Plane = NDArray[np.float64]


def standing(look: str, width: float, height: float, colour: Colour, seed: int) -> list[Shape]:
    """Return the shapes of a thing that stands: 'box', 'trunk', 'kiosk', 'hedge' or 'lamp'."""
    return THINGS[look](width, height, colour, np.random.default_rng(seed))


def plain(width: int, height: int, colour: Colour) -> tuple[Image, Light]:
    """Return a ground of one colour in even light."""
    ground = np.empty((height, width, 3), np.uint8)
    ground[:] = colour
    return ground, np.ones((height, width), np.float32)


def square(width: int, height: int, seed: int) -> tuple[Image, Light]:
    """Return a paved square before a house, half of it in the house's shade.

    Returns
    -------
    (H, W, 3) uint8 RGB ground and (H, W) float32 light in [0, 1], which is in the ground already
    """
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0 : _TALL * _FINE, 0 : _WIDE * _FINE].astype(np.float64) / _FINE
    picture = _paving(y, x, rng)  # (H, W, 3) float
    _lay(picture, _grass(y, x, rng), _GRASS_END + 3 * np.sin(x / 41.0) - y)
    _lay(picture, _flat((168, 160, 148), y), 160 - y)
    light = _light(y, x)
    picture *= light[..., None]
    picture[y < _WALL_END] = _house(rng)[y < _WALL_END]
    small = cv2.resize(np.clip(picture, 0, 255).astype(np.uint8), (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.uint8), np.asarray(cv2.resize(light, (width, height)), np.float32)


# Things that stand ------------------------------------------------------------------------------------------


def _block(width: float, height: float, colour: Colour, rng: np.random.Generator) -> list[Shape]:
    inset = 1 / 6  # as plain figures: cv2 fills the pixels of an edge too
    return [Shape(colour, (_rectangle(-width / 2 + inset, -height + inset, width / 2 - inset, -inset),))]


def _trunk(width: float, height: float, colour: Colour, rng: np.random.Generator) -> list[Shape]:
    """A tree: a trunk that widens at its foot, and a crown of leaves around its upper end."""
    half = width / 2
    sides = [
        (-1.5, 0.0),
        (-1.05, -0.05),
        (-0.85, -0.3),
        (-0.7, -0.8),
        (0.7, -0.8),
        (0.85, -0.3),
        (1.05, -0.05),
        (1.5, 0.0),
    ]
    parts = [Shape(colour, (np.array(sides) * (half, height),))]
    for offset, share in ((-0.45, 0.82), (-0.1, 1.16), (0.35, 0.9)):
        streak = capsule(
            (offset * half * 1.1, -4.0), (offset * half * 0.9, -0.78 * height), half * 0.12, half * 0.09
        )
        parts.append(Shape(_shaded(colour, share), (streak,)))
    for depth in np.linspace(0.0, 1.0, 70):
        angle, away = rng.uniform(0, 2 * math.pi), math.sqrt(rng.uniform())
        x, y = 88 * away * math.cos(angle), -height + 14 + 58 * away * math.sin(angle)
        sun = 0.78 + 0.34 * depth - 0.002 * x - 0.0022 * (y + height)
        leaves = _leafy((x - 6 * depth, y - 8 * depth), 27 - 13 * depth, rng)
        parts.append(Shape(_shaded((84, 122, 62), sun), (leaves,)))
    return parts


def _kiosk(width: float, height: float, colour: Colour, rng: np.random.Generator) -> list[Shape]:
    """A closed stall with a striped awning."""
    half = width / 2
    parts = [
        Shape(colour, (_rectangle(-half, -height * 0.86, half, 0.0),)),
        Shape(_shaded(colour, 0.8), (_rectangle(half * 0.72, -height * 0.86, half, 0.0),)),
        Shape(_shaded(colour, 0.62), (_rectangle(-half, -6.0, half, 0.0),)),
        Shape((52, 62, 74), (_rectangle(-half * 0.76, -height * 0.66, half * 0.58, -height * 0.38),)),
        Shape(
            (104, 122, 136),
            (np.array([[-0.7, -0.65], [-0.3, -0.65], [-0.5, -0.39], [-0.7, -0.39]]) * (half, height),),
        ),
        Shape((226, 216, 198), (_rectangle(-half * 0.84, -height * 0.38, half * 0.66, -height * 0.345),)),
    ]
    for stripe in range(8):
        left, right = (-half * 1.06 + (half * 2.12) * part / 8 for part in (stripe, stripe + 1))
        shade = (228, 220, 206) if stripe % 2 else (190, 74, 62)
        flap = np.array(
            [
                [left * 0.94, -0.84 * height],
                [right * 0.94, -0.84 * height],
                [right, -0.70 * height],
                [left, -0.70 * height],
            ]
        )
        parts.append(Shape(shade, (flap,)))
    parts.append(
        Shape(_shaded(colour, 0.66), (_rectangle(-half * 1.08, -height * 0.93, half * 1.08, -height * 0.83),))
    )
    parts.append(
        Shape(
            _shaded(colour, 0.9),
            (np.array([[-1.0, -0.93], [1.0, -0.93], [0.8, -1.0], [-0.8, -1.0]]) * (half, height),),
        )
    )
    return parts


def _hedge(width: float, height: float, colour: Colour, rng: np.random.Generator) -> list[Shape]:
    """A clipped hedge with leaves lit from above."""
    half = width / 2
    parts = [Shape(_shaded(colour, 0.62), (_rectangle(-half + 7, -height + 14, half - 7, 0.0),))]
    count = int(width * height / 42)
    for depth in np.sort(rng.uniform(size=count)):
        x, y = rng.uniform(-half + 4, half - 4), -rng.uniform(0.0, height - 8)
        sun = 0.58 + 0.30 * depth + 0.30 * (-y / height)
        parts.append(Shape(_shaded(colour, sun), (_leafy((x, y), rng.uniform(5, 10), rng),)))
    return parts


def _lamp(width: float, height: float, colour: Colour, rng: np.random.Generator) -> list[Shape]:
    """A lamp post with a globe."""
    half = width / 2
    return [
        Shape(_shaded(colour, 0.8), (_rectangle(-half * 2, -10.0, half * 2, 0.0),)),
        Shape(colour, (capsule((0.0, -4.0), (0.0, -height + 20), half, half * 0.75),)),
        Shape(
            _shaded(colour, 1.4),
            (capsule((-half * 0.4, -12.0), (-half * 0.4, -height + 24), half * 0.22, half * 0.2),),
        ),
        Shape(colour, (ellipse((0.0, -height + 19), half * 2.2, 3.0),)),
        Shape((238, 230, 206), (ellipse((0.0, -height + 9), 9.0, 10.0),)),
    ]


THINGS: Mapping[str, Callable[[float, float, Colour, np.random.Generator], list[Shape]]] = {
    "box": _block,
    "trunk": _trunk,
    "kiosk": _kiosk,
    "hedge": _hedge,
    "lamp": _lamp,
}


def _leafy(centre: tuple[float, float], radius: float, rng: np.random.Generator) -> Polygon:
    round_one = ellipse(centre, radius, radius * 0.8)
    return centre + (round_one - centre) * rng.uniform(0.8, 1.15, (len(round_one), 1))


def _rectangle(left: float, top: float, right: float, bottom: float) -> Polygon:
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])


def _shaded(colour: Colour, share: float) -> Colour:
    red, green, blue = (min(255, max(0, round(value * share))) for value in colour)
    return red, green, blue


# The square -------------------------------------------------------------------------------------------------


def _paving(y: _Plane, x: _Plane, rng: np.random.Generator) -> _Plane:
    """Slabs in perspective, each a little different; joints that fade with distance."""
    away = 440.0 / np.maximum(y - _HORIZON, 30.0)  # 1 at the lower edge, 4 at the house
    across, deep = (x - _WIDE / 2) * away / 62.0, 9.0 * away
    row = np.floor(deep)
    column = np.floor(across + 0.5 * (row % 2))
    tones = rng.normal(0.0, 5.0, 4096)
    tone = (
        tones[((row * 61 + column * 17) % 4096).astype(int)]
        + _cloud(y.shape, 90, rng) * 9
        + _cloud(y.shape, 3, rng) * 5
    )
    near = np.clip(1.6 / away, 0.25, 1.0)
    joint_x = np.minimum((across + 0.5 * (row % 2)) % 1.0, 1 - (across + 0.5 * (row % 2)) % 1.0) * 62.0 / away
    joint_y = np.minimum(deep % 1.0, 1 - deep % 1.0) * (y - _HORIZON) / np.maximum(9.0 * away, 1.0)
    joints = np.maximum(np.clip(1.1 - joint_x, 0, 1), np.clip(1.1 - joint_y, 0, 1)) * 26 * near
    stone = np.array([202.0, 193.0, 178.0])
    return np.asarray(stone + (tone - joints)[..., None] * np.array([1.0, 0.98, 0.94]))


def _grass(y: _Plane, x: _Plane, rng: np.random.Generator) -> _Plane:
    tone = _cloud(y.shape, 50, rng) * 14 + _cloud(y.shape, 2, rng) * 17
    return np.asarray(np.array([112.0, 142.0, 78.0]) + tone[..., None] * np.array([1.0, 1.0, 0.7]))


def _flat(colour: Colour, like: _Plane) -> _Plane:
    return np.broadcast_to(np.array(colour, np.float64), (*like.shape, 3))


def _light(y: _Plane, x: _Plane) -> Light:
    """The house's shade with a soft edge, and the flecked one of the tree."""
    edge = 268.0 - 0.055 * x + 9 * np.sign(np.sin(x / 60.0)) * (np.sin(x / 60.0) > 0.3)
    house = 1.0 / (1.0 + np.exp(np.clip((y - edge) / 2.2, -40, 40)))
    rings = ((x - 492) / 92) ** 2 + ((y - 352) / 20) ** 2
    flecks = 0.75 + 0.25 * np.sin(x / 7.0 + np.sin(y / 3.0)) * np.sin(y / 4.0 + x / 19.0)
    tree = np.clip(1.3 - rings, 0.0, 1.0) * flecks
    return np.asarray((1.0 - 0.46 * house) * (1.0 - 0.30 * tree * (1 - house)), np.float32)


def _house(rng: np.random.Generator) -> _Plane:
    """A plastered front with windows, a door and a plinth, in its own shade."""
    shape = (_TALL * _FINE, _WIDE * _FINE)
    wall = np.array([172.0, 142.0, 118.0]) + (_cloud(shape, 120, rng) * 8 + _cloud(shape, 2, rng) * 4)[..., None]
    front = np.clip(wall, 0, 255).astype(np.uint8)
    _bar(front, 0, 132, 640, 150, (120, 108, 100))
    _bar(front, 0, 18, 640, 23, (150, 124, 104))
    for left in (22, 118, 310, 406, 502, 598):
        _window(front, left)
    _bar(front, 212, 36, 272, 150, (196, 182, 164))
    _bar(front, 218, 42, 266, 150, (74, 92, 88))
    _bar(front, 241, 42, 243, 150, (52, 66, 64))
    _bar(front, 222, 48, 238, 84, (116, 134, 138))
    _bar(front, 246, 48, 262, 84, (116, 134, 138))
    return np.asarray(front * 0.82, np.float64)


def _window(front: Image, left: int) -> None:
    _bar(front, left - 4, 38, left + 56, 106, (200, 188, 172))
    _bar(front, left, 42, left + 52, 102, (70, 84, 98))
    glass = np.array([[left + 4, 42], [left + 30, 42], [left + 8, 102], [left, 102], [left, 60]], np.int32) * _FINE
    cv2.fillPoly(front, [glass], (104, 122, 138), cv2.LINE_AA)
    _bar(front, left + 25, 42, left + 27, 102, (200, 188, 172))
    _bar(front, left, 66, left + 52, 68, (200, 188, 172))
    _bar(front, left - 7, 104, left + 59, 110, (214, 204, 190))


def _bar(front: Image, left: int, top: int, right: int, bottom: int, colour: Colour) -> None:
    front[top * _FINE : bottom * _FINE, max(left, 0) * _FINE : right * _FINE] = colour


def _lay(picture: _Plane, layer: _Plane, depth: _Plane) -> None:
    """Blend a layer in where depth is above 0, with an edge of one pixel."""
    share = np.clip(depth + 0.5, 0.0, 1.0)[..., None]
    picture += (layer - picture) * share


def _cloud(shape: tuple[int, int], grain: int, rng: np.random.Generator) -> _Plane:
    """Smooth noise of about unit size whose blots are `grain` samples wide."""
    coarse = rng.normal(0.0, 1.0, (shape[0] // grain + 3, shape[1] // grain + 3))
    return np.asarray(cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC), np.float64)

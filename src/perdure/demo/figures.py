"""Figures of a drawn film: what each look is made of, and its raster.

A figure is a list of `Shape`, painted in order: polygons in pixels relative to the figure's foot point,
x to the right, y down. `raster` draws them enlarged, without anti-aliasing, and shrinks the result, so that
the picture's soft edge and the silhouette of its truth come from one drawing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.types import Bits, Mask

Colour = tuple[int, int, int]
Point = tuple[float, float]
Polygon = NDArray[np.float64]  # (n, 2): x, y

_FINE = 3  # samples a pixel, each way
_INSET = 0.5 / _FINE  # cv2 fills the pixels of an edge too: plain looks keep that far inside


class Shape(NamedTuple):
    """Polygons of one colour; where two of one shape overlap there is a hole."""

    colour: Colour
    outlines: tuple[Polygon, ...]


class Pose(NamedTuple):
    """What a figure does at a moment.

    `facing` is 1 to the right, -1 to the left; `phase` the stride in radians; `stride` how far the limbs
    swing, 0 (standing) to 1; `turn` tells how much is seen from the side, 0 to 1.
    """

    facing: float = 1.0
    phase: float = 0.0
    stride: float = 0.0
    turn: float = 1.0


class Clothes(NamedTuple):
    """Colours of a figure; a plain look wears the first."""

    top: Colour = (200, 60, 50)
    bottom: Colour = (50, 60, 90)
    skin: Colour = (226, 178, 148)
    hair: Colour = (60, 42, 34)
    bag: Colour | None = None
    skirt: bool = False


@dataclass(frozen=True, eq=False)
class Sprite:
    """A raster and its upper left corner in the picture; the corner may lie outside it.

    Parameters
    ----------
    y, x : int
    colour : (h, w, 3) uint8
        Multiplied by the cover already.
    cover : (h, w) uint8
        255 where the figure hides what is behind it.
    """

    y: int
    x: int
    colour: NDArray[np.uint8]
    cover: NDArray[np.uint8]

    @property
    def bits(self) -> Bits:
        """The silhouette (h, w): pixels at least half covered."""
        return np.asarray(self.cover >= 128)

    @property
    def mask(self) -> Mask:
        """The tight silhouette."""
        return Mask.of_image(self.bits, self.y, self.x)


def raster(shapes: Sequence[Shape], foot: Point) -> Sprite:
    """Draw shapes whose foot point is at `foot` (x, y) of the picture."""
    corner_x, corner_y = math.floor(foot[0]), math.floor(foot[1])
    every = np.concatenate([outline for shape in shapes for outline in shape.outlines])
    every += np.array([foot[0] - corner_x, foot[1] - corner_y])
    left, top = (math.floor(value) - 1 for value in every.min(axis=0))
    right, bottom = (math.ceil(value) + 1 for value in every.max(axis=0))
    fine = np.zeros(((bottom - top) * _FINE, (right - left) * _FINE, 4), np.uint8)
    shift = np.array([foot[0] - corner_x - left, foot[1] - corner_y - top])
    for colour, outlines in shapes:
        points = [np.rint(((outline + shift) * _FINE - 0.5) * 16).astype(np.int32) for outline in outlines]
        cv2.fillPoly(fine, points, (*colour, 255), cv2.LINE_8, 4)
    small = np.asarray(cv2.resize(fine, (right - left, bottom - top), interpolation=cv2.INTER_AREA), np.uint8)
    return Sprite(
        corner_y + top, corner_x + left, small[..., :3].copy(), small[..., 3].copy()
    )  # small is (h, w, 4)


def figure(look: str, width: float, height: float, clothes: Clothes, pose: Pose) -> list[Shape]:
    """Return the shapes of a look: 'box', 'ellipse', 'person', 'dog' or 'cyclist'."""
    return LOOKS[look](width, height, clothes, pose)


# Plain looks ------------------------------------------------------------------------------------------------


def _box(width: float, height: float, clothes: Clothes, pose: Pose) -> list[Shape]:
    x, top, bottom = width / 2 - _INSET, -height + _INSET, -_INSET
    return [Shape(clothes.top, (np.array([[-x, top], [x, top], [x, bottom], [-x, bottom]]),))]


def _plain_ellipse(width: float, height: float, clothes: Clothes, pose: Pose) -> list[Shape]:
    return [Shape(clothes.top, (ellipse((0.0, -height / 2), width / 2 - _INSET, height / 2 - _INSET),))]


# People -----------------------------------------------------------------------------------------------------


def _person(width: float, height: float, clothes: Clothes, pose: Pose) -> list[Shape]:
    """A walker: far limbs, legs, torso, head, near arm; lengths are shares of the height."""
    swing = 0.50 * pose.stride * math.sin(pose.phase)
    bob = 0.012 * pose.stride * abs(math.cos(pose.phase))
    wide = width / height / 0.36  # 1 for an ordinary build
    hip, shoulder = (0.0, -0.50 - bob), (0.02 * pose.turn, -0.80 - bob)
    spread = 0.035 * wide * (1.0 - 0.7 * pose.turn * pose.stride)
    dark_bottom, dark_top = _shade(clothes.bottom, 0.72), _shade(clothes.top, 0.74)
    parts: list[Shape] = []
    parts += _leg((hip[0] + spread, hip[1]), -swing, pose, dark_bottom, wide)
    parts += _arm(
        (shoulder[0] + 0.105 * wide * (1 - 0.55 * pose.turn), shoulder[1]), swing, dark_top, clothes.skin
    )
    if clothes.bag is not None:
        parts.append(Shape(clothes.bag, (capsule((-0.10, -0.76 - bob), (-0.10, -0.60 - bob), 0.06, 0.075),)))
    parts += _leg((hip[0] - spread, hip[1]), swing, pose, clothes.bottom, wide)
    parts.append(
        Shape(clothes.bottom, (capsule((0.0, -0.56 - bob), (0.0, -0.48 - bob), 0.085 * wide, 0.08 * wide),))
    )
    if clothes.skirt:
        hem = 0.15 * wide + 0.05 * abs(swing)
        parts.append(
            Shape(
                clothes.bottom,
                (np.array([[-0.08, -0.58], [0.08, -0.58], [hem, -0.30], [-hem, -0.30]]) * (wide, 1.0),),
            )
        )
    parts.append(
        Shape(clothes.top, (capsule((shoulder[0], -0.745 - bob), (0.0, -0.56 - bob), 0.108 * wide, 0.086 * wide),))
    )
    light = capsule((shoulder[0] - 0.02, -0.75 - bob), (-0.018, -0.57 - bob), 0.082 * wide, 0.064 * wide)
    parts.append(Shape(_shade(clothes.top, 1.07), (light,)))
    parts += _head((0.03 * pose.turn, -0.918 - bob), clothes, pose.turn)
    parts += _arm(
        (shoulder[0] - 0.075 * wide * (1 - 0.6 * pose.turn), shoulder[1]),
        -swing,
        _shade(clothes.top, 0.9),
        clothes.skin,
    )
    return _scaled(parts, height * pose.facing, height)


def _leg(hip: Point, swing: float, pose: Pose, colour: Colour, wide: float) -> list[Shape]:
    """Thigh and shin; the leg that swings forward bends its knee."""
    swing *= 0.35 + 0.65 * pose.turn
    bend = pose.stride * max(0.0, math.cos(pose.phase) * (1 if swing >= 0 else -1)) * 0.5 + 0.35 * max(0.0, -swing)
    knee = (hip[0] + 0.235 * math.sin(swing + 0.3 * bend), hip[1] + 0.235 * math.cos(swing))
    ankle = (knee[0] + 0.225 * math.sin(swing - bend), knee[1] + 0.225 * math.cos(swing - bend))
    ankle = ankle[0], min(ankle[1], -0.028)
    shoe = capsule(
        (ankle[0] - 0.005, ankle[1] + 0.008), (ankle[0] + 0.05 * pose.turn + 0.005, ankle[1] + 0.014), 0.024, 0.018
    )
    return [
        Shape((46, 42, 44), (shoe,)),
        Shape(colour, (capsule(knee, ankle, 0.043 * wide, 0.03),)),
        Shape(colour, (capsule(hip, knee, 0.058 * wide, 0.045 * wide),)),
    ]


def _arm(shoulder: Point, swing: float, colour: Colour, skin: Colour) -> list[Shape]:
    swing *= 0.9
    elbow = (shoulder[0] + 0.16 * math.sin(swing), shoulder[1] + 0.035 + 0.15 * math.cos(swing))
    bend = swing + 0.18
    hand = (elbow[0] + 0.14 * math.sin(bend), elbow[1] + 0.14 * math.cos(bend))
    return [
        Shape(skin, (ellipse(hand, 0.025, 0.027),)),
        Shape(colour, (capsule(elbow, hand, 0.032, 0.023),)),
        Shape(colour, (capsule((shoulder[0], shoulder[1] + 0.035), elbow, 0.04, 0.033),)),
    ]


def _head(centre: Point, clothes: Clothes, turn: float) -> list[Shape]:
    x, y = centre
    hair = ellipse((x - 0.016 * turn, y - 0.014), 0.062, 0.068)
    face = ellipse((x + 0.018 * turn, y + 0.012), 0.046, 0.056)
    return [
        Shape(_shade(clothes.skin, 0.86), (capsule((x - 0.015, y + 0.05), (x - 0.02, y + 0.11), 0.03, 0.034),)),
        Shape(clothes.hair, (hair,)),
        Shape(clothes.skin, (face,)),
        Shape(clothes.hair, (ellipse((x + 0.002 * turn, y - 0.042), 0.052, 0.03),)),
    ]


def _cyclist(width: float, height: float, clothes: Clothes, pose: Pose) -> list[Shape]:
    """A bicycle and its rider, seen from the side; the height is that of the rider's head."""
    wheel, base = 0.20, width / height / 2 - 0.20
    frame = (58, 60, 66)
    crank, seat, bar = (0.0, -0.19), (-0.12, -0.47), (base - 0.09, -0.52)
    parts = [
        Shape(frame, (ellipse((x, -wheel), wheel, wheel), ellipse((x, -wheel), wheel - 0.028, wheel - 0.028)))
        for x in (-base, base)
    ]
    parts += _pedalling(seat, crank, pose.phase + math.pi, _shade(clothes.bottom, 0.72))
    tubes = ((crank, seat), (crank, bar), (seat, (-base, -wheel)), (crank, (-base, -wheel)), (bar, (base, -wheel)))
    parts += [Shape(clothes.bag or (170, 50, 46), (capsule(begin, end, 0.014, 0.014),)) for begin, end in tubes]
    parts += _pedalling(seat, crank, pose.phase, clothes.bottom)
    shoulder = (0.09, -0.78)
    parts.append(Shape(clothes.top, (capsule(shoulder, (-0.10, -0.52), 0.09, 0.085),)))
    parts += _head((0.16, -0.918), clothes, 1.0)
    parts.append(
        Shape(_shade(clothes.top, 0.88), (capsule(shoulder, (bar[0] - 0.02, bar[1] - 0.03), 0.038, 0.026),))
    )
    return _scaled(parts, height * pose.facing, height)


def _pedalling(hip: Point, crank: Point, phase: float, colour: Colour) -> list[Shape]:
    foot = crank[0] + 0.075 * math.cos(phase), crank[1] + 0.075 * math.sin(phase)
    knee = (hip[0] + foot[0]) / 2 + 0.10, (hip[1] + foot[1]) / 2 - 0.05
    return [
        Shape((46, 42, 44), (capsule((foot[0] - 0.01, foot[1]), (foot[0] + 0.05, foot[1] + 0.008), 0.024, 0.02),)),
        Shape(colour, (capsule(knee, foot, 0.04, 0.028),)),
        Shape(colour, (capsule(hip, knee, 0.058, 0.042),)),
    ]


def _dog(width: float, height: float, clothes: Clothes, pose: Pose) -> list[Shape]:
    """A dog from the side; lengths are shares of the height, the length comes from the width."""
    half = width / height / 2
    swing = 0.55 * pose.stride * math.sin(pose.phase)
    coat, dark = clothes.top, _shade(clothes.top, 0.74)
    chest, rump = (half * 0.42, -0.58), (-half * 0.55, -0.56)
    parts: list[Shape] = []
    for (x, y), angle, colour in (
        (chest, -swing, dark),
        (rump, swing, dark),
        (chest, swing, coat),
        (rump, -swing, coat),
    ):
        paw = (x + 0.44 * math.sin(angle), min(y + 0.54 * math.cos(angle), -0.05))
        parts.append(Shape(colour, (capsule((x, y + 0.06), paw, 0.10, 0.055),)))
    wag = 0.08 * math.sin(1.7 * pose.phase)
    parts.insert(2, Shape(dark, (capsule(rump, (-half * 0.92, -0.86 + wag), 0.07, 0.035),)))
    parts.append(Shape(coat, (capsule(chest, rump, 0.185, 0.15),)))
    parts.append(Shape(coat, (capsule((half * 0.5, -0.64), (half * 0.66, -0.84), 0.13, 0.11),)))
    parts.append(Shape(coat, (capsule((half * 0.66, -0.86), (half * 0.92, -0.80), 0.12, 0.065),)))
    parts.append(Shape(dark, (capsule((half * 0.60, -0.94), (half * 0.54, -0.80), 0.06, 0.045),)))
    parts.append(Shape((30, 26, 26), (ellipse((half * 0.97, -0.82), 0.03, 0.03),)))
    parts.append(Shape(clothes.bottom, (capsule((half * 0.46, -0.68), (half * 0.60, -0.62), 0.045, 0.045),)))
    return _scaled(parts, height * pose.facing, height)


LOOKS: Mapping[str, Callable[[float, float, Clothes, Pose], list[Shape]]] = {
    "box": _box,
    "ellipse": _plain_ellipse,
    "person": _person,
    "cyclist": _cyclist,
    "dog": _dog,
}
CLASSES: Mapping[str, str] = {"person": "person", "cyclist": "bicycle", "dog": "dog"}


# Polygons ---------------------------------------------------------------------------------------------------


def ellipse(centre: Point, across: float, down: float) -> Polygon:
    """Return the ellipse with these half axes, (32, 2)."""
    angle = np.arange(32) * (math.pi / 16)
    return np.stack([centre[0] + across * np.cos(angle), centre[1] + down * np.sin(angle)], axis=1)


def capsule(begin: Point, end: Point, radius: float, end_radius: float) -> Polygon:
    """Return a limb with round ends, (20, 2)."""
    along = math.atan2(end[1] - begin[1], end[0] - begin[0])
    half_turn = np.linspace(math.pi / 2, 3 * math.pi / 2, 10) + along
    caps = ((begin, radius, half_turn), (end, end_radius, half_turn + math.pi))
    return np.concatenate(
        [np.stack([x + r * np.cos(angle), y + r * np.sin(angle)], axis=1) for (x, y), r, angle in caps]
    )


def _scaled(parts: Sequence[Shape], across: float, down: float) -> list[Shape]:
    return [Shape(colour, tuple(outline * (across, down) for outline in outlines)) for colour, outlines in parts]


def _shade(colour: Colour, share: float) -> Colour:
    red, green, blue = (min(255, round(value * share)) for value in colour)
    return red, green, blue

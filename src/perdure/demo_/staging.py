"""Drawing a world's frames, and the truth of each: both from one cast of rasters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure import scenery
from perdure.figures import CLASSES, Point, Shape, Sprite, capsule, ellipse, figure, raster
from perdure.types import Image, Mask, Status, Tracks

if TYPE_CHECKING:
    from perdure.drawn import World

SIDES = ("left", "top", "right", "bottom")
_VISIBLE_FROM, _PARTLY_FROM = 0.8, 0.15  # shares of the whole silhouette
_NOISE_MARGIN = 32  # the grain of a frame is a window of a larger sheet


class Actor(NamedTuple):
    """Something drawn in a frame: its id (0 for an occluder), its foot, its height and its raster."""

    id: int
    foot: Point
    height: float
    sprite: Sprite


@dataclass(frozen=True, eq=False)
class Stage:
    """What does not change from frame to frame."""

    world: World
    ground: Image  # (H, W, 3)
    light: scenery.Light  # (H, W)
    things: tuple[Actor, ...]
    grain: NDArray[np.int16]  # (H + margin, W + margin, 3); empty without noise

    @staticmethod
    def of(world: World) -> Stage:
        """Set the stage of a world."""
        width, height = world.width, world.height
        if world.backdrop == "square":
            ground, light = scenery.square(width, height, world.seed)
        else:
            ground, light = scenery.plain(width, height, world.ground)
        things = []
        for number, one in enumerate(world.occluders):
            shapes = scenery.standing(one.look, one.width, one.height, one.colour, world.seed + number)
            things.append(Actor(0, (one.x, one.y), one.height, raster(shapes, (one.x, one.y))))
        return Stage(world, ground, light, tuple(things), _grain(world))

    def actors(self, index: int) -> list[Actor]:
        """Return all that is there in a frame, the farthest first."""
        world, time = self.world, index / self.world.fps
        there = list(self.things)
        for identity, walker in enumerate(world.walkers, start=1):
            if walker.begin <= time <= walker.end:
                foot = walker.foot(time)
                near = _nearness(world, foot[1])
                if near > 0.0:
                    width, height = walker.width * near, walker.height * near
                    shapes = figure(walker.look, width, height, walker.clothes, walker.pose(time, height))
                    there.append(Actor(identity, foot, height, raster(shapes, foot)))
        return sorted(there, key=lambda actor: actor.foot[1])

    def picture(self, index: int) -> Image:
        """Draw a frame."""
        picture = self.ground.copy()
        actors = self.actors(index)
        if self.world.shadows:
            for actor in actors:
                _throw_shadow(picture, actor, self._light_at(actor.foot))
        for actor in actors:
            _paste(picture, actor.sprite, self._light_at(actor.foot) if actor.id else 1.0)
        return self._seen_by_sensor(picture, index)

    def rows(self, index: int) -> Tracks:
        """Return the truth of a frame: who painted a pixel last is who is seen there."""
        world = self.world
        owner = np.zeros((world.height, world.width), np.int32)
        actors = self.actors(index)
        for actor in actors:
            _claim(owner, actor)
        there = sorted((actor for actor in actors if actor.id), key=lambda actor: actor.id)
        believed = [actor.sprite.mask for actor in there]
        inside = [whole.to_image(world.height, world.width).any() for whole in believed]
        there = [actor for actor, keep in zip(there, inside, strict=True) if keep]
        believed = [whole for whole, keep in zip(believed, inside, strict=True) if keep]
        masks = [_seen(owner, actor) for actor in there]
        rows = Tracks.of(
            frames=index,
            times=index / world.fps,
            ids=[actor.id for actor in there],
            boxes=[whole.box for whole in believed],
            classes=[CLASSES.get(world.walkers[actor.id - 1].look, "") for actor in there],
            masks=masks,
            believed=believed,
            hidden_side=[_hidden_side(seen, whole) for seen, whole in zip(masks, believed, strict=True)],
        )
        share = rows.visibility
        status = np.where(share >= _PARTLY_FROM, Status.PARTLY_OCCLUDED, Status.OCCLUDED)
        return rows.replace(status=np.where(share >= _VISIBLE_FROM, Status.VISIBLE, status))

    def _light_at(self, foot: Point) -> float:
        y = min(max(round(foot[1]), 0), self.world.height - 1)
        x = min(max(round(foot[0]), 0), self.world.width - 1)
        return float(self.light[y, x])

    def _seen_by_sensor(self, picture: Image, index: int) -> Image:
        """Light that flickers a little, and noise."""
        world = self.world
        if world.flicker:
            time = index / world.fps
            wave = 0.6 * math.sin(1.9 * time) + 0.4 * math.sin(10.7 * time + 1.0)
            picture = np.asarray(cv2.convertScaleAbs(picture, alpha=1.0 + world.flicker * wave), np.uint8)
        if self.grain.size:
            rng = np.random.default_rng((world.seed, index))
            y, x = rng.integers(0, _NOISE_MARGIN, 2)
            window = self.grain[y : y + world.height, x : x + world.width]
            picture = np.asarray(cv2.add(picture, window, dtype=cv2.CV_8U), np.uint8)
        return picture


def _nearness(world: World, y: float) -> float:
    return 1.0 if world.horizon is None else (y - world.horizon) / (world.height - world.horizon)


def _grain(world: World) -> NDArray[np.int16]:
    if not world.noise:
        return np.zeros((0, 0, 3), np.int16)
    shape = (world.height + _NOISE_MARGIN, world.width + _NOISE_MARGIN, 3)
    noise = np.random.default_rng(world.seed).standard_normal(shape, np.float32) * world.noise
    return np.asarray(np.rint(noise), np.int16)


def _paste(picture: Image, sprite: Sprite, light: float) -> None:
    """Lay a sprite over the picture, in the light of its place."""
    place, crop = _window(sprite, picture.shape)
    if not place:
        return
    cover = cv2.merge([255 - sprite.cover[crop]] * 3)
    behind = cv2.multiply(picture[place], cover, scale=1 / 255)
    picture[place] = cv2.add(behind, cv2.convertScaleAbs(sprite.colour[crop], alpha=light))


def _seen(owner: NDArray[np.int32], actor: Actor) -> Mask:
    place, _ = _window(actor.sprite, owner.shape)
    return Mask.of_image(owner[place] == actor.id, place[0].start, place[1].start)


def _claim(owner: NDArray[np.int32], actor: Actor) -> None:
    place, crop = _window(actor.sprite, owner.shape)
    if place:
        owner[place][actor.sprite.bits[crop]] = actor.id


def _window(sprite: Sprite, shape: tuple[int, ...]) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Where in the picture a sprite is, and which part of it; both empty where it is outside."""
    height, width = sprite.cover.shape
    top, left = max(sprite.y, 0), max(sprite.x, 0)
    bottom, right = min(sprite.y + height, shape[0]), min(sprite.x + width, shape[1])
    if top >= bottom or left >= right:
        return (), ()
    crop = slice(top - sprite.y, bottom - sprite.y), slice(left - sprite.x, right - sprite.x)
    return (slice(top, bottom), slice(left, right)), crop


def _throw_shadow(picture: Image, actor: Actor, light: float) -> None:
    """Darken the ground at the foot, and to the right of it where the sun shines."""
    if not actor.id:
        return
    height, wide = actor.height, actor.sprite.cover.shape[1]
    contact = ellipse((0.0, -0.01 * height), 0.52 * wide, 0.035 * height)
    _darken(picture, contact, actor.foot, 0.30, height)
    if light > 0.8:
        far = capsule(
            (0.05 * height, -0.01 * height), (0.62 * height, 0.035 * height), 0.05 * height, 0.045 * height
        )
        _darken(picture, far, actor.foot, 0.16, height)


def _darken(picture: Image, outline: NDArray[np.float64], foot: Point, share: float, height: float) -> None:
    sprite = raster([Shape((255, 255, 255), (outline,))], foot)
    blur = max(1.0, 0.02 * height)
    margin = math.ceil(2 * blur)
    cover = cv2.copyMakeBorder(sprite.cover, margin, margin, margin, margin, cv2.BORDER_CONSTANT, value=0)
    soft = np.asarray(cv2.convertScaleAbs(cv2.GaussianBlur(cover, (0, 0), blur), alpha=share), np.uint8)
    black = np.zeros((*soft.shape, 3), np.uint8)
    _paste(picture, Sprite(sprite.y - margin, sprite.x - margin, black, soft), 1.0)


def _hidden_side(seen: Mask, whole: Mask) -> str:
    """The sides at which the seen part falls short of the whole by more than a tenth of its size."""
    if not seen.area:
        return ""
    (x1, y1, x2, y2), (wx1, wy1, wx2, wy2) = seen.box, whole.box
    across, down = 0.1 * (wx2 - wx1), 0.1 * (wy2 - wy1)
    short = (x1 - wx1 > across, y1 - wy1 > down, wx2 - x2 > across, wy2 - y2 > down)
    return "+".join(side for side, missing in zip(SIDES, short, strict=True) if missing)

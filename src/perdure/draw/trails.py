"""Where everybody has been in the last seconds, and how that is drawn: fading lines on a dark band."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.draw.colours import DARK, Colour, colour_of
from perdure.types import Image, Status, Tracks

_TRAIL_PIECES = 6
_REACH = 2  # points on either side that a drawn point is averaged over
_JUMP = 6.0  # a step this many times the usual is no movement but another box: the trail breaks there
_TRAIL_RATE = 10.0  # points drawn a second


@dataclass(frozen=True, eq=False)
class Trails:
    """Where each id has been in the last seconds: N foot points, oldest first.

    Parameters
    ----------
    ids : (N,) int64
    times : (N,) float64
        Seconds.
    points : (N, 2) float32
        The middle of the box's lower edge, x and y in pixels.
    """

    ids: NDArray[np.int64]
    times: NDArray[np.float64]
    points: NDArray[np.float32]

    @staticmethod
    def empty() -> Trails:
        """Return the trails before the first frame."""
        return Trails(np.zeros(0, np.int64), np.zeros(0, np.float64), np.zeros((0, 2), np.float32))

    def extended(self, rows: Tracks, time: float, keep: float = 3.0) -> Trails:
        """Return the trails with the rows of the frame at `time`, without what is older than `keep` seconds.

        Lost rows and groups leave no trail. Points at or after `time` are forgotten first, so that the
        same frame twice changes nothing and a film may be wound back.
        """
        old = (self.times < time) & (self.times >= time - keep)
        new = (rows.status != Status.LOST) & ~rows.is_group
        boxes = rows.boxes[new]
        feet = np.stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]], axis=1)  # (n, 2)
        return Trails(
            np.concatenate([self.ids[old], rows.ids[new]]),
            np.concatenate([self.times[old], np.full(len(feet), time)]),
            np.concatenate([self.points[old], feet]),
        )


def draw_trails(picture: Image, trails: Trails, time: float, line: int, halo: int) -> None:
    """Draw the trails into a picture as they are at `time`, `line` pixels wide on a band `halo` wider."""
    for path in _paths(trails, time):
        _fade_in(picture, path, line, halo)


class _Path(NamedTuple):
    """The trail of one id: points (n, 2) and how fresh each is, 0 at the oldest kept, 1 now."""

    points: NDArray[np.float32]
    fresh: NDArray[np.float64]
    colour: Colour


def _paths(trails: Trails, time: float) -> list[_Path]:
    if not len(trails.ids):
        return []
    span = max(time - float(trails.times.min()), 1e-6)
    paths = []
    for identity in np.unique(trails.ids).tolist():
        own = np.flatnonzero(trails.ids == identity)
        tick = np.floor(trails.times[own] * _TRAIL_RATE)  # of the clock, not of the trail: else it would shiver
        own = own[np.concatenate([tick[1:] != tick[:-1], [True]])]
        points = np.clip(trails.points[own], -16000, 16000)
        if len(points) < 2:
            continue
        fresh = np.clip(1.0 - (time - trails.times[own]) / span, 0.0, 1.0)
        stride = np.hypot(*np.diff(points, axis=0).T)
        jumps = np.flatnonzero(stride > _JUMP * (np.median(stride) + 4.0)) + 1
        for part, ages in zip(np.split(points, jumps), np.split(fresh, jumps), strict=True):
            if len(part) > 1:
                paths.append(_Path(_smooth(part), ages, colour_of(identity)))
    return paths


def _smooth(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Average each point with its neighbours over half a second; the foot of a box jumps with its legs."""
    padded = (
        np.pad(points, ((_REACH, _REACH), (0, 0)), mode="reflect", reflect_type="odd")
        if len(points) > _REACH
        else points
    )
    if len(padded) == len(points):
        return points
    sums = np.cumsum(np.concatenate([np.zeros((1, 2)), padded]), axis=0)  # (n + 2 reach + 1, 2)
    width = 2 * _REACH + 1
    return np.asarray((sums[width:] - sums[:-width]) / width, np.float32)


def _fade_in(picture: Image, path: _Path, line: int, halo: int) -> None:
    """Blend a trail in on its dark band, in pieces from faint to full."""
    margin = line + halo
    left, top = (max(int(low) - margin, 0) for low in path.points.min(axis=0))
    right, bottom = (max(int(high) + margin + 1, 0) for high in path.points.max(axis=0))
    crop = picture[top:bottom, left:right]
    if crop.size:
        moved = path._replace(points=path.points - np.array([left, top], np.float32))
        _blend(crop, _ink(moved, crop.shape, line + halo, 0.3), DARK)
        _blend(crop, _ink(moved, crop.shape, line, 1.0), path.colour)


def _ink(path: _Path, shape: tuple[int, ...], width: int, strength: float) -> NDArray[np.uint8]:
    """Draw how much of a pixel the trail covers, 0 to 255; less the older it is."""
    ink = np.zeros(shape[:2], np.uint8)
    points = np.rint(path.points * 8).astype(np.int32)  # 3 bits below the pixel
    bounds = np.linspace(0, len(points) - 1, _TRAIL_PIECES + 1).round().astype(int)
    for first, last in pairwise(bounds.tolist()):
        share = round(strength * (25 + 205 * float(path.fresh[last])))
        cv2.polylines(ink, [points[first : last + 1]], False, share, width, cv2.LINE_AA, 3)
    return ink


def _blend(crop: Image, ink: NDArray[np.uint8], colour: Colour) -> None:
    share = cv2.merge([ink, ink, ink])
    behind = cv2.multiply(crop, cv2.bitwise_not(share), scale=1 / 255)
    crop[:] = cv2.add(behind, cv2.merge([cv2.convertScaleAbs(ink, alpha=value / 255) for value in colour]))

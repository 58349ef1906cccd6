"""Shapes that come back: a gait repeats itself, so what is hidden has the shape that followed the last time.

While an object is seen, its shapes are kept. When it is hidden, the stretch of them that is most like the last few is
looked for, and what came after that stretch is what is expected now. A shape that does not repeat itself is rigid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.maths import levelset
from perdure.types import Bits

Float = NDArray[np.float64]

MOST = 64  # shapes that are kept
_SIDE = 48  # cells of a small picture of a shape
_LIKE = 3  # shapes that are compared
_APART = 6  # shapes between two stretches, at least
_LATE = 16  # places to which a path is fitted
_BETTER = 0.03  # IoU by which what came back must be more alike than what stays as it was


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape as it was once seen in full."""

    bits: Bits  # (h, w) inside μ, about the origin
    small: Bits  # (48, 48) the same, over a square of which the side is `scale`
    scale: float  # cells
    age: int  # of the object then, frames
    at: Float  # (2,) px, where its origin was


def kept(past: Sequence[Shape], shape: Float, age: int, at: Float) -> tuple[Shape, ...]:
    """Return the past with one more shape μ (h, w)."""
    scale = past[0].scale if past else 1.5 * max(shape.shape)
    bits = shape < 0
    one = Shape(bits, _small(bits, scale), scale, age, at)
    return (*past[-(MOST - 1) :], one)


def recalled(past: Sequence[Shape]) -> int | None:
    """Return which of past shapes was most like the last one, in what came before too; None if none comes back."""
    if len(past) < 2 * _LIKE + _APART:
        return None
    stack = np.stack([one.small for one in past]).reshape(len(past), -1).astype(np.float32)
    areas = stack.sum(axis=1)
    recent = stack[-_LIKE:]
    common = recent @ stack.T  # (_LIKE, n)
    alike = common / np.maximum(areas[-_LIKE:, None] + areas - common, 1)
    count = len(past) - _APART
    scores = np.mean([alike[j, j : count - _LIKE + 1 + j] for j in range(_LIKE)], axis=0)
    best = int(np.argmax(np.round(scores, 6)))
    lasting = float(np.mean([alike[j, len(past) - _LIKE + j - _APART] for j in range(_LIKE)]))
    return best + _LIKE - 1 if scores[best] > lasting + _BETTER else None


def place(past: Sequence[Shape], age: int, phase: int, degree: int) -> Float:
    """Return where (2,) the origin is at an age: as far from where it was at a phase of its gait as it goes meanwhile.

    Without a gait (phase < 0) it goes on as of late: a polynomial.
    """
    if phase >= 0 and degree:
        again = recalled(past)
        if again is not None:
            pairs = [(past[-1 - k], past[again - k]) for k in range(_LIKE)]
            pace = np.mean([(one.at - other.at) / (one.age - other.age) for one, other in pairs], axis=0)
            then = past[nearest(past, phase)]
            return np.asarray(then.at + pace * (age - then.age), np.float64)
    late = past[-_LATE:]
    ages = np.array([one.age - late[-1].age for one in late], np.float64)
    line = np.linalg.lstsq(np.vander(ages, degree + 1), np.stack([one.at for one in late]), rcond=None)[0]
    off = past[-1].at - line[-1]
    return np.asarray((np.vander([float(age - late[-1].age)], degree + 1) @ line)[0] + off, np.float64)


def following(past: Sequence[Shape], age: int) -> int:
    """Return the age that comes after one; after the last one, that after what was most like it."""
    if age < past[-1].age:
        return age + 1
    again = recalled(past)
    return age if again is None else past[again].age + 1


def nearest(past: Sequence[Shape], age: int) -> int:
    """Return which shape was seen nearest to an age."""
    return int(np.argmin([abs(one.age - age) for one in past]))


def drawn(one: Shape) -> Float:
    """Return μ (h, w) of a shape that was seen once."""
    return levelset.redistance(levelset.signed_distance(one.bits))


def _small(bits: Bits, scale: float) -> Bits:
    to = _SIDE / scale
    there = np.array(
        [
            [to, 0, (_SIDE - 1) / 2 - to * (bits.shape[1] - 1) / 2],
            [0, to, (_SIDE - 1) / 2 - to * (bits.shape[0] - 1) / 2],
        ]
    )
    found = cv2.warpAffine(bits.astype(np.float32), there, (_SIDE, _SIDE), flags=cv2.INTER_LINEAR)
    return np.asarray(found > 0.5)

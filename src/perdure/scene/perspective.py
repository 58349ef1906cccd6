"""The ground estimated from people who walk on it: how high they look, against where they stand.

A camera of focal length f, h metres over the ground, looks down by the tilt t. Who stands at the row y (in focal
lengths below the middle) and is B metres high looks, in focal lengths,

    B s (cos t - y sin t) / (h - B s sin t)        s = y cos t + sin t

high: near the horizon (s = 0) a line with the slope B / h. In order:

1. rows of who is seen whole: inside the picture, upright, with nobody in front;
2. a plane through (x, y, height) that most rows agree with (RANSAC): horizon, roll, height over the ground;
3. tilt, roll and log h so that squared errors of log heights are least (Levenberg), rows weighed by how far they lie
   off (Tukey), every person with a height of her own near B (a random effect);
4. the covariance of the fit, and of what was assumed.

The focal length is told, or taken to be usual. Only the bending of the line tells it, which lenses and the habits of
detectors bend as much: it gives back wrong ones with great confidence. What hangs on it is how far apart rows are
along the view; sizes, and distances across it, hardly do.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import areas, intersections
from perdure.scene.ground import Ground, of_camera
from perdure.scene.lens import Float, Lens
from perdure.types import Boxes, Status, Tracks

USUAL, USUAL_SPREAD = 1.2, 0.35  # focal length in widths of the picture, and the deviation of its logarithm
BODY = 1.7  # m
_KNOWN_SPREAD = 0.01  # relative, of a focal length that is told
_BODY_SPREAD = 0.04  # relative, of how high people here are on the mean
_DEEP = 0.2  # m that a head is farther away than the nearer foot
_OWN = 0.08  # relative, of how high one is
_APART = 0.4  # s between rows of one person
_BORDER = 2.0  # px from the picture's border
_UPRIGHT = 1.3  # height / width, from which a box is somebody upright
_COVERED = 0.15  # of a box by one in front of it
_DRAWS, _AGREE = 300, 0.12  # of RANSAC, and the relative error of who agrees
_FLOOR = 0.04  # relative, of the errors: those of a person go together for longer than rows are apart
_TUKEY = 4.7  # deviations, beyond which a row counts nothing
_STEPS, _STEP = 40, 1e-5
_LEAST_PEOPLE, _LEAST_ROWS = 5, 40
_LEAST_SHARE = 0.45  # of rows that must agree
_LEAST_SLOPE = 5.0  # deviations of the slope from 0
_LARGEST_DOUBT = 0.3  # of the camera's log height, beside that of people
NOT_ENOUGH, FROM_ABOVE, UNLIKE = "not enough", "view from above: no scale from heights", "not of one kind"


class Estimate(NamedTuple):
    """What people tell of the ground."""

    ground: Ground | None  # None where the verdict says why
    verdict: str  # '' where there is a ground
    people: int
    rows: int
    scatter: float  # relative, of heights about the fit
    focal: float = 0.0  # px
    tilt: float = 0.0  # radians
    roll: float = 0.0
    height: float = 0.0  # m
    covariance: Float = np.zeros((4, 4))  # of log focal, tilt, roll, log height
    body: float = BODY


class _Seen(NamedTuple):
    """N rows of K people, seen whole."""

    x: Float  # (N,) px, of the foot, from the middle of the picture
    y: Float
    tall: Float  # (N,) px
    person: NDArray[np.intp]  # (N,) in 0 … K - 1


def estimate(rows: Tracks, size: tuple[int, int], *, body: float = BODY, focal: float | None = None) -> Estimate:
    """Estimate the ground from the rows of people who walk on it.

    Parameters
    ----------
    rows : Tracks
        Of a fixed camera; ids tell who is who.
    size : (int, int)
        Width and height of the picture.
    body : float
        Metres that they are high on the mean.
    focal : float or None
        Pixels, where it is known.
    """
    seen = _whole(rows, size)
    people, count = len(np.unique(seen.person)), len(seen.x)
    if people < _LEAST_PEOPLE or count < _LEAST_ROWS:
        why = f"{NOT_ENOUGH}: {people} upright people seen whole {count} times, {_LEAST_PEOPLE} and {_LEAST_ROWS} are needed"
        return Estimate(None, why, people, count, 0.0)
    line = _line(seen)
    agree = np.abs(_on(line, seen) / seen.tall - 1) < _AGREE
    scatter = float(np.median(np.abs(_on(line, seen) / seen.tall - 1))) * 1.4826
    if agree.mean() < _LEAST_SHARE:
        why = f"{UNLIKE}: no line of heights has more than {100 * agree.mean():.0f} % of them"
        return Estimate(None, why, people, count, scatter)
    if line[1] <= 0 or not _grows(seen, agree):
        return Estimate(None, FROM_ABOVE, people, count, scatter)
    fit = _fitted(seen, _start(line, size, body, focal), body)
    doubt = float(np.sqrt(fit.covariance[2, 2]))
    if not fit.sound or doubt > _LARGEST_DOUBT:
        why = f"{NOT_ENOUGH}: they stand at too few distances from the camera"
        return Estimate(None, why, people, count, fit.scatter)
    spread = _KNOWN_SPREAD if focal else USUAL_SPREAD
    along = _along_focal(seen, fit, body, spread)
    covariance = spread**2 * np.outer(along, along)
    covariance[1:, 1:] += fit.covariance
    covariance[3, 3] += _BODY_SPREAD**2
    log_focal, tilt, roll, log_height = fit.values.tolist()
    lens = Lens(np.full(2, np.exp(log_focal)), np.array(size) / 2, np.zeros(5))
    height = float(np.exp(log_height))
    ground = of_camera(lens, height, tilt, roll, size, covariance=covariance, origin="video")
    return Estimate(
        replace(ground, body=body),
        "",
        people,
        count,
        fit.scatter,
        float(np.exp(log_focal)),
        tilt,
        roll,
        height,
        covariance,
        body,
    )


def _whole(rows: Tracks, size: tuple[int, int]) -> _Seen:
    """The rows of who is seen whole, at most one every `_APART` seconds of each person."""
    boxes = rows.boxes
    wide, tall = (boxes[:, 2:] - boxes[:, :2]).T
    inside = (boxes[:, :2] > _BORDER).all(axis=1) & (boxes[:, 2:] < np.array(size) - _BORDER).all(axis=1)
    kept = (rows.status == Status.VISIBLE) & inside & (tall >= _UPRIGHT * wide) & (wide > 0) & (rows.ids > 0)
    last: dict[int, float] = {}
    chosen = []
    order = np.argsort(rows.frames, kind="stable")
    begins = np.flatnonzero(np.append(True, np.diff(rows.frames[order]) != 0)[: len(order)])
    for here in np.split(order, begins[1:]):
        due = [
            i for i in here.tolist() if kept[i] and rows.times[i] - last.get(int(rows.ids[i]), -np.inf) >= _APART
        ]
        if due:
            free = ~_behind(boxes[due], boxes[here])
            for i in np.array(due)[free].tolist():
                last[int(rows.ids[i])] = float(rows.times[i])
                chosen.append(i)
    index = np.array(chosen, np.intp)
    x = (boxes[index, 0].astype(np.float64) + boxes[index, 2]) / 2 - size[0] / 2
    _, person = np.unique(rows.ids[index], return_inverse=True)
    return _Seen(x, boxes[index, 3].astype(np.float64) - size[1] / 2, tall[index].astype(np.float64), person)


def _behind(boxes: Boxes, others: Boxes) -> NDArray[np.bool_]:
    """Which boxes (N, 4) are covered by one of the others that stands nearer."""
    covered = intersections(boxes, others) / np.maximum(areas(boxes), 1.0)[:, None]
    return np.asarray((covered * (others[:, 3] > boxes[:, 3, None])).max(axis=1, initial=0.0) > _COVERED)


# The line ---------------------------------------------------------------------------------------------------


def _line(seen: _Seen) -> Float:
    """Heights a + b y + c x (3,) that most rows agree with; refitted to those."""
    design = np.stack([np.ones_like(seen.x), seen.y, seen.x], axis=1)
    generator = np.random.default_rng(0)
    best: Float = np.zeros(3)
    most = -1
    for _ in range(_DRAWS):
        three = generator.choice(len(design), 3, replace=False)
        if abs(np.linalg.det(design[three])) < 1.0:
            continue
        line = np.linalg.solve(design[three], seen.tall[three])
        count = int((np.abs(design @ line / seen.tall - 1) < _AGREE).sum())
        best, most = (np.asarray(line, np.float64), count) if count > most else (best, most)
    for _ in range(5):
        agree = np.abs(design @ best / seen.tall - 1) < _AGREE
        if agree.sum() < 3:
            break
        weight = 1 / seen.tall[agree]  # errors are relative
        best = np.asarray(
            np.linalg.lstsq(design[agree] * weight[:, None], seen.tall[agree] * weight, rcond=None)[0]
        )
    return best


def _on(line: Float, seen: _Seen) -> Float:
    return np.asarray(line[0] + line[1] * seen.y + line[2] * seen.x)


def _grows(seen: _Seen, agree: NDArray[np.bool_]) -> bool:
    """Whether heights grow downwards beyond doubt, counted by people, not by rows."""
    y, tall, person = seen.y[agree], seen.tall[agree], seen.person[agree]
    if len(y) < _LEAST_ROWS // 2:
        return False
    off = y - y.mean()
    slope = float(off @ tall) / max(float(off @ off), 1e-9)
    left = (tall - tall.mean() - slope * off) * off
    spread = float(np.sqrt((np.bincount(person, left) ** 2).sum())) / max(float(off @ off), 1e-9)
    return slope > _LEAST_SLOPE * spread


def _start(line: Float, size: tuple[int, int], body: float, focal: float | None) -> Float:
    """Log focal, tilt, roll, log height (4,) of the line."""
    length = float(np.hypot(line[1], line[2]))
    far = focal or USUAL * size[0]
    tilt = np.arctan2(line[0] / length, far)
    return np.array([np.log(far), tilt, np.arctan2(line[2], line[1]), np.log(body / length)])


# The camera -------------------------------------------------------------------------------------------------


class _Fit(NamedTuple):
    values: Float  # (4,) log focal, tilt, roll, log height
    covariance: Float  # (3, 3) of the last three, for this focal length
    scatter: float
    sound: bool


def log_heights(values: Float, x: Float, y: Float, body: float) -> Float:
    """Return the log heights in pixels (N,) at which people who stand at x, y (px from the middle) look; NaN above the horizon."""
    focal, tilt, roll, height = np.exp(values[0]), values[1], values[2], np.exp(values[3])
    up = np.array([-np.sin(roll) * np.cos(tilt), -np.cos(roll) * np.cos(tilt), -np.sin(tilt)])
    ray = np.stack([x / focal, y / focal, np.ones_like(x)], axis=1)
    with np.errstate(all="ignore"):
        foot = height * ray / -(ray @ up)[:, None]
        ahead = foot + height * up  # on the ground, from beneath the camera
        head = foot + body * up + _DEEP * ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
        tall = y - focal * head[:, 1] / np.where(head[:, 2] > 0, head[:, 2], np.nan)
        return np.where((ray @ up < 0) & (tall > 0), np.log(tall), np.nan)


def _fitted(seen: _Seen, start: Float, body: float) -> _Fit:
    """Tilt, roll and height for a focal length: Levenberg's steps, people's own heights eliminated."""
    count = int(seen.person.max()) + 1
    values, damping, own = start.copy(), 1e-3, np.zeros(count)
    normal, scatter = np.eye(3), 1.0
    for _ in range(_STEPS):
        left = np.log(seen.tall) - log_heights(values, seen.x, seen.y, body)
        there = np.isfinite(left)
        if there.sum() < _LEAST_ROWS // 2:
            return _Fit(values, np.eye(3), scatter, sound=False)
        off = np.where(there, left - own[seen.person], 0.0)
        scatter = float(np.median(np.abs(off[there]))) * 1.4826
        doubt = max(scatter, _FLOOR)
        weight = np.where(there, np.maximum(1 - (off / (_TUKEY * doubt)) ** 2, 0.0) ** 2, 0.0) / doubt**2
        left = np.where(there, left, 0.0)
        slopes = np.nan_to_num(_slopes(values, seen, body))  # (N, 3)
        mass = np.bincount(seen.person, weight, count) + 1 / _OWN**2  # (K,)
        shared = np.stack([np.bincount(seen.person, weight * one, count) for one in slopes.T])  # (3, K)
        known = np.bincount(seen.person, weight * left, count)  # (K,)
        normal = (slopes * weight[:, None]).T @ slopes - (shared / mass) @ shared.T
        right = (slopes * weight[:, None]).T @ left - (shared / mass) @ known
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)) + 1e-9 * np.eye(3), right)
        step = step * min(1.0, 0.2 / max(float(np.abs(step).max()), 1e-12))
        values[1:] += step
        own = (known - shared.T @ step) / mass
        damping = max(damping / 3, 1e-9)
        if np.abs(step).max() < 1e-7:
            break
    sound = bool(np.isfinite(values).all() and -0.3 < values[1] < 1.4 and abs(values[2]) < 0.6)
    return _Fit(values, np.asarray(np.linalg.pinv(normal), np.float64), scatter, sound)


def _slopes(values: Float, seen: _Seen, body: float) -> Float:
    """How the predicted log heights (N, 3) move with tilt, roll and log height."""
    steps = _STEP * np.eye(4)[1:]
    return np.stack(
        [
            (log_heights(values + one, seen.x, seen.y, body) - log_heights(values - one, seen.x, seen.y, body))
            / (2 * _STEP)
            for one in steps
        ],
        axis=1,
    )


def _along_focal(seen: _Seen, fit: _Fit, body: float, spread: float) -> Float:
    """How log focal, tilt, roll and log height (4,) go together where the focal length is another."""
    off = 0.5 * min(spread, 0.4)
    ends = [_fitted(seen, _other_focal(fit.values, side * off), body).values for side in (1.0, -1.0)]
    return np.asarray((ends[0] - ends[1]) / (2 * off), np.float64)


def _other_focal(values: Float, off: float) -> Float:
    """Where to begin with another focal length: the horizon stays."""
    return np.array([values[0] + off, np.arctan(np.tan(values[1]) * np.exp(-off)), *values[2:]])

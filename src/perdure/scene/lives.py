"""What is known of each target's life: where it was, how it moved, how steadily it was seen (IV.D).

A `Life` is what interpretation rests on: beliefs measure it, scenarios ask it. It grows row by row from what a tracker
says, of any tracker, and holds the last `KEPT` seconds; what is older lives on in sums.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from perdure.types import Renamed, Status, Tracks

KEPT = 60.0  # s of a path that are remembered
PACE_OVER = 0.5  # s over which a speed is averaged
_LEAST_PACE = 0.3  # s, from which there is a speed
_STEP = 0.25  # of its own size, beyond which a move counts as way, and is no jitter
_RECENT = 1.0  # s over which a size is averaged
FRAME, TIME, X, Y, WIDTH, HEIGHT, SEEN, METRES_X, METRES_Y, SPEED = range(10)  # columns of a path
_NONE = np.zeros((0, 10))
Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Life:
    """One target's life so far.

    Parameters
    ----------
    id : int
    path : (T, 10) float64
        Frame, time in s, foot x and y in px, width and height in px, 1 where it was seen, place on the ground in m, speed
        in m/s; NaN where the ground is not known.
    origin, anchor : (2,) float64
        Its middle where it was first seen, and from which its next step of way counts.
    first, born : int, float
        Frame and second in which it was first seen.
    way, reach : float
        Length of its way, and its greatest distance from the origin, px.
    area, restless, compared : float
        Of the last two rows in which it was seen whole: the area; the sum and the number of changes of its logarithm.
    seen, frames : int
        In how many frames it was seen, of how many since it was.
    labels, votes : tuple of str, tuple of float
        What the detector called it, and how often.
    gone : bool
        Whether it has left or is lost for good.
    """

    id: int
    path: Float
    origin: Float
    anchor: Float
    first: int
    born: float
    way: float = 0.0
    reach: float = 0.0
    area: float = 0.0
    restless: float = 0.0
    compared: int = 0
    seen: int = 0
    frames: int = 0
    labels: tuple[str, ...] = ()
    votes: tuple[float, ...] = ()
    gone: bool = False

    @cached_property
    def last(self) -> Float:
        """The newest row (10,) of its path."""
        return np.asarray(self.path[-1])

    def since(self, time: float) -> Float:
        """Return the rows (T, 10) of its path from a time on."""
        return self.path[np.searchsorted(self.path[:, TIME], time - 1e-9) :]

    @cached_property
    def size(self) -> tuple[float, float]:
        """Its width and height lately, px."""
        lately = self.since(self.last[TIME] - _RECENT)
        width, height = np.median(lately[:, (WIDTH, HEIGHT)], axis=0)
        return max(float(width), 1.0), max(float(height), 1.0)

    @property
    def scale(self) -> float:
        """The root of its area, px."""
        return math.sqrt(math.prod(self.size))

    @property
    def age(self) -> float:
        """For how long it has been there, s."""
        return float(self.last[TIME]) - self.born

    @cached_property
    def area_now(self) -> float:
        """The area of its newest box, px."""
        return float(self.last[WIDTH] * self.last[HEIGHT])

    @cached_property
    def moving(self) -> Float:
        """Its speed (2,) in px/s, of the line through the last half second; NaN before there is one."""
        lately = self.since(self.last[TIME] - PACE_OVER)
        lately = lately[lately[:, SEEN] > 0]
        if len(lately) < 2 or lately[-1, TIME] - lately[0, TIME] < _LEAST_PACE - 1e-9:
            return np.full(2, np.nan)
        off = lately[:, (TIME, X, Y)] - lately[:, (TIME, X, Y)].mean(axis=0)
        return np.asarray(off[:, 0] @ off[:, 1:] / (off[:, 0] @ off[:, 0]))

    def pace(self) -> float:
        """Return its speed in own heights a second; NaN before there is one."""
        return float(np.hypot(*self.moving)) / self.size[1]

    def speed(self) -> float:
        """Return its speed in m/s, where the ground is known; NaN elsewhere."""
        return float(self.last[SPEED])

    def roamed(self, over: float) -> float:
        """Return its greatest distance within `over` seconds from its mean place, own heights; NaN while it is younger."""
        if self.age < over - 1e-9:
            return math.nan
        lately = self.since(self.last[TIME] - over)[:, (X, Y)]
        away = np.hypot(*(lately - lately.mean(axis=0)).T)
        return float(away.max()) / self.size[1]


def noted(lives: Mapping[int, Life], rows: Tracks) -> dict[int, Life]:
    """Return the lives after some rows: those of a frame, or such as were said late of one whose life begins with them.

    Rows that are LOST, inferred ones before a target was seen, and rows not newer than what is known tell nothing.
    """
    after = dict(lives)
    order = np.lexsort((rows.ids, rows.frames))
    for row in order[rows.status[order] != Status.LOST].tolist():
        identity, frame = int(rows.ids[row]), int(rows.frames[row])
        known = after.get(identity)
        if known is None:
            if rows.inferred[row]:
                continue
            known = _begun(rows, row)
        elif known.path[-1, FRAME] >= frame:
            continue
        after[identity] = _grown(known, rows, row)
    return after


def passed(lives: Mapping[int, Life], ended: Iterable[int], time: float) -> dict[int, Life]:
    """Return the lives after a frame: one frame older, those in `ended` gone; who has been gone for long is forgotten."""
    ends = set(ended)
    return {
        one: dataclasses.replace(
            life, frames=life.frames + (not life.gone), gone=(life.gone or one in ends) and life.last[TIME] < time
        )
        for one, life in lives.items()
        if life.last[TIME] >= time - KEPT
    }


def renamed(lives: Mapping[int, Life], corrections: Sequence[Renamed]) -> dict[int, Life]:
    """Return the lives after one report's corrections: what they name goes from one life to another, all at once."""
    if not corrections:
        return dict(lives)
    parts: dict[int, list[tuple[Life, Float]]] = {}
    for one, life in lives.items():
        rest = np.ones(len(life.path), np.bool_)
        for correction in corrections:
            if correction.old == one:
                frames = life.path[:, FRAME]
                moved = rest & (frames >= correction.begin) & (frames <= correction.end)
                rest &= ~moved
                if moved.any():
                    parts.setdefault(correction.new, []).append((life, life.path[moved]))
        if rest.any():
            parts.setdefault(one, []).append((life, life.path[rest]))
    return {one: _joined(one, some) for one, some in parts.items()}


def _joined(identity: int, parts: Sequence[tuple[Life, Float]]) -> Life:
    """One life of pieces of several: sums are those of the pieces, by their share of what they were measured over."""
    if len(parts) == 1 and parts[0][0].id == identity and len(parts[0][1]) == len(parts[0][0].path):
        return parts[0][0]
    path = np.concatenate([piece for _, piece in parts])
    path = path[
        np.unique(path[:, FRAME], return_index=True)[1]
    ]  # of two rows of a frame the first: its own come later
    oldest = min((life for life, _ in parts), key=lambda one: one.first)
    newest = max(parts, key=lambda one: one[1][-1, FRAME])[0]
    votes: dict[str, float] = {}
    for life, piece in parts:
        for label, vote in zip(life.labels, life.votes, strict=True):
            votes[label] = votes.get(label, 0.0) + vote * len(piece) / len(life.path)
    shares = [(life, len(piece) / len(life.path)) for life, piece in parts]
    middles = path[:, (X, Y)] - np.column_stack([np.zeros(len(path)), path[:, HEIGHT] / 2])
    return Life(
        identity,
        path,
        oldest.origin,
        newest.anchor,
        min(oldest.first, int(path[0, FRAME])),
        min(oldest.born, float(path[0, TIME])),
        sum(life.way * share for life, share in shares),
        float(np.hypot(*(middles - oldest.origin).T).max()),
        newest.area,
        sum(life.restless * share for life, share in shares),
        round(sum(life.compared * share for life, share in shares)),
        round(sum(life.seen * share for life, share in shares)),
        max(round(sum(life.frames * share for life, share in shares)), 1),
        tuple(votes),
        tuple(votes.values()),
        newest.gone,
    )


def _begun(rows: Tracks, row: int) -> Life:
    middle = _middle(rows, row)
    return Life(int(rows.ids[row]), _NONE, middle, middle, int(rows.frames[row]), float(rows.times[row]))


def _grown(life: Life, rows: Tracks, row: int) -> Life:
    """A life and one more row."""
    x1, y1, x2, y2 = (float(side) for side in rows.boxes[row])
    seen, ground = not rows.inferred[row], rows.ground[row]
    metres = (
        (np.nan,) * 3 if ground is None else (ground.x, ground.y, np.nan if ground.speed is None else ground.speed)
    )
    here = [rows.frames[row], rows.times[row], (x1 + x2) / 2, y2, x2 - x1, y2 - y1, float(seen), *metres]
    path = np.concatenate([life.path[life.path[:, TIME] > rows.times[row] - KEPT], [here]])
    middle = _middle(rows, row)
    changes: dict[str, object] = {"path": path, "gone": False}
    step, scale = float(np.hypot(*(middle - life.anchor))), math.sqrt(max((x2 - x1) * (y2 - y1), 1.0))
    if step > _STEP * scale:
        changes |= {"way": life.way + step, "anchor": middle}
    changes["reach"] = max(life.reach, float(np.hypot(*(middle - life.origin))))
    if seen:
        changes |= _steadiness(life, rows, row)
        changes["seen"] = life.seen + 1
    if label := str(rows.classes[row]):
        votes = dict(zip(life.labels, life.votes, strict=True))
        votes[label] = votes.get(label, 0.0) + 1.0
        changes |= {"labels": tuple(votes), "votes": tuple(votes.values())}
    return dataclasses.replace(life, **changes)  # type: ignore[arg-type]


def _steadiness(life: Life, rows: Tracks, row: int) -> dict[str, float]:
    """How much the area changed between two frames, one after the other, in which it was seen whole."""
    if rows.status[row] != Status.VISIBLE:
        return {"area": 0.0}
    bits = rows.masks[row].area
    area = float(bits) if bits else float(np.prod(rows.boxes[row, 2:] - rows.boxes[row, :2]))
    if life.area <= 0 or area <= 0:
        return {"area": area}
    change = abs(math.log(area / life.area))
    return {"area": area, "restless": life.restless + change, "compared": life.compared + 1}


def _middle(rows: Tracks, row: int) -> Float:
    x1, y1, x2, y2 = rows.boxes[row].astype(np.float64)
    return np.array([(x1 + x2) / 2, (y1 + y2) / 2])

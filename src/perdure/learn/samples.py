"""Films with their truths in, pairs of seen things out, each with how alike it is in every feature (section 3)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import overlaps
from perdure.features.feature import Feature, Memory
from perdure.features.pool import POOL
from perdure.features.pool import known as known_rows
from perdure.learn.learning import Learning
from perdure.maths.assign import assign
from perdure.scene.measuring import Measures, Measuring, measure, measures_of
from perdure.scene.measuring import start as start_measuring
from perdure.types import Frame, Regions, Rows, Scene, Use

Float = NDArray[np.float64]
Bits = NDArray[np.bool_]
NEAR = "displacement_2d"  # the feature that gates pairs
LEAST_OVERLAP = 0.5  # of a detection with the truth that it is
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


class Film(NamedTuple):
    """Frames with what was detected in them, or with nothing where the truth's own boxes are taken."""

    name: str
    seen: Iterable[tuple[Frame, Regions]]
    truth: Rows
    scene: Scene
    detected: bool


@dataclass(frozen=True, eq=False)
class Samples:
    """Pairs, and how alike they are in each feature of the pool."""

    similarities: Float  # (N, K)
    known: Bits  # (N, K)
    labels: NDArray[np.int8]  # (N,) +1 the same, -1 different
    weights: Float  # (N,) how many pairs of the films each stands for

    @property
    def same(self) -> Bits:
        """Which are pairs of one object (N,)."""
        return np.asarray(self.labels > 0)


class _Kept(NamedTuple):
    """Pairs of one kind, thinned to a share whenever they become too many."""

    similarities: tuple[Float, ...]  # blocks (n, K); NaN where not known
    lots: tuple[Float, ...]  # blocks (n,) in [0, 1): kept are those below the rate
    seen: int
    rate: float

    @staticmethod
    def none() -> _Kept:
        return _Kept((), (), 0, 1.0)

    def lots_of(self, count: int) -> Float:
        """Lots (count,) of the next pairs: evenly spread, and the same in every run."""
        return np.asarray((np.arange(self.seen + 1, self.seen + 1 + count) * _GOLDEN) % 1.0)

    def with_pairs(self, similarities: Float, lots: Float, seen: int, most: int) -> _Kept:
        blocks, all_lots, rate = (*self.similarities, similarities), (*self.lots, lots), self.rate
        if sum(map(len, all_lots)) > most:
            rate = rate / 2
            joined, drawn = np.concatenate(blocks), np.concatenate(all_lots)
            blocks, all_lots = (joined[drawn < rate],), (drawn[drawn < rate],)
        return _Kept(blocks, all_lots, self.seen + seen, rate)


class Drawn(NamedTuple):
    """The pairs drawn so far, different and same."""

    kinds: tuple[_Kept, ...]

    @staticmethod
    def none() -> Drawn:
        """Return no pairs yet."""
        return Drawn((_Kept.none(),) * 2)

    def samples(self) -> Samples:
        """Return all of them in columns."""
        empty = np.zeros((0, len(POOL)))
        rows = [np.concatenate([empty, *kind.similarities]) for kind in self.kinds]  # (N, K) each
        labels = [np.full(len(one), label, np.int8) for one, label in zip(rows, (-1, 1), strict=True)]
        weights = [np.full(len(one), 1 / kind.rate) for one, kind in zip(rows, self.kinds, strict=True)]
        joined = np.concatenate(rows)
        known = np.isfinite(joined)
        return Samples(np.where(known, joined, 0.0), known, np.concatenate(labels), np.concatenate(weights))


class _Seen(NamedTuple):
    """The objects of a frame, described."""

    time: float
    ids: NDArray[np.int64]  # (N,) of the truth; 0 for a false detection
    rows: Mapping[str, NDArray[np.float32]]  # by feature (N, ...)
    speeds: Mapping[str, Float]  # of those that move (N, 2), a second


def watch(film: Film, learning: Learning, drawn: Drawn) -> tuple[Drawn, Measures]:
    """Draw pairs from a film, beside those drawn so far, and measure it."""
    features = {name: make(film.scene) for name, make in POOL.items()}
    memories = {name: feature.start(film.scene) for name, feature in features.items()}
    trails = _Trails.none()
    window: deque[_Seen] = deque()
    state: Measuring = start_measuring()
    for number, (frame, found, ids) in enumerate(_objects(film, learning.least_score), 1):
        state = measure(state, frame, found, film.scene, math.inf)
        memories, rows = _described(features, memories, frame, found)
        trails, speeds = trails.after(frame.time, ids, _places(features, rows), learning.carried)
        now = _Seen(frame.time, ids, rows, speeds)
        while len(window) > 1 and now.time - window[0].time > learning.gap:
            window.popleft()
        for then in _earlier(window, number, learning):
            drawn = _pairs(then, now, features, learning, drawn)
        window.append(now)
    return drawn, measures_of(state, film.scene)


def _objects(film: Film, least: float) -> Iterator[tuple[Frame, Regions, NDArray[np.int64]]]:
    """Yield every frame that the truth spans, with what is seen in it and whose it is (N,), 0 for nobody's."""
    truth = film.truth
    frames = np.unique(truth.frames)
    starts = dict(zip(frames.tolist(), np.searchsorted(truth.frames, frames, "left").tolist(), strict=True))
    ends = dict(zip(frames.tolist(), np.searchsorted(truth.frames, frames, "right").tolist(), strict=True))
    for frame, regions in film.seen:
        if not len(frames) or not frames[0] <= frame.index <= frames[-1]:
            continue
        rows = slice(starts.get(frame.index, 0), ends.get(frame.index, 0))
        boxes, scored = truth.boxes[rows].astype(np.float32), truth.use[rows] == Use.SCORED
        ids = np.where(scored, truth.ids[rows], -1)
        if film.detected:
            yield frame, *_whose(regions.take(regions.scores >= least), boxes, ids)
        else:
            yield frame, Regions.of(boxes[scored]), ids[scored]


def _whose(
    regions: Regions, boxes: NDArray[np.float32], ids: NDArray[np.int64]
) -> tuple[Regions, NDArray[np.int64]]:
    """The regions without those on what the truth does not ask for, and whose they are."""
    shared = overlaps(regions.boxes, boxes)
    pairs = assign(np.where(shared >= LEAST_OVERLAP, 1.0 - shared, np.inf)).pairs
    found = np.zeros(len(regions), np.int64)
    found[pairs[:, 0]] = ids[pairs[:, 1]]
    return regions.take(found >= 0), found[found >= 0]


def _described(
    features: Mapping[str, Feature], memories: Mapping[str, Memory], frame: Frame, regions: Regions
) -> tuple[dict[str, Memory], dict[str, NDArray[np.float32]]]:
    """Rows of every feature that can tell anything of the frame."""
    carried, rows = dict(memories), {}
    for name, feature in features.items():
        if frame.image is not None or not feature.needs_pixels:
            carried[name], rows[name] = feature.describe(memories[name], frame, regions)
    return carried, rows


def _places(features: Mapping[str, Feature], rows: Mapping[str, NDArray[np.float32]]) -> dict[str, Float]:
    """Where things are (N, 2) by the features that tell it: their first two numbers."""
    return {name: one[:, :2].astype(np.float64) for name, one in rows.items() if features[name].moves}


def _earlier(window: deque[_Seen], number: int, learning: Learning) -> Iterator[_Seen]:
    """Yield the frame before, and one that is farther back: near ones oftener, the same in every run."""
    if window:
        yield window[-1]
    if learning.gap > 0 and len(window) > 1:
        back = round(2.0 * (len(window) / 2.0) ** ((number * _GOLDEN) % 1.0))
        yield window[-min(max(back, 2), len(window))]


def _pairs(then: _Seen, now: _Seen, features: Mapping[str, Feature], learning: Learning, drawn: Drawn) -> Drawn:
    """Draw the pairs of two frames: of an object and of two; of two false detections nobody knows."""
    told = (then.ids[:, None] > 0) | (now.ids > 0)
    one, other = np.nonzero(told)  # (P,)
    elapsed = np.full(len(one), max(now.time - then.time, 1e-6), np.float32)
    if learning.gated and len(one):
        near = _similarities(NEAR, features[NEAR], then, now, one, other, elapsed)
        kept = near > 0  # NaN is not near either
        one, other, elapsed = one[kept], other[kept], elapsed[kept]
    same = then.ids[one] == now.ids[other]
    kinds = []
    for kind, wanted in zip(drawn.kinds, (~same, same), strict=True):
        lots = kind.lots_of(int(wanted.sum()))
        places = np.flatnonzero(wanted)[lots < kind.rate]
        given = then, now, one[places], other[places], elapsed[places]
        columns = [_similarities(name, feature, *given) for name, feature in features.items()]
        found = np.stack(columns, axis=1)  # (P, K)
        kinds.append(kind.with_pairs(found, lots[lots < kind.rate], len(lots), learning.most // 2))
    return Drawn(tuple(kinds))


def _similarities(
    name: str,
    feature: Feature,
    then: _Seen,
    now: _Seen,
    one: NDArray[np.intp],
    other: NDArray[np.intp],
    elapsed: NDArray[np.float32],
) -> Float:
    """How alike pairs are in a feature (P,); NaN where it is not known of one."""
    if name not in then.rows or name not in now.rows or not len(one):
        return np.full(len(one), np.nan)
    before, after = then.rows[name][one], now.rows[name][other]
    there = known_rows(before) & known_rows(after)
    if feature.moves:
        before = before.copy()
        before[:, :2] += (then.speeds[name][one] * elapsed[:, None]).astype(np.float32)
    return np.where(there, feature.similarity(before, after, elapsed), np.nan).astype(np.float64)


class _Trails(NamedTuple):
    """Where each object was lately, by the features that tell it."""

    times: Mapping[int, tuple[float, ...]]
    places: Mapping[int, tuple[Mapping[str, Float], ...]]

    @staticmethod
    def none() -> _Trails:
        return _Trails({}, {})

    def after(
        self, time: float, ids: NDArray[np.int64], places: Mapping[str, Float], lasting: float
    ) -> tuple[_Trails, dict[str, Float]]:
        """The trails with a frame more, those older than `lasting` seconds cut; and each object's speed (N, 2).

        The speed is that of a line fitted with as much doubt as makes two places close in time tell little.
        """
        times, kept = dict(self.times), dict(self.places)
        speeds = {name: np.zeros((len(ids), 2)) for name in places}
        for row, identity in enumerate(ids.tolist()):
            if identity <= 0 or lasting <= 0:
                continue
            here = {name: one[row] for name, one in places.items()}
            since = [k for k, moment in enumerate(times.get(identity, ())) if time - moment <= lasting]
            times[identity] = (*(times[identity][k] for k in since), time)
            kept[identity] = (*(kept[identity][k] for k in since), here)
            off = np.array(times[identity]) - np.mean(times[identity])
            for name in places:
                way = np.stack([one[name] for one in kept[identity]])  # (n, 2)
                speeds[name][row] = off @ (way - way.mean(axis=0)) / (off @ off + lasting * lasting / 12.0)
        gone = [identity for identity, moments in times.items() if time - moments[-1] > lasting]
        for identity in gone:
            del times[identity], kept[identity]
        return _Trails(times, kept), speeds

"""Learn how things are told apart in a kind of scene: films with a truth in, a context out (section 3, eq. 11-14).

A sample is a pair of seen things, an earlier one and a later one: +1 if they are one object, -1 if not. Of each pair
every feature of the pool tells how alike the two are, and boosting weighs the features by how well they tell the kinds
of pairs apart (`perdure.maths.boost`).

The paper takes all pairs of consecutive frames, and one threshold for all features (`PAPER`). Where we depart, each by
a parameter: pairs also farther apart, as a tracker has them after a gap; only pairs that are near enough to be linked,
or else what is trivially different would swamp the rest; the earlier thing carried on by its own motion; a threshold
that each round chooses; both kinds of pairs weighing the same; similarities counted between the levels that are
usual for different and for same pairs.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure import params
from perdure.errors import ParameterError
from perdure.features import pool
from perdure.features.boxes import overlaps
from perdure.features.feature import Feature, Memory
from perdure.features.pool import POOL
from perdure.features.pool import known as known_rows
from perdure.maths.assign import assign
from perdure.maths.boost import Boosted, best_thresholds, boost_at, boost_stumps, errors_at, separation
from perdure.params import parameter
from perdure.scene.context import ON_GROUND, Alone, Context, Training
from perdure.scene.measuring import Measures, Measuring, measure, measures_of
from perdure.scene.measuring import start as start_measuring
from perdure.types import Frame, Regions, Rows, Scene, Use

Float = NDArray[np.float64]
Bits = NDArray[np.bool_]
NEAR = "displacement_2d"  # the feature that gates pairs
LEAST_OVERLAP = 0.5  # of a detection with the truth that it is
SPREAD = (0.05, 0.95)  # quantiles: levels are that of different pairs and that of same ones
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True)
class Learning:
    """How a context is learnt."""

    rounds: int = parameter(30, "rounds of boosting at most", low=1, high=10_000, symbol="Z")
    similar: float = parameter(
        0.0, "least similarity of what counts as the same, for all features; 0: learnt", low=0.0, high=1.0,
        symbol="Th1",
    )  # fmt: skip
    kept: float = parameter(
        0.98, "share of the same pairs that a learnt threshold lets be linked", low=0.5, high=1.0
    )
    gap: float = parameter(
        2.0, "how far apart two things of a pair may be seen; 0: in consecutive frames", unit="s", low=0.0,
        high=60.0, symbol="T2",
    )  # fmt: skip
    gated: bool = parameter(True, "only pairs that are near enough in the picture to be linked")
    carried: float = parameter(
        1.0, "for how long back a motion is fitted that carries on the earlier thing; 0: it stays", unit="s",
        low=0.0, high=60.0,
    )  # fmt: skip
    balanced: bool = parameter(True, "same and different pairs weigh the same on the whole")
    levels: bool = parameter(True, "similarities count between those usual for different and for same pairs")
    least_weight: float = parameter(
        0.05, "a feature that would weigh less is left out, and need not be computed", low=0.0, high=0.5
    )
    least_score: float = parameter(0.0, "detections of a lower score are left out", low=0.0, high=1.0)
    ours: bool = parameter(True, "features beyond the paper's eight may be chosen too")
    most: int = parameter(100_000, "pairs that are kept, half of them same ones", low=100, high=10_000_000)


PAPER = Learning(
    similar=0.5, gap=0.0, gated=False, carried=0.0, balanced=False, levels=False, least_weight=0.0, ours=False
)


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


class Learnt(NamedTuple):
    """A context, the samples that it was learnt from, and the rounds."""

    context: Context
    samples: Samples
    boosted: Boosted


def learn(films: Iterable[Film], learning: Learning | None = None, name: str = "learnt") -> Learnt:
    """Learn a context from films with their truths.

    Raises
    ------
    ParameterError
        If there is no pair of one object in all of them: nothing can be learnt.
    """
    learning = Learning() if learning is None else learning
    params.check(learning)
    drawn = _Drawn((_Kept.none(),) * 2)
    sources, measured = [], []
    for film in films:
        drawn, measures = _watch(film, learning, drawn)
        sources.append(film.name)
        measured.append(measures)
    samples = drawn.samples()
    _refuse_nothing(samples, sources)
    found = context_of(samples, learning, name)
    told = replace(found.context.training, sources=tuple(sources))
    context = replace(found.context, measures=_mean(measured), training=told)
    return found._replace(context=context)


def context_of(samples: Samples, learning: Learning, name: str) -> Learnt:
    """Learn a context from samples, of which some are of the same object."""
    boosted, notes = _boosted(samples, learning)
    names = tuple(POOL)
    heavy = boosted.weights >= min(max(learning.least_weight, 1e-12), float(boosted.weights.max()))
    rest = np.where(heavy, boosted.weights, 0.0) / boosted.weights[heavy].sum()
    weights = {one: float(weight) for one, weight in zip(names, rest, strict=True) if weight > 0}
    levels = _levels(samples, weights) if learning.levels else {}
    context = Context(name, weights, levels=levels)
    link, told = link_similarity(context, samples)
    similar = learning.similar
    if not similar:
        same = link[samples.same & told]
        similar = float(np.quantile(same, 1.0 - learning.kept)) if len(same) else 0.0
    training = Training(
        same=round(float(samples.weights[samples.same].sum())),
        different=round(float(samples.weights[~samples.same].sum())),
        separation=float(separation(link[:, None], told[:, None], samples.labels)[0]),
        notes=notes,
        options=params.values(learning),
        alone=_alone(samples, learning, boosted),
    )
    return Learnt(replace(context, similar=similar, training=training), samples, boosted)


def link_similarity(context: Context, samples: Samples) -> tuple[Float, Bits]:
    """Return LS (N,) of samples (eq. 10), over the features known of each, and where any is (N,)."""
    total, share = np.zeros(len(samples.labels)), np.zeros(len(samples.labels))
    for k, name in enumerate(POOL):
        weight = context.weights.get(name, 0.0)
        if weight > 0:
            there = samples.known[:, k]
            total += weight * np.where(there, context.levelled(name, samples.similarities[:, k]), 0.0)
            share += weight * there
    return np.divide(total, share, out=np.zeros_like(total), where=share > 0), np.asarray(share > 0)


# Boosting ---------------------------------------------------------------------------------------------------


def _initial(samples: Samples, learning: Learning) -> Float:
    """What each sample weighs at first (N,): as the films have them, or both kinds the same."""
    if not learning.balanced or samples.same.all():
        return samples.weights
    shares = np.where(samples.same, samples.weights[samples.same].sum(), samples.weights[~samples.same].sum())
    return np.asarray(samples.weights / shares)


def _boosted(samples: Samples, learning: Learning) -> tuple[Boosted, tuple[str, ...]]:
    """The rounds and weights; displacement alone where there is nothing to tell apart, and a note why."""
    if samples.same.all():
        return _by_displacement(samples), ("nothing else is near the objects: displacement alone",)
    allowed = np.array([learning.ours or name in pool.PAPER for name in POOL])
    known = samples.known & allowed
    given = samples.similarities, known, samples.labels, _initial(samples, learning), learning.rounds
    found = boost_at(learning.similar, *given) if learning.similar else boost_stumps(*given)
    if not found.rounds:
        return _by_displacement(samples), ("no feature tells the pairs apart: displacement alone",)
    return found, ()


def _by_displacement(samples: Samples) -> Boosted:
    """All weight on displacement: on the ground if that is known of half the pairs at least, else in the picture."""
    names = tuple(POOL)
    on_ground = samples.known[:, names.index(ON_GROUND)].mean() >= 0.5
    weights = np.zeros(len(names))
    weights[names.index(ON_GROUND if on_ground else NEAR)] = 1.0
    return Boosted((), weights)


def _levels(samples: Samples, weights: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """What is usual for different pairs and for same ones, of features that weigh anything and where it rises."""
    found = {}
    for k, name in enumerate(POOL):
        of_kind = [samples.similarities[samples.known[:, k] & kind, k] for kind in (~samples.same, samples.same)]
        if name in weights and all(len(one) for one in of_kind):
            low, high = (float(np.quantile(one, share)) for one, share in zip(of_kind, SPREAD, strict=True))
            if high - low > 1e-3:
                found[name] = (low, high)
    return found


def _alone(samples: Samples, learning: Learning, boosted: Boosted) -> dict[str, Alone]:
    """What each feature tells by itself, of those that are known of any pair."""
    given = samples.similarities, samples.known, samples.labels, _initial(samples, learning)
    if learning.similar:
        thresholds, errors = np.full(len(POOL), learning.similar), errors_at(learning.similar, *given)
    else:
        thresholds, errors = best_thresholds(*given)
    areas, shares = separation(*given[:3]), samples.known.mean(axis=0)
    chosen = np.bincount([one.feature for one in boosted.rounds], minlength=len(POOL))
    return {
        name: Alone(float(areas[k]), float(thresholds[k]), float(errors[k]), int(chosen[k]), float(shares[k]))
        for k, name in enumerate(POOL)
        if shares[k] > 0
    }


def _refuse_nothing(samples: Samples, sources: list[str]) -> None:
    if not samples.same.any():
        where = ", ".join(sources) or "no film"
        what = "no object is seen twice" if not len(samples.labels) else "no two things seen are the same object"
        raise ParameterError(
            f"nothing can be learnt from {where}: {what} near where it was; check that the truth and the detections "
            "are of this film, its frames and its size"
        )


def _mean(measured: list[Measures]) -> Measures:
    """What the films are like on the mean."""
    values: dict[str, float | bool | None] = {}
    for name in ("objects", "cover", "occlusion", "depth", "illumination", "contrast", "fps"):
        there = [value for one in measured if (value := getattr(one, name)) is not None]
        values[name] = sum(there) / len(there) if there else None
    flags = {name: all(getattr(one, name) for one in measured) for name in ("pictures", "ground")}
    return Measures(**values, **flags)  # type: ignore[arg-type]


# Samples ----------------------------------------------------------------------------------------------------


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


class _Drawn(NamedTuple):
    """The pairs drawn so far, different and same."""

    kinds: tuple[_Kept, ...]

    def samples(self) -> Samples:
        """All of them in columns."""
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


def _watch(film: Film, learning: Learning, drawn: _Drawn) -> tuple[_Drawn, Measures]:
    """Draw pairs from a film, and measure it."""
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


def _pairs(then: _Seen, now: _Seen, features: Mapping[str, Feature], learning: Learning, drawn: _Drawn) -> _Drawn:
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
    return _Drawn(tuple(kinds))


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

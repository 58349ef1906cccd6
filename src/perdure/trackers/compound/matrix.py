"""The ambiguity matrix: which regions may be which targets, and the knots of targets and regions that result (IV.B)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import areas, hull
from perdure.types import Boxes

Float = NDArray[np.float32]
Index = NDArray[np.intp]
Possible = Callable[[Index, Index], NDArray[np.bool_]]


class Thresholds(NamedTuple):
    """What makes a correspondence."""

    distance: float
    size_ratio: float  # of areas
    second_distance: float  # of regions of low score
    sure: float  # score of a region that may be any target
    least: float  # score of a region that is looked at a second time
    share: float  # of a region in a target, or a target in a region, that makes one part of the other
    gain: float  # in distance, that a union must bring
    near: float  # distance that a union may have at most


class Knot(NamedTuple):
    """Targets and regions that belong together: a connected component of correspondences."""

    rows: tuple[int, ...]
    regions: tuple[int, ...]


class Matched(NamedTuple):
    """What the matrix says of a frame."""

    pairs: Index  # (K, 2) row of the target, region: visible targets
    knots: tuple[Knot, ...]  # ambiguous ones


def distances(regions: Boxes, targets: Boxes) -> Float:
    """Return the distance (R, T) of regions (R, 4) from targets (T, 4) (IV.B).

    1 - intersection / union where they intersect, else 1 + distance of the centres / the larger side of both: in
    [0, inf).
    """
    from perdure.maths.kernels.overlaps import distances as kernel

    return kernel(regions, targets)


class Near(NamedTuple):
    """Regions and targets that are close enough to correspond: K entries of the ambiguity matrix."""

    region: Index  # (K,)
    target: Index  # (K,)
    distance: Float  # (K,)
    alike: NDArray[np.bool_]  # (K,) of similar size


def near(regions: Boxes, targets: Boxes, farthest: float, size_ratio: float) -> Near:
    """Return the entries of the matrix with distances below `farthest`, and which are of similar size (IV.B).

    An entry of similar size is a correspondence. The thresholds are large on purpose. A region that is one piece of a
    target, or a target that is one member of a merged region, fails the test of size against the whole; `match` finds
    those by testing unions.
    """
    if farthest <= 1:  # only boxes that touch need to be looked at
        from perdure.maths.kernels.overlaps import nearby

        return Near(*nearby(regions, targets, farthest, size_ratio))
    every = distances(regions, targets)
    region, target = np.nonzero(every < farthest)
    one, other = areas(regions)[region], areas(targets)[target]
    alike = np.maximum(one, other) <= size_ratio * np.maximum(np.minimum(one, other), 1e-6)
    return Near(region, target, every[region, target], alike)


class Place(NamedTuple):
    """What zones change in the matrix."""

    reach: NDArray[np.float64]  # (T,) times the distance up to which a region may be the target
    forbidden: NDArray[np.bool_]  # (T, R) what a rule forbids


def match(
    regions: Boxes,
    scores: Float,
    targets: Boxes,
    whole: NDArray[np.bool_],
    cost: Float,
    limits: Thresholds,
    possible: Possible | None = None,
    place: Place | None = None,
) -> Matched:
    """Find visible, ambiguous and lost targets.

    Parameters
    ----------
    regions : (R, 4)
        Boxes.
    scores : (R,)
        Regions of low score are looked at a second time, for targets that found nothing.
    targets : (T, 4)
        Predicted boxes.
    whole : (T,) bool
        Temporary targets that stand for several: no test of size.
    cost : (T,)
        Added to the distance of targets that should come second.
    limits : Thresholds
        What makes a correspondence.
    possible : function or None
        Of rows of regions (K,) and of targets (K,): which pairs may correspond, for all that is known of the place.
    place : Place or None
        What zones change.
    """
    sure = scores >= limits.sure
    weak = (scores >= limits.least) & ~sure
    farthest = limits.distance if place is None else limits.distance * float(place.reach.max(initial=1.0))
    entries = near(regions, targets, farthest, limits.size_ratio)
    allowed = entries.alike | whole[entries.target]
    if possible is not None:
        allowed &= whole[entries.target] | possible(entries.region, entries.target)
    if place is not None:
        allowed &= entries.distance < limits.distance * place.reach[entries.target]
        allowed &= ~place.forbidden[entries.target, entries.region]
    worth = entries.distance + cost[entries.target]
    taken = np.full(len(regions), -1, np.intp)  # target of each region
    _one_to_one(taken, entries, worth, allowed & sure[entries.region], farthest + 1)
    if weak.any():
        late = allowed & weak[entries.region] & (entries.distance < limits.second_distance)
        _one_to_one(taken, entries, worth, late & ~np.isin(entries.target, taken[taken >= 0]), farthest + 1)
    edges = [
        *_merges(regions, targets, taken, limits),
        *_splits(regions, sure, targets, whole, taken, limits),
    ]
    if place is not None:
        edges = [edge for edge in edges if not place.forbidden[edge]]
    return _knotted(taken, edges)


def _one_to_one(taken: Index, entries: Near, cost: Float, allowed: NDArray[np.bool_], limit: float) -> None:
    """Note in `taken` the target of each region: least sum, where a pair costs less than leaving both alone."""
    from perdure.maths.kernels.counts import uncontested

    region, target = entries.region[allowed], entries.target[allowed]
    if not len(region):
        return
    plain = uncontested(region, target)
    taken[region[plain]] = target[plain]
    if plain.all():
        return
    from scipy.optimize import linear_sum_assignment  # half a second to load; most scenes begin without a choice

    rows, row = _distinct(region[~plain])
    columns, column = _distinct(target[~plain])
    part = np.full((len(rows), len(columns)), limit)
    part[row, column] = cost[allowed][~plain]
    first, second = linear_sum_assignment(part)
    kept = part[first, second] < limit
    taken[rows[first[kept]]] = columns[second[kept]]


def _distinct(numbers: Index) -> tuple[Index, Index]:
    """The distinct ones of small numbers (K,), in order, and the place of each among them (K,)."""
    distinct = np.bincount(numbers).nonzero()[0]
    return distinct, np.searchsorted(distinct, numbers)


def _merges(regions: Boxes, targets: Boxes, taken: Index, limits: Thresholds) -> list[tuple[int, int]]:
    """Edges (target, region): targets left over that explain a region better together with its own."""
    left = np.ones(len(targets), np.bool_)
    left[taken[taken >= 0]] = False
    free = left.nonzero()[0]
    if not len(free) or not len(regions):
        return []
    from perdure.maths.kernels.overlaps import shares

    inside = shares(targets[free], regions)  # (F, R)
    edges = []
    for region in np.flatnonzero((inside >= limits.share).any(axis=0)).tolist():
        part = inside[:, region]  # (F,)
        members = [int(taken[region])] if taken[region] >= 0 else []
        others = free[np.argsort(-part, kind="stable")][: int((part >= limits.share).sum())]
        for other in map(int, others):
            if members and not _gains(regions[region], targets[members], targets[other], limits.gain, limits.near):
                continue
            members.append(other)
        if len(members) > 1:
            edges += [(member, region) for member in members if member != taken[region]]
    return edges


def _splits(
    regions: Boxes,
    sure: NDArray[np.bool_],
    targets: Boxes,
    whole: NDArray[np.bool_],
    taken: Index,
    limits: Thresholds,
) -> list[tuple[int, int]]:
    """Edges (target, region): regions left over that fit a target better together with its own."""
    free = ((taken < 0) & sure).nonzero()[0]
    if not len(free) or not len(targets):
        return []
    from perdure.maths.kernels.overlaps import shares

    inside = shares(regions[free], targets)  # (F, T)
    parts = np.flatnonzero((inside >= limits.share).any(axis=1))
    own = {target: region for region, target in enumerate(taken.tolist()) if target >= 0} if len(parts) else {}
    edges = []
    scattered: dict[int, list[int]] = {}
    for region, target in zip(free[parts].tolist(), inside[parts].argmax(axis=1).tolist(), strict=True):
        mine = own.get(target)
        if mine is None:
            if whole[target]:
                edges.append((target, region))
            else:
                scattered.setdefault(target, []).append(region)
        elif whole[target] or _gains(
            targets[target], regions[[mine]], regions[region], limits.gain / 4, limits.near
        ):
            edges.append((target, region))
    for target, some in scattered.items():
        union = hull(regions[some])[None]
        if len(some) > 1 and near(union, targets[[target]], limits.distance, limits.size_ratio).alike.any():
            edges += [(target, part) for part in some]
    return edges


def _gains(whole: Float, parts: Boxes, other: Float, gain: float, least: float) -> bool:
    """Whether parts and another together are nearer to the whole than the parts alone, by `gain`."""
    alone = np.concatenate([parts[:, :2].min(axis=0), parts[:, 2:].max(axis=0)])
    union = np.concatenate([np.minimum(alone[:2], other[:2]), np.maximum(alone[2:], other[2:])])
    near, far = distances(whole[None], np.stack([union, alone]).astype(np.float32))[0]
    return bool(near < far - gain and near < least)


def _knotted(taken: Index, edges: list[tuple[int, int]]) -> Matched:
    """Connected components of the pairs and edges."""
    matched = (taken >= 0).nonzero()[0]
    pairs = np.array([taken[matched], matched]).T
    knots: list[Knot] = []
    if edges:
        group: dict[tuple[str, int], set[tuple[str, int]]] = {}
        mine = {int(target): int(region) for target, region in pairs}
        links = list(edges)
        links += [(target, mine[target]) for target, _ in edges if target in mine]
        links += [(int(taken[region]), region) for _, region in edges if taken[region] >= 0]
        for target, region in links:
            one, other = ("t", target), ("r", region)
            union = group.get(one, {one}) | group.get(other, {other})
            for node in union:
                group[node] = union
        for part in {id(one): one for one in group.values()}.values():
            rows = sorted(number for kind, number in part if kind == "t")
            knots.append(Knot(tuple(rows), tuple(sorted(number for kind, number in part if kind == "r"))))
    in_knots = {row for knot in knots for row in knot.rows}
    pairs = pairs[[int(target) not in in_knots for target in pairs[:, 0]]] if in_knots else pairs
    return Matched(pairs, tuple(sorted(knots)))

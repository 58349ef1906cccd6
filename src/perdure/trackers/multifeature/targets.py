"""Trajectories under way: the last object of each, and what its last objects were like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.features.feature import Feature, Float
from perdure.types import Boxes, Frame, Regions

Index = NDArray[np.intp]
Rows = dict[str, Float]
"""A row (N, …) for each object, by feature."""
NEVER = -1e9  # s
LOOKS = 12  # E: how many looks are kept


@dataclass(frozen=True, eq=False)
class Targets:
    """All trajectories under way, a row each; the last `Q` objects of each, the newest last."""

    keys: NDArray[np.int64]  # (N,) never reused
    ids: NDArray[np.int64]  # (N,) 0 until it has passed the filter
    born: NDArray[np.float64]  # (N,) s, of its first object
    first: NDArray[np.int64]  # (N,) frame of its first object
    origin: NDArray[np.float32]  # (N, 4) where that was, since it was lost last
    count: NDArray[np.int64]  # (N,) objects so far
    latest: NDArray[np.int64]  # (N,) frame of the last one
    missed: NDArray[np.float64]  # (N,) s for which it might have been seen since, and was not
    extent: NDArray[np.float32]  # (N, 4) bounds of the centres so far
    scores: NDArray[np.float32]  # (N,) of its last region
    classes: NDArray[np.str_]  # (N,)
    surprise: NDArray[
        np.float64
    ]  # (N, 2) how far it was from where it was expected, in its sizes; NaN if not seen
    times: NDArray[np.float64]  # (N, Q) s
    boxes: NDArray[np.float32]  # (N, Q, 4)
    rows: Rows  # of the last object
    values: (
        Rows  # (N, Q) of features that vary: their value at each object, of which eq. 15 takes mean and deviation
    )
    places: Rows  # (N, Q, ...) of features that move
    looks: Rows  # (N, E, ...) of features of looks, when it was seen by itself; the newest last
    looked: NDArray[np.float64]  # (N, E) s, when; NEVER for none
    evidence: NDArray[np.float64]  # (N,) s for which it must be seen where it came in
    entry: Index  # (N,) the entry by which it came in; -1 for none
    behind: Index  # (N,) the occluder behind which it is; -1 for none
    named: NDArray[np.float64]  # (N,) s, when it passed the filter
    recalled: NDArray[np.bool_]  # (N,) found again by its looks, and followed since

    def __len__(self) -> int:
        return len(self.keys)

    def replace(self, **columns: Any) -> Targets:
        """Return these targets with other columns."""
        return replace(self, **columns)

    def take(self, index: ArrayLike) -> Targets:
        """Return the named rows (indices or a bool array), in that order."""
        index = np.asarray(index)
        if index.dtype == np.bool_ and index.all():
            return self
        return Targets(
            **{one.name: _each(getattr(self, one.name), lambda part: part[index]) for one in fields(self)}
        )

    def described_by(self, features: Sequence[Feature], rows: Rows) -> Targets:
        """Return the targets with the columns of other features; of what is new nothing is known. `rows` give shapes."""
        names = {one.name for one in features}
        if names == set(self.rows):
            return self
        count, window = self.times.shape

        def of(columns: Rows, wanted: Sequence[Feature], *ahead: int, plain: bool = False) -> Rows:
            shapes = {one.name: () if plain else rows[one.name].shape[1:] for one in wanted}
            new = {name: np.zeros((count, *ahead, *shape), np.float32) for name, shape in shapes.items()}
            return {name: columns.get(name, nothing) for name, nothing in new.items()}

        return self.replace(
            rows=of(self.rows, features),
            values=of(self.values, [one for one in features if one.varies], window, plain=True),
            places=of(self.places, [one for one in features if one.moves], window),
        )

    def restarted(self, which: Index) -> Targets:
        """Return the targets, those `which` as if only their newest object had been seen: nothing is known of the way."""
        count, times = self.count.copy(), self.times.copy()
        count[which] = 1
        times[which] = self.times[which, -1:]
        return self.replace(count=count, times=times)

    def join(self, other: Targets) -> Targets:
        """Return these and the others behind them."""
        if not len(other):
            return self
        return Targets(
            **{one.name: _joined(getattr(self, one.name), getattr(other, one.name)) for one in fields(self)}
        )

    @property
    def seen(self) -> NDArray[np.float64]:
        """When the last object of each was seen (N,), in seconds."""
        return self.times[:, -1]

    @property
    def filled(self) -> NDArray[np.bool_]:
        """Which of the last Q objects (N, Q) there are."""
        window = self.times.shape[1]
        return np.asarray(np.arange(window) >= window - self.count[:, None])

    @property
    def length(self) -> Float:
        """How full the last Q objects of each are (N,), in (0, 1]: min(T / Q, 1)."""
        return np.asarray(np.minimum(self.count / self.times.shape[1], 1.0), np.float32)

    @property
    def last(self) -> Boxes:
        """The box of the last object of each (N, 4)."""
        return self.boxes[:, -1]


def newborn(
    frame: Frame,
    regions: Regions,
    rows: Rows,
    features: Sequence[Feature],
    looks: Mapping[str, tuple[int, ...]],
    first_key: int,
    window: int,
) -> Targets:
    """Return trajectories of one object each; `rows` are those of the regions, `window` is Q in objects.

    `looks` gives the shapes of the rows of looks.
    """
    count = len(regions)
    places = (regions.boxes[:, :2] + regions.boxes[:, 2:]) / 2

    def repeated(part: NDArray[Any]) -> NDArray[Any]:
        return np.repeat(part[:, None], window, axis=1)

    return Targets(
        keys=first_key + np.arange(count),
        ids=np.zeros(count, np.int64),
        born=np.full(count, frame.time),
        first=np.full(count, frame.index),
        origin=regions.boxes.copy(),
        count=np.ones(count, np.int64),
        latest=np.full(count, frame.index),
        missed=np.zeros(count),
        extent=np.concatenate([places, places], axis=1).astype(np.float32),
        scores=regions.scores.copy(),
        classes=regions.classes.copy(),
        surprise=np.full((count, 2), np.nan),
        times=np.full((count, window), frame.time),
        boxes=repeated(regions.boxes),
        rows={one.name: rows[one.name] for one in features},
        values={one.name: repeated(_first_value(rows[one.name])) for one in features if one.varies},
        places={one.name: repeated(rows[one.name]) for one in features if one.moves},
        looks={name: np.zeros((count, LOOKS, *shape), np.float32) for name, shape in looks.items()},
        looked=np.full((count, LOOKS), NEVER),
        evidence=np.zeros(count),
        entry=np.full(count, -1),
        behind=np.full(count, -1),
        named=np.full(count, NEVER),
        recalled=np.zeros(count, np.bool_),
    )


def extended(
    targets: Targets, which: Index, frame: Frame, regions: Regions, region: Index, rows: Rows, alike: Rows
) -> Targets:
    """Return the targets, each of `which` (K,) with its `region` (K,) as its newest object.

    `rows` are those of all regions, `alike` (K,) the link similarities to the object before, by feature.
    """
    if not len(which):
        return targets
    boxes = regions.boxes[region]
    centre = (boxes[:, :2] + boxes[:, 2:]) / 2
    extent = targets.extent.copy()
    extent[which] = np.concatenate(
        [np.minimum(extent[which, :2], centre), np.maximum(extent[which, 2:], centre)], axis=1
    )
    return targets.replace(
        count=_with(targets.count, which, targets.count[which] + 1),
        latest=_with(targets.latest, which, frame.index),
        missed=_with(targets.missed, which, 0.0),
        extent=extent,
        scores=_with(targets.scores, which, regions.scores[region]),
        classes=_with(targets.classes, which, regions.classes[region]),
        times=_rolled(targets.times, which, frame.time),
        boxes=_rolled(targets.boxes, which, boxes),
        rows={name: _with(old, which, rows[name][region]) for name, old in targets.rows.items()},
        values={
            name: _rolled(old, which, rows[name][region, 0] if is_number(rows[name]) else alike[name])
            for name, old in targets.values.items()
        },
        places={name: _rolled(old, which, rows[name][region]) for name, old in targets.places.items()},
    )


def is_number(rows: Float) -> bool:
    """Return whether a feature is a number (N, 1), whose mean can be taken; else only likenesses can."""
    return rows.ndim == 2 and rows.shape[1] == 1


def _first_value(rows: Float) -> Float:
    """The value of a feature at the first object (N,): itself where it is a number, else alike to itself."""
    return rows[:, 0] if is_number(rows) else np.ones(len(rows), np.float32)


def _with(old: NDArray[Any], which: Index, new: Any) -> NDArray[Any]:
    if old.dtype.kind == "U":
        old = old.astype(np.result_type(old, np.asarray(new)))
    found = old.copy()
    found[which] = new
    return found


def _rolled(old: NDArray[Any], which: Index, new: Any) -> NDArray[Any]:
    """The last objects (N, Q, …), of `which` without the oldest and with a new one."""
    found = old.copy()
    found[which, :-1] = old[which, 1:]
    found[which, -1] = new
    return found


def _each(column: Any, change: Any) -> Any:
    return {name: change(part) for name, part in column.items()} if isinstance(column, dict) else change(column)


def _joined(one: Any, other: Any) -> Any:
    if isinstance(one, dict):
        return {name: np.concatenate([part, other[name]]) for name, part in one.items()}
    return np.concatenate([one, other])

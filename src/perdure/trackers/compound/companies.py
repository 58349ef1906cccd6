"""Who is with whom: pairs that share a region, told as merges and splits once they have lasted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.trackers.compound.targets import CENTRE, Targets, extent
from perdure.types import Event, Frame

_LASTING = 0.1  # s together, from which a merge is told
_PARTED = 0.18  # s apart, after which a split is told; shorter gaps are bridged


class Pair(NamedTuple):
    """Two targets that share a region, or did a moment ago."""

    one: int  # keys, the smaller first
    other: int
    begin: int  # frame in which they met
    since: float  # s, its time
    end: int  # last frame together
    until: float  # s, its time
    told: bool  # whether the merge is
    distance: float  # least between their centres, sizes
    nearest: int  # the last frame in which it was so


class Told(NamedTuple):
    """Pairs after a frame, and the events that have become certain."""

    pairs: tuple[Pair, ...]
    events: tuple[Event, ...]


def accompany(
    pairs: tuple[Pair, ...], targets: Targets, region: NDArray[np.intp], frame: Frame, blind: bool
) -> Told:
    """Bring the pairs up to date and tell merges and splits.

    Parameters
    ----------
    pairs : tuple of Pair
        Those before the frame.
    targets : Targets
        N.
    region : (N,) int
        Of each target; -1 for none.
    frame : Frame
        Its time and number.
    blind : bool
        Nothing could be seen: nobody parts.
    """
    if not pairs and not targets.temporary.any():
        return Told((), ())
    known = {(pair.one, pair.other): pair for pair in pairs}
    now = _together(targets, region)
    for keys, distance in now.items():
        pair = known.get(keys) or Pair(
            *keys, frame.index, frame.time, frame.index, frame.time, False, np.inf, frame.index
        )
        pair = pair._replace(end=frame.index, until=frame.time)
        known[keys] = pair._replace(distance=distance, nearest=frame.index) if distance <= pair.distance else pair
    names = dict(zip(targets.keys.tolist(), targets.ids.tolist(), strict=True))
    seen = set(targets.keys[region >= 0].tolist())
    met: dict[int, list[Pair]] = {}
    parted: dict[int, list[Pair]] = {}
    for keys, pair in list(known.items()):
        named = names.get(pair.one, 0) and names.get(pair.other, 0)
        if keys in now and not pair.told and named and frame.time - pair.since >= _LASTING - 1e-9:
            met.setdefault(pair.begin, []).append(pair)
            known[keys] = pair._replace(told=True)
        elif keys in now or blind or (named and not seen & set(keys)):
            continue
        elif frame.time - pair.until >= _PARTED - 1e-9 or not named:
            if pair.told and named:
                parted.setdefault(pair.end + 1, []).append(pair)
            del known[keys]
    events = [
        Event(kind, begin, begin, ids, why=why)
        for kind, found, why in (
            ("merge", met, "one region for all"),
            ("split", parted, "in regions of their own"),
        )
        for begin, some in sorted(found.items())
        for ids in _joined(some, names)
    ]
    return Told(tuple(known[keys] for keys in sorted(known)), tuple(events))


def _together(targets: Targets, region: NDArray[np.intp]) -> dict[tuple[int, int], float]:
    """The distance, in sizes, of every two targets that share a region, by their keys."""
    bodies = np.flatnonzero((region >= 0) & ~targets.temporary & targets.frozen)
    found = {}
    for number in np.unique(region[bodies]):
        rows = bodies[region[bodies] == number]
        for place, row in enumerate(rows):
            for other in rows[place + 1 :]:
                way = targets.points[row, CENTRE] - targets.points[other, CENTRE]
                size = float(extent(targets.size[[row, other]]).mean())
                one, two = sorted((int(targets.keys[row]), int(targets.keys[other])))
                found[one, two] = float(np.hypot(*way)) / size
    return found


def _joined(pairs: list[Pair], names: dict[int, int]) -> list[tuple[int, ...]]:
    """The ids of pairs that hang together, each company once."""
    companies: list[set[int]] = []
    for pair in pairs:
        mine = {names[pair.one], names[pair.other]}
        apart = [one for one in companies if not one & mine]
        companies = [*apart, mine.union(*(one for one in companies if one & mine))]
    return sorted(tuple(sorted(one)) for one in companies)

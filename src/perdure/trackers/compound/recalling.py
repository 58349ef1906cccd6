"""Suspended and hidden targets found again: a new target that could be one, and looks like it, is it (IV.C, IV.D)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.appearance import alike, signature
from perdure.scene.zones import Zones
from perdure.trackers.compound.targets import CENTRE, Float, Targets, around
from perdure.types import Boxes, Event, Frame, Renamed

Index = NDArray[np.intp]
_COMPARED = 1.0  # s of age, up to which a new target is compared
_REACH = 1.5  # times the size and the way it might have gone
_SLOWEST = 0.5  # sizes a second, that anybody might have gone
_RATIO = 2.5  # of areas, at most
_SURER = (
    0.1  # by which a new target must look more like a member of a compound than the place where that is believed
)
_AHEAD = 0.3  # s: who would be beyond the border by then was leaving
_EDGE = 0.6  # sizes from the border, within which a new target has come from outside


class Found(NamedTuple):
    """Targets with some found again; their old rows have no id any more and are over."""

    targets: Targets
    region: Index  # (N,)
    keys: dict[int, int]  # of found targets: the key each had as a new one -> the one it has
    events: tuple[Event, ...]
    renamed: tuple[Renamed, ...]


def recall(
    targets: Targets,
    region: Index,
    motion: Float,
    frame: Frame,
    size: tuple[int, int],
    confirm: float,
    least: float,
    now: Callable[[int], Float],
    zones: Zones,
) -> Found:
    """Give young targets the identities of suspended ones, or of members of a compound, that they look like.

    Parameters
    ----------
    targets : Targets
        N.
    region : (N,) int
        The region of each; -1 for none.
    motion : (N, 2)
        Motion vectors, px/s.
    frame : Frame
        Its time and number.
    size : (int, int)
        Height and width of the picture.
    confirm : float
        Seconds for which a target must have been seen before it is compared.
    least : float
        Similarity from which two looks are of one thing, in [0, 1].
    now : function
        Signature of what is seen where a member of a compound is believed.
    zones : Zones
        Who comes in by an entry is new, and rules may forbid who may be found where.
    """
    region, events, renamed, keys = region.copy(), [], [], {}
    young, old = _young(targets, region, frame.time, size, confirm), _missing(targets, region, motion, size)
    looks = {int(row): signature(targets.looks[row]) for row in (*young, *old)} if len(young) and len(old) else {}
    for new in young if looks else ():
        likeness = {
            int(row): _likeness(targets, int(new), int(row), motion[row], looks, now)
            for row in old
            if targets.ids[row] and not forbidden(zones, targets, int(new), int(row))
        }
        best = max(likeness, key=lambda row: (likeness[row], -row), default=-1)
        if best < 0 or likeness[best] < least:
            continue
        said, name = int(targets.ids[new]), int(targets.ids[best])
        if said:
            renamed.append(Renamed(said, name, 0, frame.index - 1))
        events.append(_event(targets, int(new), best, likeness[best], frame))
        keys[int(targets.keys[new])] = int(targets.keys[best])
        targets = given(targets, int(new), best)
        region[best] = -1
    return Found(targets, region, keys, tuple(events), tuple(renamed))


def given(targets: Targets, new: int, old: int) -> Targets:
    """Return targets of which a new one has the identity of an old one, which is over."""
    hits, born, ids = targets.hits[old] + targets.hits[new], targets.born[old], targets.ids[old]
    targets = targets.with_([new], ids=ids, hits=hits, born=born, evidence=0.0)
    targets = targets.with_([new, old], keys=targets.keys[[old, new]])
    return targets.with_([old], ids=0, compound=0, within=0, missed=np.inf, behind=-1)


def forbidden(zones: Zones, targets: Targets, new: int, old: int) -> bool:
    """Return whether a rule between zones forbids that a new target is an old one."""
    if not zones.rules:
        return False
    gap = np.array([[max(float(targets.born[new] - targets.seen[old]), 0.0)]])
    return bool(
        zones.verdicts(targets.boxes[[old]], targets.behind[[old]], came_in(targets, [new]), gap)[0, 0] < 0
    )


def came_in(targets: Targets, rows: Sequence[int]) -> Boxes:
    """Return the boxes (K, 4) where young targets were seen first, of the size that they have now."""
    return around(targets.lines.knots[rows, 0, 1:].astype(np.float32), targets.size[rows])


def _young(targets: Targets, region: Index, time: float, size: tuple[int, int], confirm: float) -> Index:
    """New targets that are seen whole and have not come in over the border."""
    age, first = time - targets.born, targets.lines.knots[:, 0, 1:]
    here = (region >= 0) & ~targets.temporary & (targets.compound == 0) & (targets.hidden == 0)
    edge = _EDGE * targets.size
    inside = ((first > edge) & (first < np.array([size[1], size[0]]) - edge)).all(axis=1)
    inside &= targets.entry < 0
    compared = np.maximum(_COMPARED, targets.evidence)
    return np.flatnonzero(here & inside & (age >= confirm - 1e-9) & (age <= compared) & _known(targets))


def _missing(targets: Targets, region: Index, motion: Float, size: tuple[int, int]) -> Index:
    """Suspended targets that were not leaving, and members of compounds."""
    suspended = (region < 0) & (targets.compound == 0) & (targets.missed > 0) & ~leaving(targets, motion, size)
    return np.flatnonzero((suspended | targets.frozen) & ~targets.temporary & (targets.ids > 0) & _known(targets))


def leaving(targets: Targets, motion: Float, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Return who (N,) is at the border of the picture, on the way out."""
    ahead = targets.boxes + np.tile(motion, 2) * _AHEAD
    out = (ahead[:, :2] <= 0) & (motion < 0) | (ahead[:, 2:] >= np.array([size[1], size[0]])) & (motion > 0)
    return np.asarray(out.any(axis=1))


def _known(targets: Targets) -> NDArray[np.bool_]:
    """Who has been looked at."""
    return np.asarray(targets.looks[..., 3].any(axis=(1, 2)))


def _likeness(
    targets: Targets, new: int, old: int, motion: Float, looks: dict[int, Float], now: Callable[[int], Float]
) -> float:
    """How much a new target looks like an old one; -1 where it cannot be it."""
    last, born = float(targets.lines.last[old, 0]), float(targets.born[new])
    unseen = targets.missed[old] > 0 and last <= born + 1e-9
    if not unseen and not targets.frozen[old]:
        return -1.0
    side = float(targets.size[old].max())
    way = max(float(np.hypot(*motion)), _SLOWEST * side) * max(born - last, 0.0)
    ratio = float(targets.size[new].prod() / targets.size[old].prod())
    if _distance(targets, new, old) > _REACH * (side + way) or not 1 / _RATIO < ratio < _RATIO:
        return -1.0
    like = alike(looks[new], looks[old])
    return like if unseen or like >= _SURER + alike(now(old), looks[old]) else -1.0


def _distance(targets: Targets, new: int, old: int) -> float:
    """How far a new target began from where an old one was last, or from the region of its compound, px."""
    begin = targets.lines.knots[new, 0, 1:]
    region = np.flatnonzero((targets.keys == targets.within[old]) & targets.temporary)
    if targets.frozen[old] and len(region):
        box = targets.boxes[region[0]]
        return float(np.hypot(*np.maximum(np.maximum(box[:2] - begin, begin - box[2:]), 0.0)))
    return float(np.hypot(*(begin - targets.points[old, CENTRE])))


def _event(targets: Targets, new: int, old: int, likeness: float, frame: Frame) -> Event:
    """What is told of a target found again."""
    begin = int(targets.first[new])
    gone = max(float(targets.born[new] - targets.lines.last[old, 0]), 0.0)
    why = f"rule b: within reach, colours {likeness:.2f} alike, not seen by itself for {gone:.1f} s"
    return Event("found_again", begin, frame.index, (int(targets.ids[old]),), confidence=likeness, why=why)

"""Who has come free of a compound: by order (rule a), by motion (rule b), by colours (IV.C)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.appearance import alike, look, signature
from perdure.maths import polyline
from perdure.trackers.compound.companies import Pair
from perdure.trackers.compound.meetings import Compound, Meeting
from perdure.trackers.compound.targets import CENTRE, Float, Targets, around, extent, generic_points
from perdure.types import Event, Frame, Regions, Renamed

Place = NDArray[np.float64]
_BELIEF = 1.0  # log odds in favour of who is believed there
_ORDER = 3.0  # log odds of a wholly kept order
_FORGOTTEN = 20.0  # s in which order loses its weight
_STRAIGHT = 1.5  # s for which somebody is thought to go on as before
_ASTRAY = (0.35, 0.35, 0.2)  # deviation of that guess: sizes, times the way, sizes a second
_CERTAIN = 3.0  # log odds that motion gives at most


class Verdict(NamedTuple):
    """Log odds that two ambiguous targets have changed places against what is believed, and why."""

    odds: float
    why: str


@dataclass(frozen=True, eq=False)
class Judge:
    """Identifies who comes free; `colour` is the weight of colours in log odds, 0 for none."""

    frame: Frame
    regions: Regions
    pairs: tuple[Pair, ...]
    colour: float

    def __call__(self, meeting: Meeting, compound: Compound, row: int) -> tuple[Meeting, int]:
        """Return the meeting and who it is that was believed to be `row`, with an event that says why."""
        targets = meeting.targets
        rivals = np.flatnonzero(targets.frozen & (targets.compound == compound.key) & (targets.ids > 0))
        verdicts = {
            int(one): self.doubt(meeting, row, int(one)) for one in rivals if one != row and targets.ids[row]
        }
        best = max(verdicts, key=lambda one: (verdicts[one].odds, -one), default=row)
        verdict = verdicts.get(
            best, Verdict(-_BELIEF, "the last of its compound: nobody else is left that it could be")
        )
        if verdict.odds > _BELIEF:
            meeting = exchanged(meeting, compound, row, best, self.pairs, self.frame.index)
            row = best
        name, index = int(meeting.targets.ids[row]), self.frame.index
        sure = 1 / (1 + np.exp(-abs(verdict.odds - _BELIEF)))
        others = sorted(int(targets.ids[one]) for one in rivals if one != row)
        met = f" (met {', '.join(map(str, others))})" if others else ""
        event = Event("resolved", index, index, (name,), confidence=float(sure), why=verdict.why + met)
        return replace(meeting, events=(*meeting.events, event) if name else meeting.events), row

    def doubt(self, meeting: Meeting, row: int, rival: int) -> Verdict:
        """Say how likely it is that `rival` is where `row` is believed, and the other way round.

        Where both went tells who is who while they part. Of two who have been in regions of their own since, the
        frozen motion tells nothing any more: they stay who they are unless the colours speak against it.
        """
        targets = meeting.targets
        here, there = self._place(meeting, row), self._place(meeting, rival)
        one, other = targets.ice[row], targets.ice[rival]
        size = float(extent(targets.size[[row, rival]]).mean())
        since = max(self.frame.time - min(one[0], other[0]), 0.0)
        if is_rigid(one[3:], other[3:], size):
            moved = by_order(one[1:3], other[1:3], here, there, size, since)
        else:
            moved = by_motion(one, other, here, there, size, self.frame.time)
        if moved.odds > 0 and not self._lately_together(targets, row, rival):
            moved = Verdict(0.0, f"{moved.why}, but they parted before")
        seen = self._by_colours(meeting, row, rival) if self.colour else None
        if seen is None:
            return moved
        return Verdict(moved.odds + self.colour * seen, f"{moved.why}, colours {-seen:+.2f} for who was believed")

    def _lately_together(self, targets: Targets, row: int, rival: int) -> bool:
        """Whether two share a region, or did a moment ago."""
        keys = {int(targets.keys[row]), int(targets.keys[rival])}
        return any({pair.one, pair.other} == keys for pair in self.pairs)

    def _place(self, meeting: Meeting, row: int) -> Place:
        """Where a target is: the middle of its region where it is alone, else where it is believed."""
        if meeting.region[row] >= 0 and self._is_single(meeting, row):
            box = self.regions.boxes[meeting.region[row]].astype(np.float64)
            return np.asarray((box[:2] + box[2:]) / 2, np.float64)
        return np.asarray(meeting.targets.points[row, CENTRE], np.float64)

    def _is_single(self, meeting: Meeting, row: int) -> bool:
        within = meeting.targets.within
        return bool(meeting.region[row] >= 0 and within[row] and (within == within[row]).sum() == 1)

    def _by_colours(self, meeting: Meeting, row: int, rival: int) -> float | None:
        """By how much colours speak for a change: the similarities changed less those believed; None without a look."""
        looks = meeting.targets.looks
        if self.frame.image is None or not (looks[row][..., 3].any() and looks[rival][..., 3].any()):
            return None
        own, theirs = signature(looks[row]), signature(looks[rival])
        here = self._print(meeting, row)
        change = alike(here, theirs) - alike(here, own)
        if self._is_single(meeting, rival):
            there = self._print(meeting, rival)
            change += alike(there, own) - alike(there, theirs)
        return change

    def _print(self, meeting: Meeting, row: int) -> Float:
        assert self.frame.image is not None
        number = int(meeting.region[row])
        x1, y1, x2, y2 = map(float, self.regions.boxes[number])
        return signature(look(self.frame.image, self.regions.masks[number], (x1, y1, x2, y2)))


def is_rigid(one: Place, other: Place, size: float) -> bool:
    """Return whether two speeds (2,), px/s, are of one parallel motion, or both hardly any (IV.C)."""
    fast = max(float(np.hypot(*one)), float(np.hypot(*other)))
    return bool(np.hypot(*one) + np.hypot(*other) < 0.4 * size or np.hypot(*(one - other)) < 0.5 * fast)


def by_order(one: Place, other: Place, here: Place, there: Place, size: float, since: float) -> Verdict:
    """Rule a: who moves in parallel keeps the order along the way from one to the other."""
    before, now = other - one, there - here
    length = float(np.hypot(*before) * np.hypot(*now))
    kept = float(before @ now) / length if length > 0 else 0.0  # cosine
    odds = -_ORDER * kept * min(1.0, float(np.hypot(*before)) / size) * float(np.exp(-since / _FORGOTTEN))
    return Verdict(odds, f"rule a: order {'kept' if kept >= 0 else 'turned round'} ({kept:+.2f})")


def by_motion(one: Place, other: Place, here: Place, there: Place, size: float, time: float) -> Verdict:
    """Rule b: who moved differently is where her frozen motion leads; each is time, x, y, speed x, speed y (5,)."""
    believed = _misfit(one, here, size, time) + _misfit(other, there, size, time)
    changed = _misfit(one, there, size, time) + _misfit(other, here, size, time)
    odds = float(np.clip(believed - changed, -_CERTAIN, _CERTAIN))
    return Verdict(odds, f"rule b: distinct motions, log odds {-odds:+.1f} for who was believed")


def _misfit(ice: Place, place: Place, size: float, time: float) -> float:
    """Half the squared deviations between a place and where a frozen motion leads."""
    since = time - ice[0]
    reach = _STRAIGHT * -float(np.expm1(-since / _STRAIGHT))
    away = float(np.hypot(*(ice[1:3] + ice[3:] * reach - place)))
    deviation = _ASTRAY[0] * size + _ASTRAY[1] * float(np.hypot(*ice[3:])) * since + _ASTRAY[2] * size * since
    return float(0.5 * (away / max(deviation, 1e-6)) ** 2)


def exchanged(
    meeting: Meeting, compound: Compound, one: int, other: int, pairs: tuple[Pair, ...], index: int
) -> Meeting:
    """Return the meeting with two members in each other's place, and what was said of them since they were nearest."""
    targets, both, changed = meeting.targets, [one, other], [other, one]
    keys = tuple(sorted(int(key) for key in targets.keys[both]))
    begin = next((pair.nearest for pair in pairs if (pair.one, pair.other) == keys), compound.frame)
    region = meeting.region.copy()
    region[both] = region[changed]
    points = generic_points(around(targets.points[changed, CENTRE], targets.size[both]))
    moved = targets.with_(both, points=points, within=targets.within[changed], missed=targets.missed[changed])
    lines = polyline.exchanged(targets.lines, one, other)
    first, second = (int(name) for name in targets.ids[both])
    renamed = (Renamed(first, second, begin, index - 1), Renamed(second, first, begin, index - 1))
    event = Event("exchanged", begin, index, (first, second), why="places changed back to when they were nearest")
    return replace(
        meeting,
        targets=replace(moved, lines=lines),
        region=region,
        events=(*meeting.events, event),
        renamed=(*meeting.renamed, *renamed) if begin < index else meeting.renamed,
    )

"""Compound targets: frozen where correspondences are ambiguous, until somebody moves away (IV.C)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import distances_between, sizes
from perdure.trackers.compound.gathering import Held
from perdure.trackers.compound.targets import CENTRE, Float, Targets, newborn
from perdure.types import Event, Frame, Regions, Renamed

Index = NDArray[np.intp]


@dataclass(frozen=True)
class Compound:
    """A compound target; its ambiguous and temporary targets name it in their column `compound`."""

    key: int
    began: float  # s
    frame: int
    kind: str  # 'merge' or 'mixed'


@dataclass(frozen=True, eq=False)
class Meeting:
    """Targets and compounds while a frame is worked into them."""

    targets: Targets
    compounds: tuple[Compound, ...]
    next_key: int
    region: Index  # (N,) of each target, temporary ones too; -1 for none
    events: tuple[Event, ...] = ()
    renamed: tuple[Renamed, ...] = ()


Identify = Callable[[Meeting, Compound, int], tuple[Meeting, int]]


def company(targets: Targets, region: Index) -> NDArray[np.int64]:
    """Return how many targets (N,) that are not temporary share each one's region; 0 without a region."""
    from perdure.maths.kernels.counts import sharing

    return sharing(region, ~targets.temporary)


def form(
    targets: Targets,
    compounds: tuple[Compound, ...],
    next_key: int,
    held: Held,
    motion: Float,
    frame: Frame,
    regions: Regions,
) -> Meeting:
    """Freeze who shares a region in a compound, with a temporary target for every region of it.

    Parameters
    ----------
    targets, compounds
        Those before the frame.
    next_key : int
        Free for the next target or compound.
    held : Held
        Who is where.
    motion : (N, 2)
        Motion vectors, frozen with who becomes ambiguous.
    frame, regions
        What is seen.
    """
    region = held.region.copy()
    together = company(targets, region)
    ambiguous = (together > 1) | ((region >= 0) & targets.frozen)
    if regions.blind:
        return Meeting(targets, compounds, next_key, region)
    if not ambiguous.any():
        return Meeting(_ended(targets, targets.temporary), compounds, next_key, region)
    fresh = ambiguous & (targets.compound == 0)
    now = np.full(len(targets), frame.time)
    ice = np.column_stack([now, targets.points[:, CENTRE], motion])
    meeting = Meeting(targets.with_(fresh, ice=ice[fresh]), compounds, next_key, region)
    meeting = _bound(meeting, np.unique(region[together > 1]), frame)
    return _mixed(_with_temporaries(meeting, ambiguous, frame, regions), frame)


def _bound(meeting: Meeting, crowded: Index, frame: Frame) -> Meeting:
    """One compound for all who share a region: a new one, or the oldest of theirs.

    A second ambiguity resolves the first one by approximation: its ambiguous targets move on with the locations that
    were believed for them meanwhile.
    """
    column, next_key, events = meeting.targets.compound.copy(), meeting.next_key, list(meeting.events)
    known = {one.key: one for one in meeting.compounds}
    for number in crowded:
        rows = np.flatnonzero((meeting.region == number) & ~meeting.targets.temporary)
        keys = sorted(set(column[rows].tolist()) - {0})
        ids = tuple(sorted(int(one) for one in meeting.targets.ids[rows] if one))
        if not keys:
            keys, next_key = [next_key], next_key + 1
            known[keys[0]] = Compound(keys[0], frame.time, frame.index, "merge")
        elif len(keys) > 1:
            exact = ", ".join(f"{known[one].kind} since frame {known[one].frame}" for one in keys)
            why = f"a second ambiguity joins compounds ({exact}): places believed meanwhile stand"
            events.append(Event("approximated", frame.index, frame.index, ids, why=why))
            known[keys[0]] = replace(known[keys[0]], kind="mixed")
        column[np.isin(column, keys)] = keys[0]
        column[rows] = keys[0]
    targets = meeting.targets.replace(compound=column)
    return replace(
        meeting, targets=targets, compounds=tuple(known.values()), next_key=next_key, events=tuple(events)
    )


def _with_temporaries(meeting: Meeting, ambiguous: NDArray[np.bool_], frame: Frame, regions: Regions) -> Meeting:
    """A temporary target for every region that holds an ambiguous one: that in which most of them were, or a new one."""
    targets, region, next_key = meeting.targets, meeting.region.copy(), meeting.next_key
    within, used, new = targets.within.copy(), set[int](), []
    for number in np.unique(region[ambiguous]):
        rows = np.flatnonzero((region == number) & ~targets.temporary)
        votes = {
            int(key): int((within[rows] == key).sum()) for key in within[rows] if key and int(key) not in used
        }
        if votes:
            key = max(votes, key=lambda one: (votes[one], -one))
            region[np.flatnonzero(targets.keys == key)] = number
        else:
            key, next_key = next_key, next_key + 1
            new.append((int(number), int(targets.compound[rows[0]])))
        used.add(key)
        within[rows] = key
    targets = targets.replace(within=within)
    targets = _ended(targets, targets.temporary & ~np.isin(targets.keys, list(used)))
    if new:
        numbers, owners = (np.array(column) for column in zip(*new, strict=True))
        born = newborn(
            frame,
            regions.boxes[numbers],
            regions.scores[numbers],
            regions.classes[numbers],
            next_key - len(new),
        )
        targets = targets.join(born.with_(np.arange(len(born)), temporary=True, compound=owners))
        region = np.concatenate([region, numbers])
    return replace(meeting, targets=targets, region=region, next_key=next_key)


def _mixed(meeting: Meeting, frame: Frame) -> Meeting:
    """Tell of compounds that have become mixed: several targets in several regions, some of them together (fig. 2)."""
    targets, events, compounds = meeting.targets, list(meeting.events), []
    for one in meeting.compounds:
        mine = (targets.compound == one.key) & (meeting.region >= 0)
        members, temporary = np.flatnonzero(mine & ~targets.temporary), int((mine & targets.temporary).sum())
        if one.kind == "merge" and len(members) > temporary > 1:
            one = replace(one, kind="mixed")
            ids = tuple(sorted(int(name) for name in targets.ids[members] if name))
            why = f"{len(members)} targets in {temporary} regions, in one compound since frame {one.frame}"
            events.append(Event("mixed", frame.index, frame.index, ids, why=why))
        compounds.append(one)
    return replace(meeting, compounds=tuple(compounds), events=tuple(events))


def resolve(
    meeting: Meeting, frame: Frame, regions: Regions, apart: float, settle: float, identify: Identify
) -> Meeting:
    """Set free who is alone in a region that has moved away from the others of its compound.

    Parameters
    ----------
    meeting : Meeting
        Targets and compounds after `form`.
    frame, regions
        What is seen.
    apart : float
        Gap, in widths of the region, from which it has moved away.
    settle : float
        Seconds after which it has, gap or not.
    identify : function
        Says who it is, and why: of (meeting, compound, row believed) -> (meeting, row).
    """
    for compound in meeting.compounds:
        mine = meeting.targets.temporary & (meeting.targets.compound == compound.key) & (meeting.region >= 0)
        for temporary in np.flatnonzero(mine):
            targets = meeting.targets
            rows = np.flatnonzero(targets.within == targets.keys[temporary])
            if len(rows) != 1:
                continue
            others = np.flatnonzero(mine & (targets.compound == compound.key))
            box = regions.boxes[meeting.region[[temporary]]]
            gaps = distances_between(box, regions.boxes[meeting.region[others[others != temporary]]])[0]
            lasted = frame.time - targets.shared[rows[0]]
            if gaps.min(initial=np.inf) > apart * sizes(box).min() or lasted >= settle - 1e-9:
                meeting, row = identify(meeting, compound, int(rows[0]))
                targets = meeting.targets.with_([row], compound=0, within=0)
                ended = np.arange(len(targets)) == temporary
                meeting = replace(meeting, targets=_ended(targets.with_(ended, compound=0), ended))
    return meeting


def _ended(targets: Targets, rows: NDArray[np.bool_]) -> Targets:
    """Targets of which some are over: they are let go at the end of the step."""
    return targets.with_(rows, missed=np.inf) if rows.any() else targets

"""Events against events: merges, splits, total occlusions; who comes out of a merge; who shares a blob.

Said identities are translated into true ones by CLEAR's pairs, so that an event counts only when it is told of
the right objects.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.maths.assign import assign
from perdure.metrics.clear import Pairs
from perdure.metrics.compared import Compared
from perdure.types import Event, Tracks

_NEVER = np.zeros(0, np.int64)
SLACK = 5  # frames that an event may be early or late
REACH = 25  # frames before or after, from which a said id is translated
VOTES = 10  # matched frames that tell an object's said id before and after a merge
_TRUE_KIND = {"merge": "merge", "split": "split", "occluded": "full_occlusion"}  # by what a tracker calls it
_COMPANY = {"merge": 2, "split": 2, "occluded": 1}  # ids that make an event

Blobs = Mapping[int, Sequence[frozenset[int]]]  # frame → the ids in each connected blob


class Tally(NamedTuple):
    """How many there were, how many were said, and how many of each had a counterpart."""

    true: int = 0
    said: int = 0
    found: int = 0  # of the true
    right: int = 0  # of the said

    @property
    def recall(self) -> float | None:
        """Found / true; None where there were none."""
        return self.found / self.true if self.true else None

    @property
    def precision(self) -> float | None:
        """Right / said; None where nothing was said."""
        return self.right / self.said if self.said else None

    def plus(self, other: Tally) -> Tally:
        """Add up."""
        return Tally(*(one + two for one, two in zip(self, other, strict=True)))


NO_TALLY = Tally()


class Identities:
    """Which said id stood on which true one, and when."""

    def __init__(self, compared: Compared, pairs: Pairs) -> None:
        self.present = {int(one): compared.truth.frames[compared.truth.ids == one] for one in compared.true_ids}
        self.frames = compared.truth.frames[pairs.truth]
        self.true = compared.truth.ids[pairs.truth]
        self.said = compared.said.ids[pairs.said]

    def true_of(self, said: int, frame: int, *, later: bool) -> int | None:
        """The true id that a said one stood on last before a frame, or first from it on; else the other way."""
        mine = self.said == said
        frames, others = self.frames[mine], self.true[mine]
        near = np.abs(frames - frame) <= REACH
        frames, others = frames[near], others[near]
        if not len(frames):
            return None
        wrong_side = (frames < frame) if later else (frames > frame)
        return int(others[np.lexsort((np.abs(frames - frame), wrong_side))[0]])

    def votes(self, true: int, allowed: NDArray[np.bool_], *, last: bool) -> int | None:
        """The id said most often in the last, or the first, `VOTES` of the allowed matched frames of an object."""
        chosen = self.said[allowed & (self.true == true)]
        chosen = chosen[-VOTES:] if last else chosen[:VOTES]
        return Counter(chosen.tolist()).most_common(1)[0][0] if len(chosen) else None


class Merge(NamedTuple):
    """A merge of the truth: its objects touch from `begin` up to before `end`."""

    ids: tuple[int, ...]
    begin: int
    end: int


@dataclass(frozen=True)
class EventScore:
    """What a tracker told of meetings, and what it made of them."""

    merges: Tally = NO_TALLY
    splits: Tally = NO_TALLY
    occlusions: Tally = NO_TALLY  # total ones
    together: Tally = NO_TALLY  # pairs of objects in one blob, in every frame
    judged: int = 0  # merges whose objects stand free before and after
    returned: int = 0  # of these, all objects have the same id before and after

    @staticmethod
    def together_of(parts: Iterable[EventScore]) -> EventScore:
        """Add up several sequences."""
        total = EventScore()
        for one in parts:
            total = EventScore(
                total.merges.plus(one.merges),
                total.splits.plus(one.splits),
                total.occlusions.plus(one.occlusions),
                total.together.plus(one.together),
                total.judged + one.judged,
                total.returned + one.returned,
            )
        return total


def score_events(
    said: Sequence[Event] | None, truth: Sequence[Event], identities: Identities, *, blobs: Tally = NO_TALLY
) -> EventScore:
    """Score the events of a run against those of a clip.

    A said event is right when a true one of its kind is within 5 frames and is of the same objects; each true
    one can be told once. Events of more than two objects, true or said, stand for all their pairs.

    Parameters
    ----------
    said : sequence of Event or None
        None where the result has no events, as text has not: merges, splits and occlusions are not tallied.
    truth : sequence of Event
        Kinds 'merge', 'split' (at the first frame apart) and 'full_occlusion'.
    identities : Identities
        Who stood on whom.
    blobs : Tally
        Of `score_blobs`.
    """
    merges, splits, occlusions = (
        NO_TALLY if said is None else _tally(kind, said, truth, identities) for kind in _TRUE_KIND
    )
    verdicts = [came_back(one, merges_of(truth), identities) for one in merges_of(truth)]
    judged = [one for one in verdicts if one is not None]
    return EventScore(merges, splits, occlusions, blobs, len(judged), sum(judged))


def merges_of(truth: Sequence[Event]) -> list[Merge]:
    """Pair each merge with the split that ends it; without one it lasts for ever."""
    splits = sorted((one for one in truth if one.kind == "split"), key=lambda one: one.begin)
    found = []
    for merge in truth:
        if merge.kind == "merge":
            ends = [one.begin for one in splits if set(one.ids) == set(merge.ids) and one.begin > merge.begin]
            found.append(Merge(merge.ids, merge.begin, ends[0] if ends else 2**62))
    return found


def came_back(merge: Merge, others: Sequence[Merge], identities: Identities) -> bool | None:
    """Return whether all objects have the same said id when they next stand free as when they last did.

    None where no object of the merge stands free both before and after: nothing can be said of it.
    """
    names = names_around(merge, others, identities)
    return all(before is not None and before == after for _, before, after in names) if names else None


def names_around(
    merge: Merge, others: Sequence[Merge], identities: Identities
) -> list[tuple[int, int | None, int | None]]:
    """Return (object, said id before the merge, after it) of the objects that stand free both before and after."""
    found = []
    for true in merge.ids:
        spans = [(one.begin, one.end) for one in others if true in one.ids]
        there, seen = identities.present.get(true, _NEVER), identities.frames
        before, after = (_free(there, spans) & side for side in (there < merge.begin, there >= merge.end))
        if before.any() and after.any():
            first = identities.votes(true, _free(seen, spans) & (seen < merge.begin), last=True)
            then = identities.votes(true, _free(seen, spans) & (seen >= merge.end), last=False)
            found.append((true, first, then))
    return found


def score_blobs(said: Tracks, blobs: Blobs, identities: Identities) -> Tally:
    """Count the pairs of objects that share a blob, true and said, frame by frame.

    Said to share one are rows of the same group, or linked to the same region; each row stands for the object
    that its id stood on last.
    """
    true_pairs = {
        (frame, *pair)
        for frame, parts in blobs.items()
        for part in parts
        for pair in itertools.combinations(sorted(part), 2)
    }
    said_pairs = {one for one in _said_together(said, identities) if one[0] in blobs}
    both = len(true_pairs & said_pairs)
    return Tally(len(true_pairs), len(said_pairs), both, both)


def _tally(kind: str, said: Sequence[Event], truth: Sequence[Event], identities: Identities) -> Tally:
    theirs = [
        (event.begin, frozenset(objects))
        for event in truth
        if event.kind == _TRUE_KIND[kind]
        for objects in itertools.combinations(sorted(set(event.ids)), _COMPANY[kind])
    ]
    ours = [one for one in said if one.kind == kind]
    told = [(place, objects) for place, event in enumerate(ours) for objects in _objects(event, identities)]
    apart = np.full((len(theirs), len(told)), np.inf)
    for row, (begin, sought) in enumerate(theirs):
        for column, (place, objects) in enumerate(told):
            away = abs(ours[place].begin - begin)
            if away <= SLACK and objects == sought:
                apart[row, column] = away
    pairs = assign(apart).pairs
    return Tally(len(theirs), len(ours), len(pairs), len({told[column][0] for column in pairs[:, 1]}))


def _objects(event: Event, identities: Identities) -> list[frozenset[int]]:
    """The true ids that an event is about: pairs, or single ones of an occlusion."""
    known = {identities.true_of(one, event.begin, later=event.kind == "split") for one in event.ids}
    objects = sorted(one for one in known if one is not None)
    return [frozenset(one) for one in itertools.combinations(objects, _COMPANY[event.kind])]


def _free(frames: NDArray[np.int64], spans: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
    """Which frames lie in none of the spans."""
    free = np.ones(len(frames), np.bool_)
    for begin, end in spans:
        free &= (frames < begin) | (frames >= end)
    return free


def _said_together(said: Tracks, identities: Identities) -> set[tuple[int, int, int]]:
    """(frame, one, other): pairs of true ids whose said rows share a group or a region."""
    last: dict[int, int] = {}
    standing = sorted(
        zip(identities.frames.tolist(), identities.said.tolist(), identities.true.tolist(), strict=True)
    )
    place, found = 0, set()
    for frame in np.unique(said.frames).tolist():
        while place < len(standing) and standing[place][0] <= frame:
            last[standing[place][1]] = standing[place][2]
            place += 1
        for members in _companies(said.take(said.frames == frame)):
            known = sorted({last[one] for one in members if one in last})
            found |= {(frame, *pair) for pair in itertools.combinations(known, 2)}
    return found


def _companies(rows: Tracks) -> list[list[int]]:
    """The said ids that share a group or a region in a frame."""
    shared: dict[tuple[str, int], list[int]] = {}
    for identity, group, links, is_group in zip(rows.ids, rows.groups, rows.links, rows.is_group, strict=True):
        if not is_group:
            keys = [("group", int(group))] if group else []
            for key in [*keys, *(("region", link) for link in links)]:
                shared.setdefault(key, []).append(int(identity))
    return list(shared.values())

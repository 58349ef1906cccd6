"""Parts made one: borders first, then who was hidden there, as far as nobody becomes one with who was beside him."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from perdure.features.feature import Feature
from perdure.stitching.borders import Border, joins_at
from perdure.stitching.hidden import RECALL, Recall, joins_of_hidden
from perdure.stitching.likeness import Likeness
from perdure.stitching.parts import Join, Life, Part
from perdure.types import Scene


@dataclass(frozen=True)
class Stitched:
    """How parts become one.

    `handovers` are the frames from which each part but the first is told; `joins` who is who, in order of parts.
    """

    handovers: tuple[int, ...]
    joins: tuple[Join, ...]

    def span(self, parts: Sequence[Part], number: int) -> tuple[int, int]:
        """Return the first frame that is told of a part, and the one behind the last."""
        begin = parts[number].begin if number == 0 else self.handovers[number - 1]
        return begin, self.handovers[number] if number < len(self.handovers) else parts[number].end


def stitch(parts: Sequence[Part], scene: Scene, kinds: Sequence[Feature], recall: Recall = RECALL) -> Stitched:
    """Return which identities of the parts, given in order, are one; `kinds` are the features of their looks."""
    likeness = Likeness(kinds, parts)
    chains = Chains(parts)
    handovers = []
    for number in range(len(parts) - 1):
        border = Border.of(parts[number], parts[number + 1], scene)
        handovers.append(border.handover)
        for join in joins_at(border, number, parts, likeness):
            chains.join(join)
    for join in joins_of_hidden(parts, chains.ends(), chains.begins(), likeness, scene, recall):
        chains.join(join)
    joins = sorted(chains.joins, key=lambda one: (one.later, one.earlier))
    return Stitched(tuple(handovers), tuple(joins))


def names(
    told: Sequence[Mapping[int, int]], joins: Sequence[Join]
) -> tuple[list[dict[int, int]], list[dict[int, int]]]:
    """Return by part for each identity the name it is said by, and the one that it has in the end.

    `told` are the identities of whom rows are told, by part, each with the first frame. Names count from 1 in the order
    in which they appear; what is said of who turns out to be another has a name behind all of these.
    """
    leader: dict[tuple[int, int], tuple[int, int]] = {}

    def first(one: tuple[int, int]) -> tuple[int, int]:
        while one in leader:
            one = leader[one]
        return one

    for join in joins:
        one, other = sorted((first(join.earlier), first(join.later)))
        if one != other:
            leader[other] = one
    order = sorted((frame, part, own) for part, some in enumerate(told) for own, frame in some.items())
    final: dict[tuple[int, int], int] = {}
    for _, part, own in order:
        final.setdefault(first((part, own)), len(final) + 1)
    said: list[dict[int, int]] = [{} for _ in told]
    after: list[dict[int, int]] = [{} for _ in told]
    used: set[int] = set()
    upcoming = len(final) + 1
    for _, part, own in order:
        name = final[first((part, own))]
        after[part][own] = name
        said[part][own] = upcoming if name in used else name
        upcoming += name in used
        used.add(name)
    return said, after


class Chains:
    """Who is one so far: identities of parts in sets, of which no two were seen together."""

    def __init__(self, parts: Sequence[Part]) -> None:
        self._parts = parts
        self._of = {(number, one): {(number, one)} for number, part in enumerate(parts) for one in part.lives}
        self.joins: list[Join] = []

    def join(self, join: Join) -> bool:
        """Make two one, unless they cannot be; return whether they are now."""
        if join.earlier not in self._of or join.later not in self._of:
            return False
        one, other = self._of[join.earlier], self._of[join.later]
        if one is other or any(self._apart(a, b) for a in one for b in other):
            return False
        one |= other
        for member in other:
            self._of[member] = one
        self.joins.append(join)
        return True

    def ends(self) -> list[tuple[int, int]]:
        """Return of each set the identity that was seen last."""
        return self._extremes(lambda one: (-self._life(one).end, -one[0]))

    def begins(self) -> list[tuple[int, int]]:
        """Return of each set the identity that was seen first."""
        return self._extremes(lambda one: (self._life(one).begin, one[0]))

    def _extremes(self, key: Callable[[tuple[int, int]], Any]) -> list[tuple[int, int]]:
        sets = {id(some): some for some in self._of.values()}
        return sorted(min(some, key=key) for some in sets.values())

    def _life(self, one: tuple[int, int]) -> Life:
        return self._parts[one[0]].lives[one[1]]

    def _apart(self, one: tuple[int, int], other: tuple[int, int]) -> bool:
        """Whether a part saw both in one frame at two places, or one is a group and the other is not."""
        if self._life(one).group != self._life(other).group:
            return True
        return (
            one[0] == other[0] and (min(one[1], other[1]), max(one[1], other[1])) in self._parts[one[0]].together
        )

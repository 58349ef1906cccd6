"""What a step learned: rows, corrections, events, reasons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from perdure.types.tracks import Tracks


@dataclass(frozen=True)
class Event:
    """Something that happened: merge, split, occluded, found_again, resolved, entered, left, …

    `begin` and `end` are frames (equal for a moment); `why` names the rule and its figures.
    """

    kind: str
    begin: int
    end: int
    ids: tuple[int, ...] = ()
    zone: str = ""
    confidence: float = 1.0
    why: str = ""


@dataclass(frozen=True)
class Renamed:
    """A correction: rows of `old` said before, in frames `begin` to `end` inclusive, belong to `new`."""

    old: int
    new: int
    begin: int
    end: int


@dataclass(frozen=True)
class Dropped:
    """A correction: rows of `id` said before, in frames `begin` to `end` inclusive, were wrong."""

    id: int
    begin: int
    end: int


@dataclass(frozen=True)
class Explanation:
    """Why a row or link of an identity was chosen, with the figures that decided."""

    id: int
    why: str
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Report:
    """What a step learned: rows of this frame (or of earlier ones, said late), corrections, events, reasons."""

    rows: Tracks = field(default_factory=Tracks.empty)
    renamed: tuple[Renamed, ...] = ()
    dropped: tuple[Dropped, ...] = ()
    events: tuple[Event, ...] = ()
    explanations: tuple[Explanation, ...] = ()
    begun: tuple[Event, ...] = ()  # scenarios that are recognised and go on; told as events when they are over

    @staticmethod
    def empty() -> Report:
        """Return the report of a step that learned nothing."""
        return Report()

    def equals(self, other: Report) -> bool:
        """Return whether both report the same."""
        return self.rows.equals(other.rows) and all(
            getattr(self, name) == getattr(other, name)
            for name in ("renamed", "dropped", "events", "explanations", "begun")
        )

"""What a file of any format holds, what a format is, and rows gathered with the places that they come from."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError, ParameterError
from perdure.features.masks import disjoint
from perdure.files.formats.traits import Trait
from perdure.files.room import Room
from perdure.types import Ground, Mask, Outline, Status, Tracks
from perdure.types.regions import FARTHEST

RATE = 25.0  # frames a second, where nothing tells
LAST = 10**9  # frame
MOST_FRAMES = 10**7  # that a film may have to be listed
LARGEST_ID = 2**53  # beyond it the numbers of JSON are not exact


@dataclass(frozen=True, eq=False)
class Content:
    """What a file holds.

    Parameters
    ----------
    tracks : Tracks
        All its rows, in the order of (frame, id).
    size : (int, int) or None
        Height and width of the pictures, where the file says.
    frames : sequence of int or None
        All frames of the film, also those without a row, where the file says; ascending.
    fps : float or None
        Frames a second, where the file says; for the times of rows that have none.
    timed : bool
        Whether rows have times of their own.
    name : str
        Of the film.
    images : frame → str
        Names of the pictures.
    notes : tuple of str
        What was left out or changed while reading.
    """

    tracks: Tracks
    size: tuple[int, int] | None = None
    frames: Sequence[int] | None = None
    fps: float | None = None
    timed: bool = False
    name: str = ""
    images: Mapping[int, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def film(self) -> Sequence[int]:
        """All frames that are known of, ascending: those of the film, and those with rows."""
        said = np.unique(self.tracks.frames).tolist()
        return said if self.frames is None else sorted({*said, *self.frames})

    def sized(self, what: str) -> tuple[int, int]:
        """Return height and width; ParameterError where they are not known."""
        if self.size is None:
            raise ParameterError(
                f"{what} needs the size of the pictures, which this file does not tell; add --size WIDTHxHEIGHT"
            )
        return self.size

    def replace(self, **changes: Any) -> Content:
        """Return the same with some fields changed."""
        return replace(self, **changes)


@dataclass(frozen=True)
class Reading:
    """How a file is to be read: which of its films, where it holds several."""

    video: str | None = None


class Writer(Protocol):
    """Writes a content to a place that is free or may be overwritten; returns how many rows were written."""

    def __call__(self, path: Path, content: Content, *, overwrite: bool) -> int: ...  # noqa: D102


@dataclass(frozen=True)
class Format:
    """A format of files.

    Parameters
    ----------
    name : str
        As it is chosen by.
    about : str
        What it is, in a few words.
    read, write : function or None
        None where files of it are only written, or only read.
    suffixes : tuple of str
        Names of its files end so; the first where it is written.
    is_folder : bool
        Whether it is a folder.
    needs_size : bool
        Whether it cannot be written without the size of the pictures.
    holds : frozenset of Trait
        What of `Tracks` it holds, beside frame and id.
    rounds : column → float
        Steps to which boxes (px), times (s) and confidence are rounded.
    classes : tuple of str
        The only classes that it has words for; empty where any will do.
    unnamed : str
        What it says of a row without a class, where that does not read back as none.
    blank : str
        What it writes for a blank in a class, where it cannot hold one.
    """

    name: str
    about: str
    read: Callable[[Path, Reading], Content] | None
    write: Writer | None
    suffixes: tuple[str, ...] = ()
    is_folder: bool = False
    needs_size: bool = False
    holds: frozenset[Trait] = frozenset()
    rounds: Mapping[str, float] = field(default_factory=dict)
    classes: tuple[str, ...] = ()
    unnamed: str = ""
    blank: str = " "


class Gathering:
    """Rows as they are read, each checked as it comes; an error names the file and the place in it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._rows: list[dict[str, Any]] = []
        self._room = Room(path.stat().st_size if path.is_file() else 0)
        self._seen: dict[tuple[int, int], str] = {}

    def __len__(self) -> int:
        return len(self._rows)

    def refuse(self, place: str, what: object) -> FormatError:
        """Return the error that says what is wrong at a place."""
        return FormatError(f"{self.path}, {place}: {what}")

    def add(
        self,
        place: str,
        *,
        frame: Any,
        identity: Any,
        box: Iterable[Any],
        time: Any = 0.0,
        status: int = Status.VISIBLE,
        confidence: Any = 1.0,
        kind: str = "",
        group: Any = 0,
        inferred: bool = False,
        mask: Mask | None = None,
        believed: Mask | None = None,
        outline: Outline | None = None,
        hidden_side: str = "",
        ground: Ground | None = None,
    ) -> None:
        """Take up a row; the id may be 0 here, see `counted_from_one`.

        Raises
        ------
        FormatError
            For a frame, id or group that is no whole number from 0 on, a number that is not finite or too far out, a
            box inside out, and an id that a frame has already.
        """
        number = self._whole(place, "frame", frame, LAST)
        name = self._whole(place, "id", identity, LARGEST_ID)
        earlier = self._seen.setdefault((number, name), place)
        if earlier is not place:
            raise self.refuse(place, f"frame {number} has id {name} already, in {earlier}; keep one of the two")
        try:
            self._room.take(one.bits.size for one in (mask, believed) if one is not None)
        except ValueError as error:
            raise self.refuse(place, error) from None
        self._rows.append(
            {
                "frames": number,
                "ids": name,
                "times": self._real(place, "time", time, LAST),
                "boxes": self._box(place, box),
                "status": status,
                "confidence": self._real(place, "confidence", confidence, _SUREST),
                "classes": kind,
                "groups": self._whole(place, "group", group, LARGEST_ID),
                "inferred": inferred,
                "masks": Mask.empty() if mask is None else mask,
                "believed": believed,
                "outlines": outline,
                "hidden_side": hidden_side,
                "ground": self._ground(place, ground),
            }
        )

    def tracks(self) -> Tracks:
        """Return the rows, in the order of (frame, id)."""
        if not self._rows:
            return Tracks.empty()
        columns = {name: [row[name] for row in self._rows] for name in self._rows[0]}
        order = np.lexsort((columns["ids"], columns["frames"]))
        return Tracks.of(**columns).take(order)

    def _whole(self, place: str, name: str, value: Any, most: int) -> int:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value or value % 1:
            raise self.refuse(place, f"{name} {value!r} is not a whole number")
        if not 0 <= value <= most:
            raise self.refuse(place, f"{name} {value:g} is not from 0 to {most}")
        return int(value)

    def _real(self, place: str, name: str, value: Any, most: float) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= most:
            raise self.refuse(place, f"{name} {value!r} is not a number that can be")
        return float(value)

    def _ground(self, place: str, ground: Ground | None) -> Ground | None:
        for one in ground or ():
            if one is not None:
                self._real(place, "a place or speed on the ground", one, LAST)
        return ground

    def _box(self, place: str, box: Iterable[Any]) -> tuple[float, ...]:
        sides = tuple(
            self._real(place, f"{side} of the box", one, FARTHEST) for side, one in zip(_SIDES, box, strict=True)
        )
        if sides[0] > sides[2] or sides[1] > sides[3]:
            raise self.refuse(
                place, f"a box from ({sides[0]:g}, {sides[1]:g}) to ({sides[2]:g}, {sides[3]:g}) is inside out"
            )
        return sides


def counted_from_one(tracks: Tracks) -> tuple[Tracks, tuple[str, ...]]:
    """Return rows whose ids begin at 1, and a note where they had to be raised because the file counts from 0."""
    if not len(tracks) or int(tracks.ids.min()) >= 1:
        return tracks, ()
    groups = np.where(tracks.groups > 0, tracks.groups + 1, 0)
    return tracks.replace(ids=tracks.ids + 1, groups=groups), ("ids count from 0 there; here each is one more",)


def cut_to(tracks: Tracks, size: tuple[int, int] | None) -> Tracks:
    """Return the rows without those pixels of silhouettes that leave a picture (height, width), where it is known."""
    if size is None or not any(mask.bits.size for mask in tracks.masks):
        return tracks
    cut = (disjoint([mask], *size)[0] if mask.bits.size else mask for mask in tracks.masks)
    return tracks.replace(masks=tuple(cut))


def with_times(content: Content, fps: float | None) -> Content:
    """Return the content with a time for each row: frames / `fps` where that is given, or where rows have none."""
    if content.timed and fps is None:
        return content
    told = fps or content.fps
    times = content.tracks.frames / (told or RATE)
    return content.replace(tracks=content.tracks.replace(times=times), fps=told)


def rate_of(tracks: Tracks) -> float | None:
    """Return the frames a second at which all rows have their times, to a millisecond; None where there is none."""
    after = tracks.frames > 0
    if not after.any():
        return None
    rates = tracks.frames[after] / np.maximum(tracks.times[after], 1e-9)
    rate = float(np.median(rates))
    if not math.isfinite(rate) or not 0 < rate <= _FASTEST:
        return None
    near = round(rate) if abs(rate - round(rate)) < 1e-3 * rate else rate
    return near if keeps_time(tracks, near) else None


def keeps_time(tracks: Tracks, fps: float) -> bool:
    """Return whether every row's time is frame / `fps`, to a millisecond."""
    return bool((np.abs(tracks.times - tracks.frames / fps) <= 1e-3).all())


def ordered(tracks: Tracks) -> Tracks:
    """Return the rows in the order of (frame, id)."""
    order: NDArray[np.intp] = np.lexsort((tracks.ids, tracks.frames))
    return tracks.take(order)


_SIDES = ("left", "top", "right", "bottom")
_SUREST = 1e30
_FASTEST = 1e6  # frames a second

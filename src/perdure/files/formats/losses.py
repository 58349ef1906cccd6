"""What a format cannot hold of some rows, in words, and of how many."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.masks import part, touching
from perdure.files.formats.content import RATE, Content, Format, keeps_time, rate_of
from perdure.files.formats.traits import Trait
from perdure.types import Status, Tracks


class Loss(NamedTuple):
    """What is lost, in words, and of how many rows."""

    what: str
    rows: int

    def __str__(self) -> str:
        return f"{self.what} ({self.rows} row{'s' if self.rows != 1 else ''})"


def lost(content: Content, format_: Format) -> list[Loss]:
    """Return what a format does not hold of a content; nothing that the content does not have."""
    tracks = content.tracks
    if not len(tracks):
        return []
    found = []
    for trait, said in _SAID.items():
        whole = _PART_OF.get(trait)
        if trait in format_.holds or (whole is not None and whole not in format_.holds):
            continue
        rows = int(np.count_nonzero(said(tracks)))
        if rows:
            found.append(Loss(trait.value, rows))
    return found + _lost_words(tracks, format_) + _lost_times(tracks, format_) + _rounded(tracks, format_.rounds)


def _lost_words(tracks: Tracks, format_: Format) -> list[Loss]:
    """Classes that the format has no word for."""
    if Trait.CLASS not in format_.holds:
        return []
    found = []
    if format_.classes:
        others = int(np.count_nonzero(~np.isin(tracks.classes, ("", *format_.classes))))
        found += [Loss(f"classes other than {' and '.join(format_.classes)}", others)] if others else []
    if format_.blank != " ":
        apart = sum(len(str(one).split()) > 1 for one in tracks.classes)
        found += [Loss(f"blanks in classes: they are {format_.blank!r} there", apart)] if apart else []
    none = int(np.count_nonzero(tracks.classes == ""))
    if none and format_.unnamed:
        found.append(
            Loss(f"that no class is known: it says {format_.unnamed!r} there; --class names another", none)
        )
    return found


def _lost_times(tracks: Tracks, format_: Format) -> list[Loss]:
    """Times that will not be those that are taken when the file is read again."""
    if Trait.TIME in format_.holds or keeps_time(tracks, RATE):
        return []
    rate = rate_of(tracks)
    if rate is not None and Trait.RATE in format_.holds:
        return []
    return [Loss("times" if rate is None else f"times: read it with --fps {rate:.6g}", len(tracks))]


def _rounded(tracks: Tracks, rounds: Mapping[str, float]) -> list[Loss]:
    """Values that are finer than the format's steps."""
    values = {"boxes": tracks.boxes, "times": tracks.times, "confidence": tracks.confidence}
    found = []
    for name, step in rounds.items():
        exact = np.asarray(values[name], np.float64).reshape(len(tracks), -1)
        away = np.abs(exact - np.round(exact / step) * step).max(axis=1)
        rows = int(np.count_nonzero(away > step / 20))
        if rows:
            found.append(Loss(f"{name} finer than {step:g}{_UNITS[name]}", rows))
    return found


def _has_mask(tracks: Tracks) -> NDArray[np.bool_]:
    return np.array([mask.bits.size > 0 for mask in tracks.masks])


def _has_outline(tracks: Tracks) -> NDArray[np.bool_]:
    return np.array([one is not None for one in tracks.outlines])


def _has_own_box(tracks: Tracks) -> NDArray[np.bool_]:
    differs = (tracks.boxes != tracks.visible_boxes).any(axis=1)
    return np.asarray(_has_mask(tracks) & differs)


def _is_covered(tracks: Tracks) -> NDArray[np.bool_]:
    """Rows of whose silhouette an earlier row of the frame has a pixel too."""
    covered = np.zeros(len(tracks), np.bool_)
    crops = tracks.visible_boxes.astype(np.int64)
    for frame in np.unique(tracks.frames):
        rows = np.flatnonzero(tracks.frames == frame)
        for one, other, box in touching(crops[rows], crops[rows]):
            if one < other and (part(tracks.masks[rows[one]], box) & part(tracks.masks[rows[other]], box)).any():
                covered[rows[other]] = True
    return covered


def _changes(tracks: Tracks, column: NDArray[np.generic]) -> NDArray[np.bool_]:
    """Rows of ids that do not have one value throughout."""
    _, values = np.unique(column, return_inverse=True)
    _, ids = np.unique(tracks.ids, return_inverse=True)
    least, most = np.full(ids.max() + 1, values.max()), np.zeros(ids.max() + 1, np.int64)
    np.minimum.at(least, ids, values)
    np.maximum.at(most, ids, values)
    return np.asarray((least != most)[ids])


_SAID: Mapping[Trait, Callable[[Tracks], NDArray[np.bool_]]] = {
    Trait.BOX: _has_own_box,
    Trait.MASK: _has_mask,
    Trait.MASK_TOO: lambda tracks: _has_mask(tracks) & _has_outline(tracks),
    Trait.OVERLAP: _is_covered,
    Trait.BELIEVED: lambda tracks: np.array([one is not None for one in tracks.believed]),
    Trait.OUTLINE: _has_outline,
    Trait.CLASS: lambda tracks: tracks.classes != "",
    Trait.CHANGING_CLASS: lambda tracks: _changes(tracks, tracks.classes),
    Trait.CONFIDENCE: lambda tracks: tracks.confidence != 1,
    Trait.CHANGING_CONFIDENCE: lambda tracks: _changes(tracks, tracks.confidence),
    Trait.STATUS: lambda tracks: tracks.status != Status.VISIBLE,
    Trait.LOST: lambda tracks: tracks.status == Status.LOST,
    Trait.GROUP: lambda tracks: tracks.groups > 0,
    Trait.INFERRED: lambda tracks: tracks.inferred,
    Trait.SIDE: lambda tracks: tracks.hidden_side != "",
    Trait.GROUND: lambda tracks: np.array([one is not None for one in tracks.ground]),
    Trait.LINKS: lambda tracks: np.array([len(one) > 0 for one in tracks.links]),
}
_PART_OF = {  # told only where the format holds the rest of it
    Trait.MASK_TOO: Trait.MASK,
    Trait.OVERLAP: Trait.MASK,
    Trait.CHANGING_CLASS: Trait.CLASS,
    Trait.CHANGING_CONFIDENCE: Trait.CONFIDENCE,
    Trait.LOST: Trait.STATUS,
}
_UNITS = {"boxes": " px", "times": " s", "confidence": ""}

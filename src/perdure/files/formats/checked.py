"""Rows that came as whole columns, checked as `Gathering` checks them one by one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError
from perdure.files.formats.content import LARGEST_ID, LAST, Content, counted_from_one, ordered
from perdure.types.regions import FARTHEST


def checked(path: Path, content: Content) -> Content:
    """Return the content in the order of (frame, id); FormatError names the first row that cannot be."""
    tracks = content.tracks
    x1, y1, x2, y2 = tracks.boxes.T
    faults = {
        f"a frame that is not from 0 to {LAST}": (tracks.frames < 0) | (tracks.frames > LAST),
        f"an id that is not from 0 to {LARGEST_ID}": (tracks.ids < 0) | (tracks.ids > LARGEST_ID),
        "a group below 0": tracks.groups < 0,
        "a box that is inside out or too far out": (x1 > x2)
        | (y1 > y2)
        | (np.abs(tracks.boxes) > FARTHEST).any(axis=1),
    }
    for what, wrong in faults.items():
        _refuse(path, what, wrong)
    order = np.lexsort((tracks.ids, tracks.frames))
    frames, ids = tracks.frames[order], tracks.ids[order]
    twice = np.zeros(len(tracks), np.bool_)
    twice[order[1:]] = (frames[1:] == frames[:-1]) & (ids[1:] == ids[:-1])
    _refuse(path, "an id that its frame has already", twice)
    raised, notes = counted_from_one(ordered(tracks))
    return content.replace(tracks=raised, notes=(*content.notes, *notes))


def _refuse(path: Path, what: str, wrong: NDArray[np.bool_]) -> None:
    if wrong.any():
        raise FormatError(f"{path}, row {int(np.argmax(wrong))} (from 0) has {what}")

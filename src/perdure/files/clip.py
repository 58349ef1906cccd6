"""What is known of a composed clip: `clip.json` (its events) and `blobs.txt` (who shares a connected blob)."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path

from perdure.errors import FormatError
from perdure.files.mot_table import read_lines
from perdure.files.span import shown
from perdure.types import Event

_MOMENTS = ("merge", "split", "enter", "leave")
_STRETCHES = ("full_occlusion", "occluded", "behind", "in_front", "stands")


def read_clip(path: Path) -> tuple[tuple[Event, ...], tuple[int, int] | None]:
    """Return the events of a `clip.json` and, where it says, the height and width of the pictures.

    Frames count from 0 here; events of other things than objects, and merges or splits of fewer than two, are left
    out.

    A split or leave stands at the first frame after it.

    Raises
    ------
    FormatError
        Naming file and event.
    """
    try:
        clip = json.loads(path.read_text(encoding="utf-8-sig"))
        events, size = clip["events"], (clip.get("height"), clip.get("width"))
    except OSError as error:
        raise FormatError(f"cannot read {path}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise FormatError(f"{path} is no description of a clip: wanted is a JSON object with 'events'") from error
    if not isinstance(events, list):
        raise FormatError(f"{path}: 'events' must be a list, not {shown(events)}")
    found = []
    for number, event in enumerate(events, 1):
        try:
            if event["type"] in (*_MOMENTS, *_STRETCHES):
                found.append(_event(event))
        except (KeyError, TypeError, ValueError) as error:
            raise FormatError(
                f"{path}, event {number}: wanted are 'type', 'frame' or 'begin' and 'end', and 'ids'"
            ) from error
    are_sides = all(type(side) is int and 1 <= side <= _LONGEST_SIDE for side in size)
    told = size if are_sides else None
    return tuple(one for one in found if len(set(one.ids)) >= (2 if one.kind in ("merge", "split") else 1)), told


def read_blobs(path: Path) -> Mapping[int, tuple[frozenset[int], ...]]:
    """Return for each frame, counted from 0, the ids in each connected blob; lines as `106 1+3 2`.

    Raises
    ------
    FormatError
        Naming file and line.
    """
    found: dict[int, tuple[frozenset[int], ...]] = {}
    for number, line in enumerate(read_lines(path), 1):
        if not line.strip():
            continue
        frame, *blobs = line.split()
        try:
            found[_whole(frame, _LAST) - 1] = tuple(
                frozenset(_whole(one, _LARGEST_ID) for one in blob.split("+")) for blob in blobs
            )
        except ValueError as error:
            raise FormatError(
                f"{path}, line {number}: {shown(line.strip())} is not a frame and blobs such as 1+3"
            ) from error
    return found


def _whole(word: str, most: int) -> int:
    """The number from 1 on that a word says; ValueError for what is none."""
    if not re.fullmatch(r"[0-9]{1,18}", word) or not 1 <= int(word) <= most:
        raise ValueError
    return int(word)


def _event(event: Mapping[str, object]) -> Event:
    kind = str(event["type"])
    begin = event["frame"] if kind in _MOMENTS else event["begin"]
    end = begin if kind in _MOMENTS else event["end"]
    ids = event["ids"]
    if not isinstance(ids, list) or not {type(one) for one in (begin, end, *ids)} <= {int}:
        raise TypeError
    if not 1 <= begin <= end <= _LAST or not all(1 <= one <= _LARGEST_ID for one in ids):  # type: ignore[operator]
        raise ValueError
    return Event(kind, begin - 1, end - 1, tuple(ids))  # type: ignore[operator]


_LAST, _LARGEST_ID = 10**9, 2**53  # frame, id
_LONGEST_SIDE = 1 << 16  # px, of a picture

"""What is known of a composed clip: `clip.json` (its events) and `blobs.txt` (who shares a connected blob)."""

from __future__ import annotations

import json
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
    told = (size[0], size[1]) if isinstance(size[0], int) and isinstance(size[1], int) else None
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
            found[int(frame) - 1] = tuple(frozenset(int(one) for one in blob.split("+")) for blob in blobs)
        except ValueError as error:
            raise FormatError(
                f"{path}, line {number}: {shown(line.strip())} is not a frame and blobs such as 1+3"
            ) from error
    return found


def _event(event: Mapping[str, object]) -> Event:
    kind = str(event["type"])
    begin = event["frame"] if kind in _MOMENTS else event["begin"]
    end = begin if kind in _MOMENTS else event["end"]
    ids = event["ids"]
    if not isinstance(begin, int) or not isinstance(end, int) or not isinstance(ids, list):
        raise TypeError
    return Event(kind, begin - 1, end - 1, tuple(int(one) for one in ids))

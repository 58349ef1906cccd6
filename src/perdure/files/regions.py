"""Files of regions: JSON lines of `perdure detect` (with masks), or MOTChallenge text."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from perdure.errors import FormatError
from perdure.files.lines import Line, line_at, mask_of_json, mask_to_json, read_lines, short, short_row, to_line
from perdure.files.mot import read_detections
from perdure.files.room import Room
from perdure.files.span import cut, shown
from perdure.files.whole import whole_file
from perdure.types import Event, Frame, Mask, Regions
from perdure.types.regions import FARTHEST

FORMAT, VERSION = "perdure-regions", 1
_LAST = 10**9  # frame
_LEAST_BYTES = 64  # of a region in a line


def write_regions(path: Path, seen: Iterable[tuple[Frame, Regions]]) -> int:
    """Write regions frame by frame, by the name's ending: `.jsonl` keeps all, `.txt` is MOTChallenge boxes.

    Returns the number of regions. The file appears whole or not at all.
    """
    check_ending(path)
    count = 0
    with whole_file(path) as file:
        if _keeps_all(path):
            file.write(to_line({"format": FORMAT, "version": VERSION}))
        for frame, regions in seen:
            count += len(regions)
            file.write(to_line(_to_json(frame, regions)) if _keeps_all(path) else _to_mot(frame, regions))
    return count


def check_ending(path: Path) -> None:
    """Refuse a name that is not one of a regions file."""
    if path.suffix.lower() not in (".jsonl", ".txt"):
        raise FormatError(
            f"{path}: a regions file ends in .jsonl (boxes, scores, masks) or .txt (MOTChallenge boxes)"
        )


def read_regions(path: Path) -> Mapping[int, Regions]:
    """Return the regions by frame number (from 0), for either kind of file; silhouettes stay on disk.

    Raises
    ------
    FormatError
        Naming file and line, if it is neither.
    """
    _refuse_device(path)
    if not _keeps_all(path):
        return read_detections(path)
    places: dict[int, tuple[int, int]] = {}
    for line in read_lines(path, FORMAT, VERSION):
        frame = _frame_of(path, line)
        if frame in places:
            raise FormatError(
                f"{path}, line {line.number}: frame {frame} was given already, in line {places[frame][0]};"
                " give each frame once"
            )
        places[frame] = line.number, line.offset
    return _OnDisk(path, places)


def _refuse_device(path: Path) -> None:
    """Refuse what is no regular file; boxes as text may also come through a pipe, which is read once."""
    try:
        wrong = path.exists() and not path.is_file() and (_keeps_all(path) or not path.is_fifo())
    except OSError as error:
        raise FormatError(f"cannot read {cut(str(path))}: {error.strerror or error}") from None
    if wrong or "\0" in str(path):
        raise FormatError(f"{cut(str(path), 250)} is no regular file; give a file of regions")


def _keeps_all(path: Path) -> bool:
    """Whether a file is named as one that keeps all of a region; in any letter case."""
    return path.suffix.lower() == ".jsonl"


class _OnDisk(Mapping[int, Regions]):
    """Regions by frame, each read when it is asked for."""

    def __init__(self, path: Path, places: Mapping[int, tuple[int, int]]) -> None:
        self._path, self._places = path, places  # frame -> line number, byte offset

    def __getitem__(self, index: int) -> Regions:
        return _read(self._path, line_at(self._path, *self._places[index]))

    def __iter__(self) -> Iterator[int]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


def _frame_of(path: Path, line: Line) -> int:
    """The number of a line's frame, once all that the line says is found good."""
    _read(path, line)
    frame = line.value.get("frame")
    if type(frame) is not int or not 0 <= frame <= _LAST:
        raise FormatError(
            f"{path}, line {line.number}: frame = {shown(frame)} is no whole number from 0 on, up to {_LAST}"
        )
    return frame


def _read(path: Path, line: Line) -> Regions:
    try:
        return _of_line(line.value)
    except ValueError as error:
        raise FormatError(f"{path}, line {line.number}: {error}") from None


def _to_json(frame: Frame, regions: Regions) -> Any:
    value: dict[str, Any] = {"frame": frame.index, "time": frame.time}
    value["boxes"] = [short_row(box) for box in regions.boxes]
    value["scores"] = [short(score) for score in regions.scores]
    value["classes"] = [str(name) for name in regions.classes]
    value["masks"] = [mask_to_json(mask) if mask.bits.size else None for mask in regions.masks]
    if regions.blind:
        value["blind"] = True
    if regions.events:
        value["events"] = [{name: getattr(event, name) for name in _EVENT} for event in regions.events]
    return value


_EVENT = ("kind", "begin", "end", "why")  # what a detector's event says


def _of_line(value: Mapping[str, Any]) -> Regions:
    """The regions that a line says; ValueError says in one line what is wrong with them."""
    boxes = value.get("boxes")
    if not isinstance(boxes, list):
        raise ValueError("boxes must be there, as a list of [x1, y1, x2, y2]")
    if not all(isinstance(box, list) and len(box) == 4 and _are_numbers(box) for box in boxes):
        raise ValueError("a box must be four numbers [x1, y1, x2, y2]")
    if not all(abs(place) <= FARTHEST for box in boxes for place in box):
        raise ValueError(f"a box must be finite, and may reach {FARTHEST:g} pixels at most")
    scores = _column(value, "scores", [1.0] * len(boxes))
    if not _are_numbers(scores) or not all(0 <= score <= 1 for score in scores):
        raise ValueError("scores must be numbers in [0, 1]")
    classes = _column(value, "classes", [""] * len(boxes))
    if not all(isinstance(one, str) for one in classes):
        raise ValueError("classes must be texts")
    masks = _column(value, "masks", [None] * len(boxes))
    blind = value.get("blind", False)
    if type(blind) is not bool:
        raise ValueError("blind must be true or false")
    room = Room(len(boxes) * _LEAST_BYTES)
    regions = Regions.of(
        np.array(boxes, np.float32).reshape(-1, 4),
        scores,
        classes,
        [Mask.empty() if one is None else room.keep(mask_of_json(one)) for one in masks],
    )
    return dataclasses.replace(regions, events=_events(value.get("events", []), value.get("frame")), blind=blind)


def _events(said: Any, frame: Any) -> tuple[Event, ...]:
    """The events of a frame's line."""
    if not isinstance(said, list) or not all(isinstance(one, dict) and set(one) == set(_EVENT) for one in said):
        raise ValueError(f"events must be a list of {{{', '.join(_EVENT)}}}")
    for one in said:
        if not all(isinstance(one[name], str) for name in ("kind", "why")):
            raise ValueError("an event's kind and why must be texts")
        if not one["kind"]:
            raise ValueError("an event must be of a kind")
        if not all(type(one[name]) is int for name in ("begin", "end")) or not 0 <= one["begin"] <= one["end"]:
            raise ValueError("an event's begin and end must be frames, whole numbers from 0 on, in this order")
        if type(frame) is int and one["end"] > frame:
            raise ValueError(f"an event cannot end in frame {one['end']}, after the frame in which it is told")
    return tuple(Event(**one) for one in said)


def _column(value: Mapping[str, Any], name: str, default: list[Any]) -> list[Any]:
    """One entry a box, or the default where the file leaves it out."""
    column = value.get(name)
    if column is None or column == []:
        return default
    if not isinstance(column, list) or len(column) != len(default):
        raise ValueError(f"{name} must be a list as long as boxes, {len(default)}")
    return column


def _are_numbers(values: list[Any]) -> bool:
    return set(map(type, values)) <= {int, float}


def _to_mot(frame: Frame, regions: Regions) -> str:
    return "".join(
        f"{frame.index + 1},-1,{box[0] + 1:.2f},{box[1] + 1:.2f},{box[2] - box[0]:.2f},{box[3] - box[1]:.2f},"
        f"{score:.4g},-1,-1,-1\n"
        for box, score in zip(regions.boxes.astype(float), regions.scores, strict=True)
    )

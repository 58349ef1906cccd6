"""Files of regions: JSON lines of `perdure detect` (with masks), or MOTChallenge text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from perdure.errors import FormatError
from perdure.files.lines import Line, line_at, mask_of_json, mask_to_json, read_lines, short, short_row, to_line
from perdure.files.mot import read_detections
from perdure.files.whole import whole_file
from perdure.types import Frame, Mask, Regions

FORMAT, VERSION = "perdure-regions", 1


def write_regions(path: Path, seen: Iterable[tuple[Frame, Regions]]) -> int:
    """Write regions frame by frame, by the name's ending: `.jsonl` keeps all, `.txt` is MOTChallenge boxes.

    Returns the number of regions. The file appears whole or not at all.
    """
    check_ending(path)
    count = 0
    with whole_file(path) as file:
        if path.suffix == ".jsonl":
            file.write(to_line({"format": FORMAT, "version": VERSION}))
        for frame, regions in seen:
            count += len(regions)
            file.write(to_line(_to_json(frame, regions)) if path.suffix == ".jsonl" else _to_mot(frame, regions))
    return count


def check_ending(path: Path) -> None:
    """Refuse a name that is not one of a regions file."""
    if path.suffix not in (".jsonl", ".txt"):
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
    if path.suffix != ".jsonl":
        return read_detections(path)
    return _OnDisk(
        path, {_frame_of(path, line): (line.number, line.offset) for line in read_lines(path, FORMAT, VERSION)}
    )


class _OnDisk(Mapping[int, Regions]):
    """Regions by frame, each read when it is asked for."""

    def __init__(self, path: Path, places: Mapping[int, tuple[int, int]]) -> None:
        self._path, self._places = path, places  # frame -> line number, byte offset

    def __getitem__(self, index: int) -> Regions:
        return _of_line(line_at(self._path, *self._places[index]))

    def __iter__(self) -> Iterator[int]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


def _frame_of(path: Path, line: Line) -> int:
    try:
        _of_line(line)
        return int(line.value["frame"])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise FormatError(f"{path}, line {line.number}: not the regions of a frame ({error!r})") from error


def _to_json(frame: Frame, regions: Regions) -> Any:
    value: dict[str, Any] = {"frame": frame.index, "time": frame.time}
    value["boxes"] = [short_row(box) for box in regions.boxes]
    value["scores"] = [short(score) for score in regions.scores]
    value["classes"] = [str(name) for name in regions.classes]
    value["masks"] = [mask_to_json(mask) if mask.bits.size else None for mask in regions.masks]
    return value


def _of_line(line: Line) -> Regions:
    value = line.value
    count = len(value["boxes"])
    return Regions.of(
        np.array(value["boxes"], np.float32).reshape(count, 4),
        value.get("scores"),
        value.get("classes") or [""] * count,
        [Mask.empty() if one is None else mask_of_json(one) for one in value.get("masks") or [None] * count],
    )


def _to_mot(frame: Frame, regions: Regions) -> str:
    return "".join(
        f"{frame.index + 1},-1,{box[0] + 1:.2f},{box[1] + 1:.2f},{box[2] - box[0]:.2f},{box[3] - box[1]:.2f},"
        f"{score:.4g},-1,-1,-1\n"
        for box, score in zip(regions.boxes.astype(float), regions.scores, strict=True)
    )

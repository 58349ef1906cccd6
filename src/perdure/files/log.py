"""The run log `tracks.jsonl`: a report a line, append-only; whatever byte it is cut off at, it is valid."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np

from perdure.errors import FormatError, OutputError
from perdure.files.lines import (
    mask_of_json,
    mask_to_json,
    outline_of_json,
    outline_to_json,
    read_lines,
    short,
    short_row,
    to_line,
)
from perdure.files.whole import cannot_write, lock
from perdure.types import Dropped, Event, Explanation, Ground, Mask, Renamed, Report, Status, Tracks

FORMAT, VERSION = "perdure-log", 1
Json = Any


class Entry(NamedTuple):
    """One line of a log: the report of a frame; frame -1 for what was said when the run finished."""

    frame: int
    time: float
    report: Report


@dataclass(frozen=True)
class LogMark:
    """A place in a log: how many bytes are before it, and their CRC-32."""

    size: int
    checksum: int


class RunLog:
    """A log being written; every line is with the operating system before the next frame is read.

    Nobody else can write it meanwhile. With a mark it goes on from there: what was written behind it is cut off.

    Raises
    ------
    OutputError
        If it cannot be written, somebody else is writing it, or what is before the mark is not what it was.
    """

    def __init__(self, path: Path, mark: LogMark | None = None) -> None:
        self._path = path
        self._size = self._checksum = 0
        try:
            self._file = path.open("a+b", buffering=0)
        except OSError as error:
            raise cannot_write(path, error) from error
        try:
            lock(self._file, path)
            if mark is not None:
                self._go_on(mark)
            elif self._file.seek(0, os.SEEK_END):
                self._file.truncate(0)
            if mark is None:
                self._write({"format": FORMAT, "version": VERSION})
        except OSError as error:
            self._file.close()
            raise cannot_write(path, error) from error
        except BaseException:
            self._file.close()
            raise

    @property
    def mark(self) -> LogMark:
        """Where the log ends now."""
        return LogMark(self._size, self._checksum)

    def append(self, frame: int, time: float, report: Report) -> None:
        """Write the report of one frame."""
        try:
            self._write(report_to_json(frame, time, report))
        except OSError as error:
            raise OutputError(
                f"cannot write {self._path}: {error.strerror or error}; what is in it is kept: make room, and go on with "
                "--resume"
            ) from error

    def sync(self) -> None:
        """Have everything so far on the disk."""
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            raise cannot_write(self._path, error) from error

    def _write(self, value: Json) -> None:
        line = to_line(value).encode()
        rest = memoryview(line)
        while rest:  # a disk that becomes full takes a part
            rest = rest[self._file.write(rest) :]
        self._size += len(line)
        self._checksum = crc32(line, self._checksum)

    def _go_on(self, mark: LogMark) -> None:
        """Cut off what is behind a mark, if what is before it is what it was."""
        self._file.seek(0)
        left = mark.size
        while left and (piece := self._file.read(min(left, 1 << 20))):
            left -= len(piece)
            self._checksum = crc32(piece, self._checksum)
        if left or self._checksum != mark.checksum:
            raise OutputError(
                f"{self._path} is not the log that this run wrote: it was changed or cut; start anew with --overwrite"
            )
        self._size = mark.size
        self._file.truncate(mark.size)

    def __enter__(self) -> RunLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()


def read_log(path: Path, *, with_masks: bool = True) -> Iterator[Entry]:
    """Yield the entries of a log, in order; without silhouettes, which is faster, where nobody needs them.

    Raises
    ------
    FormatError
        Naming file and line, if the log is damaged elsewhere than at its cut-off end.
    """
    for number, _, value in read_lines(path, FORMAT, VERSION):
        try:
            entry = Entry(int(value["frame"]), float(value["time"]), report_of_json(value, with_masks))
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
            raise FormatError(f"{path}, line {number}: not a report ({error})") from error
        yield entry


def report_to_json(frame: int, time: float, report: Report) -> Json:
    """Return a report as plain values; columns at their default are left out."""
    value: dict[str, Json] = {"frame": frame, "time": time}
    value["rows"] = [_row_to_json(report.rows, i, frame) for i in range(len(report.rows))]
    if report.renamed:
        value["renamed"] = [[one.old, one.new, one.begin, one.end] for one in report.renamed]
    if report.dropped:
        value["dropped"] = [[one.id, one.begin, one.end] for one in report.dropped]
    if report.events:
        value["events"] = [dataclasses.asdict(one) for one in report.events]
    if report.begun:
        value["begun"] = [dataclasses.asdict(one) for one in report.begun]
    if report.explanations:
        value["explanations"] = [
            {"id": one.id, "why": one.why, "figures": dict(one.figures)} for one in report.explanations
        ]
    return value


def report_of_json(value: Mapping[str, Json], with_masks: bool = True) -> Report:
    """Return the report that `report_to_json` wrote."""
    frame, time = int(value["frame"]), float(value["time"])
    return Report(
        rows=_rows_of_json(value["rows"], frame, time, with_masks),
        renamed=tuple(Renamed(*map(int, one)) for one in value.get("renamed", ())),
        dropped=tuple(Dropped(*map(int, one)) for one in value.get("dropped", ())),
        events=_events_of_json(value.get("events", ())),
        begun=_events_of_json(value.get("begun", ())),
        explanations=tuple(Explanation(**one) for one in value.get("explanations", ())),
    )


def _events_of_json(value: Iterable[Mapping[str, Json]]) -> tuple[Event, ...]:
    return tuple(Event(**{**one, "ids": tuple(map(int, one["ids"]))}) for one in value)


def _row_to_json(rows: Tracks, i: int, frame: int) -> Json:
    row: dict[str, Json] = {"id": int(rows.ids[i]), "box": short_row(rows.boxes[i])}
    if rows.frames[i] != frame:
        row["frame"], row["time"] = int(rows.frames[i]), float(rows.times[i])
    row["status"] = Status(rows.status[i]).word
    row["confidence"] = short(rows.confidence[i])
    believed, outline, ground = rows.believed[i], rows.outlines[i], rows.ground[i]
    optional = {
        "class": str(rows.classes[i]),
        "group": int(rows.groups[i]),
        "inferred": bool(rows.inferred[i]),
        "hidden_side": str(rows.hidden_side[i]),
        "links": list(rows.links[i]),
        "ground": None if ground is None else [one for one in ground if one is not None],
        "believed": None if believed is None else mask_to_json(believed),
        "outline": None if outline is None else outline_to_json(outline),
        "mask": mask_to_json(rows.masks[i]) if rows.masks[i].bits.size else None,
    }
    return row | {key: value for key, value in optional.items() if value}


def _rows_of_json(rows: list[Json], frame: int, time: float, with_masks: bool) -> Tracks:
    if not rows:
        return Tracks.empty()
    return Tracks.of(
        frames=[row.get("frame", frame) for row in rows],
        times=[row.get("time", time) for row in rows],
        ids=[row["id"] for row in rows],
        boxes=np.array([row["box"] for row in rows], np.float32),
        status=[Status[row["status"].upper()] for row in rows],
        confidence=[row["confidence"] for row in rows],
        classes=[row.get("class", "") for row in rows],
        groups=[row.get("group", 0) for row in rows],
        inferred=[row.get("inferred", False) for row in rows],
        hidden_side=[row.get("hidden_side", "") for row in rows],
        links=[tuple(map(int, row.get("links", ()))) for row in rows],
        ground=[Ground(*map(float, row["ground"])) if "ground" in row else None for row in rows],
        believed=[mask_of_json(row["believed"]) if with_masks and "believed" in row else None for row in rows],
        outlines=[outline_of_json(row["outline"]) if with_masks and "outline" in row else None for row in rows],
        masks=[mask_of_json(row["mask"]) if with_masks and "mask" in row else _NO_MASK for row in rows],
    )


_NO_MASK = Mask.empty()

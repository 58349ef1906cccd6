"""The run log `tracks.jsonl`: a report a line, append-only; whatever byte it is cut off at, it is valid."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple
from zlib import crc32

from perdure.errors import FormatError, OutputError
from perdure.files.lines import read_lines, to_line
from perdure.files.reports import check_report, report_of_json, report_to_json
from perdure.files.whole import cannot_write, lock
from perdure.types import Report

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
    newest = -1
    for number, _, value in read_lines(path, FORMAT, VERSION):
        try:
            frame, time = check_report(value, newest)
            entry = Entry(frame, time, report_of_json(value, with_masks))
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
            raise FormatError(f"{path}, line {number}: not a report ({error})") from error
        newest = max(newest, frame)
        yield entry

"""A run's log as columns, read on as it grows: what a viewer needs of it in memory, and where the rest is.

Silhouettes stay in the file: 50 people for 10 000 frames are 20 MB here, and their silhouettes ten times that.
"""

from __future__ import annotations

import json
import re
import time
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError
from perdure.files.lines import check_header, json_of, why_not_json
from perdure.files.log import FORMAT, VERSION
from perdure.files.reports import check_report
from perdure.types import Dropped, Event, Explanation, Renamed, Status

_SHAPES = re.compile(rb',"(?:mask|believed|outline)":\{[^{}]*\}')
_STATUS = {one.word: int(one) for one in Status}
_TAIL = 256  # bytes
SIDES = {"left": 1, "top": 2, "right": 4, "bottom": 8}
Json = Any


class Columns(NamedTuple):
    """Rows as they were said, in the order of the log; all (N,) but the boxes, (N, 4)."""

    frames: NDArray[np.int64]
    ids: NDArray[np.int64]
    groups: NDArray[np.int64]
    boxes: NDArray[np.float32]
    status: NDArray[np.int8]
    confidence: NDArray[np.float32]
    inferred: NDArray[np.bool_]
    hidden: NDArray[np.uint8]  # sides that are not seen, a bit each: `SIDES`
    numbers: NDArray[np.int64]  # of the report
    places: NDArray[np.int64]  # in the report

    @staticmethod
    def empty() -> Columns:
        """Return no rows."""
        return Columns(*(np.zeros((0, 4) if name == "boxes" else 0, kind) for name, kind in _KINDS.items()))


_KINDS: Mapping[str, Any] = {
    "frames": np.int64,
    "ids": np.int64,
    "groups": np.int64,
    "boxes": np.float32,
    "status": np.int8,
    "confidence": np.float32,
    "inferred": np.bool_,
    "hidden": np.uint8,
    "numbers": np.int64,
    "places": np.int64,
}
_CODES = {
    "frames": "q",
    "ids": "q",
    "groups": "q",
    "boxes": "f",
    "status": "b",
    "confidence": "f",
    "inferred": "b",
}
_CODES |= {"hidden": "B", "numbers": "q", "places": "q"}


@dataclass
class Ledger:
    """The log of one run; `refresh` reads what came since.

    A last line cut off is left until it is whole. At a whole line that is damaged reading ends for good: `damage` says
    where and why, and what came before it stands.
    """

    path: Path
    damage: str = ""
    complete: bool = False  # whether all whole lines were read when it was last looked at
    version: int = 0  # rises with every change
    frames: array[int] = field(default_factory=lambda: array("q"))  # of the film, in the order of the log
    times: array[float] = field(default_factory=lambda: array("d"))  # s
    offsets: array[int] = field(default_factory=lambda: array("q"))  # of each report in the file, bytes
    corrections: list[tuple[int, Renamed | Dropped]] = field(default_factory=list)
    events: list[tuple[int, int, Event]] = field(default_factory=list)  # number of the report, number there
    narrow: list[tuple[int, int, int, int, float]] = field(default_factory=list)
    # links hardly better than another: number of the report, frame, id, runner-up, margin
    classes: dict[int, str] = field(default_factory=dict)  # by id as said, the last that was told
    explains: bool = False  # whether any link is explained
    _at: int = 0  # bytes that were read
    _lines: int = 0
    _tail: bytes = b""  # the end of what was read: a log that was replaced has another there
    _rows: dict[str, array[Any]] = field(default_factory=dict)

    def refresh(self, seconds: float = 1e9) -> bool:
        """Read whole lines for some time; return whether there were any.

        A log that was replaced by another is read from its beginning.
        """
        try:
            if not self._rows or not self._stands():
                self._begin()
            return self._read_on(time.monotonic() + seconds)
        except OSError as error:
            self.complete = True
            return self._fail(f"cannot read {self.path}: {error.strerror or error}")

    def columns(self) -> Columns:
        """Return a copy of the rows so far."""
        if not self._rows:
            return Columns.empty()
        found = {name: np.array(self._rows[name], _KINDS[name]) for name in _KINDS}
        found["boxes"] = found["boxes"].reshape(-1, 4)
        return Columns(**found)

    def report(self, number: int) -> Mapping[str, Json]:
        """Return the line of a report, silhouettes and all; FormatError if it is not there any more."""
        try:
            with self.path.open("rb") as file:
                file.seek(self.offsets[number])
                value = json.loads(file.readline())
        except (OSError, ValueError, IndexError, RecursionError) as error:
            raise FormatError(f"{self.path}: report {number} cannot be read ({error})") from error
        return value if isinstance(value, Mapping) else {}

    def explanations(self, number: int) -> Iterator[Explanation]:
        """Yield the reasons of links that a report puts down; FormatError where it is damaged."""
        try:
            for one in self.report(number).get("explanations", ()):
                yield Explanation(int(one["id"]), str(one["why"]), dict(one["figures"]))
        except (KeyError, TypeError, ValueError) as error:
            raise FormatError(f"{self.path}: the reasons of report {number} are damaged ({error})") from error

    def _stands(self) -> bool:
        """Whether what was read is still there."""
        with self.path.open("rb") as file:
            file.seek(self._at - len(self._tail))
            return file.read(len(self._tail)) == self._tail

    def _begin(self) -> None:
        """Forget everything: another file."""
        version = self.version + 1
        fresh = Ledger(self.path)
        self.__dict__.update(fresh.__dict__)
        self.version = version
        self._rows = {name: array(code) for name, code in _CODES.items()}

    def _fail(self, why: str) -> bool:
        changed, self.damage = self.damage != why, why
        self.version += changed
        return changed

    def _read_on(self, until: float) -> bool:
        if self.damage:
            self.complete = True
            return False
        before = self._at
        with self.path.open("rb") as file:
            file.seek(self._at)
            for raw in file:
                if not raw.endswith(b"\n"):
                    break
                try:
                    self._take(raw)
                except FormatError as error:
                    self.complete = True
                    return self._fail(str(error))
                self._at += len(raw)
                self._tail = raw[-_TAIL:]
                if time.monotonic() > until:
                    self.complete, self.version = False, self.version + 1
                    return True
        self.complete = True
        self.version += self._at > before
        return self._at > before

    def _take(self, raw: bytes) -> None:
        """Take up a line; FormatError, with nothing taken up, if it is damaged."""
        self._lines += 1
        try:
            value = json_of(_SHAPES.sub(b"", raw))
        except (ValueError, RecursionError) as error:
            raise FormatError(f"{self.path}, line {self._lines}: not JSON ({why_not_json(error)})") from error
        if not isinstance(value, Mapping):
            raise FormatError(f"{self.path}, line {self._lines}: not a JSON object")
        if self._lines == 1:
            check_header(self.path, value, FORMAT, VERSION)
            return
        try:
            self._take_report(value)
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
            raise FormatError(f"{self.path}, line {self._lines}: not a report ({error!r:.100})") from error

    def _take_report(self, value: Mapping[str, Json]) -> None:
        (frame, instant), number = check_report(value, self.frames[-1] if self.frames else -1), len(self.offsets)
        rows = _rows(value["rows"], frame, number)
        events = [
            (number, place, Event(**{**one, "ids": tuple(one["ids"])}))
            for place, one in enumerate(value.get("events", ()))
        ]
        changes = [(number, Renamed(*one)) for one in value.get("renamed", ())]
        drops = [(number, Dropped(*one)) for one in value.get("dropped", ())]
        reasons = value.get("explanations", ())
        narrow = [one for reason in reasons if (one := _narrow(reason, number, frame)) is not None]
        for name, column in rows.items():
            self._rows[name].extend(column)
        self.classes |= {row["id"]: row["class"] for row in value["rows"] if "class" in row}
        self.events += events
        self.corrections += [*changes, *drops]
        self.narrow += narrow
        self.explains = self.explains or bool(reasons)
        self.offsets.append(self._at)
        if frame >= 0:
            self.frames.append(frame)
            self.times.append(instant)


def _rows(rows: Json, frame: int, number: int) -> dict[str, array[Any]]:
    """The columns of a report's rows, which were found good."""
    boxes = array("f", (side for row in rows for side in row["box"]))
    columns: dict[str, Any] = {
        "frames": [row.get("frame", frame) for row in rows],
        "ids": [row["id"] for row in rows],
        "groups": [row.get("group", 0) for row in rows],
        "status": [_STATUS[row["status"]] for row in rows],
        "confidence": [row["confidence"] for row in rows],
        "inferred": [1 if row.get("inferred") else 0 for row in rows],
        "hidden": [_sides(row["hidden_side"]) if "hidden_side" in row else 0 for row in rows],
        "numbers": [number] * len(rows),
        "places": range(len(rows)),
    }
    return {name: array(_CODES[name], column) for name, column in columns.items()} | {"boxes": boxes}


def _sides(words: str) -> int:
    return sum(SIDES.get(one, 0) for one in set(words.split("+")))


_NARROW = 0.1  # of a link's score, above the best rival's


def _narrow(reason: Json, number: int, frame: int) -> tuple[int, int, int, int, float] | None:
    """A link that another id would have had nearly as well; None for one that is sure."""
    figures = reason["figures"]
    for name, score in figures.items():
        if name.startswith("runner_up:") and name[10:].isdecimal():
            margin = float(figures.get("score", 0.0)) - float(score)
            if margin < _NARROW:
                return number, frame, reason["id"], int(name[10:]), margin
    return None

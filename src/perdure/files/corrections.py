"""Corrections by hand, `corrections.jsonl` beside the log: an action a line, append-only, undone ones too.

A header, then lines such as

    {"do":"swap","ids":[50,53],"begin":522}                 from frame 522 on each has the other's id
    {"do":"join","ids":[28,6],"begin":0,"end":370}          rows of 28 belong to 6
    {"do":"cut","ids":[4,71],"begin":301}                   from frame 301 on rows of 4 are those of 71, a new id
    {"do":"delete","ids":[63],"begin":0}                    rows of 63 are nothing
    {"do":"confirm","ids":[4,6],"begin":47,"event":[48,0]}  looked at, and right; nothing is changed
    {"do":"undo"}   {"do":"redo"}                           the last one that is in force; the last undone

Ids are those of the results as they were when the action was taken. `end` is the last frame, included; without it the
action holds to the end. Each action in force is a last report of the run, so whatever settles a run heeds it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from perdure.errors import FormatError, OutputError, ParameterError
from perdure.files.lines import read_lines, to_line
from perdure.files.span import shown
from perdure.files.whole import cannot_write
from perdure.params import unknown_name
from perdure.types import Dropped, Renamed, Report

FORMAT, VERSION = "perdure-corrections", 1
NAME = "corrections.jsonl"
COUNTS = {"swap": 2, "join": 2, "cut": 2, "delete": 1, "confirm": None}  # ids of each action; None for any number
OPEN_END = 2**62  # frame: no run is so long
_LARGEST_ID = 2**31 - 1
_MOST = 64  # ids of a confirmed event
Json = Any


@dataclass(frozen=True)
class Correction:
    """An action on the identities of a run.

    Parameters
    ----------
    do : str
        'swap', 'join', 'cut', 'delete' or 'confirm'.
    ids : tuple of int
        swap: both; join: who is taken up and by whom; cut: who, and the new id; delete: who; confirm: the event's.
    begin, end : int
        First and last frame, both included; None for no end.
    event : (int, int) or None
        The doubtful event that this settles: the number of its report in the log, and its number in that; of what no
        report names, -1 less the frame, and an id.
    """

    do: str
    ids: tuple[int, ...]
    begin: int
    end: int | None = None
    event: tuple[int, int] | None = None

    def report(self) -> Report:
        """Return the action as what a tracker would have said at the end of the run."""
        end = OPEN_END if self.end is None else self.end
        if self.do == "delete":
            return Report(dropped=(Dropped(self.ids[0], self.begin, end),))
        if self.do == "confirm":
            return Report.empty()
        one, other = self.ids
        there = Renamed(one, other, self.begin, end)
        return Report(renamed=(there, Renamed(other, one, self.begin, end)) if self.do == "swap" else (there,))

    def to_json(self) -> dict[str, Json]:
        """Return the line that says this."""
        value: dict[str, Json] = {"do": self.do, "ids": list(self.ids), "begin": self.begin}
        if self.end is not None:
            value["end"] = self.end
        return value | ({} if self.event is None else {"event": list(self.event)})


@dataclass(frozen=True)
class History:
    """The corrections of a run: those in force, and those undone, which can be done again, the next one last."""

    in_force: tuple[Correction, ...] = ()
    undone: tuple[Correction, ...] = ()

    def after(self, line: Correction | str) -> History:
        """Return the history after one more line: a correction, 'undo' or 'redo'; ParameterError if there is none."""
        if isinstance(line, Correction):
            return History((*self.in_force, line))
        before, beyond = (self.in_force, self.undone) if line == "undo" else (self.undone, self.in_force)
        if not before:
            raise ParameterError(f"there is nothing to {line}")
        before, beyond = before[:-1], (*beyond, before[-1])
        return History(before, beyond) if line == "undo" else History(beyond, before)


def correction_of_json(value: Json) -> Correction | str:
    """Return the action that a line says, 'undo' or 'redo'; ParameterError says what is wrong with it."""
    if not isinstance(value, Mapping):
        raise ParameterError('a correction is a JSON object such as {"do": "delete", "ids": [7], "begin": 120}')
    do = value.get("do")
    if do in ("undo", "redo"):
        return str(do)
    if not isinstance(do, str) or do not in COUNTS:
        raise ParameterError(unknown_name("correction", shown(do).strip("'"), (*COUNTS, "undo", "redo")))
    strange = sorted(set(value) - {"do", "ids", "begin", "end", "event"})
    if strange:
        raise ParameterError(unknown_name("word of a correction", strange[0], ("ids", "begin", "end", "event")))
    begin, end = _frame(value, "begin"), _frame(value, "end") if "end" in value else None
    if end is not None and end < begin:
        raise ParameterError(f"a correction cannot end in frame {end}, before it begins in frame {begin}")
    return Correction(do, _ids(do, value.get("ids")), begin, end, _event(value.get("event")))


def read_corrections(path: Path) -> History:
    """Return the corrections of a file; none where there is no file, and a last line cut off is left out.

    Raises
    ------
    FormatError
        Naming file and line, if it is damaged.
    """
    history = History()
    if not path.exists():
        return history
    for number, _, value in read_lines(path, FORMAT, VERSION):
        try:
            history = history.after(correction_of_json(value))
        except ParameterError as error:
            raise FormatError(
                f"{path}, line {number}: {error}; mend the line, or move the file away to see the run uncorrected"
            ) from error
    return history


def append_correction(path: Path, line: Correction | str) -> History:
    """Write one more line, and return the corrections after it.

    Raises
    ------
    ParameterError
        For an undo or redo without anything to undo or redo; nothing is written.
    FormatError, OutputError
        If the file is damaged, or cannot be written.
    """
    history = read_corrections(path).after(line)
    said = to_line({"do": line} if isinstance(line, str) else line.to_json())
    try:
        with path.open("ab") as file:
            _end_at_line(path, file.fileno())
            if file.seek(0, os.SEEK_END) == 0:
                file.write(to_line({"format": FORMAT, "version": VERSION}).encode())
            file.write(said.encode())
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise OutputError(str(cannot_write(path, error)).partition(";")[0]) from error
    return history


def newest_id(ids: Sequence[int], history: History) -> int:
    """Return an id that nobody has or has had: above those of the run and those of all corrections, undone ones too."""
    said = (one for done in (*history.in_force, *history.undone) for one in done.ids)
    return max((0, *ids, *said)) + 1


def with_new_id(correction: Correction, fresh: int) -> Correction:
    """Return a cut with the new id, where none was given."""
    if correction.do == "cut" and correction.ids[1] == 0:
        return replace(correction, ids=(correction.ids[0], fresh))
    return correction


def _end_at_line(path: Path, descriptor: int) -> None:
    """Take away a last line that was cut off while it was written: it never counted."""
    written = path.read_bytes()
    if written and not written.endswith(b"\n"):
        os.ftruncate(descriptor, written.rfind(b"\n") + 1)


def _ids(do: str, value: Json) -> tuple[int, ...]:
    count = COUNTS[do]
    lowest = 0 if do == "cut" else 1  # 0: a new one is to be found
    if (
        not isinstance(value, list)
        or not all(type(one) is int and lowest <= one <= _LARGEST_ID for one in value)
        or (do == "cut" and value and value[0] == 0)
    ):
        raise ParameterError(f"the ids of a {do} must be a list of whole numbers from 1 on")
    if len(value) > _MOST if count is None else len(value) != count:
        raise ParameterError(f"a {do} has {count or f'up to {_MOST}'} ids, not {len(value)}")
    if count == 2 and value[0] == value[1]:
        raise ParameterError(f"a {do} needs two different ids, not {value[0]} twice")
    return tuple(value)


def _frame(value: Mapping[str, Json], name: str) -> int:
    frame = value.get(name)
    if type(frame) is not int or not 0 <= frame <= OPEN_END:
        raise ParameterError(f"{name} = {shown(frame)} must be the number of a frame, from 0")
    return frame


def _event(value: Json) -> tuple[int, int] | None:
    if value is None:
        return None
    if not (
        isinstance(value, list)
        and len(value) == 2
        and all(type(one) is int and abs(one) <= OPEN_END for one in value)
    ):
        raise ParameterError("an event is [number of its report, its number there]")
    return value[0], value[1]

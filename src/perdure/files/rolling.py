"""Run folders one after another, by the clock: of an endless run a piece can be read, moved or deleted while it goes on.

Each is a run folder as any other. Ids go on from one to the next; a correction of rows that are in an earlier folder
does not reach them.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from perdure import params
from perdure.errors import OutputError
from perdure.files.log import RunLog
from perdure.files.runs import Reporting, RunFolder
from perdure.types import Report

_MARK = "live"  # the key in run.json of folders that may be deleted again
_FORM = "%Y-%m-%dT%H-%M-%S"


@dataclass
class Rolling:
    """The folders of one endless run.

    Parameters
    ----------
    place : Path
        The folder that holds them, each named after the time (UTC) at which it begins.
    about : mapping
        What `run.json` of each says.
    reporting : Reporting
    every : float
        Seconds after which a new one begins, on the clock: 3600 is on the hour. 0 for one folder.
    keep : int
        How many finished ones are kept; 0 for all.
    now : function
        The time.
    """

    place: Path
    about: Mapping[str, Any]
    reporting: Reporting
    every: float = 3600.0
    keep: int = 0
    now: Callable[[], datetime] = field(default=lambda: datetime.now(UTC))

    def __post_init__(self) -> None:
        self.folder: RunFolder | None = None
        self.begun = 0  # folders
        self._log: RunLog | None = None
        self._until = datetime.max.replace(tzinfo=UTC)
        self._frames = 0
        self._began: datetime | None = None
        self._settling: list[tuple[RunFolder, dict[str, Any], subprocess.Popen[str]]] = []
        self.failed: list[str] = []

    def append(self, frame: int, time: float, report: Report) -> None:
        """Write the report of a frame; into a new folder, where its time has come."""
        if self._log is None or self.now() >= self._until:
            self._turn()
        if self._log is not None:
            self._log.append(frame, time, report)
            self._frames += 1 if frame >= 0 else 0

    def close(self, status: str = "done", message: str = "") -> None:
        """Finish the folder that is open, and wait until all are settled."""
        self._finish(status, message)
        self._gather(wait=True)
        self.folder = None
        self._forget()

    def _turn(self) -> None:
        self._finish("done", "")
        self._gather(wait=False)
        now = self.now()
        self._began, self._until = now, self._next(now)
        self.folder = RunFolder.create(self._name(now), overwrite=False)
        self.folder.write_about(self._about("running"))
        self._log = RunLog(self.folder.log)
        self._frames = 0
        self.begun += 1
        self._forget()

    def _next(self, now: datetime) -> datetime:
        """When the next folder begins: at whole multiples of `every` since midnight, UTC."""
        if not self.every:
            return datetime.max.replace(tzinfo=UTC)
        day = now.replace(hour=0, minute=0, second=0, microsecond=0)
        turns = int((now - day).total_seconds() // self.every) + 1
        return day + timedelta(seconds=turns * self.every)

    def _name(self, now: datetime) -> Path:
        place = self.place / now.strftime(_FORM)
        number = 2
        while place.exists():
            place = self.place / f"{now.strftime(_FORM)}-{number}"
            number += 1
        return place

    def _about(self, status: str) -> dict[str, Any]:
        began = "" if self._began is None else self._began.isoformat(timespec="milliseconds")
        return {
            **self.about,
            _MARK: {"began": began, "number": self.begun + (status == "running")},
            "status": status,
        }

    def _finish(self, status: str, message: str) -> None:
        """Close the log, and have it settled in a process of its own: what is live must not wait for it."""
        if self._log is None or self.folder is None:
            return
        self._log.__exit__(None, None, None)
        self._log = None
        about = {**self._about(status), "message": message, "frames": self._frames}
        self.folder.write_about({**about, "status": "settling"})
        words = [
            sys.executable,
            "-m",
            "perdure.files.rolling",
            str(self.folder.path),
            repr(self.reporting.report_confidence),
        ]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self._settling.append((self.folder, about, process))

    def _gather(self, *, wait: bool) -> None:
        """Write down what folders hold that have been settled."""
        waiting = []
        for folder, about, process in self._settling:
            if not wait and process.poll() is None:
                waiting.append((folder, about, process))
                continue
            out, wrong = process.communicate()
            if process.returncode:
                self.failed.append(f"{folder.path} could not be settled: {wrong.strip().rpartition(chr(10))[2]}")
            else:
                folder.write_about({**about, **json.loads(out)})
        self._settling = waiting

    def _forget(self) -> None:
        """Delete the oldest finished folders of ours beyond those that are kept."""
        if not self.keep:
            return
        mine = sorted(one.parent for one in self.place.glob("*/run.json") if _is_ours(one))
        busy = {folder.path for folder, _, _ in self._settling} | ({self.folder.path} if self.folder else set())
        finished = [one for one in mine if one not in busy]
        for one in finished[: max(0, len(finished) - self.keep)]:
            try:
                shutil.rmtree(one)
            except OSError as error:
                self.failed.append(f"{one} cannot be deleted: {error.strerror}")


def _is_ours(place: Path) -> bool:
    """Whether a run.json is of a folder that was made by rolling."""
    try:
        about = json.loads(place.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(about, dict) and isinstance(about.get(_MARK), dict) and about.get("status") != "running"


def check_place(place: Path) -> None:
    """Refuse a place that holds anything but folders of ours.

    Raises
    ------
    OutputError
        If it is a file, or a run folder itself.
    """
    if place.exists() and not place.is_dir():
        raise OutputError(f"{place} is a file; name a folder with -o")
    if (place / "run.json").exists():
        raise OutputError(
            f"{place} is a run folder; name another folder with -o, which will hold one for each hour"
        )


def main(words: list[str]) -> None:
    """Settle the log of a finished folder, in a process of its own, and print what it holds."""
    place, confidence = words
    reporting = params.build(Reporting, {"report_confidence": float(confidence)})
    print(json.dumps(asdict(RunFolder(Path(place)).write_results(reporting))))


if __name__ == "__main__":
    main(sys.argv[1:])

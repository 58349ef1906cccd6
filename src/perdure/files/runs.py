"""The run folder: `run.json`, `tracks.jsonl`, `tracks.txt`, `events.csv`, `tracked.mp4`; `corrections.jsonl` by hand.

Until the run is done there is its checkpoint, too.
"""

from __future__ import annotations

import csv
import json
from array import array
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from perdure import __version__
from perdure.errors import FormatError, OutputError
from perdure.files.corrections import NAME as CORRECTIONS
from perdure.files.corrections import read_corrections
from perdure.files.lines import json_with_nan
from perdure.files.log import Entry, read_log
from perdure.files.mot import write_rows
from perdure.files.whole import cannot_write, whole_file
from perdure.fold import Corrections, coherent, settle, settle_by_frame, settle_with
from perdure.params import parameter
from perdure.types import Event, Report, Tracks

FORMAT, VERSION = "perdure-run", 1
FINISHED = ("done", "damaged")  # how a run ends that has nothing to go on with
EVENT_COLUMNS = (
    "kind",
    "begin_frame",
    "end_frame",
    "begin_time",
    "end_time",
    "ids",
    "zone",
    "confidence",
    "why",
)
PARTS = ("run.json", "tracks.jsonl", "checkpoint.zip", "tracks.txt", "events.csv", "tracked.mp4", CORRECTIONS)
_LEFTOVERS = {".DS_Store", *(f".{name}.part" for name in PARTS)}  # of a run that was killed


@dataclass(frozen=True)
class Reporting:
    """Which rows of a run count."""

    report_confidence: float = parameter(
        0.5, "hidden targets surer than this are in tracks.txt and exports", low=0.0, high=1.0
    )


@dataclass(frozen=True)
class Totals:
    """What a finished run holds."""

    rows: int  # that count
    tracks: int  # ids among them
    events: int


@dataclass(frozen=True)
class RunFolder:
    """The folder of one run, new or existing."""

    path: Path

    @staticmethod
    def create(path: Path, *, overwrite: bool, inputs: Iterable[Path] = ()) -> RunFolder:
        """Make the folder of a new run.

        Raises
        ------
        OutputError
            If it holds a run and `overwrite` is not asked, if it holds anything else, or if one of the
            run's `inputs`, files that are there, would be replaced.
        """
        folder = RunFolder(path)
        try:
            if path.exists() and not path.is_dir():
                raise OutputError(f"{path} is a file; name a folder with -o")
            there = {one.name for one in path.iterdir()} if path.is_dir() else set()
            folder._refuse_to_replace(there - _LEFTOVERS, overwrite=overwrite, inputs=inputs)
            path.mkdir(parents=True, exist_ok=True)
            folder.discard(keep_folder=True)
        except OSError as error:
            raise cannot_write(path, error) from error
        return folder

    def _refuse_to_replace(self, there: set[str], *, overwrite: bool, inputs: Iterable[Path]) -> None:
        if there and "run.json" not in there:
            raise OutputError(f"{self.path} holds other files ({min(there)}); name a new folder with -o")
        if "run.json" in there and not overwrite:
            try:
                about = self.read_about()
                of, over = about.get("source", "another source"), about.get("status") in FINISHED
            except FormatError:
                of, over = "something", True
            add = "--overwrite" if over else "--resume to go on with it, or --overwrite"
            raise OutputError(f"{self.path} holds a run of {of}; add {add}, or name another folder with -o")
        for part in PARTS:
            place = self.path / part
            if place.is_dir():
                raise OutputError(
                    f"{place} is a folder where a file of the run belongs; name another folder with -o"
                )
            if place.exists() and any(place.samefile(one) for one in inputs):
                raise OutputError(
                    f"{place} is needed for this run and would be replaced; name another folder with -o"
                )

    def discard(self, *, keep_folder: bool = False) -> None:
        """Remove the run's files and leftovers, `run.json` last; and the folder, if nothing else is in it."""
        for name in (*_LEFTOVERS, *reversed(PARTS)):
            (self.path / name).unlink(missing_ok=True)
        if not keep_folder and self.path.is_dir() and not any(self.path.iterdir()):
            self.path.rmdir()

    @staticmethod
    def open(path: Path) -> RunFolder:
        """Return an existing run.

        Raises
        ------
        FormatError
            If there is none.
        """
        inside = sorted(one.parent for one in path.glob("*/tracks.jsonl")) if path.is_dir() else []
        if not (path / "tracks.jsonl").is_file() and inside:
            raise FormatError(
                f"{path} is not a run folder, but holds {len(inside)}; name one of them, such as {inside[-1]}"
            )
        if not (path / "tracks.jsonl").is_file():
            raise FormatError(f"{path} is not a run folder (no tracks.jsonl in it); `perdure track` makes one")
        return RunFolder(path)

    @property
    def log(self) -> Path:
        """The append-only log."""
        return self.path / "tracks.jsonl"

    @property
    def corrections(self) -> Path:
        """The corrections by hand, which need not be there."""
        return self.path / CORRECTIONS

    @property
    def film(self) -> Path:
        """The drawn film."""
        return self.path / "tracked.mp4"

    def write_about(self, about: Mapping[str, Any]) -> None:
        """Write `run.json`: what was run, with which parameters, how it ended."""
        with whole_file(self.path / "run.json") as file:
            json.dump({"format": FORMAT, "version": VERSION, "perdure": __version__, **about}, file, indent=2)
            file.write("\n")

    def read_about(self) -> dict[str, Any]:
        """Return what `run.json` says; empty where it is missing.

        Raises
        ------
        FormatError
            If it is damaged.
        """
        place = self.path / "run.json"
        try:
            about = json_with_nan(place.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, RecursionError) as error:
            raise FormatError(
                f"{place} is damaged ({error}); `perdure track --overwrite` makes it anew"
            ) from error
        if not isinstance(about, dict) or any(
            not isinstance(about.get(key, {}), dict) for key in ("window", "reporting")
        ):
            raise FormatError(
                f"{place} is damaged: no description of a run; `perdure track --overwrite` makes it anew"
            )
        return about

    def entries(self, *, with_masks: bool = True) -> Iterator[Entry]:
        """Yield what was said: the entries of the log, then every correction by hand as an entry of frame -1.

        Raises
        ------
        FormatError
            Naming file and line, if one of both is damaged.
        """
        by_hand = read_corrections(self.corrections).in_force
        yield from read_log(self.log, with_masks=with_masks)
        yield from (Entry(-1, 0.0, one.report()) for one in by_hand)

    def settled_by_frame(self) -> Iterator[tuple[int, Tracks]]:
        """Yield (frame, settled rows), all statuses, groups too; memory stays bounded."""
        return settle_by_frame(lambda: (entry.report for entry in self.entries()))

    def tracks(self) -> Tracks:
        """Return all settled rows at once."""
        return settle(entry.report for entry in self.entries())

    def read(self, *, with_masks: bool = True) -> tuple[Tracks, tuple[Event, ...], int]:
        """Return all settled rows, all events with their settled ids, and how many frames the log holds."""
        entries = list(self.entries(with_masks=with_masks))
        reports = [entry.report for entry in entries]
        corrections = Corrections.of(reports)
        rows = settle(reports)
        settled = [
            (event, corrections.event(event, number))
            for number, report in enumerate(reports)
            for event in report.events
        ]
        kept = (after for before, after in settled if after.ids or not before.ids)
        events = tuple(coherent(kept, set(rows.ids.tolist())))
        return rows, events, sum(entry.frame >= 0 for entry in entries)

    def scenario_events(self) -> tuple[Event, ...]:
        """Return the settled events of scenarios that the run was to recognise; none where it was to recognise none."""
        about = self.read_about().get("scenarios")
        wanted = about.get("scenarios", ()) if isinstance(about, dict) else ()
        names = {one.get("name") for one in wanted if isinstance(one, dict)}
        if not names:
            return ()
        _, events, _ = self.read(with_masks=False)
        return tuple(one for one in events if one.kind in names)

    def write_results(self, reporting: Reporting) -> Totals:
        """Settle the log into `tracks.txt` and `events.csv`, streaming."""
        corrections = Corrections.of(entry.report for entry in self.entries(with_masks=False))
        rows, ids, known = 0, set(), set()
        with whole_file(self.path / "events.csv") as events, whole_file(self.path / "tracks.txt") as tracks:
            table = _EventTable(events, corrections)
            for _, settled in settle_with(corrections, table.passing(self.entries(with_masks=False))):
                known.update(settled.ids.tolist())
                counted = settled.counted(reporting.report_confidence)
                write_rows(tracks, counted)
                rows += len(counted)
                ids.update(counted.ids.tolist())
            table.write(known)
        return Totals(rows, len(ids), table.count)


def unended(folder: RunFolder, about: Mapping[str, Any], frames: int) -> str:
    """Return what is to be known of a run whose log, of so many frames, is not whole; empty where it is."""
    status = str(about.get("status", "done"))
    if status == "running":
        return (
            f"{folder.path} has not ended: it is running still, or was killed, and can be gone on with by --resume; "
            f"it ends after {frames} frames"
        )
    if status != "done":
        return f"{folder.path} is {status}: it ends after {frames} frames"
    if isinstance(about.get("frames"), int) and frames < about["frames"]:
        return f"the log of {folder.path} breaks off after {frames} of {about['frames']} frames"
    return ""


class _EventTable:
    """`events.csv`, gathered while the entries of a log pass by, and written in the order in which the events began."""

    def __init__(self, file: IO[str], corrections: Corrections) -> None:
        self.count = 0
        self._corrections = corrections
        self._clock = _Clock()
        self._table = csv.writer(file, lineterminator="\n")
        self._events: list[Event] = []

    def passing(self, entries: Iterable[Entry]) -> Iterator[Report]:
        for number, entry in enumerate(entries):
            self._clock.note(entry.frame, entry.time)
            for event in entry.report.events:
                settled = self._corrections.event(event, number)
                if settled.ids or not event.ids:
                    self._events.append(settled)
            yield entry.report

    def write(self, ids: set[int]) -> None:
        """Write the table, where rows have these `ids`; of events that began in one frame, as they were told."""
        self._table.writerow(EVENT_COLUMNS)
        for event in coherent(self._events, ids):
            self._table.writerow(_event_row(event, self._clock))
            self.count += 1


class _Clock:
    """The times of all frames, 16 bytes each."""

    def __init__(self) -> None:
        self._frames, self._times = array("q"), array("d")

    def note(self, frame: int, time: float) -> None:
        if frame >= 0:  # the finishing entry has no frame
            self._frames.append(frame)
            self._times.append(time)

    def at(self, frame: int) -> float:
        place = bisect_left(self._frames, frame)
        return self._times[min(place, len(self._times) - 1)] if self._times else 0.0


def _event_row(event: Event, clock: _Clock) -> list[object]:
    ids = " ".join(str(one) for one in event.ids)
    begin, end = f"{clock.at(event.begin):.3f}", f"{clock.at(event.end):.3f}"
    return [event.kind, event.begin, event.end, begin, end, ids, event.zone, f"{event.confidence:g}", event.why]

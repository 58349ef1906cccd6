"""One run as the viewer has it: its log read on as it grows, its corrections, and what is made of both."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from perdure import params
from perdure.errors import FormatError, ParameterError, PerdureError
from perdure.files.corrections import (
    Correction,
    History,
    append_correction,
    correction_of_json,
    newest_id,
    read_corrections,
    with_new_id,
)
from perdure.files.lines import mask_of_json, outline_of_json
from perdure.files.runs import Reporting, RunFolder
from perdure.fold import Corrections
from perdure.reasons import DECIDING, as_value, reason_of
from perdure.types import Event, Status
from perdure.web.doubts import LIMIT, Doubt, doubts, settled_events
from perdure.web.ledger import Columns, Ledger
from perdure.web.pictures import Pictures
from perdure.web.settled import Change, Settled, settle_columns
from perdure.web.words import looked_words, words_of

Json = Any
_SLICE = 0.04  # s for which a log is read before somebody else may ask
_LIVE = 15.0  # s without a new line, after which a run that says it is running is taken for dead


@dataclass
class _Made:
    """What was made of the log and the corrections, and of which versions of both."""

    edition: int = -1
    known: Corrections = field(default_factory=lambda: Corrections({}, {}))
    settled: Settled = field(default_factory=lambda: Settled(Columns.empty()))
    doubts: list[Doubt] | None = None
    tracks: dict[str, Json] | None = None
    said_ids: list[int] = field(default_factory=list)
    ids: frozenset[int] = frozenset()  # that have rows


class OpenRun:
    """A run that is shown; every method may be called from any thread.

    Parameters
    ----------
    folder : RunFolder
    source : str or None
        Where its film is now, if not where it was when it was tracked.
    """

    def __init__(self, folder: RunFolder, source: str | None = None) -> None:
        self.folder = folder
        self.about = _about(folder)
        self.ledger = Ledger(folder.log)
        self.size = _size(self.about)
        window = self.about.get("window", {})
        rate = window.get("fps") if isinstance(window, dict) else None
        self.pictures = Pictures(
            source or str(self.about.get("source", "")),
            fps=rate if isinstance(rate, (int, float)) else None,
            size=self.size,
        )
        self._lock, self._writing = threading.RLock(), threading.Lock()
        self._history, self._history_wrong = History(), ""
        self._edition, self._seen = 0, (-1, History())
        self._made = _Made()
        self._grown = time.monotonic()
        self._unsaved: threading.Timer | None = None
        self._wrong_results = ""
        self._file = (0, 0)  # time and size of the corrections as they were read
        self._read_history()

    # What is known -----------------------------------------------------------------------------------------

    @property
    def fps(self) -> float:
        """Frames per second of the source."""
        rate = self.about.get("fps", 25.0)
        return float(rate) if isinstance(rate, (int, float)) and rate > 0 else 25.0

    def refresh(self) -> None:
        """Read what the log has gained, for a moment; and how the run says that it stands."""
        with self._lock:
            if self.ledger.refresh(_SLICE):
                self._grown = time.monotonic()
            if self.about.get("status") == "running":
                self.about = _about(self.folder) or self.about
                self.size = _size(self.about) if all(_size(self.about)) else self.size
            if (
                _stamp(self.folder.corrections) != self._file
            ):  # somebody else has corrected, or taken the file away
                self._read_history()
            now = (self.ledger.version, self._history)
            if now != self._seen:
                self._seen, self._edition = now, self._edition + 1

    @property
    def live(self) -> bool:
        """Whether the run is still going."""
        quiet = time.monotonic() - self._grown
        return self.about.get("status") == "running" and (quiet < _LIVE or not self.ledger.complete)

    def state(self) -> dict[str, Json]:
        """Return what may change from one moment to the next."""
        with self._lock:
            self.refresh()
            made, history = self._settle(), self._history
            rows = made.settled.rows
            return {
                "edition": made.edition,
                "frames": len(self.ledger.frames),
                "complete": self.ledger.complete,
                "live": self.live,
                "status": str(self.about.get("status", "")),
                "rows": len(rows.ids),
                "notes": [one for one in (self.ledger.damage, self._history_wrong, self._wrong_results) if one],
                "undo": words_of(history.in_force[-1]) if history.in_force else "",
                "redo": words_of(history.undone[-1]) if history.undone else "",
                "corrections": sum(one.do != "confirm" for one in history.in_force),
                "saved": self._unsaved is None,
            }

    def frames(self) -> dict[str, Json]:
        """Return the numbers and times of all frames so far."""
        with self._lock:
            return {"frames": self.ledger.frames.tolist(), "times": [round(one, 4) for one in self.ledger.times]}

    def tracks(self) -> dict[str, Json]:
        """Return where each id is, stretch by stretch, and what it is called."""
        with self._lock:
            made = self._settle()
            if made.tracks is None:
                made.tracks = {
                    "edition": made.edition,
                    "spans": made.settled.spans(self._step()),
                    "groups": made.settled.group_ids(),
                    "classes": {str(made.known.identity(k, 0, -1)): v for k, v in self.ledger.classes.items()},
                }
            return made.tracks

    def rows(self, begin: int, end: int) -> bytes:
        """Return the settled rows of some frames, packed."""
        with self._lock:
            return self._settle().settled.between(begin, end).packed()

    def shapes(self, begin: int, end: int) -> dict[str, dict[str, Json]]:
        """Return by frame and id the silhouettes and contours as the log has them; damaged ones are left out."""
        with self._lock:
            rows = self._settle().settled.between(begin, end).rows
        reports: dict[int, Sequence[Json]] = {}
        for number in np.unique(rows.numbers).tolist():
            try:
                reports[number] = self.ledger.report(number).get("rows", ())
            except FormatError:
                reports[number] = ()
        found: dict[str, dict[str, Json]] = {}
        for frame, identity, number, place in zip(
            rows.frames.tolist(), rows.ids.tolist(), rows.numbers.tolist(), rows.places.tolist(), strict=True
        ):
            shape = _shape(reports[number][place]) if place < len(reports[number]) else {}
            if shape:
                found.setdefault(str(frame), {})[str(identity)] = shape
        return found

    def events(self) -> dict[str, Json]:
        """Return all events, the doubts, the most doubtful first, and what was said of each."""
        with self._lock:
            made = self._settle()
            if made.doubts is None:
                made.doubts = doubts(self.ledger, made.known, made.settled, self.size, self.fps)
            looked = {one.event: one.do for one in self._history.in_force if one.event is not None}
            told = [
                asdict(one) | {"doubtful": one.doubt >= LIMIT, "looked": looked_words(looked.get(one.key))}
                for one in made.doubts
            ]
            return {
                "edition": made.edition,
                "doubts": told,
                "doubtful": sum(one["doubtful"] for one in told),
                "open": sum(one["doubtful"] and not one["looked"] for one in told),
                "events": [
                    {"key": key, **asdict(event)}
                    for key, event in settled_events(self.ledger, made.known, made.ids)
                ],
            }

    def explain(self, identity: int, frame: int) -> dict[str, Json]:
        """Return why the row of an id in a frame is its own: its row, its link's reason, and events about it.

        Only `missing`, in words, where there is no such row.
        """
        with self._lock:
            made = self._settle()
            rows = made.settled.between(frame, frame + 1).rows
            (place,) = np.nonzero(rows.ids == identity)
            if not len(place):
                return {"missing": f"{identity} has no row in frame {frame}"}
            known, row = made.known, int(place[0])
            reason = self._reason(identity, frame, known)
            events = [event for _, event in settled_events(self.ledger, known, made.ids) if identity in event.ids]
            return {
                "id": identity,
                "frame": frame,
                "status": Status(int(rows.status[row])).word,
                "confidence": round(float(rows.confidence[row]), 3),
                "inferred": bool(rows.inferred[row]),
                "box": [round(float(side), 1) for side in rows.boxes[row]],
                "link": None if reason is None else as_value(reason),
                "explains": self.ledger.explains,
                "events": [asdict(one) for one in _about_frame(events, frame)],
            }

    def report_confidence(self) -> float:
        """From which confidence hidden targets count."""
        try:
            return params.build(Reporting, self.about.get("reporting", {})).report_confidence
        except ParameterError:
            return Reporting().report_confidence

    # What is changed ---------------------------------------------------------------------------------------

    def correct(self, value: Json) -> dict[str, Json]:
        """Take up a correction and return what it is now; the results are written anew a moment later.

        Raises
        ------
        ParameterError
            If it cannot be, or the run is still going.
        FormatError, OutputError
            If the file of corrections is damaged, or cannot be written.
        """
        with self._lock:
            self.refresh()
            line = correction_of_json(value)
            if self.live or not self.ledger.complete:
                raise ParameterError("the run is still going; repair it when it has ended")
            made = self._settle()
            if isinstance(line, Correction):
                self._refuse_unknown(line, made)
                line = with_new_id(line, newest_id(made.said_ids, self._history))
            self._history = append_correction(self.folder.corrections, line)
            self._history_wrong, self._file = "", _stamp(self.folder.corrections)
            self._save_later()
            return {"done": line if isinstance(line, str) else line.to_json(), **self.state()}

    def save(self) -> None:
        """Write `tracks.txt` and `events.csv` anew, if corrections have changed them."""
        with self._writing:
            waiting = self._unsaved
            if waiting is None:
                return
            waiting.cancel()
            try:
                self.folder.write_results(Reporting(self.report_confidence()))
                self._wrong_results = ""
            except PerdureError as error:
                self._wrong_results = str(error)
            with self._lock:
                if self._unsaved is waiting:  # nothing was corrected meanwhile
                    self._unsaved = None

    def close(self) -> None:
        """Write what is to be written, and give back files and threads."""
        self.save()
        self.pictures.close()

    # Inside ------------------------------------------------------------------------------------------------

    def _settle(self) -> _Made:
        """What is made of the log and the corrections as they are now."""
        if self._made.edition != self._edition:
            said, count = self.ledger.columns(), len(self.ledger.offsets)
            changes: list[Change] = list(self.ledger.corrections)
            by_id: dict[int, list[Any]] = {}
            for number, one in enumerate(self._history.in_force, count):
                report = one.report()
                changes += [(number, change) for change in report.renamed]
                changes += [(number, change) for change in report.dropped]
            for number, change in changes:
                by_id.setdefault(getattr(change, "old", getattr(change, "id", 0)), []).append((number, change))
            settled = settle_columns(said, changes)
            self._made = _Made(
                self._edition,
                Corrections(by_id, {}),
                settled,
                ids=frozenset(np.unique(settled.rows.ids).tolist()),
                said_ids=np.unique(np.concatenate([said.ids, said.groups])).tolist(),
            )
        return self._made

    def _read_history(self) -> None:
        self._file = _stamp(self.folder.corrections)
        try:
            self._history, self._history_wrong = read_corrections(self.folder.corrections), ""
        except FormatError as error:
            self._history, self._history_wrong = History(), f"{error}; shown is the run without any"

    def _refuse_unknown(self, line: Correction, made: _Made) -> None:
        """Refuse what speaks of ids that nobody has."""
        named = line.ids[:1] if line.do == "cut" else line.ids
        for one in named if line.do != "confirm" else ():
            if one not in made.ids:
                raise ParameterError(f"there is no id {one} in the results any more")
        if line.do == "cut" and line.ids[1] != 0:
            raise ParameterError("the new id of a cut is found here; give 0 for it")

    def _save_later(self) -> None:
        if self._unsaved is not None:
            self._unsaved.cancel()
        self._unsaved = threading.Timer(1.0, self.save)
        self._unsaved.daemon = True
        self._unsaved.start()

    def _step(self) -> int:
        """Frames from one to the next."""
        frames = np.array(self.ledger.frames[:64])
        return int(np.diff(frames).min()) if len(frames) > 1 else 1

    def _reason(self, identity: int, frame: int, known: Corrections) -> Any:
        """The reason of a link in a frame, as `perdure explain` has it; None where there is none."""
        if not self.ledger.explains:
            return None
        places = np.flatnonzero(np.array(self.ledger.frames) == frame)
        for number in places.tolist():
            for one in self.ledger.explanations(number):
                if known.identity(one.id, frame, number) == identity:
                    return reason_of(one, frame, number, known)
        return None


def _about(folder: RunFolder) -> dict[str, Json]:
    """What `run.json` says; nothing where it is damaged, since the log alone can be shown."""
    try:
        return folder.read_about()
    except FormatError:
        return {}


def _stamp(path: Path) -> tuple[int, int]:
    """What changes with a file; zeros where there is none."""
    try:
        about = path.stat()
    except OSError:
        return 0, 0
    return about.st_mtime_ns, about.st_size


def _size(about: Mapping[str, Json]) -> tuple[int, int]:
    width, height = about.get("width"), about.get("height")
    if isinstance(width, int) and isinstance(height, int) and 0 < width <= 1 << 16 and 0 < height <= 1 << 16:
        return width, height
    return 0, 0


def _shape(row: Json) -> dict[str, Json]:
    """The silhouettes and contour of a row that are sound."""
    found = {}
    for name, read in (("mask", mask_of_json), ("believed", mask_of_json), ("outline", outline_of_json)):
        if isinstance(row, Mapping) and name in row:
            try:
                read(row[name])
            except (ValueError, TypeError, KeyError):
                continue
            found[name] = row[name]
    return found


def _about_frame(events: Sequence[Event], frame: int) -> list[Event]:
    """The events that a frame lies in, and before them the last one that decided whose the id is."""
    earlier = [one for one in events if one.kind in DECIDING and one.end < frame]
    return earlier[-1:] + [one for one in events if one.begin <= frame <= one.end]

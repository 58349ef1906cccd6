"""Going on with a run: is it the one that is asked for, where did it stand, and checkpoints while it goes."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from perdure.errors import DamagedVideo, OutputError, ParameterError, StateError
from perdure.files.checkpoints import Checkpoint, Progress, picture_of, write_checkpoint
from perdure.files.log import RunLog
from perdure.files.runs import FINISHED, RunFolder
from perdure.pipeline import AnyStanding, Plan
from perdure.trackers.foreign import Foreign
from perdure.types import Frame

EVERY = 5.0  # s between checkpoints
SHARE = 0.015  # of a run's time that checkpoints may take
_ASKED = (
    "source",
    "width",
    "height",
    "fps",
    "window",
    "inputs",
    "classes",
    "detector",
    "init",
    "tracker",
    "context",
    "embedding",
    "reporting",
    "scenarios",
    "ground",
    "zones",
)
_FOUND = {"context": ("chosen", "weights", "similar")}  # what a run finds out itself
_SHOWN = 3  # differences that are named


class Checkpoints:
    """Takes checkpoints of a run: every so many seconds, and more seldom where they take long.

    Where the disk has no room for one the run goes on without; where a state cannot be saved there is none.

    Parameters
    ----------
    folder : Path
        The run's.
    every : float
        Seconds between two; 0: as often as `SHARE` allows.
    """

    def __init__(self, folder: Path, every: float = EVERY) -> None:
        self.count = 0
        self.seconds = 0.0
        self.notes: tuple[str, ...] = ()
        self._folder = folder
        self._every = every
        self._due = time.monotonic() + every

    def taken_by(
        self, made: Plan, log: RunLog, progress: Callable[[], tuple[Progress, Frame | None]]
    ) -> Callable[[AnyStanding], None] | None:
        """Return what a run is to tell between frames where it stands; None where it cannot be gone on with."""
        reason = cannot_resume(made)
        if reason:
            return None
        kind = made.standing_kind()

        def between(standing: AnyStanding) -> None:
            begun = time.monotonic()
            if begun < self._due:
                return
            so_far, frame = progress()
            picture = 0 if frame is None else picture_of(frame)
            try:
                write_checkpoint(self._folder, Checkpoint(standing, so_far, picture, log.mark), kind, log)
                self.count += 1
            except OutputError as error:
                self.notes = (f"a checkpoint could not be written: {error}",)
            taken = time.monotonic() - begun
            self.seconds += taken
            self._due = begun + taken + max(self._every, taken / SHARE)

        return between


def cannot_resume(made: Plan) -> str:
    """Return why a run of this plan cannot be gone on with; empty where it can."""
    if not made.source.rereadable:
        return f"{made.source.name} passes only once, so that a run of it cannot be gone on with"
    if isinstance(made.tracker, Foreign):
        return "a tracker of another library cannot save its state, so that a run of it cannot be gone on with"
    try:
        made.standing_kind()
    except StateError as error:
        return str(error)
    return ""


def found(made: Plan, place: Path, asked: Mapping[str, Any]) -> RunFolder | None:
    """Return the run to go on with, finished or not; None where there is none.

    Raises
    ------
    ParameterError
        If the source passes only once, or the run there was asked for differently.
    FormatError
        If its description is damaged.
    """
    if not made.source.rereadable:
        raise ParameterError(f"{cannot_resume(made)}; leave out --resume")
    folder = RunFolder(place)
    if not folder.read_about():
        return None
    refuse_another(asked, folder)
    return folder


def is_finished(folder: RunFolder) -> bool:
    """Return whether a run is over and its results are there; the film may be missing."""
    results = (folder.log, folder.path / "tracks.txt", folder.path / "events.csv")
    return folder.read_about().get("status") in FINISHED and all(one.is_file() for one in results)


def refuse_another(asked: Mapping[str, Any], folder: RunFolder) -> None:
    """Refuse to go on with a run that was asked for differently.

    Raises
    ------
    ParameterError
        Naming what differs, how it was, and how it is now.
    """
    there = folder.read_about()
    now = json.loads(json.dumps(dict(asked)))
    if now.get("window", {}).get("calibration") == "auto":
        there, now = ({**one, "ground": None} for one in (there, now))  # which a run finds out itself
    differing: list[str] = []
    for key in _ASKED:
        differing += _differences(_without_found(key, there.get(key)), _without_found(key, now.get(key)), key)
    if differing:
        more = f", and {len(differing) - _SHOWN} more" if len(differing) > _SHOWN else ""
        raise ParameterError(
            f"{folder.path} holds another run: {'; '.join(differing[:_SHOWN])}{more}; ask for the same, add --overwrite to "
            "begin anew, or name another folder with -o"
        )


def behind(made: Plan, checkpoint: Checkpoint[Any]) -> Iterator[Frame]:
    """Return the frames that a run goes on with, once the last one before them is found to be what it was.

    Raises
    ------
    ParameterError
        If the source is not what it was.
    """
    last = checkpoint.progress.frame
    frames = iter(made.source.after(last - 1))
    try:
        first = next(frames, None)
    except DamagedVideo:
        first = None
    if first is None or (first.index, picture_of(first)) != (last, checkpoint.picture):
        what = "ends before it" if first is None else "shows something else there"
        raise ParameterError(
            f"{made.source.name} is not what it was when its run stood at frame {last}: it {what}; add --overwrite to "
            "begin anew"
        )
    return frames


def _without_found(key: str, value: Any) -> Any:
    if key not in _FOUND or not isinstance(value, Mapping):
        return value
    return {name: one for name, one in value.items() if name not in _FOUND[key]}


def _differences(there: Any, now: Any, name: str) -> Iterable[str]:
    """What differs between two values of a run's description, in words."""
    if isinstance(there, Mapping) and isinstance(now, Mapping):
        for key in dict.fromkeys([*there, *now]):
            yield from _differences(there.get(key), now.get(key), f"{name}.{key}")
    elif there != now and name.startswith("inputs."):
        yield f"the file for {name.removeprefix('inputs.')} has other contents"
    elif there != now:
        yield f"{name} was {_short(there)}, now {_short(now)}"


def _short(value: Any) -> str:
    text = "not given" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}…"

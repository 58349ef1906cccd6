"""Checkpoints: where a run stood after a frame, in `checkpoint.zip` of its folder; whole or not at all.

A checkpoint takes its name only when the log before it is on the disk, and is on the disk itself when it does: wherever
a process or the power ends, a checkpoint that is there can be gone on from.
"""

from __future__ import annotations

import contextlib
import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar, cast
from zlib import crc32

from perdure import __version__, states
from perdure.detect.plausible import LeftOut
from perdure.errors import FormatError, OutputError, StateError
from perdure.files.log import LogMark, RunLog
from perdure.files.whole import whole_binary_file
from perdure.fold import Standing
from perdure.types import Frame

S = TypeVar("S")
NAME = "checkpoint.zip"
Lasting = tuple[str, tuple[int, ...], str]  # kind, ids and zone of what goes on


@dataclass(frozen=True)
class Progress:
    """How far a run is, and what it has told beside its log."""

    frames: int = 0  # that were logged
    frame: int = -1  # number of the last
    time: float = 0.0  # s, of the last
    regions: int = 0  # that were tracked
    context: str = ""  # that is in force
    left_out: LeftOut = field(default_factory=LeftOut)  # boxes of the detector
    lasting: tuple[Lasting, ...] = ()  # events that were told as begun


@dataclass(frozen=True, eq=False)
class Checkpoint(Generic[S]):
    """All that a run goes on from."""

    standing: S
    progress: Progress
    picture: int  # checksum of the last frame, by which its source is known again
    log: LogMark


def picture_of(frame: Frame) -> int:
    """Return the checksum of a frame's picture; 0 where it has none."""
    return 0 if frame.image is None else crc32(frame.image.tobytes())


def digest(file: Path) -> str:
    """Return the SHA-256 of what is in a file, by which it is known again.

    Raises
    ------
    FormatError
        If it cannot be read.
    """
    try:
        with file.open("rb") as opened:
            return hashlib.file_digest(opened, "sha256").hexdigest()
    except OSError as error:
        raise FormatError(f"cannot read {file}: {error.strerror or error}") from error


def write_checkpoint(
    folder: Path, checkpoint: Checkpoint[Standing[Any, Any, Any]], kind: Any, log: RunLog
) -> None:
    """Write where a run stands into its folder, in place of the checkpoint before.

    Parameters
    ----------
    folder : Path
        The run's.
    checkpoint : Checkpoint
        It may share its arrays with the run.
    kind : type
        Of what it stands on, as `load` needs it to read it back.
    log : RunLog
        It stands at the checkpoint's mark.

    Raises
    ------
    OutputError
        If it cannot be written.
    StateError
        If a state cannot be saved.
    """
    log.sync()
    with whole_binary_file(folder / NAME) as file:
        states.write(checkpoint, file, _release(kind))


def read_checkpoint(folder: Path, kind: Any) -> Checkpoint[Standing[Any, Any, Any]] | None:
    """Return the last checkpoint of a run; None where there is none.

    Raises
    ------
    StateError
        If it is of another version, or damaged.
    """
    place = folder / NAME
    try:
        content = place.read_bytes()
        found = states.load(content, cast(Any, Checkpoint)[kind], _release(kind))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise OutputError(f"cannot read {place}: {error.strerror or error}") from error
    except StateError as error:
        raise StateError(f"{place}: {error} with --overwrite") from error
    return cast("Checkpoint[Standing[Any, Any, Any]]", found)


def remove_checkpoint(folder: Path) -> None:
    """Remove the checkpoint of a run that is over; a disk that refuses does not undo the run."""
    with contextlib.suppress(OSError):
        (folder / NAME).unlink(missing_ok=True)


def _release(kind: Any) -> str:
    """What a state is of: this version, and how it lays out the states."""
    return f"Perdure {__version__}, states {hashlib.sha256(states.layout(kind).encode()).hexdigest()[:12]}"

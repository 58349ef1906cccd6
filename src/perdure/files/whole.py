"""Files that appear whole or not at all, also where the power fails."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

from perdure.errors import OutputError


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[IO[str]]:
    """Open a text file for writing that takes its name only when all of it is written.

    Raises
    ------
    OutputError
        If the place cannot be written; what stood there before stays.
    """
    with _whole(path, lambda part: part.open("w", encoding="utf-8", newline="\n")) as file:
        yield file


@contextlib.contextmanager
def whole_binary_file(path: Path) -> Iterator[IO[bytes]]:
    """Open a file of bytes for writing that takes its name only when all of it is written.

    Raises
    ------
    OutputError
        If the place cannot be written; what stood there before stays.
    """
    with _whole(path, lambda part: part.open("wb")) as file:
        yield file


def sync_folder(folder: Path) -> None:
    """Have the names in a folder on the disk; where folders cannot be synchronised (Windows) the system sees to it."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


@contextlib.contextmanager
def _whole(path: Path, opened: Callable[[Path], IO[Any]]) -> Iterator[IO[Any]]:
    """A file that has another name until it is on the disk."""
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with opened(part) as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
        sync_folder(path.parent)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def lock(file: IO[bytes], path: Path) -> None:
    """Keep everybody else from writing a file until it is closed, or this process ends; on Windows, nobody is kept.

    Raises
    ------
    OutputError
        If another process has it.
    """
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise OutputError(
            f"{path} is being written by another process; wait until it has ended, or name another folder with -o"
        ) from None
    except OSError:  # a file system without locks
        return


def refuse_existing(path: Path, *, overwrite: bool) -> None:
    """Refuse to write over a file that is there, unless that is asked.

    Raises
    ------
    OutputError
        If it is there and `overwrite` is not asked, or if it is a folder.
    """
    if path.is_dir():
        raise OutputError(f"{path} is a folder; name a file")
    if path.exists() and not overwrite:
        raise OutputError(f"{path} is there already; add --overwrite, or name another file")


def cannot_write(path: Path, error: OSError) -> OutputError:
    """Say that a place cannot be written and why."""
    return OutputError(f"cannot write {path}: {error.strerror or error}; name another place with -o")

"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from perdure.errors import OutputError


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[IO[str]]:
    """Open a text file for writing that takes its name only when all of it is written.

    Raises
    ------
    OutputError
        If the place cannot be written; what stood there before stays.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("w", encoding="utf-8", newline="\n") as file:
            yield file
        os.replace(part, path)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


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

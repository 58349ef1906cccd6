"""Folders of ours that appear whole or not at all: of one file a frame, named by it in six digits, or of named files."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from perdure.errors import OutputError
from perdure.files.whole import cannot_write


@contextlib.contextmanager
def whole_folder(folder: Path, suffix: str, *, overwrite: bool) -> Iterator[Callable[[int, bytes], None]]:
    """Give a function that writes the file of a frame; the folder takes its name only when all of it is written.

    Raises
    ------
    OutputError
        If the place cannot be written, or is refused by `refuse_existing_folder`; what stood there before stays.
    """
    refuse_existing_folder(folder, suffix, overwrite=overwrite)
    with _whole(folder, lambda path: _is_frame(path, suffix)) as part:
        yield lambda frame, content: _write(part / f"{frame:06d}{suffix}", content)


@contextlib.contextmanager
def whole_files(folder: Path, names: Collection[str], *, overwrite: bool) -> Iterator[Path]:
    """Give a folder to write files of these names into; it takes its name only when all of them are written.

    Raises
    ------
    OutputError
        If the place cannot be written, or is refused by `refuse_existing_files`; what stood there before stays.
    """
    refuse_existing_files(folder, names, overwrite=overwrite)
    with _whole(folder, lambda path: path.name in (".DS_Store", *names)) as part:
        yield part


def refuse_existing_folder(folder: Path, suffix: str, *, overwrite: bool) -> None:
    """Refuse to write files of frames over something else, or unasked over such files.

    Raises
    ------
    OutputError
        If it is a file, holds anything but files named by their frames, or is not to be replaced.
    """
    _refuse(folder, lambda path: _is_frame(path, suffix), "pictures", overwrite=overwrite)


def refuse_existing_files(folder: Path, names: Collection[str], *, overwrite: bool) -> None:
    """Refuse to write files of these names beside something else, or unasked over such files.

    Raises
    ------
    OutputError
        If it is a file, holds anything but such files, or is not to be replaced.
    """
    _refuse(folder, lambda path: path.name in (".DS_Store", *names), "results", overwrite=overwrite)


def is_number(text: str) -> bool:
    """Return whether a text is a plain number that may be a frame's."""
    return re.fullmatch(r"[0-9]{1,9}", text) is not None


@contextlib.contextmanager
def _whole(folder: Path, is_ours: Callable[[Path], bool]) -> Iterator[Path]:
    folder = folder.resolve()
    part = folder.with_name(f".{folder.name}.part")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        _remove(part, is_ours)  # of a command that was killed
        part.mkdir()
        yield part
        _give_place(part, folder, is_ours)
    except OSError as error:
        raise cannot_write(folder, error) from error
    finally:
        with contextlib.suppress(OSError):
            _remove(part, is_ours)


def _refuse(folder: Path, is_ours: Callable[[Path], bool], what: str, *, overwrite: bool) -> None:
    try:
        if folder.exists() and not folder.is_dir():
            raise OutputError(f"{folder} is a file; name a folder")
        there = sorted(folder.iterdir()) if folder.is_dir() else []
    except OSError as error:
        raise cannot_write(folder, error) from error
    others = [one.name for one in there if not is_ours(one)]
    if others:
        raise OutputError(f"{folder} holds other files ({others[0]}); name a new folder")
    if there and not overwrite:
        raise OutputError(f"{folder} holds {what} already; add --overwrite or name another folder with -o")


def _write(path: Path, content: bytes) -> None:
    path.write_bytes(content)


def _give_place(part: Path, folder: Path, is_ours: Callable[[Path], bool]) -> None:
    """Give a finished folder its name; what had it before goes, once that is done."""
    if not folder.exists():
        part.rename(folder)
        return
    old = folder.with_name(f".{folder.name}.old")
    _remove(old, is_ours)
    folder.rename(old)
    try:
        part.rename(folder)
    except BaseException:
        old.rename(folder)
        raise
    _remove(old, is_ours)


def _remove(folder: Path, is_ours: Callable[[Path], bool]) -> None:
    """Remove a folder of ours; OSError where something else is in it."""
    if folder.is_dir():
        for one in folder.iterdir():
            if is_ours(one):
                one.unlink()
        folder.rmdir()


def _is_frame(path: Path, suffix: str) -> bool:
    return path.name == ".DS_Store" or (path.suffix == suffix and len(path.stem) >= 6 and is_number(path.stem))

"""Where compiled kernels are kept: a file each, whole or not at all, used only by what it was compiled from.

Numba's own cache fails where neither the package nor the home can be written into, and on a damaged file; and where
two processes compile one function for different types at once, one's code may end up under the other's types. This
is the one room below `files` that opens files.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import logging
import os
import pickle
import stat
import sys
import tempfile
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps
from numba.misc.appdirs import AppDirs

LOG = logging.getLogger("perdure.kernels")  # level INFO: a kernel is being compiled; WARNING: none can be kept
ENDING = ".kernel"
_HERE = Path(__file__).absolute().parent
_DIGEST = 32  # bytes


class Kept(NullCache):
    """The compiled forms of one function, one for each set of types: what Numba asks before and after it compiles."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self.place: Path | None = None  # where the last form was found or put

    @property
    def cache_path(self) -> str:
        """The folder of the last form, for Numba's statistics."""
        return str(self.place or "")

    def load_overload(self, types: Any, target: Any) -> Any:
        """Return the form for these types; None where there is none that is whole and of this very source."""
        target.refresh()
        for place, code in self._whole(types, target.codegen()):
            with contextlib.suppress(Exception):  # whatever is wrong with it, compiling anew mends it
                form = CompileResult._rebuild(target, *pickle.loads(code))
                self.place = place
                return form
        LOG.info("compiling %s", self._function.__qualname__)
        return None

    def save_overload(self, types: Any, form: Any) -> None:
        """Keep the form for these types in the first place that takes it."""
        if form.lifted or form.library.has_dynamic_globals:
            return
        name = self._name(types, form.library.codegen)
        code = dumps(form._reduce())
        for place in offered():
            with contextlib.suppress(OSError):
                _write(place / name, self._digest(name, code) + code)
                self.place = place
                return
        _say_that_nothing_is_kept()

    def has(self, types: Any, codegen: Any) -> bool:
        """Whether there is a form for these types that is whole and of this very source."""
        return next(self._whole(types, codegen), None) is not None

    def _whole(self, types: Any, codegen: Any) -> Iterator[tuple[Path, bytes]]:
        name = self._name(types, codegen)
        for place in searched():
            with contextlib.suppress(OSError):
                held = (place / name).read_bytes()
                if held[:_DIGEST] == self._digest(name, held[_DIGEST:]):
                    yield place, held[_DIGEST:]

    def _name(self, types: Any, codegen: Any) -> str:
        """One for each function, set of types, processor, Python and Numba; newer source takes the place of older.

        Types are equal where Numba writes them alike.
        """
        machine = (sys.implementation.cache_tag, numba.__version__, codegen.magic_tuple())
        told_apart = hashlib.sha256(repr((str(types), machine)).encode()).hexdigest()[:16]
        module = self._function.__module__.rpartition(".")[2]
        return f"{module}.{self._function.__name__}-{told_apart}{ENDING}"

    def _digest(self, name: str, code: bytes) -> bytes:
        return hashlib.sha256(b"".join([name.encode(), _source(), self._function.__code__.co_code, code])).digest()


def searched() -> Iterator[Path]:
    """Yield the folders where kernels may have been kept."""
    yield from _lasting()
    if _is_own(_temporary()):
        yield _temporary() / _folder()


def offered() -> Iterator[Path]:
    """Yield the folders where one may be kept, the first choice first; the first that takes it has it."""
    yield from _lasting()
    with contextlib.suppress(OSError):
        _temporary().mkdir(mode=0o700, exist_ok=True)
    if _is_own(_temporary()):
        yield _temporary() / _folder()


def _lasting() -> list[Path]:
    """NUMBA_CACHE_DIR where it is set, else beside the source, where one copy serves all users, and the user's cache."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return [Path(chosen).absolute() / _folder()]
    own = Path(AppDirs("perdure", appauthor=False).user_cache_dir)
    # Without a home it is not absolute, and would be a folder '~' wherever one happens to be.
    return [_HERE / "__pycache__", *([own / _folder()] if own.is_absolute() else [])]


def _folder() -> str:
    """A name for the kernels of this installation: others have other sources."""
    return f"kernels-{hashlib.sha256(str(_HERE).encode()).hexdigest()[:12]}"


def _temporary() -> Path:
    """The user's folder among temporary files."""
    with contextlib.suppress(OSError):
        return Path(tempfile.gettempdir()) / f"perdure-{_user()}"
    return Path(os.devnull)  # there are no temporary files; nothing is in this either


def _is_own(folder: Path) -> bool:
    """Whether nobody else can have put something into a folder: what is kept there will be run."""
    try:
        about = folder.lstat()
    except OSError:
        return False
    private = _user() is None or (about.st_uid == _user() and not about.st_mode & 0o077)
    return stat.S_ISDIR(about.st_mode) and private


def _user() -> int | None:
    """The user's number; None on Windows, where temporary files are the user's own."""
    return os.getuid() if hasattr(os, "getuid") else None


def _write(path: Path, content: bytes) -> None:
    """Write a file so that it appears whole, whoever else writes it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f"{path.name}.{uuid.uuid4().hex[:8]}")
    try:
        unfinished.write_bytes(content)
        os.replace(unfinished, path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise


@functools.cache
def _source() -> bytes:
    """What all kernels are made of: one takes in the functions and constants of others."""
    files = sorted(_HERE.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).digest()


@functools.cache
def _say_that_nothing_is_kept() -> None:
    LOG.warning(
        "no folder can be written into, so kernels are compiled anew in every run; "
        "name one in the environment variable NUMBA_CACHE_DIR"
    )

"""One input for one reader: what it says of it, within bounds of time and memory."""

from __future__ import annotations

import contextlib
import re
import resource
import shutil
import signal
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NamedTuple

from hostile.sanity import Insane
from perdure.errors import PerdureError

if TYPE_CHECKING:
    from hostile.readers import Reader

SECONDS, MIB = 5.0, 1536  # of the processor, and of memory beyond what the process has


class Outcome(NamedTuple):
    """What a reader made of an input: read it, refused it with a word, or failed, and where."""

    word: str  # of the refusal; empty where it was read
    fault: str = ""  # what failed, in a line; empty where all is well
    where: str = ""  # the place in the code, by which one fault is told from another
    trace: str = ""


class TooLong(Exception):
    """An input that takes longer than it may."""


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """A folder for files that are read and thrown away, in memory where there is room for it."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        yield Path(folder)


@contextlib.contextmanager
def bounded(seconds: float = SECONDS, mib: int = MIB) -> Iterator[None]:
    """Bound the processor's time and the memory of what is done here."""

    def stop(_: int, __: FrameType | None) -> None:
        raise TooLong(f"it takes longer than {seconds:g} s")

    pages = int(Path("/proc/self/statm").read_text().split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    handler = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + mib * 2**20, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, handler)


def tried(reader: Reader, data: bytes, place: Path) -> Outcome:
    """Return what a reader makes of an input, in an empty folder that is left empty."""
    try:
        with bounded(), warnings.catch_warnings():
            warnings.simplefilter("error")
            reader.look(place, data)
    except PerdureError as error:
        word = str(error)
        if "\n" in word or not word or len(word) > 2000:
            return Outcome(word, "a refusal that is no line", _where(error))
        return Outcome(word)
    except Exception as error:
        return Outcome("", f"{type(error).__name__}: {error}"[:300], _where(error), traceback.format_exc())
    finally:
        for one in place.iterdir():
            shutil.rmtree(one) if one.is_dir() else one.unlink()
    return Outcome("")


def _where(error: BaseException) -> str:
    """The last line of the program that an error came through, and its kind."""
    if isinstance(error, Insane):
        return re.sub(r"[0-9.]+", "", str(error))[:60]
    places = traceback.extract_tb(error.__traceback__)
    own = [one for one in places if "perdure" in one.filename]
    last = own[-1] if own else places[-1]
    return f"{type(error).__name__} at {'/'.join(Path(last.filename).parts[-3:])}:{last.lineno}"

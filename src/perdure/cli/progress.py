"""Live progress on stderr: frames done, rate, time left."""

from __future__ import annotations

import contextlib
import functools
import logging
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.progress import Task as RichTask
from rich.text import Text

T = TypeVar("T")
COMPILING = "compiling kernels, once per machine…"
_QUIET_INTERVAL = 10.0  # s between lines where stderr is not a terminal


def watched(items: Iterable[T], what: str, total: int | None, unit: str = "frames") -> Iterator[T]:
    """Yield the items while a line on stderr tells how far it is.

    On a terminal a bar with rate and time left; elsewhere a plain line every ten seconds.
    """
    if sys.stderr.isatty():
        yield from _with_bar(items, what, total)
        return
    begun = said = time.monotonic()
    with kernel_news(functools.cache(lambda: print(f"{what}: {COMPILING}", file=sys.stderr))):
        for done, item in enumerate(items, 1):
            yield item
            now = time.monotonic()
            if now - said > _QUIET_INTERVAL:
                said = now
                of = f" of {total}" if total else ""
                print(f"{what}: {done}{of} {unit}, {done / (now - begun):.1f} a second", file=sys.stderr)


@contextlib.contextmanager
def kernel_news(compiling: Callable[[], object]) -> Iterator[None]:
    """Within the context, call `compiling` for each kernel that is not there yet, and print what kernels warn of.

    They tell both to a logger, so that nothing need load them before they are needed.
    """
    log = logging.getLogger("perdure.kernels")
    listener = _Listener(compiling)
    before = log.level
    log.addHandler(listener)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(listener)
        log.setLevel(before)


class _Listener(logging.Handler):
    def __init__(self, compiling: Callable[[], object]) -> None:
        super().__init__()
        self._compiling = compiling

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno >= logging.WARNING:
            print(f"perdure: note: {record.getMessage()}", file=sys.stderr)
        else:
            self._compiling()


def _with_bar(items: Iterable[T], what: str, total: int | None) -> Iterator[T]:
    columns = [
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        _Rate(),
        TimeRemainingColumn(compact=True),
    ]
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(what, total=total)

        def compiling() -> None:
            progress.update(task, description=f"{what}: {COMPILING}", refresh=True)

        with kernel_news(compiling):
            for item in items:
                yield item
                progress.update(task, description=what, advance=1)


class _Rate(ProgressColumn):
    """Frames a second."""

    def render(self, task: RichTask) -> Text:
        return Text(f"{task.speed:.0f} frames/s" if task.speed else "")

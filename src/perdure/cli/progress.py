"""Live progress on stderr: frames done, rate, time left."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
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
_QUIET_INTERVAL = 10.0  # s between lines where stderr is not a terminal


def watched(items: Iterable[T], what: str, total: int | None, unit: str = "frames") -> Iterator[T]:
    """Yield the items while a line on stderr tells how far it is.

    On a terminal a bar with rate and time left; elsewhere a plain line every ten seconds.
    """
    if sys.stderr.isatty():
        yield from _with_bar(items, what, total)
        return
    begun = said = time.monotonic()
    for done, item in enumerate(items, 1):
        yield item
        now = time.monotonic()
        if now - said > _QUIET_INTERVAL:
            said = now
            of = f" of {total}" if total else ""
            print(f"{what}: {done}{of} {unit}, {done / (now - begun):.1f} a second", file=sys.stderr)


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
        for item in items:
            yield item
            progress.advance(task)


class _Rate(ProgressColumn):
    """Frames a second."""

    def render(self, task: RichTask) -> Text:
        return Text(f"{task.speed:.0f} frames/s" if task.speed else "")

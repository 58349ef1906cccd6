"""Reading ahead: an iterator worked off in a thread, so that decoding overlaps with what uses it."""

from __future__ import annotations

import queue
import threading
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")
_POLL = 0.05  # s


@dataclass(frozen=True)
class _Item(Generic[T]):
    value: T


def ahead(items: Iterator[T], depth: int = 4) -> Generator[T, None, None]:
    """Yield the items in order while a thread makes up to `depth` of them in advance.

    An exception of the iterator is raised here, after all items before it. The thread ends when the
    items end, and when the caller stops early (closes or drops this generator, or is interrupted).
    A generator `items` is closed, in the thread that ran it.
    """
    made: queue.Queue[_Item[T] | BaseException | None] = queue.Queue(depth)
    stop = threading.Event()
    thread = threading.Thread(target=_work, args=(items, made, stop), name="perdure-ahead", daemon=True)
    thread.start()
    try:
        while (item := made.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item.value
    finally:
        stop.set()
        thread.join()


def _work(items: Iterator[T], made: queue.Queue[_Item[T] | BaseException | None], stop: threading.Event) -> None:
    last: BaseException | None = None
    try:
        for value in items:
            if not _put(made, _Item(value), stop):
                break
    except BaseException as error:  # passed on to the caller's thread, whatever it is
        last = error
    finally:
        if isinstance(items, Generator):
            items.close()
    _put(made, last, stop)


def _put(
    made: queue.Queue[_Item[T] | BaseException | None],
    item: _Item[T] | BaseException | None,
    stop: threading.Event,
) -> bool:
    """Put the item unless the caller has stopped; return whether it was put."""
    while not stop.is_set():
        try:
            made.put(item, timeout=_POLL)
        except queue.Full:
            continue
        return True
    return False

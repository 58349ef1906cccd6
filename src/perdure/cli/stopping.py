"""Ending a run early so that nothing is lost: by Ctrl-C, a termination signal, or damage of the source."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterable, Iterator
from types import FrameType, TracebackType

from perdure.errors import DamagedVideo
from perdure.pipeline import Plan
from perdure.types import Frame


class Ending:
    """Passes frames on until they end, break off, or the user has had enough; remembers which.

    Within the context the first Ctrl-C ends the frames, so that the tracker still finishes and results
    are written; a second one interrupts at once.
    """

    def __init__(self) -> None:
        self.damage: DamagedVideo | None = None
        self.interrupted = False
        self._waiting = False

    def at_once(self) -> None:
        """From now on the first signal interrupts: what is under way may be thrown away."""
        self._waiting = True

    @property
    def status(self) -> str:
        """'done', 'damaged' or 'interrupted'."""
        if self.interrupted:
            return "interrupted"
        return "done" if self.damage is None else "damaged"

    @contextlib.contextmanager
    def at_once_within(self) -> Iterator[None]:
        """Within the context the first signal interrupts."""
        self._waiting = True
        try:
            yield
        finally:
            self._waiting = False

    def first_look(self, plan: Plan) -> Plan:
        """Return the plan with its first look taken, or as it was if the user interrupts."""
        try:
            with self.at_once_within():
                return plan.prepared()
        except KeyboardInterrupt:
            self.interrupted = True
            return plan

    def frames(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Yield the frames; damage and interruption end them quietly."""
        iterator = iter(frames)
        while not self.interrupted:
            try:
                self._waiting = True
                frame = next(iterator, None)
            except KeyboardInterrupt:
                self.interrupted = True
                return
            except DamagedVideo as damage:
                self.damage = damage
                return
            finally:
                self._waiting = False
            if frame is None:
                return
            yield frame

    def __enter__(self) -> Ending:
        self._before = {}
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self._waiting or self.interrupted:  # the source may never answer; a second wish is an order
            raise KeyboardInterrupt
        self.interrupted = True

"""A live source that goes on: connections that come back, frames never older than they may be, what was lost told.

A thread reads what comes and keeps the newest; who is too slow for all of it gets what is new enough, and the rest is
dropped and counted. When a connection ends it is opened again, sooner at first, later more seldom, until it answers or
`give_up` seconds have passed.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from perdure.errors import DamagedVideo, ParameterError, VideoError
from perdure.files.passing import Passing
from perdure.params import parameter
from perdure.types import Bits, Event, Frame, Image, Scene

_SOONEST, _LATEST = 0.5, 10.0  # s between two tries to reach a source
_POLL = 0.2  # s
_MOST = 256  # frames that wait, however long they may
_STEP = 1e-3  # s between two frames at least


@dataclass(frozen=True)
class Patience:
    """How a live source is read."""

    max_latency: float = parameter(
        0.5, "how old a frame may be when it is taken; older ones are dropped", unit="s", low=0.01, high=60.0
    )
    silence: float = parameter(
        10.0, "how long nothing may come before the connection counts as lost", unit="s", low=0.5, high=3600.0
    )
    give_up: float = parameter(
        0.0, "how long a lost source is tried again; 0 for ever", unit="s", low=0.0, high=1e6
    )


class Taken(NamedTuple):
    """A picture that has come."""

    number: int
    time: float  # s since the first frame, by the source's own clock within a connection
    arrived: float  # s of this machine's clock
    image: Image


@dataclass
class Counts:
    """What has come and gone; read by others while it grows."""

    received: int = 0
    dropped: int = 0
    connections: int = 0
    failures: int = 0  # tries that did not reach the source
    away: float = 0.0  # s without a connection
    connected: bool = False
    why: str = ""  # it is not


@dataclass(eq=False)
class LiveSource:
    """A camera or a stream, of any length.

    Parameters
    ----------
    reach : function
        Opens the source; raises VideoError where it cannot.
    patience : Patience
    clock, sleep : functions
        Of this machine: seconds, and waiting for some, or until an event is set.
    """

    reach: Callable[[], Passing]
    patience: Patience = field(default_factory=Patience)
    clock: Callable[[], float] = time.monotonic
    name: str = ""
    origin: str = ""
    width: int = 0
    height: int = 0
    fps: float = 25.0
    warnings: list[str] = field(default_factory=list)
    counts: Counts = field(default_factory=Counts)
    rereadable: bool = False
    has_images: bool = True
    wanted: range | None = None
    count: int | None = None
    folder: Path | None = None

    def __post_init__(self) -> None:
        self._frames: deque[Taken] = deque()
        self._events: list[Event] = []
        self._condition = threading.Condition()
        self._stop = threading.Event()
        self._ended = self._why = ""  # why nothing will come any more; why the last connection was lost
        self._begun = self._lost = 0.0
        self._last = -1.0
        self._next = 0
        self.told: Callable[[str], None] = lambda text: None
        first = self.reach()
        self.name, self.origin, self.fps = first.name, first.origin, first.fps
        self.width, self.height = first.width, first.height
        self._current: Passing | None = first
        self._thread = threading.Thread(target=self._read, name="perdure-live", daemon=True)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the newest frames as they come; DamagedVideo where the source was given up."""
        if not self._thread.is_alive() and not self._stop.is_set():
            self._thread.start()
        while (taken := self._take()) is not None:
            self.arrived = taken.arrived
            yield Frame(taken.number, taken.time, taken.image)
        if self._ended:
            raise DamagedVideo(f"{self.name}: {self._ended}", self._next, max(self._last, 0.0))

    def after(self, index: int) -> Iterator[Frame]:
        """Yield what still comes behind frame `index`; what has passed does not come again."""
        return (frame for frame in self if frame.index > index)

    arrived: float = 0.0  # s of this machine's clock at which the frame came that was taken last

    def happened(self) -> tuple[Event, ...]:
        """Return what has happened to the source since it was asked last: connections that were lost and came back."""
        with self._condition:
            events, self._events = tuple(self._events), []
        return events

    @property
    def waiting(self) -> int:
        """How many frames wait to be taken."""
        return len(self._frames)

    def sample(self, count: int) -> list[Frame]:
        """Return nothing: what has passed does not come again."""
        return []

    def image_name(self, index: int) -> str | None:
        """Return None: no frame of it is a file."""
        return None

    def scene(self, roi: Bits | None = None) -> Scene:
        """Return the scene that this source shows."""
        return Scene(self.width, self.height, self.fps, roi=roi)

    def close(self) -> None:
        """End reading; a connection that does not answer is left to end by itself."""
        self._stop.set()
        with self._condition:
            self._condition.notify_all()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)

    # Taking ---------------------------------------------------------------------------------------------------------

    def _take(self) -> Taken | None:
        """Wait for the oldest frame that is new enough; None when there will be none any more."""
        with self._condition:
            while True:
                self._drop_old()
                if self._frames:
                    return self._frames.popleft()
                if self._stop.is_set() or self._ended:
                    return None
                self._condition.wait(_POLL)

    def _drop_old(self) -> None:
        """Drop frames that are too old, but the newest: it is all there is."""
        oldest = self.clock() - self.patience.max_latency
        while len(self._frames) > 1 and (self._frames[0].arrived < oldest or len(self._frames) > _MOST):
            self._frames.popleft()
            self.counts.dropped += 1

    # Reading, in the thread -----------------------------------------------------------------------------------------

    def _read(self) -> None:
        try:
            while not self._stop.is_set():
                source = self._current or self._reached()
                self._current = None
                if source is None:
                    return
                self._follow(source)
        except Exception as error:  # whatever a decoder may throw: the taker must not wait for ever
            self._end(f"reading it failed: {error}")

    def _follow(self, source: Passing) -> None:
        """Keep what one connection gives, until it ends."""
        why, first = "the stream ended", True
        connected = self.clock()
        try:
            for shot in source.shots:
                now = self.clock()
                if first:
                    self._connected(now)
                    offset = now - self._begun - (shot.seconds or 0.0)
                time = now - self._begun if shot.seconds is None else shot.seconds + offset
                if abs(time - (now - self._begun)) > self.patience.silence:  # its clock was set anew
                    offset = now - self._begun - (shot.seconds or 0.0)
                    time = now - self._begun
                self._keep(shot.image, max(time, self._last + _STEP), now)
                first = False
                if self._stop.is_set():
                    break
        except VideoError as error:
            why = str(error)
        finally:
            source.close()
        if not self._stop.is_set():
            self._lost = self.clock() if not first else connected
            with self._condition:
                self.counts.connected, self.counts.why = False, why
                self._why = why
            self.told(f"the connection to {self.name} was lost ({why}); it is tried again")

    def _connected(self, now: float) -> None:
        with self._condition:
            if self.counts.connections:
                gap = now - self._lost
                self.counts.away += gap
                why = f"{self._why}; back after {gap:.1f} s"
                self.told(f"{self.name} is back after {gap:.1f} s")
                self._events.append(Event("gap", self._next, self._next, why=why))
            else:
                self._begun = now
            self.counts.connections += 1
            self.counts.connected, self.counts.why = True, ""

    def _keep(self, image: Image, time: float, now: float) -> None:
        with self._condition:
            self._frames.append(Taken(self._next, time, now, self._fitting(image)))
            self._next, self._last = self._next + 1, time
            self.counts.received += 1
            self._drop_old()
            self._condition.notify()

    def _fitting(self, image: Image) -> Image:
        """The picture in the size of the first one."""
        if image.shape[:2] == (self.height, self.width):
            return image
        import cv2

        text = f"its frames changed from {self.width}x{self.height} to {image.shape[1]}x{image.shape[0]}; they are scaled"
        if text not in self.warnings:
            self.warnings.append(text)
        return np.asarray(cv2.resize(image, (self.width, self.height), interpolation=cv2.INTER_AREA), np.uint8)

    def _reached(self) -> Passing | None:
        """Try until the source answers; None where that is given up, or nobody wants it any more."""
        wait = _SOONEST
        while not self._stop.is_set():
            limit = self.patience.give_up
            if limit and self.clock() - self._lost > limit:
                self._end(f"{self._why}; not reached again for {limit:g} s")
                return None
            if self._stop.wait(wait):
                return None
            try:
                return self.reach()
            except VideoError as error:
                self.counts.failures += 1
                self.counts.why = str(error)
                wait = min(2 * wait, _LATEST)
        return None

    def _end(self, why: str) -> None:
        with self._condition:
            self._ended = why
            self._condition.notify_all()


def open_live(
    source: str, *, fps: float | None = None, patience: Patience | None = None, wait: bool = False
) -> LiveSource:
    """Open a camera's number or a stream's URL as a live source; with `wait`, try until it can be reached.

    Raises
    ------
    VideoError
        If it cannot be reached now; waiting, if it is given up.
    ParameterError
        If it is neither.
    """
    from perdure.files.live import open_camera, open_url
    from perdure.files.span import read_span

    span = read_span(None, None, 1)
    wanted = patience or Patience()
    if "://" in source:
        return _first_reached(lambda: open_url(source, fps, span, wanted.silence), wanted, wait=wait)
    if source.isascii() and source.isdigit():
        return _first_reached(lambda: open_camera(int(source), fps, span), wanted, wait=wait)
    raise ParameterError(f"{source} is neither a camera's number nor a URL; `perdure track` follows files")


def _first_reached(reach: Callable[[], Passing], patience: Patience, *, wait: bool) -> LiveSource:
    """The source, as soon as it can be reached."""
    begun, pause = time.monotonic(), _SOONEST
    while True:
        try:
            return LiveSource(reach, patience)
        except VideoError:
            late = patience.give_up and time.monotonic() - begun > patience.give_up
            if not wait or late:
                raise
        time.sleep(pause)
        pause = min(2 * pause, _LATEST)

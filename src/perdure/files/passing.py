"""Sources that pass once: cameras, streams, iterators of arrays."""

from __future__ import annotations

import itertools
import weakref
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from perdure.errors import DamagedVideo, VideoError
from perdure.files.ahead import ahead
from perdure.files.clock import Clock
from perdure.files.span import Span
from perdure.types import Bits, Frame, Image, Scene


class Shot(NamedTuple):
    """A picture and the seconds its source gives for it, None where it gives none."""

    image: Image
    seconds: float | None


@dataclass(frozen=True, eq=False)
class Passing:
    """A source that can be read once; iterating again goes on where the last iteration stopped.

    Parameters
    ----------
    shots : iterator of Shot
        Raises VideoError where it breaks off.
    clock : Clock
        Makes increasing times of what the source gives.
    shut : function
        Gives back the device or the connection.
    threaded : bool
        Whether to read ahead in a thread; not where the shots are made by the caller's own code.
    """

    name: str
    origin: str
    width: int
    height: int
    fps: float
    span: Span
    shots: Iterator[Shot]
    clock: Clock
    numbers: Iterator[int]
    warnings: list[str]
    shut: Callable[[], None]
    threaded: bool
    count: int | None = None
    rereadable: bool = False
    wanted: range | None = None
    has_images: bool = True
    folder: Path | None = None
    running: weakref.WeakSet[Generator[Frame, None, None]] = field(default_factory=weakref.WeakSet, repr=False)

    def __iter__(self) -> Iterator[Frame]:
        frames = ahead(self._frames()) if self.threaded else self._frames()
        self.running.add(frames)
        return frames

    def after(self, index: int) -> Iterator[Frame]:
        """Yield what still comes behind frame `index`; what has passed does not come again."""
        return (frame for frame in self if frame.index > index)

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
        """End what still reads from it, and give back the device or the connection."""
        for frames in list(self.running):
            frames.close()
        self.shut()

    def _frames(self) -> Generator[Frame, None, None]:
        first: int | None = None
        for index in self.numbers:
            try:
                shot = next(self.shots, None)
                if shot is not None and shot.image.shape[:2] != (self.height, self.width):
                    size = f"{shot.image.shape[1]}x{shot.image.shape[0]}"
                    raise VideoError(f"its frames change from {self.width}x{self.height} to {size}")
            except VideoError as error:
                time = self.clock.next_time
                raise DamagedVideo(
                    f"{self.name} breaks off at frame {index} ({time:.2f} s): {error};"
                    " everything before it is kept",
                    index,
                    time,
                ) from None
            if shot is None:
                return
            time = self.clock.time(index, shot.seconds)
            if self.span.passed(index, time):
                return
            if self.span.reached(index, time):
                first = index if first is None else first
                if (index - first) % self.span.stride == 0:
                    yield Frame(index, time, shot.image)


def passing(
    name: str,
    origin: str,
    fps: float,
    span: Span,
    shots: Iterator[Shot],
    clock: Clock,
    warnings: list[str],
    shut: Callable[[], None] | None = None,
) -> Passing:
    """Make a source of shots; the first is looked at to know the size (0x0 where there is none)."""
    first = next(shots, None)
    height, width = (0, 0) if first is None else first.image.shape[:2]
    shots = iter(()) if first is None else itertools.chain([first], shots)
    return Passing(
        name,
        origin,
        width,
        height,
        fps,
        span,
        shots,
        clock,
        itertools.count(),
        warnings,
        shut or _nothing,
        shut is not None,
    )


def _nothing() -> None:
    """There is nothing to give back."""

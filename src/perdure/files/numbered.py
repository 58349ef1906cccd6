"""Sources whose frames can be fetched by number: image folders, lists of arrays, boxes without images."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from perdure.errors import DamagedVideo, ParameterError, VideoError
from perdure.files.ahead import ahead
from perdure.files.span import Span, no_frame
from perdure.types import Bits, Frame, Image, Scene


@dataclass(frozen=True, eq=False)
class Numbered:
    """A source of frames 0 … `total` - 1, all equally long.

    Parameters
    ----------
    read : function
        Returns the RGB image of a frame, or None where there is none. It raises VideoError for one
        that cannot be read.
    names : tuple of str
        The names of the images, or empty.
    """

    name: str
    origin: str
    width: int
    height: int
    fps: float
    total: int
    span: Span
    read: Callable[[int], Image | None]
    has_images: bool = True
    names: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    folder: Path | None = None
    rereadable: bool = True
    running: weakref.WeakSet[Generator[Frame, None, None]] = field(default_factory=weakref.WeakSet, repr=False)

    def __post_init__(self) -> None:
        first = 0 if self.span.start is None else self.span.start.number(self.fps)
        if first and first >= self.total:
            raise VideoError(
                f"start ({self.span.start}) is beyond the end of {self.name}: it has {self.total} frames"
                f" ({self.total / self.fps:.2f} s)"
            )
        if self.total and not self.wanted:
            raise ParameterError(no_frame(self.span))

    @property
    def count(self) -> int | None:
        """How many frames it will deliver."""
        return len(self.wanted)

    @property
    def wanted(self) -> range:
        """The numbers of the frames that it will deliver."""
        return self.span.numbers(self.total, self.fps)

    def __iter__(self) -> Iterator[Frame]:
        return self.after(-1)

    def after(self, index: int) -> Iterator[Frame]:
        """Yield the wanted frames behind frame `index`."""
        frames = ahead(self._frames(index)) if self.has_images else self._frames(index)
        self.running.add(frames)
        return frames

    def sample(self, count: int) -> list[Frame]:
        """Return about `count` frames spread evenly; those that cannot be read are left out."""
        wanted = self.wanted
        places = np.unique(np.linspace(0, len(wanted) - 1, max(0, min(count, len(wanted)))).round().astype(int))
        frames = []
        for place in places:
            try:
                frames.append(self._frame(wanted[place]))
            except DamagedVideo:
                continue
        return frames

    def image_name(self, index: int) -> str | None:
        """Return the name of the image that is frame `index`."""
        return self.names[index] if 0 <= index < len(self.names) else None

    def scene(self, roi: Bits | None = None) -> Scene:
        """Return the scene that this source shows."""
        return Scene(self.width, self.height, self.fps, roi=roi)

    def close(self) -> None:
        """End what still reads from it."""
        for frames in list(self.running):
            frames.close()

    def _frames(self, after: int) -> Generator[Frame, None, None]:
        for index in self.wanted:
            if index > after:
                yield self._frame(index)

    def _frame(self, index: int) -> Frame:
        try:
            image = self.read(index)
            if image is not None and image.shape[:2] != (self.height, self.width):
                raise VideoError(
                    f"it is {image.shape[1]}x{image.shape[0]}, those before it {self.width}x{self.height}"
                )
        except VideoError as error:
            what = self.image_name(index) or "frame"
            time = index / self.fps
            raise DamagedVideo(
                f"{self.name} breaks off at frame {index} ({time:.2f} s) of {self.total}, {what}: {error};"
                " everything before it is kept",
                index,
                time,
            ) from None
        return Frame(index, index / self.fps, image)

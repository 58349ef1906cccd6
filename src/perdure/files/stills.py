"""Any frame of a source by its number: what a viewer needs, which goes back and forth."""

from __future__ import annotations

import contextlib
from bisect import bisect_left
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from typing import Any

from perdure.errors import PerdureError, VideoError
from perdure.files.numbered import Numbered
from perdure.files.recording import Recording
from perdure.files.span import Moment, Span
from perdure.files.video import open_source
from perdure.types import Frame

_KEPT = 12  # frames before one asked for that are passed to `seen` on the way: somebody steps back
_NEAR = 64  # frames: so far ahead it is quicker to go on than to enter anew


class Stills:
    """The frames of a source that can be read again, each by its number in the whole source.

    Not for several threads at once. A frame asked for costs the way from the key frame before it, or from the last
    frame asked for; the last ones on the way are passed to `seen`, so that they may be kept.

    Parameters
    ----------
    source : str
        A video file, a folder or glob of images.
    fps : float or None
        As the run was given it; times are not used.
    seen : function of a frame
        Told the frame asked for, and some before it.

    Raises
    ------
    VideoError
        If the source cannot be opened, read again, or holds no pictures.
    """

    def __init__(self, source: str, *, fps: float | None = None, seen: Callable[[Frame], None]) -> None:
        opened = open_source(source, fps=fps, start="0f")
        if not opened.rereadable or not opened.has_images:
            opened.close()
            what = "cannot be read a second time" if not opened.rereadable else "has no pictures"
            raise VideoError(f"{source} {what}")
        self.width, self.height = opened.width, opened.height
        self._source: Any = opened
        self._seen = seen
        self._running: Iterator[Frame] = iter(())
        self._next = -1  # number of the frame that comes next

    def frame(self, index: int) -> Frame:
        """Return a frame.

        Raises
        ------
        VideoError
            If there is none of this number, or it is damaged.
        """
        if not 0 <= self._next <= index <= self._next + _NEAR:
            self._enter(index)
        try:
            for frame in self._running:
                self._next = frame.index + 1
                self._seen(frame)
                if frame.index >= index:
                    if frame.index == index:
                        return frame
                    break
        except PerdureError:
            self._leave()
            raise
        self._leave()
        raise VideoError(f"{self._source.name} has no frame {index}")

    def near(self, index: int) -> int:
        """Return the number of a frame at or before one that can be had at once: of a video, a key frame's."""
        if not isinstance(self._source, Recording) or 0 <= self._next <= index <= self._next + _KEPT:
            return index
        listing = self._source.listing
        if listing is None or not listing.exact or not listing.keys:
            return index
        key = bisect_left(listing.stamps, listing.key_before(index))
        return index if index - key <= _KEPT else key

    def close(self) -> None:
        """Give back files and threads."""
        self._leave()
        self._source.close()

    def _enter(self, index: int) -> None:
        self._leave()
        if isinstance(self._source, Numbered):
            if index >= self._source.total:
                raise VideoError(f"{self._source.name} has no frame {index}; it has {self._source.total}")
            self._running = iter(replace(self._source, span=Span(Moment(frame=index))))
            self._next = index
        elif isinstance(self._source, Recording):
            listing = self._source.listing
            if listing is not None and listing.exact and index >= len(listing.stamps):
                raise VideoError(f"{self._source.name} has no frame {index}; it has {len(listing.stamps)}")
            self._running = self._source.frames_towards(index, _KEPT)
            self._next = index
        else:
            raise VideoError(f"{self._source.name} cannot be read by the numbers of its frames")

    def _leave(self) -> None:
        running, self._running, self._next = self._running, iter(()), -1
        if isinstance(running, Generator):
            with contextlib.suppress(PerdureError):
                running.close()

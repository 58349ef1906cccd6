"""Frames of a run's source as JPEG, each by its exact number; what was decoded or encoded lately is kept.

A browser plays few codecs, and its video element does not tell which frame it shows. So the server decodes, by the same
code that the tracker read the film with: frame k of the log is frame k of the picture.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

from perdure.errors import PerdureError, VideoError
from perdure.files.stills import Stills
from perdure.types import Frame, Image

_QUALITY = 88
_KEPT_PICTURES = 96 << 20  # bytes of decoded frames
_KEPT_JPEGS = 192 << 20


class Pictures:
    """The frames of one source; safe for threads, which wait for one another.

    Parameters
    ----------
    source : str
    fps : float or None
        As the run was given it.
    size : (int, int)
        Width and height that the run says; (0, 0) where it says none.
    """

    def __init__(self, source: str, *, fps: float | None, size: tuple[int, int]) -> None:
        self._source, self._fps, self._size = source, fps, size
        self._lock = threading.Lock()
        self._stills: Stills | None = None
        self._wrong = ""
        self._decoded: OrderedDict[int, Image] = OrderedDict()
        self._jpegs: OrderedDict[int, bytes] = OrderedDict()
        self._bytes = {"decoded": 0, "jpegs": 0}

    def why_not(self) -> str:
        """Return why there are no pictures; nothing where there are."""
        with self._lock:
            self._open()
            return self._wrong

    def kept(self, index: int) -> bytes | None:
        """Return a frame's JPEG if it is at hand."""
        return self._jpegs.get(index)

    def near(self, index: int) -> int:
        """Return the number of a frame near one that can be had at once: one at hand, or a key frame."""
        with self._lock:
            if index in self._jpegs or index in self._decoded:
                return index
            stills = self._open()
            if stills is None:
                return index
            key = stills.near(index)
            at_hand = [one for one in (*self._jpegs, *self._decoded) if key <= one <= index]
            return max(at_hand, default=key)

    def jpeg(self, index: int) -> bytes:
        """Return a frame as JPEG.

        Raises
        ------
        VideoError
            If there is none of this number, it is damaged, or there are no pictures at all.
        """
        with self._lock:
            found = self._jpegs.get(index)
            if found is not None:
                self._jpegs.move_to_end(index)
                return found
            stills = self._open()
            if stills is None:
                raise VideoError(self._wrong)
            image = self._decoded.get(index)
            if image is None:
                image = stills.frame(index).image
            if image is None:
                raise VideoError(f"frame {index} has no picture")
            encoded = _jpeg(image)
            self._keep(self._jpegs, "jpegs", index, encoded, len, _KEPT_JPEGS)
            return encoded

    def close(self) -> None:
        """Give back files and threads."""
        with self._lock:
            if self._stills is not None:
                self._stills.close()
                self._stills = None
            self._wrong = "the viewer is closing"

    def _open(self) -> Stills | None:
        if self._stills is None and not self._wrong:
            try:
                stills = Stills(self._source, fps=self._fps, seen=self._see)
            except (PerdureError, OSError) as error:
                self._wrong = str(error)
                return None
            if all(self._size) and (stills.width, stills.height) != self._size:
                stills.close()
                self._wrong = (
                    f"{self._source} is {stills.width}x{stills.height}, the run was over pictures of "
                    f"{self._size[0]}x{self._size[1]}"
                )
                return None
            self._stills = stills
        return self._stills

    def _see(self, frame: Frame) -> None:
        if frame.image is not None:
            self._keep(
                self._decoded, "decoded", frame.index, frame.image, lambda image: image.nbytes, _KEPT_PICTURES
            )

    def _keep(
        self, kept: OrderedDict[int, Any], what: str, index: int, value: Any, size: Callable[[Any], int], most: int
    ) -> None:
        """Keep a value, and let the oldest go where there are too many bytes."""
        if index in kept:
            self._bytes[what] -= size(kept.pop(index))
        kept[index] = value
        self._bytes[what] += size(value)
        while self._bytes[what] > most and len(kept) > 1:
            self._bytes[what] -= size(kept.popitem(last=False)[1])


def _jpeg(image: Image) -> bytes:
    import cv2

    done, encoded = cv2.imencode(
        ".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
    )
    if not done:
        raise VideoError("the picture cannot be encoded")
    return encoded.tobytes()

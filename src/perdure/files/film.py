"""Writing films and pictures: each appears whole under its name, or not at all.

A film is VP9 in an `.mp4` or `.webm`, playable in a browser, with the times it was given: its first frame
is at 0, and the spacing of the frames, also an uneven one, is kept. Odd sizes grow by one repeated row
or column, because VP9's 4:2:0 colour wants even ones.
"""

from __future__ import annotations

import contextlib
import math
import os
import queue
import threading
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Self, cast

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.errors import OutputError, ParameterError
from perdure.files.whole import cannot_write
from perdure.types import Image

_CODEC = "libvpx-vp9"
_TICKS = {".mp4": 90_000, ".webm": 1_000}  # a second; webm knows no finer
_FAILURES = (OSError, av.FFmpegError)
_WAITING = 8  # pictures between the caller and the encoder
_KEY_SECONDS = 4.0  # a player seeks to a key frame
_BT601, _LIMITED_RANGE = 6, 1  # FFmpeg's numbers of what cv2's RGB to I420 makes

_Waiting = tuple[NDArray[np.uint8], int]  # I420 planes (H * 3 / 2, W) and the time in ticks


class Film:
    """A film being written; a context manager.

    The film appears under its name when it is closed: at the end of a `with` block that raised nothing, or
    by `close()`. After an exception, or if no frame was written, there is no file, and a film that was
    there before stays as it was. Pictures are encoded on a thread of the film's own.

    Parameters
    ----------
    path : Path
        Ends in `.mp4` or `.webm`; an existing film is replaced at the end,
        a folder that is missing is made.
    width, height : int
        Size of the pictures, in pixels.
    fps : float
        Nominal frames per second: how long the last frame stays.
    quality : int
        0 (best) to 63 (smallest); VP9's constant quality.

    Raises
    ------
    OutputError
        If the ending is another one or the folder cannot be written to.
    ParameterError
        If size, fps or quality are out of range.
    """

    def __init__(self, path: Path, width: int, height: int, *, fps: float, quality: int = 32) -> None:
        self.path = Path(path)
        _check(self.path, width, height, fps, quality)
        self._shape = (height, width, 3)
        self._ticks = _TICKS[self.path.suffix.lower()]
        self._fps = fps
        self._begin: float | None = None
        self._last = -1
        self._failure: BaseException | None = None
        self._closed = self._discarded = False
        self._partial = _beside(self.path)
        self._container = _opened(self._partial, self.path)
        self._stream = self._new_stream(quality)
        self._waiting: queue.Queue[_Waiting | None] = queue.Queue(_WAITING)
        self._thread = threading.Thread(target=self._encode, name=f"film {self.path.name}", daemon=True)
        self._thread.start()

    def write(self, image: Image, time: float) -> None:
        """Add a picture (H, W, 3), RGB, shown from `time` in seconds until the next one's time.

        The picture may be reused at once. A time that is not later than the one before is taken for the
        very next tick (1/90000 s, in a `.webm` 1/1000 s).

        Raises
        ------
        OutputError
            If an earlier picture could not be written, the disk being full for example.
        ValueError
            If the picture is of another size, the time is no number or the film is closed.
        """
        if self._closed:
            raise ValueError(f"{self.path}: the film is closed")
        if image.shape != self._shape or image.dtype != np.uint8:
            raise ValueError(f"{self.path}: pictures must be {self._shape} uint8, not {image.shape} {image.dtype}")
        if not math.isfinite(time):
            raise ValueError(f"{self.path}: a picture's time must be a number of seconds, not {time}")
        self._raise_failure()
        if self._begin is None:
            self._begin = time
        self._last = max(round((time - self._begin) * self._ticks), self._last + 1)
        self._waiting.put((_planes(image), self._last))

    def close(self) -> None:
        """Finish the film and put it in its place; closing again does nothing.

        Raises
        ------
        OutputError
            If the film could not be written; nothing is left of it then.
        """
        if self._closed:
            return
        try:
            self._end_thread()
            self._raise_failure()
            if self._begin is None:
                self._remove()
                return
            self._finish()
        except BaseException:
            self._abandon()
            raise

    def discard(self) -> None:
        """Stop and leave nothing of the film; what was there before stays."""
        if not self._closed:
            self._abandon()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.discard()

    def _new_stream(self, quality: int) -> av.VideoStream:
        height, width = self._shape[0] + self._shape[0] % 2, self._shape[1] + self._shape[1] % 2
        try:
            rate = Fraction(self._fps).limit_denominator(1001)
            stream = cast(
                av.VideoStream, self._container.add_stream(_CODEC, rate=rate, options=_options(quality, width))
            )
        except (OSError, ValueError, LookupError) as error:
            self._remove()
            raise OutputError(f"{self.path}: this build of av cannot encode VP9 ({error})") from error
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, self._ticks)
        stream.codec_context.gop_size = max(1, round(_KEY_SECONDS * self._fps))
        stream.codec_context.colorspace = _BT601
        stream.codec_context.color_range = _LIMITED_RANGE
        stream.codec_context.thread_count = 2
        return stream

    def _encode(self) -> None:
        """Encode what comes until None comes; after a failure or a discard, only take it off the queue."""
        while (waiting := self._waiting.get()) is not None:
            if self._failure is None and not self._discarded:
                try:
                    self._encode_one(*waiting)
                except BaseException as failure:  # told to the caller's thread, by write or close
                    self._failure = failure

    def _encode_one(self, planes: NDArray[np.uint8], ticks: int) -> None:
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.time_base, frame.pts = Fraction(1, self._ticks), ticks
        frame.duration = max(1, round(self._ticks / self._fps))
        frame.colorspace, frame.color_range = _BT601, _LIMITED_RANGE
        self._container.mux(self._stream.encode(frame))

    def _end_thread(self) -> None:
        self._closed = True
        self._waiting.put(None)
        self._thread.join()

    def _abandon(self) -> None:
        self._discarded = True  # what waits is not encoded any more
        if not self._closed:
            self._end_thread()
        self._thread.join()  # again, where an interrupt ended the first wait
        self._remove()

    def _finish(self) -> None:
        try:
            self._container.mux(self._stream.encode(None))
            self._container.close()
            os.replace(self._partial, self.path)
        except _FAILURES as error:
            raise _failed(self.path, error) from error

    def _remove(self) -> None:
        with contextlib.suppress(*_FAILURES):  # the first failure is the one that is told
            self._container.close()
        with contextlib.suppress(OSError):
            self._partial.unlink(missing_ok=True)

    def _raise_failure(self) -> None:
        if isinstance(self._failure, _FAILURES):
            raise _failed(self.path, self._failure) from self._failure
        if self._failure is not None:
            raise self._failure


def save_png(path: Path, image: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
    """Write a picture, (H, W, 3) RGB or (H, W) of 8 or 16 bits, as a PNG file.

    Raises
    ------
    OutputError
        If the name does not end in `.png` or the folder cannot be written to.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise OutputError(f"{path}: a picture is written as .png")
    planes = cv2.cvtColor(image, cv2.COLOR_RGB2BGR) if image.ndim == 3 else image
    done, content = cv2.imencode(".png", planes)
    if not done:
        raise OutputError(f"{path}: a picture of shape {image.shape} and type {image.dtype} cannot be a PNG")
    partial = _beside(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(content.tobytes())
        os.replace(partial, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        raise cannot_write(path, error) from error


def _check(path: Path, width: int, height: int, fps: float, quality: int) -> None:
    if path.suffix.lower() not in _TICKS:
        raise OutputError(f"{path}: a film's name must end in {' or '.join(_TICKS)}")
    if not (1 <= width <= 16384 and 1 <= height <= 16384):
        raise ParameterError(f"a film must be 1 to 16384 pixels wide and high, not {width}x{height}")
    if not (math.isfinite(fps) and 0.001 <= fps <= 1000):
        raise ParameterError(f"fps must be 0.001 to 1000, not {fps}")
    if not 0 <= quality <= 63:
        raise ParameterError(f"quality must be 0 (best) to 63 (smallest), not {quality}")


def _options(quality: int, width: int) -> dict[str, str]:
    """Settings of libvpx: fast enough to run beside the tracking, on two threads."""
    return {
        "crf": str(quality),
        "b": "0",
        "deadline": "realtime",
        "cpu-used": "8",
        "row-mt": "1",
        "tile-columns": "1" if width >= 512 else "0",
        "lag-in-frames": "0",
    }


def _opened(partial: Path, path: Path) -> av.container.OutputContainer:
    kind = path.suffix.lower()[1:]
    options = {"movflags": "+faststart"} if kind == "mp4" else {}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return av.open(str(partial), "w", format=kind, options=options)
    except _FAILURES as error:
        raise _failed(path, error) from error


def _planes(image: Image) -> NDArray[np.uint8]:
    """Return I420 planes (H * 3 / 2, W) of a picture made even."""
    height, width = image.shape[:2]
    if height % 2 or width % 2:
        image = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420), np.uint8)


def _failed(path: Path, error: Exception) -> OutputError:
    return cannot_write(path, error if isinstance(error, OSError) else OSError(str(error)))


def _beside(path: Path) -> Path:
    """Return the name, in the same folder, of what is not whole yet."""
    return path.with_name(f".{path.name}.part")

"""Opening a source: a video file, a folder or glob of images, a camera, a URL, a MOTChallenge folder, arrays.

What a source says of time is kept: `Frame.time` is the file's own timestamp, also where the frame rate
varies, and `Frame.index` is the number in the whole source, also after a start or with a stride.
Every kind of source is a file of its own beside this one; this is the door.
"""

from __future__ import annotations

import glob
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from perdure.errors import ParameterError, VideoError
from perdure.files.live_source import LiveSource
from perdure.files.span import Span, cut, read_span, real, shown
from perdure.types import Bits, Frame, Scene

RATES = (0.001, 1000.0)  # frames per second that a source may have
_CAMERAS = 10**9


class Source(Protocol):
    """Frames from somewhere, one after the other."""

    @property
    def name(self) -> str:
        """A short name, fit for a folder."""
        ...

    @property
    def origin(self) -> str:
        """Where it comes from: an absolute path, a URL, a camera."""
        ...

    @property
    def width(self) -> int:
        """Pixels, after the rotation that the file asks for."""
        ...

    @property
    def height(self) -> int:
        """Pixels, after the rotation that the file asks for."""
        ...

    @property
    def fps(self) -> float:
        """Nominal frames per second; times come with the frames."""
        ...

    @property
    def count(self) -> int | None:
        """How many frames it will deliver, as far as it says; None where it does not."""
        ...

    @property
    def wanted(self) -> range | None:
        """The numbers of the frames that it will deliver, where it can be known beforehand."""
        ...

    @property
    def rereadable(self) -> bool:
        """Whether iterating twice gives the same frames."""
        ...

    @property
    def has_images(self) -> bool:
        """False for a MOTChallenge folder without images, whose frames have the image None."""
        ...

    @property
    def warnings(self) -> list[str] | tuple[str, ...]:
        """What the user should know; more may be added while it is read."""
        ...

    @property
    def folder(self) -> Path | None:
        """The root of a MOTChallenge folder, else None."""
        ...

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames; raises DamagedVideo where the source breaks off."""
        ...

    def after(self, index: int) -> Iterator[Frame]:
        """Yield the frames behind frame `index`, the very ones that iterating gives; only if it is rereadable."""
        ...

    def sample(self, count: int) -> list[Frame]:
        """Return about `count` frames spread over the whole, for a first look; [] if not rereadable."""
        ...

    def image_name(self, index: int) -> str | None:
        """Return the file name of the image that is frame `index`, or None."""
        ...

    def scene(self, roi: Bits | None = None) -> Scene:
        """Return the scene that this source shows."""
        ...

    def close(self) -> None:
        """End reading and give back files, threads and devices."""
        ...


def open_source(
    source: str | Path | int | Iterable[NDArray[np.uint8]] | LiveSource,
    *,
    fps: float | None = None,
    start: str | float | None = None,
    end: str | float | None = None,
    stride: int = 1,
) -> Source:
    """Open a source and look at its first frame.

    Parameters
    ----------
    source : str, Path, int or iterable of arrays
        A video file, a folder or glob of images, a MOTChallenge folder (one with `seqinfo.ini`), a
        camera's number, a URL, or (H, W, 3) or (H, W) uint8 arrays, RGB or grey.
    fps : float or None
        Frames per second in [0.001, 1000], instead of what the source says: times become index / fps.
    start, end : str, float or None
        Seconds (12.5, '1:02', '0:01:02.5') or a frame ('300f'); the end is not included.
    stride : int
        Every so many frames, from the start.

    Raises
    ------
    VideoError
        For a source that cannot be opened, or holds no frame.
    ParameterError
        For an fps, start, end or stride that cannot be.
    FormatError
        For a `seqinfo.ini` that is not what it should be.
    """
    rate = _rate(fps)
    span = read_span(start, end, stride)
    if isinstance(source, LiveSource):
        return source
    if isinstance(source, bool):
        raise ParameterError(f"{shown(source)} is no source: give a file, a folder, a URL or a camera number")
    if isinstance(source, (int, np.integer)):
        return _open_camera(int(source), rate, span)
    if isinstance(source, (str, Path)):
        return _open_place(source, rate, span)
    from perdure.files.arrays import open_arrays

    return open_arrays(source, rate, span)


def _rate(fps: object) -> float | None:
    if fps is None:
        return None
    rate, (low, high) = real(fps), RATES
    if not low <= rate <= high:
        raise ParameterError(f"fps = {shown(fps)} is out of range: it must be {low:g} to {high:g} frames/s")
    return rate


def _open_place(source: str | Path, fps: float | None, span: Span) -> Source:
    text = str(source)
    if not text:
        raise ParameterError("the source is empty: give a file, a folder, a URL or a camera number")
    if "://" in text:
        from perdure.files.live import open_url

        try:
            urlsplit(text)
        except ValueError:  # not shown: there may be a password in it
            raise VideoError("the URL cannot be read: check how its host and port are written") from None
        return open_url(text, fps, span)
    try:
        if text.isascii() and text.isdigit() and len(text) < 10 and not Path(text).exists():
            return _open_camera(int(text), fps, span)
        return _open_path(text, fps, span)
    except PermissionError as error:
        place = error.filename or text
        raise VideoError(f"{place} cannot be read: permission denied; check its rights") from None
    except OSError as error:
        place, why = cut(str(error.filename or text)), str(error.strerror or error).lower()
        raise VideoError(f"{place} cannot be opened: {why}; check the name of the source") from None


def _open_path(text: str, fps: float | None, span: Span) -> Source:
    from perdure.files import images, recording

    path = Path(text)
    if path.is_dir():
        return images.open_folder(path, fps, span)
    if path.is_file():
        opener = images.open_single if path.suffix.lower() in images.SUFFIXES else recording.open_recording
        return opener(path, fps, span)
    if path.exists():
        raise VideoError(f"{path} is no regular file; give a file, a folder, a URL or a camera number")
    if "\0" in text:
        raise VideoError(f"{cut(text)} cannot be opened: there is a zero byte in the name")
    if glob.has_magic(text):
        return images.open_glob(text, fps, span)
    raise VideoError(_missing(path))


def _open_camera(number: int, fps: float | None, span: Span) -> Source:
    from perdure.files.live import open_camera

    if number >= _CAMERAS:
        raise VideoError(f"there is no camera with a number from {_CAMERAS} on; the first is 0")
    return open_camera(number, fps, span)


def _missing(path: Path) -> str:
    """Say that nothing is at a path, with what comes near it."""
    import difflib

    folder = path.parent
    if not folder.is_dir():
        return f"{cut(str(path), 250)} does not exist: there is no folder {cut(str(folder), 250)}"
    names = [one.name for one in folder.iterdir() if not one.name.startswith(".")]
    near = difflib.get_close_matches(path.name, names, n=3, cutoff=0.5)
    hint = f"; did you mean {' or '.join(near)}?" if near else ""
    return f"{cut(str(path), 250)} does not exist{hint}"

"""Opening a video file by FFmpeg, and saying in one line why it cannot be opened."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import av
from av.container import InputContainer
from av.video.stream import VideoStream

from perdure.errors import VideoError

# Names and titles that are not UTF-8 are no reason to refuse a film; from version 19 on, av sees to that itself.
TOLERANT: dict[str, Any] = {"metadata_errors": "replace"} if int(av.__version__.split(".")[0]) < 19 else {}

_TEXT_ART = {"tty", "lrc", "srt", "webvtt", "ass"}  # formats that FFmpeg reads out of text files

_BOXES = {b"ftyp", b"mdat", b"wide", b"free", b"skip", b"moov"}
_NO_INDEX = (
    "{} has no whole index ('moov'): the recording was cut before its index was written, or the copy is not whole"
)


@contextlib.contextmanager
def opened(path: Path) -> Iterator[InputContainer]:
    """Open a video file and close it again; VideoError says why where it cannot be opened."""
    if path.stat().st_size == 0:
        raise VideoError(f"{path} is empty (0 bytes): the recording or the copy failed")
    with path.open("rb") as file:
        head = file.read(4096)
    try:
        container = av.open(str(path), **TOLERANT)
    except av.error.FFmpegError as error:
        raise VideoError(_why_not(path, head, error)) from None
    with container:
        if container.format.name in _TEXT_ART:
            raise VideoError(f"{path} is text, not a video")
        yield container


def video_stream(path: Path, container: InputContainer) -> VideoStream:
    """Return the stream of moving pictures; VideoError where there is none, or no decoder for it."""
    cover = av.stream.Disposition.attached_pic
    streams = [one for one in container.streams.video if not one.disposition & cover]
    if not streams:
        kinds = sorted({one.type or "unknown" for one in container.streams})
        raise VideoError(f"{path} holds no video, only {', '.join(kinds) or 'nothing'}")
    if cast("object | None", streams[0].codec_context) is None:
        if "mov" in container.format.name and _lacks_index(path):
            raise VideoError(_NO_INDEX.format(path))
        raise VideoError(
            f"{path}: there is no decoder for the codec of its video; convert it, for instance to H.264 or VP9"
        )
    return streams[0]


def _why_not(path: Path, head: bytes, error: av.error.FFmpegError) -> str:
    if head[4:8] in _BOXES and _lacks_index(path):
        return _NO_INDEX.format(path)
    if b"\0" not in head and not head.startswith(b"YUV4MPEG2 "):
        return f"{path} is not a video but text"
    return f"{path} is not a video that can be read ({error.strerror or error})"


def _lacks_index(path: Path) -> bool:
    """Whether an MP4 or QuickTime file has no 'moov' box, or ends within it."""
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        while at + 8 <= size:
            file.seek(at)
            header = file.read(16)
            length, kind = int.from_bytes(header[:4]), header[4:8]
            if length == 1:  # a 64-bit length follows
                length = int.from_bytes(header[8:16])
            if kind == b"moov":
                return at + length > size
            if length < 8:  # 0: up to the end of the file
                return True
            at += length
    return True

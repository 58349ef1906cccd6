"""The pictures of a video file, by FFmpeg: exactly those before the first damage, with their numbers.

Error concealment would paint pictures that never were, so decoding stops at the first damage. Found are:
a file cut short, by its header's own count or length; packets that the container marks as incomplete;
errors that the decoder meets, also in the middle of a file (H.264, H.265 and MPEG-4 part 2 notice nearly
every overwritten byte that visibly changes a picture, Motion JPEG most). Not found are changed bytes that
are valid code themselves: MS-MPEG-4, VP8 and VP9 notice few of them within a picture, uncompressed video
none. A file without a count or length (MPEG-TS; an AVI or Matroska file that was never closed) may end
anywhere.

Only codecs that raise an error for damage are decoded on several threads. Where FFmpeg conceals damage and
marks the frame, the mark of a frame decoded on several threads comes or does not come by chance. A decoder
that meets damage drops pictures that it held back; so the damaged packet is looked for without threads, and
the packets before it are decoded again, on their own.

PyAV's log level stays as it is (off): when set, FFmpeg's threads wait for the interpreter to log an error
while PyAV holds it to wait for them, and a damaged file never ends.
"""

from __future__ import annotations

import contextlib
import re
import sys
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, cast

import av
from av.container import InputContainer
from av.video.stream import VideoStream

from perdure.files.refusal import opened, video_stream
from perdure.types import Image

_THREADED = frozenset({"vp9", "libvpx-vp9", "av1", "libdav1d"})
_HELD = 8  # frames
_UNSEEN = {"vp8"}  # codecs with packets of their own for pictures that are never shown
_StampOf = Callable[["av.Packet[VideoStream] | av.VideoFrame"], "int | None"]
if TYPE_CHECKING:
    _Packet = av.Packet[VideoStream]
_LATE = 1.0  # s: how much earlier than its declared length a file may end


@dataclass(frozen=True)
class Picture:
    """A decoded frame, its number in the file, and its timestamp in seconds or None."""

    index: int
    seconds: float | None
    frame: av.VideoFrame


class Broken(Exception):
    """Decoding met damage; every picture before it was yielded."""


@dataclass(frozen=True)
class Listing:
    """The frames of a file as its packets tell without decoding.

    Parameters
    ----------
    stamps : list of int
        Timestamps in ticks, sorted.
    keys : list of int
        Those at which decoding can begin, sorted.
    tick : float
        Seconds.
    exact : bool
        Whether the i-th timestamp is that of the i-th frame.
    cut : bool
        Whether the file ends before its header says.
    """

    stamps: list[int]
    keys: list[int]
    tick: float
    exact: bool
    cut: bool

    def key_before(self, index: int) -> int:
        """Return the timestamp of the last key frame at or before frame `index`."""
        stamp = self.stamps[min(index, len(self.stamps) - 1)]
        return max((key for key in self.keys if key <= stamp), default=self.stamps[0])


def list_frames(path: Path) -> Listing:
    """List the frames of a file from its packets, as far as they can be read."""
    with opened(path) as container:
        stream = video_stream(path, container)
        stamp_of, extent = _stamp_of(container), _Extent(container, stream)
        stamps: list[int | None] = []
        keys: set[int] = set()
        with contextlib.suppress(av.error.FFmpegError):
            for packet in _packets(container, stream, None, extent):
                if packet.size and not packet.is_discard:
                    stamps.append(stamp := stamp_of(packet))
                    keys |= {stamp} if packet.is_keyframe and stamp is not None else set()
        sure = sorted({one for one in stamps if one is not None})
        exact = len(sure) == len(stamps) and stream.codec_context.name not in _UNSEEN
        if container.format.name == "avi":  # has no timestamps, and may pack two frames into one packet
            exact = exact and not stream.codec_context.has_b_frames
        return Listing(sure, sorted(keys), float(stream.time_base or 0), exact, extent.cut())


def can_enter(path: Path, key: int) -> bool:
    """Return whether the file can be entered at a key frame or before it; some formats land behind."""
    with opened(path) as container:
        stream = _entered(path, container, key)
        stamp_of = _stamp_of(container)
        stamps = (stamp_of(one) for one in container.demux(stream) if one.is_keyframe)
        with contextlib.suppress(av.error.FFmpegError):
            stamp = next(stamps, None)
            return stamp is not None and stamp <= key
    return False


def decode(path: Path, key: int | None = None, listing: Listing | None = None) -> Generator[Picture, None, None]:
    """Yield the pictures of a file, from the first or from a key frame on.

    Parameters
    ----------
    path : Path
        The file.
    key : int or None
        The timestamp of the key frame to begin at, in ticks; None for the first.
    listing : Listing or None
        What tells the key frame's number; needed with a key.

    Raises
    ------
    Broken
        At the first damage.
    """
    upcoming = 0
    flaw: _Flaw | None = None
    for again in (False, True):
        try:
            pictures = _pictures(path, key, listing, flaw)
            for picture in pictures if again else _held_back(pictures):
                if picture.index >= upcoming:
                    upcoming = picture.index + 1
                    yield picture
            return
        except _Damage:
            if again:
                raise Broken from None
            flaw = _find_flaw(path, key)


def rgb(frame: av.VideoFrame) -> Image:
    """Return the (H, W, 3) RGB picture of a decoded frame."""
    return cast("Image", frame.to_ndarray(format="rgb24"))


def _held_back(pictures: Iterator[Picture]) -> Iterator[Picture]:
    """The pictures, a few late: a damaged frame may be marked only after those that were made from it."""
    held: deque[Picture] = deque()
    for picture in pictures:
        held.append(picture)
        if len(held) > _HELD:
            yield held.popleft()
    yield from held


class _Damage(Exception):
    """Decoding met damage, or what is marked as damaged."""


@dataclass(frozen=True)
class _Flaw:
    """The first damaged packet, counted from where decoding begins, and its timestamp in ticks."""

    packet: int
    stamp: int | None


def _pictures(path: Path, key: int | None, listing: Listing | None, flaw: _Flaw | None) -> Iterator[Picture]:
    """The pictures in the order of showing; with a flaw, those before it."""
    with opened(path) as container:
        stream = _entered(path, container, key)
        stamp_of, tick = _stamp_of(container), float(stream.time_base or 0)
        extent = _Extent(container, stream)
        packets = _packets(container, stream, key, extent)
        frames = _frames(packets, stream) if flaw is None else _frames_before(flaw, packets, stream, stamp_of)
        index: int | None = 0 if key is None else None
        for frame in frames:
            stamp = stamp_of(frame)
            if index is None:
                index = bisect_left(listing.stamps, stamp) if listing and stamp is not None else 0
            yield Picture(index, None if stamp is None else stamp * tick, frame)
            index += 1
        if flaw is not None or (extent.cut() if listing is None else listing.cut):
            raise _Damage


def _entered(
    path: Path, container: InputContainer, key: int | None, threaded: frozenset[str] = _THREADED
) -> VideoStream:
    """The video stream, made ready to be decoded from a key frame on."""
    stream = video_stream(path, container)
    stream.thread_type = "AUTO" if stream.codec_context.name in threaded else "NONE"
    stream.codec_context.options = {"err_detect": "explode"}
    if key is not None:
        container.seek(key, stream=stream)
    return stream


def _frames(packets: Iterator[_Packet | None], stream: VideoStream) -> Iterator[av.VideoFrame]:
    """The frames of the packets up to the first damage; None lets out what the decoder holds back."""
    try:
        for packet in packets:
            if packet is not None and packet.is_corrupt:
                raise _Damage
            for frame in stream.codec_context.decode(packet):
                if frame.is_corrupt:
                    raise _Damage
                yield frame
    except av.error.FFmpegError:
        raise _Damage from None


def _frames_before(
    flaw: _Flaw, packets: Iterator[_Packet], stream: VideoStream, stamp_of: _StampOf
) -> Iterator[av.VideoFrame]:
    """The frames of the packets before the flaw, as far as they are shown before it."""
    for frame in _frames(chain(islice(packets, flaw.packet), [None]), stream):
        stamp = stamp_of(frame)
        if stamp is None or flaw.stamp is None or stamp < flaw.stamp:
            yield frame


def _find_flaw(path: Path, key: int | None) -> _Flaw | None:
    """Find the first damaged packet, without threads; None where there is none."""
    with opened(path) as container:
        stream = _entered(path, container, key, frozenset())
        stamp_of, met = _stamp_of(container), list[int | None]()
        try:
            for packet in _packets(container, stream, key, _Extent(container, stream)):
                met.append(stamp_of(packet))
                if packet.is_corrupt:
                    return _Flaw(len(met) - 1, met[-1])
                for frame in stream.codec_context.decode(packet):
                    if frame.is_corrupt:
                        stamp = stamp_of(frame)
                        return _Flaw(met.index(stamp) if stamp in met else len(met) - 1, stamp)
        except av.error.FFmpegError:
            return _Flaw(max(0, len(met) - 1), met[-1] if met else None)
    return None


def _packets(
    container: InputContainer, stream: VideoStream, key: int | None, extent: _Extent
) -> Iterator[_Packet]:
    """The packets that can be decoded: from the first key frame on, without what leads into it."""
    stamp_of = _stamp_of(container)
    entered, entry = False, key
    for packet in container.demux(stream):
        extent.meet(packet)
        stamp = stamp_of(packet)
        if packet.size and not entered:
            entered = packet.is_keyframe
            if not entered:
                entry = -sys.maxsize
                continue
            entry = stamp if entry is not None else None
        if entry is None or stamp is None or stamp >= entry:
            yield packet


class _Extent:
    """How much of a file was met, against what its header declares."""

    def __init__(self, container: InputContainer, stream: VideoStream) -> None:
        self.format = container.format.name
        self.stream = stream
        self.length = (container.duration or 0) / av.time_base if len(container.streams) == 1 else 0.0
        self.packets = 0
        self.end = 0.0

    def meet(self, packet: _Packet) -> None:
        """Count a packet."""
        if packet.size or packet.dts is not None:
            self.packets += 1
        if packet.pts is not None:
            self.end = max(self.end, (packet.pts + (packet.duration or 0)) * float(self.stream.time_base or 0))

    def cut(self) -> bool:
        """Return whether the file ends clearly before its header says; asked at its end."""
        if "matroska" in self.format:
            own = seconds_of_tag(self.stream.metadata.get("DURATION", ""))
            return own - self.end > 3.0 / float(self.stream.average_rate or 3) or self.length - self.end > _LATE
        declared = self.stream.frames
        if "mov" in self.format:  # an edit list may leave out samples that its header counts
            declared = len(self.stream.index_entries) if hasattr(self.stream, "index_entries") else 0
        return declared - self.packets > max(2, declared // 200)


def seconds_of_tag(text: str) -> float:
    """Return the seconds of a Matroska duration '00:00:02.400000000'; 0 where it is none."""
    match = re.fullmatch(r"(\d+):(\d+):(\d+(?:\.\d+)?)", text)
    return int(match[1]) * 3600 + int(match[2]) * 60 + float(match[3]) if match else 0.0


def _stamp_of(container: InputContainer) -> _StampOf:
    """What tells the time of a packet or frame: an AVI has no timestamps but only an order."""
    if container.format.name == "avi":
        return lambda one: one.dts
    return lambda one: one.pts

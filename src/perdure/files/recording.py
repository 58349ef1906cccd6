"""A video file as a source: true timestamps, exact frame numbers, everything before the first damage."""

from __future__ import annotations

import contextlib
import math
import weakref
from bisect import bisect_left
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import av
import numpy as np
from av.container import InputContainer
from av.video.stream import VideoStream

from perdure.errors import DamagedVideo, ParameterError, VideoError
from perdure.files.ahead import ahead
from perdure.files.clock import Clock
from perdure.files.cut_short import cut_short
from perdure.files.decoding import Broken, Listing, Picture, can_enter, decode, list_frames, rgb
from perdure.files.refusal import opened, video_stream
from perdure.files.span import Span, no_frame
from perdure.files.tally import Promise, Tally, promise_of
from perdure.types import Bits, Frame, Image, Scene

_RATE = 25.0  # frames per second, where a file says none
_SHORT = 1500 * 768 * 576  # pixels: a recording up to this is decoded straight through for a first look
_OUT_OF_ORDER = 4  # frames that a decoder may have to wait for
_FURTHER = 48  # frames decoded after a key frame, at most, for a first look


@dataclass(frozen=True, eq=False)
class Recording:
    """A video file as a source."""

    name: str
    origin: str
    width: int
    height: int
    fps: float
    span: Span
    path: Path
    fixed: float | None
    first: float | None
    turns: int
    total: int | None
    count: int | None
    listing: Listing | None
    promise: Promise = field(default_factory=Promise)
    warnings: list[str] = field(default_factory=list)
    rereadable: bool = True
    has_images: bool = True
    folder: Path | None = None
    running: weakref.WeakSet[Generator[Frame, None, None]] = field(default_factory=weakref.WeakSet, repr=False)

    @property
    def wanted(self) -> range | None:
        """The numbers of the frames that it will deliver, by its packets; None where these tell nothing."""
        known, wanted = self._known_and_wanted()
        return wanted if known.stamps else None

    def __iter__(self) -> Iterator[Frame]:
        return self.after(-1)

    def after(self, index: int) -> Iterator[Frame]:
        """Yield the wanted frames behind frame `index`.

        Those before it are decoded, too: from another entry a decoder may give other pictures.
        """
        frames = ahead(self._frames(index))
        self.running.add(frames)
        return frames

    def frames_towards(self, index: int, near: int) -> Generator[Frame, None, None]:
        """Yield frames one after the other, from `near` before `index` on, as far as the way from a key frame goes by there.

        Raises
        ------
        DamagedVideo
            At the first damage.
        """
        known = self.listing
        key = known.key_before(index) if known is not None and known.exact and known.stamps else None
        if known is None or key is None or key <= known.stamps[0] or not can_enter(self.path, key):
            key = None
        clock, upcoming = self._clock(), index
        try:
            for picture in decode(self.path, key=key, listing=known):
                time = clock.time(picture.index, picture.seconds)
                upcoming = picture.index + 1
                if picture.index >= index - near:
                    yield Frame(picture.index, time, self._image(picture, time))
        except Broken:
            raise self._damaged(upcoming, clock.next_time) from None

    def sample(self, count: int) -> list[Frame]:
        """Return about `count` frames spread over the wanted part; damaged ones are left out.

        A short recording is decoded straight through; of a long one the key frames near evenly spaced
        times are taken, and frames a little after them.
        """
        if count < 1:
            return []
        known, wanted = self._known_and_wanted()
        if not wanted:
            return []
        places = {wanted[i] for i in np.linspace(0, len(wanted) - 1, min(count, len(wanted))).round().astype(int)}
        straight = max(places) * self.width * self.height <= _SHORT or not known.keys
        found = self._pick(sorted(places)) if straight else self._leap(sorted(places), known)
        return [frame for _, frame in sorted(found.items())]

    def image_name(self, index: int) -> str | None:
        """Return None: no frame of it is a file of its own."""
        return None

    def scene(self, roi: Bits | None = None) -> Scene:
        """Return the scene that this source shows."""
        return Scene(self.width, self.height, self.fps, roi=roi)

    def close(self) -> None:
        """End what still reads from it."""
        for frames in list(self.running):
            frames.close()

    def _known_and_wanted(self) -> tuple[Listing, range]:
        """What the packets tell, and the numbers of the wanted frames by it."""
        known = self.listing or list_frames(self.path)
        return known, wanted_frames(self.span, known, self.fixed, self.first)

    def _frames(self, after: int) -> Generator[Frame, None, None]:
        """The wanted frames behind one; DamagedVideo at the first damage, after every frame before it."""
        clock, tally = self._clock(), Tally()
        begin: int | None = None
        upcoming = 0
        try:
            for picture in decode(self.path, key=self._key(), listing=self.listing):
                time = clock.time(picture.index, picture.seconds)
                upcoming = picture.index + 1
                tally.note(picture.index, picture.seconds)
                if self.span.passed(picture.index, time):
                    return
                if not self.span.reached(picture.index, time):
                    continue
                begin = picture.index if begin is None else begin
                if picture.index > after and (picture.index - begin) % self.span.stride == 0:
                    yield Frame(picture.index, time, self._image(picture, time))
        except Broken:
            raise self._damaged(upcoming, clock.next_time) from None
        if begin is None and self.span.start is not None:
            raise VideoError(too_late(self.span, self.path, clock.last or 0.0))
        if self.listing is None:  # all of it was wanted
            told = tally.notes(self.promise, cut_short(self.path))
            self.warnings.extend(note for note in told if note not in self.warnings)

    def _damaged(self, index: int, time: float) -> DamagedVideo:
        of = f" of {self.total}" if self.total and self.total > index else ""
        return DamagedVideo(
            f"{self.path.name} is damaged: it breaks off at frame {index} ({time:.2f} s){of};"
            " everything before it is kept",
            index,
            time,
        )

    def _image(self, picture: Picture, time: float) -> Image:
        image = rgb(picture.frame)
        if self.turns:
            image = np.ascontiguousarray(np.rot90(image, self.turns))
        if image.shape[:2] != (self.height, self.width):
            size = f"{image.shape[1]}x{image.shape[0]}"
            raise DamagedVideo(
                f"{self.path.name} changes its size from {self.width}x{self.height} to {size} at frame"
                f" {picture.index} ({time:.2f} s); everything before it is kept",
                picture.index,
                time,
            )
        return image

    def _clock(self) -> Clock:
        return Clock(self.fps, self.warnings, self.first, self.fixed)

    def _key(self) -> int | None:
        """The key frame to enter at for the start, where the file's packets tell which frame it is."""
        if self.listing is None or not self.listing.exact:
            return None
        wanted = wanted_frames(self.span, self.listing, self.fixed, self.first)
        key = self.listing.key_before(wanted.start) if wanted else self.listing.stamps[0]
        return key if key > self.listing.stamps[0] and can_enter(self.path, key) else None

    def _pick(self, places: list[int], key: int | None = None, known: Listing | None = None) -> dict[int, Frame]:
        """Decode straight on to the last place and keep the frames at the places."""
        clock = self._clock()
        found: dict[int, Frame] = {}
        pictures = decode(self.path, key=key, listing=known)
        with contextlib.suppress(Broken, VideoError), contextlib.closing(pictures):
            for picture in pictures:
                time = clock.time(picture.index, picture.seconds)
                if picture.index in places or (key is not None and picture.index > places[-1] and not found):
                    found[picture.index] = Frame(picture.index, time, self._image(picture, time))
                if picture.index >= places[-1]:
                    break
        return found

    def _leap(self, places: list[int], known: Listing) -> dict[int, Frame]:
        """Enter at the key frame before each place and go on towards it, `_FURTHER` frames a place at most."""
        found: dict[int, Frame] = {}
        near: dict[int, list[int]] = {}
        for place in places:
            near.setdefault(known.key_before(place), []).append(place)
        for key, wanted in near.items():
            base = bisect_left(known.stamps, key)
            close = [min(place, base + _FURTHER * (i + 1)) for i, place in enumerate(wanted)]
            found |= self._pick(close, key, known)
        return found


def wanted_frames(span: Span, known: Listing, fixed: float | None, first: float | None) -> range:
    """Return the numbers of the wanted frames, by the timestamps of the packets or by a fixed rate."""
    if fixed:
        return span.numbers(len(known.stamps), fixed)
    times = [stamp * known.tick - (first or 0.0) for stamp in known.stamps]
    begin = next((i for i, time in enumerate(times) if span.reached(i, time)), len(times))
    stop = next((i for i, time in enumerate(times) if span.passed(i, time)), len(times))
    return range(begin, max(begin, stop), span.stride)


def too_late(span: Span, path: Path, length: float) -> str:
    """Say that the start lies beyond the end."""
    return f"start ({span.start}) is beyond the end of {path.name}: it is {length:.2f} s long"


def open_recording(path: Path, fps: float | None, span: Span) -> Recording:
    """Open a video file and decode its first frame.

    Raises
    ------
    VideoError
        For a file that holds no video, that cannot be decoded, or that ends before the start.
    """
    warnings: list[str] = []
    with opened(path) as container:
        stream = video_stream(path, container)
        rate = _rate(stream, warnings)
        promise = promise_of(container, stream)
        begin = _beginning(container, stream)
        total = stream.frames or round((container.duration or 0) / av.time_base * rate) or None
    first = first_picture(path)
    if first.seconds is not None and (first.seconds - begin) * rate > 1.5:
        when = f"its first frame is at {first.seconds:.2f} s"
        warnings.append(f"{when}: those before it are missing, or cannot be decoded")
    turns = round(first.frame.rotation / 90) % 4
    if turns:
        warnings.append(f"rotated by {90 * turns}° counter-clockwise, as its metadata says")
    width, height = first.frame.width, first.frame.height
    whole = span.start is None and span.end is None
    listing = None if whole else list_frames(path)
    count = None if total is None else -(-total // span.stride)
    if listing is not None and listing.stamps:
        wanted = wanted_frames(span, listing, fps, first.seconds)
        count = len(wanted)
        if span.start is not None and wanted.start >= len(listing.stamps):
            own = (listing.stamps[-1] - listing.stamps[0]) * listing.tick + 1 / rate
            raise VideoError(too_late(span, path, len(listing.stamps) / fps if fps else own))
        if not wanted:
            raise ParameterError(no_frame(span))
    return Recording(
        name=path.stem,
        origin=str(path.resolve()),
        width=height if turns % 2 else width,
        height=width if turns % 2 else height,
        fps=fps or rate,
        span=span,
        path=path,
        fixed=fps,
        first=first.seconds,
        turns=turns,
        total=total,
        count=count,
        listing=listing,
        promise=promise,
        warnings=warnings,
    )


def _beginning(container: InputContainer, stream: VideoStream) -> float:
    """At what second a file begins: at its first packet, a Matroska at 0 but for frames that are shown out of order."""
    if container.format.name == "avi" or stream.start_time is None:  # an AVI has no timestamps
        return math.inf
    begin = float(stream.start_time * (stream.time_base or 0))
    late = _OUT_OF_ORDER / float(stream.average_rate or _RATE)
    return min(begin, late) if "matroska" in container.format.name else begin


def first_picture(path: Path) -> Picture:
    """Decode the first picture; VideoError where there is none."""
    with contextlib.closing(decode(path)) as pictures:
        try:
            picture = next(pictures, None)
        except Broken:
            raise VideoError(f"{path} is damaged: its first frame cannot be decoded") from None
    if picture is None:
        raise VideoError(f"{path} holds no frames")
    return picture


def _rate(stream: VideoStream, warnings: list[str]) -> float:
    for rate in (stream.average_rate, stream.guessed_rate):
        if rate and 0 < rate <= 1000:
            return float(rate)
    warnings.append(f"it says no frame rate: {_RATE:g} per second are taken; give fps for the true one")
    return _RATE

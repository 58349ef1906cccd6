"""What is missing of a recording, told when its frames have passed: frames within it, and at its end.

A frame whose packet was lost leaves a gap in the timestamps of a film that is otherwise regular. Where a film has another
frame after another time anyway, nothing can be told. A frame that was dropped by the camera looks the same.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import av
from av.container import InputContainer
from av.video.stream import VideoStream

from perdure.files.decoding import seconds_of_tag

_MOST = 1000  # different steps that are counted: a film with more is not regular
_REGULAR = 0.9  # share of the steps that are like the commonest
_ALIKE = 0.35  # of a step
_LEAST = 8  # steps


@dataclass
class Tally:
    """Counts frames and the steps between their timestamps, in milliseconds."""

    frames: int = 0
    first: float | None = None  # s
    last: float | None = None  # s
    steps: Counter[int] = field(default_factory=Counter)  # ms -> how many
    begun: dict[int, int] = field(default_factory=dict)  # ms -> the first frame behind which it was so long

    def note(self, index: int, seconds: float | None) -> None:
        """Count a frame with its own timestamp, None where it has none."""
        self.frames += 1
        if seconds is None:
            return
        if self.last is not None:
            step = round(1000 * (seconds - self.last))
            if step in self.steps or len(self.steps) < _MOST:
                self.steps[step] += 1
                self.begun.setdefault(step, index - 1)
        self.first = seconds if self.first is None else self.first
        self.last = seconds

    @property
    def step(self) -> int:
        """Milliseconds from one frame to the next, where the film is regular; else 0."""
        if not self.steps:
            return 0
        commonest, _ = self.steps.most_common(1)[0]
        alike = sum(count for step, count in self.steps.items() if abs(step - commonest) <= _ALIKE * commonest)
        total = self.steps.total()
        return commonest if commonest > 0 and total >= _LEAST and alike >= _REGULAR * total else 0

    def gaps(self) -> tuple[int, int]:
        """Return how many frames are missing within a regular film, and behind which frame the first are."""
        step = self.step
        wide = [one for one in self.steps if step and one > (2 - _ALIKE) * step]
        missing = sum((round(one / step) - 1) * self.steps[one] for one in wide)
        return missing, min((self.begun[one] for one in wide), default=-1)

    def lacks(self, promise: Promise) -> int:
        """Return how many frames are missing by what a header says; where it has a count and an end, by both."""
        counted = promise.frames - self.frames
        if not promise.end or self.last is None:
            return counted if counted > 1 else 0  # an AVI with packed frames has one less than it says
        step = self.step / 1000 or promise.end / max(promise.frames, 1)
        late = int((promise.end - self.last) / step + 0.5 - _ALIKE) - 1
        if promise.frames:
            return counted if min(counted, late) > 0 else 0
        return max(0, late) if self.step else 0

    def notes(self, promise: Promise, cut_short: str) -> tuple[str, ...]:
        """Return what is missing of a recording of which every frame has passed, in words."""
        told = []
        missing, behind = self.gaps()
        if missing:
            told.append(
                f"{_frames(missing)} missing within it, by its timestamps: the first behind frame {behind}"
            )
        lacking = self.lacks(promise)
        if lacking:
            told.append(f"{_frames(lacking)} missing, by what its header says: {self.frames} came")
        elif cut_short:
            told.append(f"{cut_short}: frames may be missing behind frame {self.frames - 1}")
        return tuple(told)


@dataclass(frozen=True)
class Promise:
    """What the header of a file says of its frames; 0 where it says nothing that holds."""

    frames: int = 0
    end: float = 0.0  # s, of the last


def promise_of(container: InputContainer, stream: VideoStream) -> Promise:
    """Return what a header promises: the count of an AVI, when others end, both of an MP4.

    An edit list of an MP4 may leave out samples that its header counts, and another stream may be longer.
    """
    name, alone = container.format.name, len(container.streams) == 1
    own = seconds_of_tag(stream.metadata.get("DURATION", "")) if "matroska" in name else 0.0
    length = (container.duration or 0) / av.time_base if alone else 0.0
    if name == "avi":
        return Promise(frames=stream.frames)
    if "mov" in name:
        return Promise(stream.frames, length) if length else Promise()
    return Promise(end=own or (length if "matroska" in name or name == "flv" else 0.0))


def _frames(count: int) -> str:
    return f"{count} frame{' is' if count == 1 else 's are'}"

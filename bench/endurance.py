"""Long runs: do memory and the time a frame takes grow with the length of the video?

    python bench/endurance.py [VIDEO] [--tracker overlap] [--frames 200000] [--json] [-- OPTION ...]

The packets of VIDEO (without one: of two people who meet, 120x80, 55 frames) are repeated without decoding them, and
`perdure track` runs over them in a process of its own, which is looked at from outside: its resident memory, the time that
processors have worked for it, and how many frames its log holds. `memory_growth` compares the largest memory in the last fifth of the frames with that in the second
fifth; `time_growth` compares the time a frame takes there. Both are 0 where nothing grows; the memory in which results are
settled at the end is `settling_mib`. What stands behind `--` goes to `perdure track`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from memory import repeat
from resume import divided

PERDURE = [sys.executable, "-c", "from perdure.cli import main; main()"]
_LOOK = 0.05  # s between two looks


@dataclass(frozen=True)
class Look:
    """What is seen of a run from outside at a moment."""

    seconds: float  # that processors worked
    frames: int
    mib: float


@dataclass(frozen=True)
class Endured:
    """A long run."""

    looks: tuple[Look, ...]  # while it tracked
    frames: int
    settling_mib: float

    def between(self, begin: float, end: float) -> list[Look]:
        """The looks from one share of the frames to another."""
        return [one for one in self.looks if begin * self.frames <= one.frames <= end * self.frames]

    @property
    def memory_growth(self) -> float:
        """By how much of it the memory of the last fifth is above that of the second."""
        early, late = (max(one.mib for one in self.between(*part)) for part in _FIFTHS)
        return late / early - 1

    @property
    def time_growth(self) -> float:
        """By how much of it the time of a frame in the last fifth is above that in the second."""
        early, late = (_pace(self.between(*part)) for part in _FIFTHS)
        return late / early - 1


_FIFTHS = (0.2, 0.4), (0.8, 1.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("video", type=Path, nargs="?")
    parser.add_argument("--tracker", default="overlap")
    parser.add_argument("--frames", type=int, default=200_000)
    parser.add_argument("--json", action="store_true")
    own, options = divided(sys.argv[1:])
    arguments = parser.parse_args(own)
    with tempfile.TemporaryDirectory() as folder:
        film = arguments.video or meeting(Path(folder) / "film.avi")
        long = Path(folder) / f"long{film.suffix}"
        repeat(film, long, arguments.frames)
        words = ["--tracker", arguments.tracker, *options]
        endured = endure(long, Path(folder) / "run", words)
    for share in np.arange(0.1, 1.01, 0.1):
        look = endured.between(0.0, float(share))[-1]
        print(f"{look.frames:>8} frames  {look.seconds:8.1f} s  {look.mib:8.1f} MiB")
    told = summary(arguments.tracker, endured)
    print("\n".join(f"{name.replace('_', ' '):<16} {value}" for name, value in told.items()))
    if arguments.json:
        print(json.dumps(told))


def summary(tracker: str, endured: Endured) -> dict[str, float | str]:
    """The figures."""
    return {
        "tracker": tracker,
        "frames": endured.frames,
        "seconds": round(endured.looks[-1].seconds, 1),
        "memory_growth": round(endured.memory_growth, 4),
        "time_growth": round(endured.time_growth, 4),
        "settling_mib": round(endured.settling_mib, 1),
    }


def meeting(path: Path) -> Path:
    """Draw two who meet and part."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height, stream.pix_fmt = 120, 80, "yuv420p"
        stream.bit_rate, stream.gop_size = 2_000_000, 10
        for k in range(55):
            picture = np.full((80, 120, 3), 90, np.uint8)
            for x, y, colour in ((5 + 2 * k, 30, (200, 40, 40)), (105 - 2 * k, 34, (40, 60, 220))):
                picture[y : y + 16, max(x, 0) : max(x + 10, 0)] = colour
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode(None))
    return path


def endure(video: Path, run: Path, options: Sequence[str]) -> Endured:
    """Track a video in a process of its own, and look at it."""
    words = [*PERDURE, "track", str(video), "-o", str(run), "--no-video", "--json", *options]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    looks, settling = [], 0.0
    for look, is_over in watched(process, run / "tracks.jsonl"):
        if is_over:
            settling = max(settling, look.mib)
        else:
            looks.append(look)
    told, _ = process.communicate()
    if process.returncode:
        sys.exit(f"perdure track ended with status {process.returncode}")
    return Endured(tuple(looks), json.loads(told.splitlines()[-1])["frames"], settling)


def watched(process: subprocess.Popen[str], log: Path) -> Iterator[tuple[Look, bool]]:
    """Yield what is seen of a process while it runs, and whether it has logged all."""
    frames, ended = -1, False  # the header is no frame
    while not log.exists() and process.poll() is None:
        time.sleep(_LOOK)
    with log.open("rb") as lines:
        while process.poll() is None:
            new = lines.read()
            frames += new.count(b"\n")
            ended = ended or b'"frame":-1,' in new
            try:
                yield _look(process.pid, frames), ended
            except (OSError, IndexError):  # it has ended
                return
            time.sleep(_LOOK)


def _look(pid: int, frames: int) -> Look:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    ticks = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    seconds = sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")
    return Look(seconds, frames, pages * os.sysconf("SC_PAGE_SIZE") / 2**20)


def _pace(looks: Sequence[Look]) -> float:
    """Seconds of work for a frame, from the first look to the last."""
    return (looks[-1].seconds - looks[0].seconds) / max(1, looks[-1].frames - looks[0].frames)


if __name__ == "__main__":
    main()

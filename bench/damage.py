"""Damaged videos: what does `perdure track` say of films that are cut short, or in which bits are turned over?

    python bench/damage.py [KIND ...] [--places 50] [--seed 0] [--show] [--json]

A film of two who meet (120x80, 40 frames) is drawn into each kind of file. A copy of it is cut at so many places; in as
many copies a single bit is turned over, and in as many a stretch of 2 to 64 bytes is overwritten; a third of these in
the first kilobyte and a sixth in the last, where headers and indexes are. Each copy is tracked in a process of its own,
with a limit of its time and memory, and what came before the damage is read back from its run folder.

`whole` counts runs that found what the undamaged film gives; `told` those that said at which frame the film breaks off,
or in a note that part of it is missing (exit code 3, or a note), `refused` those that said why it cannot be opened (exit code 2). `unnoticed` are
runs with every frame, whose pictures had changed: valid code that means something else. The others ought to be 0:
`crash` (a traceback, a signal), `hang` (over the limit), `shorter` (frames are missing and nothing says so), `unreadable`
(the run folder).
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.cli.commands import run as perdure
from perdure.errors import PerdureError
from perdure.files.runs import RunFolder

VERDICTS = ("whole", "told", "refused", "unnoticed", "crash", "hang", "shorter", "unreadable")
WRONG = VERDICTS[4:]
FRAMES = 40
_LIMIT, _MEMORY = 120.0, 4 << 30  # s, on a busy machine too; bytes
_SIZE = 120, 80


class Harm(NamedTuple):
    """What is done to the bytes of a film."""

    words: str
    harmed: Callable[[bytes], bytes]


@dataclass(frozen=True)
class Told:
    """What a run of a damaged film came to."""

    harm: str
    verdict: str
    words: str  # its last line on stderr
    seconds: float
    mib: float


def main() -> None:
    arguments = _parser().parse_args()
    unknown = set(arguments.kinds) - set(KINDS)
    if unknown:
        sys.exit(f"{', '.join(sorted(unknown))}: not among {', '.join(KINDS)}")
    figures = {}
    with tempfile.TemporaryDirectory() as folder:
        warm(Path(folder))
        for kind in arguments.kinds or KINDS:
            told = list(tried(kind, Path(folder), arguments.places, arguments.seed))
            for one in told if arguments.show else [one for one in told if one.verdict in WRONG]:
                print(f"{kind:<10} {one.harm:<34} {one.verdict:<10} {one.words}", flush=True)
            figures[kind] = summary(told)
            print(f"{kind:<10} {figures[kind]}", file=sys.stderr, flush=True)
    print(table(figures))
    if arguments.json:
        print(json.dumps(figures))
    sys.exit(1 if any(one[name] for one in figures.values() for name in WRONG) else 0)


def warm(folder: Path) -> None:
    """Load all that a run needs into this process, of which the others are forked."""
    cv2.setNumThreads(1)  # a pool of threads would not be forked with it
    film = KINDS["avi-raw"](folder / "warm")
    with contextlib.redirect_stdout(sys.stderr):
        sys.argv = ["perdure", *_words(film, folder / "warm")]
        perdure()


def tried(kind: str, folder: Path, places: int, seed: int) -> Iterator[Told]:
    """Harm a film of this kind in `places` places each way, and track each copy."""
    good = KINDS[kind](folder / f"good-{kind}")
    files = sorted(good.iterdir()) if good.is_dir() else [good]
    code, whole, _ = _tracked(good, folder / "whole")
    if code:
        sys.exit(f"{kind}: the undamaged film cannot be tracked: {whole.strip()}")
    wanted = _rows(folder / "whole")
    rng = random.Random(f"{seed} {kind}")
    for number in range(3 * places):
        file = files[0] if len(files) == 1 else rng.choice(files)
        content = file.read_bytes()
        harm = _harm(number % 3, (number // 3 + rng.random()) / places, len(content), rng)
        yield _judged(_copied(good, file, harm.harmed(content), folder), harm.words, folder / "run", wanted)


def _harm(way: int, share: float, size: int, rng: random.Random) -> Harm:
    """A cut behind a share of the bytes, a bit, or a stretch of bytes."""
    if way == 0:
        at = int(share * size)
        return Harm(f"cut at {at} of {size}", lambda content: content[:at])
    ends = (
        (0, min(1024, size)),
        (max(0, size - 1024), size),
        (0, size),
        (0, size),
        (0, size),
        (0, min(1024, size)),
    )
    at = rng.randrange(*ends[rng.randrange(6)])
    if way == 1:
        bit = 1 << rng.randrange(8)
        return Harm(
            f"bit {bit} at {at} of {size}", lambda content: _overwritten(content, at, bytes([content[at] ^ bit]))
        )
    stretch = rng.randbytes(rng.randint(2, 64))
    return Harm(
        f"{len(stretch)} bytes at {at} of {size}", lambda content: _overwritten(content, at, stretch)[:size]
    )


def _overwritten(content: bytes, at: int, by: bytes) -> bytes:
    return content[:at] + by + content[at + len(by) :]


def _copied(good: Path, file: Path, content: bytes, folder: Path) -> Path:
    """The harmed film, under the same ending."""
    place = folder / f"harmed{good.suffix}"
    if place.is_dir():
        shutil.rmtree(place)
    if good.is_dir():
        shutil.copytree(good, place)
    (place / file.name if good.is_dir() else place).write_bytes(content)
    return place


def _judged(film: Path, harm: str, run: Path, wanted: bytes) -> Told:
    """Track a harmed film and say what came of it."""
    begun = time.monotonic()
    code, words, mib = _tracked(film, run)
    lines = [line for line in words.splitlines() if line.startswith("perdure: ")]
    last = lines[-1] if lines else words.strip().rpartition("\n")[2]
    verdict = _verdict(code, words, lines, run, wanted)
    return Told(harm, verdict, f"({code}) {last}", time.monotonic() - begun, mib)


def _verdict(code: int | None, words: str, lines: Sequence[str], run: Path, wanted: bytes) -> str:
    if code is None:
        return "hang"
    if code not in (0, 2, 3) or "Traceback" in words or (code and not lines):
        return "crash"
    if code == 2:
        return "refused" if not run.exists() else "unreadable"
    try:
        _, _, frames = RunFolder.open(run).read()
        missing = frames < FRAMES
    except PerdureError:
        return "unreadable"
    if code == 3:
        return "told"
    if missing:
        return "told" if any("missing" in line for line in lines) else "shorter"
    return "whole" if _rows(run) == wanted else "unnoticed"


def _rows(run: Path) -> bytes:
    return (run / "tracks.txt").read_bytes()


def _tracked(film: Path, run: Path) -> tuple[int | None, str, float]:
    """Track in a forked process: its exit code, None over the limit; what it said; MiB of memory at most."""
    shutil.rmtree(run, ignore_errors=True)
    said = run.with_name("said")
    process = os.fork()
    if not process:
        _in_child(_words(film, run), said)
    until = time.monotonic() + _LIMIT
    while time.monotonic() < until:
        ended, status, usage = os.wait4(process, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status), said.read_text(errors="replace"), usage.ru_maxrss / 1024
        time.sleep(0.005)
    os.kill(process, signal.SIGKILL)
    _, _, usage = os.wait4(process, 0)
    return None, said.read_text(errors="replace"), usage.ru_maxrss / 1024


def _words(film: Path, run: Path) -> list[str]:
    return ["track", str(film), "-o", str(run), "--no-video", "--tracker", "overlap"]


def _in_child(words: list[str], said: Path) -> None:
    """Run a command and end the process by its exit code, whatever happens."""
    code = 1
    try:
        place = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(place, 2)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        sys.argv = ["perdure", *words]
        code = perdure()
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            sys.stderr.flush()
        os._exit(code)


def summary(told: Sequence[Told]) -> dict[str, float | int]:
    """The figures of one kind."""
    counts = Counter(one.verdict for one in told)
    return {
        "places": len(told),
        **{name: counts[name] for name in VERDICTS},
        "seconds": round(max(one.seconds for one in told), 1),
        "mib": round(max(one.mib for one in told)),
    }


def table(figures: dict[str, dict[str, float | int]]) -> str:
    """The figures as Markdown."""
    names = ["places", *VERDICTS, "seconds", "mib"]
    rows = [["kind", *names[:-2], "slowest", "most memory"], ["---"] * (len(names) + 1)]
    for kind, one in figures.items():
        rows.append([kind, *(str(one[name]) for name in names[:-2]), f"{one['seconds']} s", f"{one['mib']} MiB"])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def pictures() -> list[NDArray[np.uint8]]:
    """Two who meet and part, on a ground with a texture."""
    ground = np.random.default_rng(0).integers(70, 110, (*_SIZE[::-1], 1), np.uint8).repeat(3, axis=2)
    drawn = []
    for k in range(FRAMES):
        picture = ground.copy()
        for x, y, colour in ((5 + 2 * k, 30, (200, 40, 40)), (105 - 2 * k, 34, (40, 60, 220))):
            picture[y : y + 16, max(x, 0) : max(x + 10, 0)] = colour
        drawn.append(picture)
    return drawn


def coded(codec: str, suffix: str, muxing: dict[str, str] | None = None, **options: str) -> Callable[[Path], Path]:
    """What writes the film by a codec into the container that a suffix means."""

    def write(place: Path) -> Path:
        film = place.with_suffix(suffix)
        layout = {"mjpeg": "yuvj420p", "rawvideo": "bgr24", "ffv1": "yuv420p"}.get(codec, "yuv420p")
        with av.open(str(film), "w", options=muxing or {}) as container:
            stream = container.add_stream(codec, rate=10, options=options)
            stream.width, stream.height, stream.pix_fmt = *_SIZE, layout
            stream.codec_context.gop_size, stream.bit_rate = 10, 1_000_000
            for picture in pictures():
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            container.mux(stream.encode(None))
        return film

    return write


def images(suffix: str) -> Callable[[Path], Path]:
    """What writes the film as a folder of images."""

    def write(place: Path) -> Path:
        place.mkdir()
        for k, picture in enumerate(pictures()):
            cv2.imwrite(str(place / f"{k:04d}{suffix}"), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        return place

    return write


def yuv4mpeg(place: Path) -> Path:
    """Write the film as YUV4MPEG2: a line of text, and before each picture's planes another."""
    film = place.with_suffix(".y4m")
    with film.open("wb") as file:
        file.write(f"YUV4MPEG2 W{_SIZE[0]} H{_SIZE[1]} F10:1 Ip A1:1 C420mpeg2\n".encode())
        for picture in pictures():
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(format="yuv420p")
            file.write(b"FRAME\n" + frame.to_ndarray().tobytes())
    return film


KINDS: dict[str, Callable[[Path], Path]] = {
    "mp4-h264": coded("libx264", ".mp4"),
    "mp4-first": coded("libx264", ".mp4", {"movflags": "+faststart"}),
    "mov-mjpeg": coded("mjpeg", ".mov"),
    "mkv-h264": coded("libx264", ".mkv"),
    "mkv-ffv1": coded("ffv1", ".mkv", slicecrc="1", level="3"),
    "webm-vp9": coded("libvpx-vp9", ".webm", deadline="realtime"),
    "webm-vp8": coded("libvpx", ".webm", deadline="realtime"),
    "avi-mpeg4": coded("mpeg4", ".avi"),
    "avi-mjpeg": coded("mjpeg", ".avi"),
    "avi-raw": coded("rawvideo", ".avi"),
    "ts-h264": coded("libx264", ".ts"),
    "mpg-mpeg2": coded("mpeg2video", ".mpg"),
    "flv-h264": coded("libx264", ".flv"),
    "y4m": yuv4mpeg,
    "png": images(".png"),
    "jpg": images(".jpg"),
    "tif": images(".tif"),
}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join(KINDS)}; default: all")
    parser.add_argument("--places", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--show", action="store_true", help="say what came of each copy")
    parser.add_argument("--json", action="store_true")
    return parser


if __name__ == "__main__":
    main()

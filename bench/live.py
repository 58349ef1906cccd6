"""Endless input: does a live run stay as quick and as small as it was at first?

    python bench/live.py [--minutes N] [--away N] [--json] [--write]

A drawn camera on this machine (tests/rtsp.py: RTSP, VP8 over TCP, 320x240, 10 frames a second, people who walk by without
end) is followed by `perdure live`, with scenarios, as a process of its own; every tenth of the time it is cut off for
--away seconds. Memory and latency are read from the run's own health page, once a second; their slopes are those of a
straight line through all but the first fifth, which compiles and fills what is kept. --write puts the table into
docs/live.md, --json prints everything as one object in the last line.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from pages import Marks
from regions import Table, markdown, plain

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))
from rtsp import Camera  # noqa: E402

from perdure.files.whole import whole_file  # noqa: E402

PAGE = ROOT / "docs" / "live.md"
MARKS = Marks.of("bench/live.py", PAGE)
WIDTH, HEIGHT, FPS = 320, 240, 10.0
FLOOR = np.random.default_rng(0).integers(70, 130, (HEIGHT, WIDTH, 3), np.uint8)


@dataclass(frozen=True)
class Told:
    """What an endless run was like."""

    minutes: float
    frames: int
    received: int
    dropped: int
    connections: int
    seconds_away: float
    folders: int
    latency_ms: float  # median
    latency_worst_ms: float  # the worst of ten seconds, median
    latency_slope: float  # ms an hour
    memory_mb: float  # at the end
    memory_slope: float  # MB an hour


def draw(k: int) -> np.ndarray:
    """People who come in on the left and go out on the right, each at a height of her own."""
    image = FLOOR.copy()
    for n in range(3):
        at = k * (2 + n) - 130 * n
        turn, x = divmod(at, WIDTH + 60)
        if at >= 0:
            top = 30 + 65 * n + 7 * (turn % 3)
            colour = ((200, 60, 50), (50, 80, 210), (60, 180, 80))[(turn + n) % 3]
            image[top : top + 45, max(0, x - 30) : max(0, x - 12)] = colour
    return image


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0, help="how long (default 60)")
    parser.add_argument(
        "--away", type=float, default=3.0, help="seconds for which the camera is cut off (default 3)"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the table in docs/live.md")
    arguments = parser.parse_args()
    told, seen = measure(arguments.minutes, arguments.away)
    print(plain(table(told)))
    if arguments.write:
        text = MARKS.replaced(PAGE.read_text(encoding="utf-8"), page(told))
        with whole_file(PAGE) as file:
            file.write(text)
    if arguments.json:
        print(json.dumps({**asdict(told), "seen": seen}))


def measure(minutes: float, away: float) -> tuple[Told, list[dict[str, float]]]:
    """Follow the camera for so long; also what the health page said, by the minute."""
    camera = Camera(draw, FPS)
    port, total = camera.port, 60.0 * minutes
    cuts = [total * (k + 0.5) / 10 for k in range(10)]
    with tempfile.TemporaryDirectory() as folder:
        words = [
            sys.executable, "-m", "perdure", "live", camera.url, "-o", f"{folder}/runs", "--scenarios", "usual",
            "--for", f"{total:g}", "--roll", f"{max(60.0, total / 4):g}", "--health", "0",
        ]  # fmt: skip
        run = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        assert run.stderr is not None
        url = next((found[0] for line in run.stderr if (found := re.findall(r"http://127\S+/", line))), "")
        begun, told = time.monotonic(), []
        while run.poll() is None:
            time.sleep(1.0)
            if cuts and time.monotonic() - begun >= cuts[0]:
                cuts.pop(0)
                camera.stop()
                time.sleep(away)
                camera.start(port)
            try:
                with urllib.request.urlopen(f"{url}health.json", timeout=5) as answer:
                    told.append(json.load(answer))
            except (urllib.error.URLError, OSError, ValueError):
                continue
        camera.stop()
        folders = len(list(Path(f"{folder}/runs").iterdir()))
        if run.returncode or not told:
            raise SystemExit(f"live.py: the run ended with {run.returncode}: {run.stderr.read()}")
    late = [one for one in told[len(told) // 5 :] if one["latency_ms"] is not None]
    hours = np.array([one["seconds"] for one in late]) / 3600
    last = told[-1]
    return Told(
        minutes,
        last["frames"],
        last["received"],
        last["dropped"],
        last["connections"],
        last["seconds_away"],
        folders,
        float(np.median([one["latency_ms"] for one in late])),
        float(np.median([one["latency_worst_ms"] for one in late])),
        _slope(hours, [one["latency_ms"] for one in late]),
        last["memory_mb"],
        _slope(hours, [one["memory_mb"] for one in late]),
    ), [{name: one[name] for name in ("seconds", "latency_ms", "memory_mb", "dropped")} for one in told[::60]]


def _slope(hours: np.ndarray, values: list[float]) -> float:
    return float(np.polyfit(hours, values, 1)[0]) if len(hours) > 2 else float("nan")


def table(told: Told) -> Table:
    """Every figure in a row."""
    rows = [
        ["minutes", f"{told.minutes:g}"],
        ["frames worked off, of those that came", f"{told.frames} of {told.received} ({told.dropped} dropped)"],
        ["connections, seconds without one", f"{told.connections}, {told.seconds_away:.0f}"],
        ["run folders", str(told.folders)],
        [
            "latency, median; worst of ten seconds, median",
            f"{told.latency_ms:.0f} ms; {told.latency_worst_ms:.0f} ms",
        ],
        ["latency grows by", f"{told.latency_slope:+.1f} ms an hour"],
        ["memory at the end", f"{told.memory_mb:.0f} MB"],
        ["memory grows by", f"{told.memory_slope:+.1f} MB an hour"],
    ]
    return Table("Endless input", ["figure", "value"], rows)


def page(told: Told) -> str:
    """What goes into the page."""
    command = " ".join(["python bench/live.py", *sys.argv[1:]])
    return f"`{command}`\n\n{markdown(table(told))}"


if __name__ == "__main__":
    main()

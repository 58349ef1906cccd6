"""Runs that are killed: `killed.py VIDEO FOLDER KILLS` prints, as JSON, after which frame each was gone on with.

Each run is a process that this one forks when everything is loaded, so that a run lasts no longer than its tracking.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import sys
import time
from pathlib import Path

from perdure.cli import main
from perdure.cli.commands import run as _loaded  # noqa: F401 - whatever a run needs

OPTIONS = ["--no-video", "--checkpoint-every", "0", "--tracker", "overlap", "--resume"]


def started(video: str, folder: Path) -> int:
    child = os.fork()
    if child:
        return child
    sys.argv = ["perdure", "track", video, "-o", str(folder), *OPTIONS]
    with (
        open(os.devnull, "w") as nothing,
        contextlib.redirect_stdout(nothing),
        contextlib.redirect_stderr(nothing),
    ):
        try:
            main()
        except SystemExit as ended:
            os._exit(int(ended.code or 0))
    os._exit(1)


def code(child: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def lasting(video: str, folder: Path) -> float:
    begun = time.monotonic()
    assert code(started(video, folder)) == 0
    return time.monotonic() - begun


def killed(video: str, folder: Path, after: float) -> int:
    """Kill a run after some seconds and go on with it; return how it was ended."""
    child = started(video, folder)
    time.sleep(after)
    os.kill(child, signal.SIGKILL)
    ended = code(child)
    assert code(started(video, folder)) == 0
    return ended


if __name__ == "__main__":
    video, place, kills = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
    lasting(video, place / "first")  # which finds everything in the disk's cache
    length, rng, told = lasting(video, place / "peace"), random.Random(7), []
    for number in range(kills):
        folder = place / str(number)
        ended = killed(video, folder, length * (number + rng.random()) / kills)
        about = json.loads((folder / "run.json").read_text())
        told.append({"killed": ended == -signal.SIGKILL, "resumed": about.get("resumed", [])})
    print(json.dumps(told))

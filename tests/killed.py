"""Runs that are killed: `killed.py VIDEO FOLDER KILLS` prints, as JSON, with which frames each was gone on with.

Each run is a process that this one forks when everything is loaded, so that a run lasts no longer than its tracking;
OpenCV's threads do not outlive a fork, so that it has none.
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

import cv2

from perdure.cli import main, resuming

OPTIONS = ["--no-video", "--checkpoint-every", "0", "--tracker", "overlap", "--resume"]


def started(video: str, folder: Path) -> int:
    child = os.fork()
    if not child:
        os._exit(tracked(video, folder))
    return child


def tracked(video: str, folder: Path) -> int:
    """Track in this process; its exit code."""
    sys.argv = ["perdure", "track", video, "-o", str(folder), *OPTIONS]
    with (
        open(os.devnull, "w") as nothing,
        contextlib.redirect_stdout(nothing),
        contextlib.redirect_stderr(nothing),
    ):
        try:
            main()
        except SystemExit as ended:
            return int(ended.code or 0)
    return 1


def code(child: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def size(log: Path) -> int:
    return log.stat().st_size if log.exists() else -1


def killed(video: str, folder: Path, at: int) -> int:
    """Kill a run when its log has so many bytes, and go on with it; return how it was ended."""
    child = started(video, folder)
    while size(folder / "tracks.jsonl") < at:
        time.sleep(0.001)
    os.kill(child, signal.SIGKILL)
    ended = code(child)
    assert code(started(video, folder)) == 0
    return ended


if __name__ == "__main__":
    video, place, kills = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
    cv2.setNumThreads(1)
    resuming.SHARE = 0.3  # a checkpoint behind every few frames
    assert tracked(video, place / "first") == 0  # which loads everything
    assert code(started(video, place / "peace")) == 0
    whole, rng, told = size(place / "peace/tracks.jsonl"), random.Random(7), []
    for number in range(kills):
        folder = place / str(number)
        ended = killed(video, folder, int(whole * (number + rng.random()) / kills))
        about = json.loads((folder / "run.json").read_text())
        told.append({"killed": ended == -signal.SIGKILL, "resumed": about.get("resumed", [])})
    print(json.dumps(told))

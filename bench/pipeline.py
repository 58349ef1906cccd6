"""Where the time of `perdure track` goes, and how it compares with a bare loop of OpenCV's MOG2.

    python bench/pipeline.py VIDEO [--json] [--repeat 3]

Three parts, in one run on one machine:
  stages   milliseconds a frame of each stage, run one after the other on frames held in memory
  whole    `perdure track VIDEO --no-video` as a process of its own, start-up and first look included
  loop     a process that decodes with cv2.VideoCapture and applies cv2.createBackgroundSubtractorMOG2
The last two are timed in turn, `--repeat` times each after one warm-up; `ratio` is the median rate of
whole / loop: above 1, tracking everything is faster than the bare subtraction.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

LOOP = """
import sys, cv2
capture, model = cv2.VideoCapture(sys.argv[1]), cv2.createBackgroundSubtractorMOG2()
frames = 0
while True:
    read, image = capture.read()
    if not read:
        break
    model.apply(image)
    frames += 1
print(frames)
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("video")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--stage-frames", type=int, default=300, help="frames for the table of stages")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    stages = time_stages(arguments.video, arguments.stage_frames)
    whole, loop, frames = time_processes(arguments.video, arguments.repeat)
    result = {
        "video": Path(arguments.video).name,
        "frames": frames,
        "stages_ms": {name: round(value, 3) for name, value in stages.items()},
        "whole_ms": round(1e3 * statistics.median(whole) / frames, 3),
        "loop_ms": round(1e3 * statistics.median(loop) / frames, 3),
        "ratio": round(statistics.median(loop) / statistics.median(whole), 3),
    }
    print(f"{result['video']}, {frames} frames\n\nstage          ms a frame")
    for name, value in stages.items():
        print(f"{name:<14} {value:8.2f}")
    print(f"\nperdure track --no-video  {result['whole_ms']:6.2f} ms a frame, the whole process")
    print(f"decode + MOG2, bare loop  {result['loop_ms']:6.2f} ms a frame")
    print(f"ratio of rates            {result['ratio']:6.2f}")
    if arguments.json:
        print(json.dumps(result))


def time_stages(video: str, limit: int) -> dict[str, float]:
    """Milliseconds a frame of every stage, each run alone over the first `limit` frames."""
    import numpy as np

    from perdure.detect.background import Background
    from perdure.detect.components import regions_of
    from perdure.draw import Trails, paint
    from perdure.files.film import Film
    from perdure.files.log import RunLog
    from perdure.files.video import open_source
    from perdure.trackers import TRACKERS

    source = open_source(video, end=f"{limit}f")
    timer = Timer()
    frames = timer.add("decode", lambda: list(source))
    scene = source.scene(None)
    detector = timer.add("first look", lambda: Background().prepare(source.sample(25)))
    state = detector.start(scene)
    detector.step(detector.start(scene), frames[0])  # compiles

    masks, regions, reports = [], [], []
    for frame in frames:
        state, foreground = timer.add("background", lambda s=state, f=frame: detector.foreground(s, f))
        masks.append(foreground)
    for foreground in masks:
        stage = detector.stage(scene.height, foreground.size)
        regions.append(timer.add("components", lambda f=foreground, s=stage: regions_of(f, s)))
    for name in ("overlap", "compound"):  # the log, the paint and the film are the last one's
        tracker, reports = TRACKERS[name](), []
        tracked = tracker.start(scene)
        for frame, seen in zip(frames, regions, strict=True):
            tracked, report = timer.add(
                f"tracker {name}", lambda t=tracker, s=tracked, f=frame, r=seen: t.step(s, f, r)
            )
            reports.append(report)
    with tempfile.TemporaryDirectory() as folder:
        with RunLog(Path(folder) / "log") as log:
            for frame, report in zip(frames, reports, strict=True):
                timer.add("log", lambda f=frame, r=report: log.append(f.index, f.time, r))
        trails, painted = Trails.empty(), []
        for frame, report in zip(frames, reports, strict=True):
            trails = trails.extended(report.rows, frame.time)
            painted.append(timer.add("paint", lambda f=frame, r=report, t=trails: paint(f, r.rows, t, scene)))
        begun = time.perf_counter()
        with Film(Path(folder) / "film.mp4", scene.width, scene.height, fps=scene.fps) as film:
            for frame, image in zip(frames, painted, strict=True):
                film.write(np.asarray(image), frame.time)
        timer.spent["film"] = time.perf_counter() - begun
    return {name: 1e3 * seconds / len(frames) for name, seconds in timer.spent.items()}


class Timer:
    """Seconds spent by name."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}

    def add(self, name: str, work: Callable):
        begun = time.perf_counter()
        result = work()
        self.spent[name] = self.spent.get(name, 0.0) + time.perf_counter() - begun
        return result


def time_processes(video: str, repeat: int) -> tuple[list[float], list[float], int]:
    """Seconds of the whole command and of the bare loop, in turn; and the number of frames."""
    whole, loop, frames = [], [], 0
    with tempfile.TemporaryDirectory() as folder:
        track = [sys.executable, "-c", "from perdure.cli import main; main()", "track", video, "--no-video"]
        for turn in range(repeat + 1):
            out = str(Path(folder) / str(turn))
            seconds, printed = timed([*track, "-o", out, "--json"])
            frames = json.loads(printed.splitlines()[-1])["frames"]
            bare, counted = timed([sys.executable, "-c", LOOP, video])
            if int(counted) != frames:
                print(f"note: the bare loop read {int(counted)} frames, perdure {frames}", file=sys.stderr)
            if turn:  # the first is the warm-up
                whole.append(seconds)
                loop.append(bare)
    return whole, loop, frames


def timed(command: list[str]) -> tuple[float, str]:
    begun = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return time.perf_counter() - begun, done.stdout


if __name__ == "__main__":
    main()

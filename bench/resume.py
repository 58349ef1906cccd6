"""Runs that are killed and gone on with, against one that is not: are the results the same bytes, and what do checkpoints cost?

    python bench/resume.py [VIDEO] [--kills 50] [--tracker NAME] [--every SECONDS] [--seed N] [--json] [-- OPTION ...]

Without VIDEO the demo's film is drawn. It is tracked once in peace; then, for each kill, a run of its own is ended by
SIGKILL at a moment drawn evenly from the time that takes, and gone on with by `--resume` until it is done; with
`--again N` it is killed up to N times. `equal` counts the runs whose `tracks.jsonl`, `tracks.txt` and `events.csv` have
the bytes of the first. `share` is the time of the checkpoints of the run in peace, by its own clock, over its time.
What stands behind `--` goes to `perdure track`.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from perdure.demo import demo_world
from perdure.files.film import Film

RESULTS = ("tracks.jsonl", "tracks.txt", "events.csv")
PERDURE = [sys.executable, "-c", "from perdure.cli import main; main()"]


@dataclass(frozen=True)
class Peaceful:
    """A run that nobody kills."""

    seconds: float  # of the whole process
    frames: int
    tracking: float  # s
    checkpoints: int
    taken: float  # s, by checkpoints
    results: tuple[bytes, ...]


@dataclass(frozen=True)
class Killed:
    """A run that was killed and gone on with."""

    at: float  # s after its start
    frames: int  # in its log when it was killed
    resumed: tuple[int, ...]  # frames with which it was gone on
    kills: int
    equal: bool


def main() -> None:
    own, options = divided(sys.argv[1:])
    arguments = _parser().parse_args(own)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        video = arguments.video or draw(place / "film.mp4")
        words = track_words(video, arguments.tracker, arguments.every, options)
        peaceful = in_peace(words, place / "peace")
        print(f"{peaceful.frames} frames in peace: {peaceful.seconds:.1f} s", flush=True)
        rng, done = random.Random(arguments.seed), []
        for number in range(arguments.kills):
            moments = [rng.uniform(0.0, peaceful.seconds) for _ in range(arguments.again)]
            done.append(killed(words, place / "killed", moments, peaceful.results))
            print(_row(number + 1, done[-1]), flush=True)
    print(table(peaceful, done))
    if arguments.json:
        print(json.dumps(summary(peaceful, done)))
    sys.exit(0 if all(one.equal for one in done) else 1)


def divided(words: list[str]) -> tuple[list[str], list[str]]:
    """The words of this command, and those behind `--`."""
    place = words.index("--") if "--" in words else len(words)
    return words[:place], words[place + 1 :]


def draw(path: Path) -> Path:
    """Draw the demo's film."""
    world = demo_world()
    with Film(path, world.width, world.height, fps=world.fps) as film:
        for frame in world.frames():
            if frame.image is not None:
                film.write(frame.image, frame.time)
    return path


def track_words(video: Path, tracker: str, every: float, options: Sequence[str]) -> list[str]:
    """The command that tracks a video, but for the run folder."""
    words = ["track", str(video), "--tracker", tracker, "--no-video", "--checkpoint-every", str(every)]
    return [*PERDURE, *words, "--json", "--resume", *options]


def in_peace(words: Sequence[str], run: Path) -> Peaceful:
    """Track without a kill."""
    begun = time.monotonic()
    done = subprocess.run([*words, "-o", str(run)], capture_output=True, text=True, check=False)
    seconds = time.monotonic() - begun
    if done.returncode:
        sys.exit(f"perdure track ended with status {done.returncode}: {done.stderr.strip()}")
    told = json.loads(done.stdout.splitlines()[-1])
    taken = json.loads((run / "run.json").read_text()).get("checkpoints", {"count": 0, "seconds": 0.0})
    return Peaceful(seconds, told["frames"], told["seconds"], taken["count"], taken["seconds"], results(run))


def killed(words: Sequence[str], run: Path, moments: Sequence[float], wanted: tuple[bytes, ...]) -> Killed:
    """Track, kill at each of the moments that comes before the end, and go on until it is done."""
    shutil.rmtree(run, ignore_errors=True)
    kills, frames = 0, 0
    for moment in moments:
        process = subprocess.Popen([*words, "-o", str(run)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            process.wait(moment)
            break
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            kills += 1
            frames = frames or logged(run)
    done = subprocess.run([*words, "-o", str(run)], capture_output=True, text=True, check=False)
    resumed = json.loads((run / "run.json").read_text()).get("resumed", []) if done.returncode == 0 else []
    leftover = (run / "checkpoint.zip").exists()
    equal = done.returncode == 0 and not leftover and results(run) == wanted
    return Killed(moments[0], frames, tuple(resumed), kills, equal)


def results(run: Path) -> tuple[bytes, ...]:
    """The bytes of what a run found."""
    return tuple((run / name).read_bytes() for name in RESULTS)


def logged(run: Path) -> int:
    """How many frames a log that may be cut holds."""
    log = run / "tracks.jsonl"
    return max(0, log.read_bytes().count(b"\n") - 1) if log.exists() else 0


def summary(peaceful: Peaceful, done: Sequence[Killed]) -> dict[str, float | int]:
    """The figures."""
    return {
        "frames": peaceful.frames,
        "seconds": round(peaceful.seconds, 2),
        "tracking_seconds": round(peaceful.tracking, 2),
        "checkpoints": peaceful.checkpoints,
        "checkpoint_seconds": round(peaceful.taken, 4),
        "share": round(peaceful.taken / peaceful.tracking, 5) if peaceful.tracking else 0.0,
        "runs": len(done),
        "kills": sum(one.kills for one in done),
        "gone_on_behind_a_checkpoint": sum(any(one.resumed) for one in done),
        "equal": sum(one.equal for one in done),
    }


def table(peaceful: Peaceful, done: Sequence[Killed]) -> str:
    """The figures as lines."""
    return "\n".join(f"{name.replace('_', ' '):<28} {value}" for name, value in summary(peaceful, done).items())


def _row(number: int, one: Killed) -> str:
    went_on = ", ".join(map(str, one.resumed)) or "-"
    verdict = "equal" if one.equal else "DIFFERENT"
    return f"{number:>4}  killed at {one.at:6.2f} s, {one.frames:>6} frames logged; on from {went_on}: {verdict}"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("video", type=Path, nargs="?")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--again", type=int, default=1)
    parser.add_argument("--tracker", default="compound")
    parser.add_argument("--every", type=float, default=0.0, help="--checkpoint-every of the runs; 0: all they may")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    return parser


if __name__ == "__main__":
    main()

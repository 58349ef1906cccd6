"""Our scores beside TrackEval's, on every shared sequence, and the time of both.

    python bench/parity.py [--environment DIR] [--record] [--size 2000x30] [--repeat 3] [--json]

Every truth under the data folder is disturbed in a fixed way (boxes or silhouettes moved, rows lost, invented and
doubled, identities exchanged) and the result scored twice: by `perdure.metrics.score`, and by TrackEval with its own
readers and its own preparation of the benchmark, as a process of the peers' environment (see bench/peers.py).
`--record` writes TrackEval's figures to tests/metrics/trackeval.json, which a test holds ours against.
Then 2000 frames x 30 drawn objects: seconds of each, reading included, imports not, in turn in one run.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import tempfile
import time
import warnings
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from perdure.files.mot import read_said, read_truth
from perdure.files.mots import read_masks
from perdure.metrics import Score, score

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("PERDURE_DATA", ROOT.parent / "shared" / "data"))
ENVIRONMENT = Path(os.environ.get("PERDURE_PEERS", ROOT / "bench/peers/.venv"))  # that of the peers
RECORDED = ROOT / "tests/metrics/trackeval.json"
SAME = 1e-6  # figures that differ by no more are equal
NAMES_OF_MASKS = {"MOTSA": "MOTA", "MOTSP": "MOTP", "sMOTSA": "sMOTA"}


@dataclass(frozen=True)
class Group:
    """Sequences that one benchmark's rules hold for."""

    name: str
    kind: str  # boxes or masks
    benchmark: str
    truths: tuple[Path, ...]


def groups(data: Path) -> list[Group]:
    """Every shared truth that TrackEval can read."""
    composites = sorted((data / "composites").glob("*/gt/gt.txt"))
    flies = sorted((data / "flies").glob("*.gt.txt"))
    mot15 = (data / "pets09-s2l1/gt/gt.txt", data / "tud-campus-text/gt/gt.txt", *flies)
    mot17 = (*sorted((data / "mot17-text").glob("*/gt/gt.txt")), *composites)
    masks = tuple(path.with_name("visible.txt") for path in composites)
    found = [
        Group("mot15", "boxes", "MOT15", mot15),
        Group("mot17", "boxes", "MOT17", mot17),
        Group("mots", "masks", "MOTS", masks),
    ]
    return [one for one in found if all(path.is_file() for path in one.truths) and one.truths]


def name_of(truth: Path) -> str:
    """The sequence that a truth is of."""
    return truth.parents[1].name if truth.parent.name == "gt" else truth.name.removesuffix(".gt.txt")


def prepared(truth: Path, kind: str) -> str:
    """The text of a truth; to one of silhouettes an area to be ignored is added, the left quarter of each frame."""
    rows = [line.split() for line in truth.read_text().splitlines() if line.strip()]
    if kind == "boxes":
        return truth.read_text()
    found = []
    for frame in sorted({int(row[0]) for row in rows}):
        here = [row for row in rows if int(row[0]) == frame]
        free = np.ones((int(here[0][3]), int(here[0][4])), np.uint8)
        free[:, free.shape[1] // 4 :] = 0
        for row in here:
            free[_decode(row) > 0] = 0
            found.append([*row[:2], "2", *row[3:]])
        found.append([str(frame), "10000", "10", *here[0][3:5], _encode(free)])
    return "".join(" ".join(row) + "\n" for row in found)


def disturbed(truth: str, kind: str, seed: int = 0) -> str:
    """The text of a result with every fault a tracker can have, the same in every process and NumPy."""
    chance = np.random.RandomState(seed)  # its stream never changes, unlike those of the newer ones
    lines = [line.split("," if kind == "boxes" else " ") for line in truth.splitlines() if line.strip()]
    lines = [words for words in lines if kind == "boxes" or words[2] != "10"]
    exchanged = _exchanges(lines, chance)
    rows: list[str] = []
    taken: dict[int, np.ndarray] = {}  # silhouettes of a frame may share no pixel
    for words in lines:
        frame, identity = int(words[0]), exchanged(int(words[0]), int(words[1]))
        if chance.random_sample() < 0.12:
            continue
        if kind == "boxes":
            rows += _boxes(frame, identity, words, chance)
        else:
            rows += _masks(frame, identity, words, taken, stray=chance.random_sample() < 0.3)
    return "".join(f"{row}\n" for row in rows)


def _exchanges(lines: list[list[str]], chance: np.random.RandomState) -> Callable[[int, int], int]:
    """A renaming in time: now and then two identities are exchanged for good."""
    ids = sorted({int(words[1]) for words in lines})
    last = max(int(words[0]) for words in lines)
    moments = sorted((int(chance.randint(1, last + 1)), *(int(one) for one in chance.choice(ids, 2))) for _ in ids)
    names = [{identity: identity for identity in ids}]
    for _, one, other in moments:
        swapped = {one: other, other: one}
        names.append({identity: swapped.get(name, name) for identity, name in names[-1].items()})
    begins = [moment for moment, _, _ in moments]
    return lambda frame, identity: names[bisect_right(begins, frame)][identity]


def _boxes(frame: int, identity: int, words: list[str], chance: np.random.RandomState) -> list[str]:
    """A row moved and stretched, and in one of ten cases another beside it that is nobody's."""
    left, top, width, height = (float(word) for word in words[2:6])
    wide, tall = np.exp(0.12 * chance.standard_normal(2)) * (width, height)
    x, y = (left, top) + 0.08 * chance.standard_normal(2) * (width, height)
    found = [f"{frame},{identity},{x:.2f},{y:.2f},{wide:.2f},{tall:.2f},1,-1,-1,-1"]
    if chance.random_sample() < 0.1:
        found.append(f"{frame},{identity + 5000},{x + wide:.2f},{y:.2f},{wide:.2f},{tall:.2f},1,-1,-1,-1")
    return found


def _masks(frame: int, identity: int, words: list[str], taken: dict[int, np.ndarray], *, stray: bool) -> list[str]:
    """The silhouette, moved by a few pixels that depend on frame and identity; a stray one far to the left, too."""
    picture = _decode(words)
    busy = taken.setdefault(frame, np.zeros_like(picture))
    found = []
    for name, right in (
        (identity, (3 * frame + identity) % 13 - 6),
        *(((identity + 500, -150),) if stray else ()),
    ):
        moved = np.roll(picture, ((frame + identity) % 9 - 4, right), axis=(0, 1)) & (1 - busy)
        if moved.any():
            busy |= moved
            found.append(f"{frame} {name} 2 {words[3]} {words[4]} {_encode(moved)}")
    return found


def _decode(words: list[str]) -> np.ndarray:
    from pycocotools import mask as rle

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of NumPy 2, inside pycocotools
        return rle.decode({"size": [int(words[3]), int(words[4])], "counts": words[5].encode()})


def _encode(picture: np.ndarray) -> str:
    from pycocotools import mask as rle

    return rle.encode(np.asfortranarray(picture))["counts"].decode()


@dataclass(frozen=True)
class Job:
    """Truths and results of one group as files of a folder, the way TrackEval wants them."""

    group: Group
    folder: Path

    def truth(self, name: str) -> Path:
        return self.folder / f"truth/{name}.txt"

    def said(self, name: str) -> Path:
        return self.folder / f"said/tracker/data/{name}.txt"

    @staticmethod
    def write(group: Group, folder: Path) -> Job:
        """Prepare the truths and disturb them."""
        job = Job(group, folder)
        for path in group.truths:
            text = prepared(path, group.kind)
            job.put(name_of(path), text, disturbed(text, group.kind))
        return job

    def put(self, name: str, truth: str, said: str) -> None:
        for path, text in ((self.truth(name), truth), (self.said(name), said)):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    @property
    def names(self) -> list[str]:
        return sorted(path.stem for path in (self.folder / "truth").iterdir())


def ours(job: Job) -> dict[str, dict[str, float]]:
    """Our figures by sequence, and of all together, under TrackEval's names."""
    parts = {}
    for name in job.names:
        if job.group.kind == "boxes":
            parts[name] = score(
                read_said(job.said(name)), read_truth(job.truth(name), job.group.benchmark.lower())
            )
        else:
            parts[name] = score(read_masks(job.said(name)), read_masks(job.truth(name)), masks=True)
    named = {name: one.figures for name, one in parts.items()}
    if len(parts) > 1:
        named["COMBINED_SEQ"] = Score.together(list(parts.values())).figures
    return {
        name: {NAMES_OF_MASKS.get(key, key): value for key, value in one.items()} for name, one in named.items()
    }


def trackeval(job: Job, python: Path) -> tuple[dict, float]:
    """TrackEval's figures by sequence, and of all together; and the seconds they took."""
    separator = "," if job.group.kind == "boxes" else " "
    lengths = {
        name: max(int(line.split(separator)[0]) for line in job.truth(name).read_text().splitlines())
        for name in job.names
    }
    order = job.folder / "job.json"
    order.write_text(
        json.dumps(
            {
                "kind": job.group.kind,
                "benchmark": job.group.benchmark,
                "folder": str(job.folder),
                "sequences": lengths,
            }
        )
    )
    oracle = ROOT / "bench/peers/oracle.py"
    done = subprocess.run([python, oracle, order], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"TrackEval failed: {done.stderr.strip().splitlines()[-1]}")
    answer = json.loads(done.stdout)
    return answer["figures"], answer["seconds"]


def drawn(frames: int, objects: int) -> tuple[str, str]:
    """A truth and a result of so many objects walking through each other, as MOT text."""
    chance = np.random.RandomState(1)
    start, speed = chance.uniform(0, 1500, (objects, 2)), chance.uniform(-6, 6, (objects, 2))
    true, said = [], []
    for frame in range(1, frames + 1):
        corners = np.abs((start + frame * speed) % 3000 - 1500)
        for identity, (x, y) in enumerate(corners, 1):
            true.append(f"{frame},{identity},{x:.2f},{y:.2f},40,90,1,1,1\n")
            if chance.random_sample() < 0.9:
                a, b = np.add((x, y), chance.normal(0, 4, 2))
                said.append(f"{frame},{identity + 100 * (frame // 500)},{a:.2f},{b:.2f},42,88,1,-1,-1,-1\n")
    return "".join(true), "".join(said)


def compare_times(python: Path, size: tuple[int, int], repeat: int) -> tuple[float, float]:
    """Median seconds of ours and of TrackEval, in turn, on the same two files."""
    spent: tuple[list[float], list[float]] = ([], [])
    with tempfile.TemporaryDirectory() as place:
        job = Job(Group("drawn", "boxes", "MOT17", ()), Path(place))
        job.put("drawn", *drawn(*size))
        for turn in range(repeat + 1):
            begun = time.perf_counter()
            ours(job)
            here = time.perf_counter() - begun
            _, there = trackeval(job, python)
            if turn:  # the first is the warm-up
                spent[0].append(here)
                spent[1].append(there)
    return statistics.median(spent[0]), statistics.median(spent[1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--environment", type=Path, default=ENVIRONMENT, help="of the peers")
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--size", default="2000x30", help="frames x objects of the timed sequence")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    python = arguments.environment / "bin/python"
    if not python.exists():
        raise SystemExit(f"no {python}: `python bench/peers.py` makes the environment, or name one: --environment")
    worst, recorded = compare_figures(python)
    if arguments.record:
        RECORDED.write_text(json.dumps(recorded, indent=1) + "\n")
    frames, objects = map(int, arguments.size.split("x"))
    here, there = compare_times(python, (frames, objects), arguments.repeat)
    print(
        f"\n{frames} frames x {objects} objects: ours {here:.2f} s, TrackEval {there:.2f} s, ratio {here / there:.2f}"
    )
    if arguments.json:
        print(json.dumps({"worst": worst, "ours_s": here, "trackeval_s": there, "ratio": here / there}))
    if worst > SAME:
        raise SystemExit(f"a figure differs from TrackEval's by {worst:.1e}, more than {SAME:.0e}")


def compare_figures(python: Path) -> tuple[float, dict]:
    """The greatest difference in any figure; and TrackEval's figures by group and sequence."""
    worst, recorded = 0.0, {}
    print(f"{'sequence':<28} {'HOTA':>9} {'MOTA':>9} {'IDF1':>9}   greatest difference of any figure")
    for group in groups(DATA):
        with tempfile.TemporaryDirectory() as place:
            job = Job.write(group, Path(place))
            here = ours(job)
            there, _ = trackeval(job, python)
        recorded[group.name] = there
        for name, figures in there.items():
            furthest = max(figures, key=lambda key: abs(figures[key] - here[name].get(key, figures[key])))
            apart = abs(figures[furthest] - here[name].get(furthest, figures[furthest]))
            worst = max(worst, apart)
            print(
                f"{group.name + ' ' + name:<28} {figures['HOTA']:9.5f} {figures['MOTA']:9.5f} {figures['IDF1']:9.5f}"
                f"   {apart:.1e} {furthest if apart else ''}"
            )
    return worst, recorded


if __name__ == "__main__":
    main()

"""Films tracked in chunks whose tracks are stitched, held against the unbroken run and against the truth.

    python bench/chunks.py [--data DIR] [--clips NAME ...] [--trackers NAME ...] [--lengths T ...] [--overlap T]
                           [--workers N] [--keep DIR] [--json] [--write]

Each clip is tracked by each tracker in one go (`perdure run --workers 1`) and in chunks (`--chunks T --workers N`).
*alive* counts, over all borders, the identities of the unbroken run that have rows in the ten seconds before a border and
behind it. One is *joined* if the chunked run has one and the same identity in its places on both sides: by the
majority of the second's worth of rows nearest to the border in which the chunked run has anybody there, at an intersection
over union of .5; who it has nowhere on one side is not joined. *wrong*
counts the identities of the chunked run that are one of the unbroken run's before and another behind. *kept* is the
share of true objects with rows on both sides that keep one identity, of the unbroken run and of the chunked one.
*wall* is how many times as long the chunked run took by the clock, with all its starting and stitching; *work* how many
times as much processor time, which other programs on the machine change little; of runs that --keep holds from an
earlier call neither is told. --write puts the table into docs/many.md.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pages import Marks, absent
from regions import Table, chosen, markdown, plain

from perdure.comparison import Wanted, compare_files
from perdure.errors import PerdureError
from perdure.features.boxes import overlaps
from perdure.files.runs import RunFolder
from perdure.files.scored import Match, read_scored_truth
from perdure.files.whole import whole_file
from perdure.maths.assign import assign
from perdure.types import Rows, Tracks, Use

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "many.md"
MARKS = Marks.of("bench/chunks.py", PAGE)
SIDE, NEAREST, SAME = 10.0, 1.0, 0.5  # s that are looked at beside a border; s of rows that decide; least overlap


class Clip(NamedTuple):
    source: str
    truth: str | None
    detections: str | None
    lengths: tuple[str, ...]


CLIPS = {
    "pets09-s2l1": Clip("pets09-s2l1/video.avi", "pets09-s2l1/gt/gt.txt", None, ("20",)),
    "crowd8": Clip("composites/crowd8/video.mp4", "composites/crowd8/gt/gt.txt", None, ("4",)),
    **{
        name: Clip(f"mot17-text/{name}", f"mot17-text/{name}/gt/gt.txt", f"mot17-text/{name}/det/det_FRCNN.txt", (length,))
        for name, length in (("MOT17-02", "4"), ("MOT17-10", "8"))
    },
}  # fmt: skip
TRACKERS = ("compound", "multifeature")
HEAD = [
    "clip", "tracker", "chunks", "borders", "alive", "joined %", "wrong", "kept %", "IDF1", "HOTA", "wall", "work",
]  # fmt: skip


@dataclass(frozen=True)
class Judged:
    """How identities came over borders; sums of several are what they are together."""

    alive: int = 0
    joined: int = 0
    wrong: int = 0
    misses: tuple[tuple[int, int], ...] = ()  # (border, identity of the reference)

    def __add__(self, other: Judged) -> Judged:
        return Judged(
            self.alive + other.alive,
            self.joined + other.joined,
            self.wrong + other.wrong,
            self.misses + other.misses,
        )

    @property
    def share(self) -> float:
        """Joined ones in percent; NaN where nobody is alive."""
        return 100 * self.joined / self.alive if self.alive else float("nan")


class Ran(NamedTuple):
    """One call of `perdure run`."""

    folder: Path
    wall: float | None  # s; None where it was there before
    work: float | None  # s of processor time


def judged(reference: Rows, run: Rows, borders: Sequence[int], fps: float) -> Judged:
    """Return how identities of a reference come over borders (the first frames behind them) in a run."""
    pairs = _paired(reference, run)
    return sum((_at(reference, pairs, border, fps) for border in borders), Judged())


def _at(reference: Rows, pairs: Mapping[tuple[int, int], int], border: int, fps: float) -> Judged:
    reach, nearest = round(SIDE * fps), max(1, round(NEAREST * fps))
    sides: tuple[dict[int, list[int]], dict[int, list[int]]] = ({}, {})
    for frame, one in zip(reference.frames.tolist(), reference.ids.tolist(), strict=True):
        if border - reach <= frame < border + reach:
            sides[frame >= border].setdefault(one, []).append(frame)
    before, behind = (
        {
            one: _majority(
                [pairs[frame, one] for frame in sorted(some, reverse=not late) if (frame, one) in pairs][:nearest]
            )
            for one, some in side.items()
        }
        for late, side in enumerate(sides)
    )
    alive = sorted(before.keys() & behind.keys())
    joined = [one for one in alive if before[one] and before[one] == behind[one]]
    first = {said: one for one, said in before.items() if said}
    wrong = sum(1 for one, said in behind.items() if first.get(said, one) != one and before.get(one) != said)
    return Judged(len(alive), len(joined), wrong, tuple((border, one) for one in alive if one not in joined))


def _majority(said: Sequence[int]) -> int:
    """The identity that most rows have; 0 where there is none."""
    return Counter(said).most_common(1)[0][0] if said else 0


def _paired(reference: Rows, run: Rows) -> dict[tuple[int, int], int]:
    """The identity of the run in the place of each (frame, identity) of the reference."""
    found = {}
    for frame in np.intersect1d(reference.frames, run.frames).tolist():
        mine, theirs = (np.flatnonzero(rows.frames == frame) for rows in (reference, run))
        overlap = overlaps(reference.boxes[mine].astype(np.float32), run.boxes[theirs].astype(np.float32))
        for row, column in assign(np.where(overlap >= SAME, 1.0 - overlap, np.inf)).pairs.tolist():
            found[frame, int(reference.ids[mine[row]])] = int(run.ids[theirs[column]])
    return found


def rows_of(folder: Path) -> Rows:
    """Return the rows of a run that count."""
    tracks: Tracks = RunFolder.open(folder).tracks().counted()
    return Rows.of(frames=tracks.frames, ids=tracks.ids, boxes=tracks.boxes)


def ran(data: Path, clip: Clip, tracker: str, into: Path, words: Sequence[str]) -> Ran:
    """Call `perdure run` and return where the run is and what it took."""
    command = [
        sys.executable,
        "-m",
        "perdure",
        "run",
        str(data / clip.source),
        "--tracker",
        tracker,
        "-o",
        str(into),
    ]
    command += [
        "--json",
        *words,
        *([] if clip.detections is None else ["--detector", str(data / clip.detections)]),
    ]
    begun, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    wall, after = time.monotonic() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise PerdureError(f"{' '.join(command)} ended with {done.returncode}: {done.stderr.strip()[-300:]}")
    (job,) = json.loads(done.stdout.splitlines()[-1])["jobs"]
    work = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Ran(Path(job["run"]), *((None, None) if job["skipped"] else (wall, work)))


def compared(data: Path, name: str, tracker: str, length: str, unbroken: Ran, chunked: Ran) -> dict[str, Any]:
    """Return all figures of one clip, tracker and length."""
    clip, about = CLIPS[name], RunFolder.open(chunked.folder).read_about()
    borders, fps = [one["frame"] for one in about["chunks"]["borders"]], float(about["fps"])
    whole, parts = rows_of(unbroken.folder), rows_of(chunked.folder)
    told = judged(whole, parts, borders, fps)
    value: dict[str, Any] = {
        "clip": name, "tracker": tracker, "chunks": length, "borders": len(borders),
        "alive": told.alive, "joined": told.joined, "wrong": told.wrong, "misses": told.misses,
        "wall": [unbroken.wall, chunked.wall], "work": [unbroken.work, chunked.work],
    }  # fmt: skip
    if clip.truth is not None:
        true = read_scored_truth(data / clip.truth, masks=False).boxes
        assert true is not None
        true = true.take(true.use == Use.SCORED)
        value["kept"] = [judged(true, rows, borders, fps).share for rows in (whole, parts)]
        for figure in ("IDF1", "HOTA"):
            value[figure] = [_score(one.folder, data / clip.truth, figure) for one in (unbroken, chunked)]
    return value


def _score(run: Path, truth: Path, figure: str) -> float:
    scored = compare_files(Match(run.name, run, truth), Wanted()).boxes
    assert scored is not None
    return 100 * float(scored.figures[figure])


def table_of(values: Sequence[Mapping[str, Any]]) -> Table:
    """Return the figures as a table; pairs are of the unbroken run and of the chunked one."""
    rows = []
    for one in values:
        share = f"{100 * one['joined'] / one['alive']:.1f}" if one["alive"] else "-"
        scores = [_pair(one.get(name)) for name in ("kept", "IDF1", "HOTA")]
        ratios = [_ratio(*one[name]) for name in ("wall", "work")]
        counts = [str(one[name]) for name in ("borders", "alive")]
        rows.append(
            [
                one["clip"],
                one["tracker"],
                f"{one['chunks']} s",
                *counts,
                share,
                str(one["wrong"]),
                *scores,
                *ratios,
            ]
        )
    return Table("Chunks against the unbroken run (unbroken / chunked)", HEAD, rows)


def _ratio(unbroken: float | None, chunked: float | None) -> str:
    return f"{chunked / unbroken:.2f}" if unbroken and chunked else "-"


def _pair(both: Sequence[float] | None) -> str:
    return "-" if both is None else " / ".join(f"{one:.1f}" for one in both)


def measured(given: argparse.Namespace, into: Path) -> list[dict[str, Any]]:
    """Run all that was asked for."""
    values = []
    for name in chosen(given.clips, {one: [one] for one in CLIPS}, "clip"):
        clip = CLIPS[name]
        if absent(given.data / clip.source):
            continue
        for tracker in given.trackers:
            unbroken = ran(given.data, clip, tracker, into, ["--workers", "1"])
            for length in given.lengths or clip.lengths:
                words = ["--chunks", length, "--workers", str(given.workers)]
                words += ["--overlap", given.overlap] if given.overlap else []
                chunked = ran(given.data, clip, tracker, into, words)
                values.append(compared(given.data, name, tracker, length, unbroken, chunked))
                print(" ".join(table_of(values[-1:]).rows[0]), file=sys.stderr)
    return values


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--data", type=Path, default=Path(os.environ.get("PERDURE_DATA", ROOT.parent / "shared" / "data"))
    )
    parser.add_argument("--clips", nargs="+", default=list(CLIPS), metavar="NAME")
    parser.add_argument("--trackers", nargs="+", default=list(TRACKERS), metavar="NAME")
    parser.add_argument("--lengths", nargs="+", metavar="T", help="of chunks, instead of the clip's own")
    parser.add_argument("--overlap", metavar="T")
    parser.add_argument("--workers", type=int, default=2, metavar="N")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="where the runs are kept")
    parser.add_argument("--json", action="store_true", help="all figures as one object, in the last line")
    parser.add_argument("--write", action="store_true", help="the table into docs/many.md")
    given = parser.parse_args()
    try:
        with tempfile.TemporaryDirectory() as place:
            values = measured(given, given.keep or Path(place))
        table = table_of(values)
        print(plain(table))
        if given.write:
            page = MARKS.replaced(PAGE.read_text(encoding="utf-8"), f"\n{markdown(table)}\n")
            with whole_file(PAGE) as file:
                file.write(page)
        if given.json:
            print(json.dumps({"runs": values}))
    except PerdureError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()

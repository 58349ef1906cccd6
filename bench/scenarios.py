"""What beliefs do to tracks: every clip without and with the feedback of scenarios.

    python bench/scenarios.py [--data DIR] [--trackers NAME ...] [--clips NAME ...] [--json] [--write]

Clips run as `perdure track --scenarios usual` runs them, from pixels; *without* is the same with --no-drop-noise
--protect 1. A track is true if half of its rows that could be judged lie on something that moves: IoU of .4 with a true
box, or, where the truth is pixels (cdnet-*), a fifth of the box moving. *Covered* is how much of what truly moves is in a
row: of true boxes, the share with a row on it; of moving pixels, the share in boxes of rows. IDF1 and MOTA where the truth
has identities. The data is read from $PERDURE_DATA or ../shared/data beside the repository. --write puts the tables into
docs/scenarios.md, --json prints everything as one object in the last line.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
from pages import Marks, absent
from regions import Table, chosen, markdown, plain

from perdure import fold
from perdure.errors import PerdureError
from perdure.features.boxes import overlaps
from perdure.files.mot import protocol_of, read_said, read_truth
from perdure.files.mot_table import read_table
from perdure.files.whole import whole_file
from perdure.fold import Corrections, coherent
from perdure.metrics.compared import compare
from perdure.metrics.scoring import score_compared
from perdure.pipeline import plan
from perdure.trackers import TRACKERS
from perdure.types import Event, Rows, Tracks

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "scenarios.md"
MARKS = Marks.of("bench/scenarios.py", PAGE)
MOVING, OUTSIDE, UNKNOWN = 255, 85, 170  # grey levels of CDnet's truth
ON_BOX, ON_PIXELS = 0.4, 0.2
"""Least IoU with a true box, and least share of moving pixels, of a row that is true."""


@dataclass(frozen=True)
class Clip:
    """A film and its truth: boxes by text, or moving pixels by frame."""

    film: str
    truth: str
    first: int = 1  # number of the truth of frame 0, where it is pixels
    window: tuple[str | None, str | None] = (None, None)
    fps: float | None = None


CLIPS = {
    "pets09-s2l1": Clip("pets09-s2l1/video.avi", "pets09-s2l1/gt/gt.txt"),
    "cdnet-fall": Clip("cdnet-fall/input", "cdnet-fall/groundtruth", 1460, fps=25.0),
    "cdnet-highway": Clip("cdnet-highway/video.avi", "cdnet-highway/groundtruth", 1, ("470f", "1270f")),
    "crowd8": Clip("composites/crowd8/video.mp4", "composites/crowd8/gt/gt.txt"),
    "group4": Clip("composites/group4/video.mp4", "composites/group4/gt/gt.txt"),
    "illumination": Clip("composites/illumination/video.mp4", "composites/illumination/gt/gt.txt"),
    "lights": Clip("composites/lights/video.mp4", "composites/lights/gt/gt.txt"),
}
SETTINGS = {"without": {"drop_noise": False, "protect": 1.0}, "with": {}}


@dataclass(frozen=True)
class Told:
    """What one run of a clip gave."""

    clip: str
    tracker: str
    feedback: str
    tracks: int
    true: int
    rows: int
    true_rows: float  # share of those judged
    covered: float
    idf1: float | None
    mota: float | None
    events: dict[str, int]


def main() -> None:
    arguments = _arguments()
    try:
        trackers = chosen(arguments.trackers, {name: [name] for name in TRACKERS}, "tracker")
        names = chosen(arguments.clips, {name: [name] for name in CLIPS}, "clip")
        told = []
        for name in names:
            clip = CLIPS[name]
            if absent(arguments.data / clip.film) or absent(arguments.data / clip.truth):
                continue
            for tracker in trackers:
                for feedback in SETTINGS:
                    told.append(measure(arguments.data, name, tracker, feedback))
        print(plain(table(told)))
        if arguments.write:
            text = MARKS.replaced(PAGE.read_text(encoding="utf-8"), page(told))
            with whole_file(PAGE) as file:
                file.write(text)
        if arguments.json:
            print(json.dumps([asdict(one) for one in told]))
    except PerdureError as error:
        print(f"scenarios.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--data", type=Path, default=root, help="where the clips are")
    parser.add_argument(
        "--trackers", nargs="+", metavar="NAME", default=["compound", "overlap"], help=", ".join(TRACKERS)
    )
    parser.add_argument("--clips", nargs="+", metavar="NAME", default=list(CLIPS), help=", ".join(CLIPS))
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the table in docs/scenarios.md")
    return parser.parse_args()


def measure(data: Path, name: str, tracker: str, feedback: str) -> Told:
    """Track a clip and hold its rows against the truth."""
    clip = CLIPS[name]
    start, end = clip.window
    made = plan(
        str(data / clip.film), tracker=tracker, scenarios="usual", parameters=SETTINGS[feedback],
        start=start, end=end, fps=clip.fps,
    )  # fmt: skip
    try:
        reports = [step.report for step in made.prepared().steps()]
    finally:
        made.source.close()
    tracks = fold.settle(reports)
    counted = tracks.counted()
    truth = data / clip.truth
    judged = by_boxes(counted, truth) if truth.is_file() else by_pixels(counted, _moving(truth, clip.first))
    figures = _figures(counted, truth) if truth.is_file() else None
    return Told(
        name,
        tracker,
        feedback,
        len(np.unique(counted.ids)),
        judged.tracks,
        len(counted),
        judged.rows,
        judged.covered,
        None if figures is None else figures[0],
        None if figures is None else figures[1],
        dict(Counter(one.kind for one in _events(reports, tracks))),
    )


@dataclass(frozen=True)
class Judged:
    """How true a run's rows are."""

    tracks: int
    rows: float
    covered: float


def by_boxes(tracks: Tracks, truth: Path) -> Judged:
    """Judge rows by true boxes."""
    true = read_said(truth)
    hits, covered, count = np.zeros(len(tracks), np.bool_), 0, 0
    for frame in np.unique(np.concatenate([true.frames, tracks.frames])).tolist():
        mine, theirs = tracks.frames == frame, true.frames == frame
        shared = overlaps(tracks.boxes[mine], np.asarray(true.boxes[theirs], np.float32)) > ON_BOX
        hits[mine] = shared.any(axis=1)
        covered, count = covered + int(shared.any(axis=0).sum()), count + int(theirs.sum())
    return _judged(tracks, hits, np.ones(len(tracks), np.bool_), covered / max(count, 1))


def by_pixels(tracks: Tracks, moving: Callable[[int], np.ndarray | None]) -> Judged:
    """Judge rows by true pixels, `moving(frame)`, in frames that have them; where half a box is outside, not at all."""
    hits, judged = np.zeros(len(tracks), np.bool_), np.zeros(len(tracks), np.bool_)
    inside = total = 0
    for frame in np.unique(tracks.frames).tolist():
        truth = moving(frame)
        if truth is None:
            continue
        held = np.zeros(truth.shape, np.bool_)
        for row in np.flatnonzero(tracks.frames == frame).tolist():
            x1, y1, x2, y2 = np.clip(tracks.boxes[row], 0, [truth.shape[1], truth.shape[0]] * 2).astype(int)
            piece = truth[y1:y2, x1:x2]
            held[y1:y2, x1:x2] = True
            known = piece[(piece != OUTSIDE) & (piece != UNKNOWN)]
            judged[row] = known.size > piece.size / 2 > 0
            hits[row] = judged[row] and (known == MOVING).mean() >= ON_PIXELS
        inside, total = inside + int((held & (truth == MOVING)).sum()), total + int((truth == MOVING).sum())
    return _judged(tracks, hits, judged, inside / max(total, 1))


def _judged(tracks: Tracks, hits: np.ndarray, judged: np.ndarray, covered: float) -> Judged:
    true = sum(bool(hits[judged & (tracks.ids == one)].mean() >= 0.5) for one in np.unique(tracks.ids[judged]))
    return Judged(true, float(hits[judged].mean()) if judged.any() else 0.0, covered)


def _moving(folder: Path, first: int) -> Callable[[int], np.ndarray | None]:
    return lambda frame: cv2.imread(str(folder / f"gt{frame + first:06d}.png"), cv2.IMREAD_GRAYSCALE)


def _figures(tracks: Tracks, truth: Path) -> tuple[float, float]:
    """IDF1 and MOTA."""
    true = read_truth(truth, protocol_of(read_table(truth)))
    figures = score_compared(compare(Rows.of_tracks(tracks), true)).figures
    return float(figures["IDF1"]), float(figures["MOTA"])


def _events(reports: list, tracks: Tracks) -> list[Event]:
    corrections = Corrections.of(reports)
    settled = (corrections.event(one, number) for number, report in enumerate(reports) for one in report.events)
    return coherent(settled, set(tracks.ids.tolist()))


COLUMNS = (
    "clip",
    "tracker",
    "feedback",
    "tracks",
    "true",
    "rows",
    "true rows",
    "covered",
    "MOTA",
    "IDF1",
    "noise",
)


def table(told: list[Told]) -> Table:
    """One row a run."""
    rows = [
        [
            one.clip, one.tracker, one.feedback, str(one.tracks), str(one.true), str(one.rows),
            f"{100 * one.true_rows:.1f}", f"{100 * one.covered:.1f}",
            "" if one.mota is None else f"{100 * one.mota:.1f}", "" if one.idf1 is None else f"{100 * one.idf1:.1f}",
            str(one.events.get("noise", 0)),
        ]
        for one in told
    ]  # fmt: skip
    return Table("Tracks without and with feedback", list(COLUMNS), rows)


def page(told: list[Told]) -> str:
    """What goes into the page."""
    return f"`python bench/scenarios.py --write`\n\n{markdown(table(told))}"


if __name__ == "__main__":
    main()

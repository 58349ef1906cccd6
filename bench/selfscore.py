"""Tuning without truth: how well what a run tells of itself ranks settings, compared with the truth.

    python bench/selfscore.py [--data DIR] [--clips NAME ...] [--tracker NAME] [--settings N] [--frames N] [--workers N] [--write]

Of every clip the first --frames frames are taken, and their regions recorded once. The tracker runs over them with its
defaults and with settings drawn at random from where `perdure tune` searches, forwards and backwards
(src/perdure/consistency.py). For each clip, Spearman's rank correlation of each figure with IDF1 of the run forwards
against the truth; and the IDF1 of the setting that agreement and explanation together (`whole`) would choose, beside
that of the defaults, of the middle one and of the best. `better half` leaves out the half of the settings that is worse by the truth, since to
tell a hopeless setting from a sound one is easy. --write puts the table into docs/tuning.md.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pages import Marks, absent
from regions import Table, chosen, markdown, plain
from scipy.stats import spearmanr

from perdure import fold, params
from perdure.cli.trials import true_rows
from perdure.cli.tune import LEFT_OUT
from perdure.cluster import Where, crew
from perdure.consistency import backwards, consistency
from perdure.errors import PerdureError
from perdure.files.regions import read_regions, write_regions
from perdure.files.whole import whole_file
from perdure.metrics.scoring import score
from perdure.pipeline import plan
from perdure.trackers import TRACKERS
from perdure.tuning import Span, span_of

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "tuning.md"
MARKS = Marks.of("bench/selfscore.py", PAGE)
COMPOSITES = (
    "crossing2", "group4", "behind2", "huddle4", "whiteband", "attractive", "turning", "crowd8", "illumination", "lights",
)  # fmt: skip
CLIPS: dict[str, tuple[str, str, str | None]] = {  # name: source, truth, detections
    "pets09-s2l1": ("pets09-s2l1/video.avi", "pets09-s2l1/gt/gt.txt", None),
    **{
        name: (f"composites/{name}/video.mp4", f"composites/{name}/gt/gt.txt", None)
        for name in COMPOSITES
    },
    "2flies": ("flies/sleap_clip_2flies.mp4", "flies/sleap_clip_2flies.gt.txt", None),
    **{
        name: (f"mot17-text/{name}", f"mot17-text/{name}/gt/gt.txt", f"mot17-text/{name}/det/det_FRCNN.txt")
        for name in ("MOT17-02", "MOT17-04", "MOT17-10")
    },
}  # fmt: skip
FIGURES = ("agreement", "explained", "sureness", "whole")


@dataclass(frozen=True)
class Clip:
    """A clip, and where its regions are recorded."""

    name: str
    source: Path
    truth: Path
    detector: Path | None
    regions: Path
    frames: int
    tracker: str


@dataclass(frozen=True)
class Told:
    """What one run tells of itself, and the truth of it."""

    figures: Mapping[str, float]
    idf1: float


def main() -> None:
    arguments = _arguments()
    try:
        names = chosen(arguments.clips, {name: [name] for name in CLIPS}, "clip")
        told = measure(arguments, names)
        print(plain(table(told)))
        if arguments.write:
            text = PAGE.read_text(encoding="utf-8")
            command = " ".join(["python bench/selfscore.py", *sys.argv[1:]])
            with whole_file(PAGE) as file:
                file.write(MARKS.replaced(text, f"`{command}`\n\n{markdown(table(told))}"))
    except PerdureError as error:
        print(f"selfscore.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--data", type=Path, default=root, help="where the clips are")
    parser.add_argument("--clips", nargs="+", metavar="NAME", default=list(CLIPS), help=", ".join(CLIPS))
    parser.add_argument("--tracker", default="compound", choices=list(TRACKERS), help="whose settings")
    parser.add_argument("--settings", type=int, default=12, help="how many, the defaults among them")
    parser.add_argument("--frames", type=int, default=300, help="of each clip, at most")
    parser.add_argument("--workers", type=int, default=None, help="processes")
    parser.add_argument("--seed", type=int, default=0, help="of the settings")
    parser.add_argument("--write", action="store_true", help="replace the table in docs/tuning.md")
    return parser.parse_args()


def measure(arguments: argparse.Namespace, names: Sequence[str]) -> dict[str, list[Told]]:
    """What every setting tells on every clip; the defaults come first."""
    settings = drawn(arguments.tracker, arguments.settings, arguments.seed)
    with tempfile.TemporaryDirectory() as place, crew(Where(), arguments.workers) as workers:
        clips = []
        for name in names:
            source, truth, detections = CLIPS[name]
            if absent(arguments.data / source):
                continue
            detector = None if detections is None else arguments.data / detections
            regions = Path(place) / f"{name}.jsonl"
            clips.append(
                Clip(
                    name,
                    arguments.data / source,
                    arguments.data / truth,
                    detector,
                    regions,
                    arguments.frames,
                    arguments.tracker,
                )
            )
        for ended in workers.work(clips, record):
            _value(ended)
        tasks = [(clip, one) for clip in clips for one in settings]
        told: dict[int, Told] = {}
        for ended in workers.work(tasks, tried):
            told[ended.place] = _value(ended)
            print(f"{len(told)} of {len(tasks)} settings tried", file=sys.stderr)
    count = len(settings)
    return {clip.name: [told[k * count + j] for j in range(count)] for k, clip in enumerate(clips)}


def _value(ended: Any) -> Any:
    if ended.failure:
        raise PerdureError(ended.defect or ended.failure)
    return ended.value


def drawn(tracker: str, count: int, seed: int) -> list[dict[str, Any]]:
    """The defaults, and settings of all parameters at random, each from where `perdure tune` searches it."""
    random = np.random.default_rng(seed)
    found = (span_of(one) for one in params.describe(TRACKERS[tracker]) if one.name not in LEFT_OUT)
    spans = [one for one in found if one is not None]
    return [{}, *({one.name: _draw(random, one) for one in spans} for _ in range(count - 1))]


def _draw(random: np.random.Generator, span: Span) -> Any:
    if span.choices:
        return span.choices[int(random.integers(len(span.choices)))]
    if span.log:
        value = float(np.exp(random.uniform(np.log(span.low), np.log(span.high))))
    else:
        value = float(random.uniform(span.low, span.high))
    return round(value) if isinstance(span.default, int) else value


def record(clip: Clip) -> int:
    """Record the regions of a clip."""
    made = plan(clip.source, detector=clip.detector, end=f"{clip.frames}f")
    try:
        return write_regions(clip.regions, made.prepared().seen())
    finally:
        made.source.close()


def tried(task: tuple[Clip, dict[str, Any]]) -> Told:
    """What a run with a setting tells of itself, and the truth of it."""
    clip, parameters = task
    options = {"tracker": clip.tracker, "detector": str(clip.regions), "parameters": parameters}
    made = plan(clip.source, **options, end=f"{clip.frames}f")
    try:
        count = len(made.source.wanted or ())
        tracks = fold.settle(step.report for step in made.steps())
        back = backwards(made, 0, count)
    finally:
        made.source.close()
    own = consistency(tracks, back, dict(read_regions(clip.regions)))
    truth = true_rows(clip.truth).between(0, count - 1)
    idf1 = score(tracks, truth).identity.f1
    return Told({name: float(getattr(own, name)) for name in FIGURES}, float(idf1))


def table(told: Mapping[str, Sequence[Told]]) -> Table:
    """A row for every clip, and their means."""
    rows = {name: row_of(several) for name, several in told.items()}
    means = np.nanmean(np.array(list(rows.values()), float), axis=0)
    body = [[name, *_cells(row)] for name, row in (*rows.items(), ("mean", means.tolist()))]
    head = [
        "clip",
        *(f"ρ {name}" for name in FIGURES),
        "ρ whole, better half",
        "chosen",
        "defaults",
        "middle",
        "best",
    ]
    return Table("rank correlation with IDF1, and IDF1 in percent", head, body)


def row_of(several: Sequence[Told]) -> list[float]:
    """The figures of one clip: correlations, then IDF1."""
    true = np.array([one.idf1 for one in several])
    half = np.argsort(-true, kind="stable")[: (len(true) + 1) // 2]
    own = {name: np.array([one.figures[name] for one in several]) for name in FIGURES}
    return [
        *(correlation(own[name], true) for name in FIGURES),
        correlation(own["whole"][half], true[half]),
        100 * float(true[int(np.argmax(own["whole"]))]),
        100 * float(true[0]),
        100 * float(np.median(true)),
        100 * float(true.max()),
    ]


def correlation(one: Any, other: Any) -> float:
    """Spearman's, nan where either side is all alike."""
    if np.ptp(one) < 1e-12 or np.ptp(other) < 1e-12:
        return float("nan")
    return float(spearmanr(one, other).statistic)


def _cells(row: Sequence[float]) -> list[str]:
    shown = [f"{one:.2f}" for one in row[:5]] + [f"{one:.1f}" for one in row[5:]]
    return ["-" if text == "nan" else text for text in shown]


if __name__ == "__main__":
    main()

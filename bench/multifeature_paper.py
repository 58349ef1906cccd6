"""What the paper of `multifeature` shows, repeated in form: what learning the weights is good for, and who is beaten.

    python bench/multifeature_paper.py [--parts others halves peers trajectories] [--settings paper defaults]
                                       [--data DIR] [--environment DIR] [--json] [--write]

others        the paper's Table 1: each sequence is followed with equal weights of the eight features, and with those
              learnt from ANOTHER sequence; where there are two sets of detections, also learnt on the one and tested on
              the other. Of MOT17 second halves are tested, as in bench/peers.py.
halves        the same, learnt from the first half of the sequence whose second half is tested.
peers         Table 2: the mean of M1, M2, M3 beside that of the other trackers, on the same regions, at the better of
              their two settings (bench/peers.py); ours learnt as in `others`, and with the weights that it has without
              a context. Nobody else is given pictures; ours is, where there are any, and silhouettes where our detector
              made the regions.
trajectories  Table 3: of the same runs of ours, trajectories found (TP), lost (FN) and invented (FP).

--settings paper: fathers chosen once, no motion, no second look at weak regions, nobody found again by looks or by
meetings, raw boxes, Th1 = 0.5, and the paper's rule of learning (`perdure learn --paper`) over the paper's eight
features. defaults: `perdure learn` and `perdure track --tracker multifeature --context FILE`; equal weights are there
`--weights` with 1 for each of the eight, with the Th1 that the tracker has for its own weights, and, in a line of their
own, the same weights with the Th1 that `perdure learn` finds for them in the same films.

M1, M2, M3 and their mean M are those of ETISEO (perdure.metrics.etiseo); with IDF1 and HOTA they are what `perdure score`
says. Milliseconds are CPU time of a step, the median over frames, OpenCV on one thread, pictures decoded and regions
found before. Features are those that weigh something and can be known: without pictures no colours, without a calibration
no distance in metres.

The data is read from $PERDURE_DATA or ../shared/data beside the repository; what is not there is left out with a note, and
so are the other trackers where their environment ($PERDURE_PEERS or bench/peers/.venv) is not. --write puts the tables into
docs/multi-feature.md, and leaves those of other parts there; --json prints everything as one object in the last line.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import statistics
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import peers
from pages import Marks, absent, given, versions
from regions import Table, chosen, markdown

from perdure import fold
from perdure.errors import PerdureError
from perdure.features.pool import PAPER as EIGHT
from perdure.features.pool import POOL
from perdure.files.mot import read_truth
from perdure.learn import PAPER, Film, Learning, Samples, context_of, learn, link_similarity
from perdure.metrics import score
from perdure.pipeline import plan
from perdure.scene.context import ON_GROUND, Context, needs_pixels
from perdure.trackers.multifeature import MultiFeature
from perdure.types import Frame, Regions, Rows, Scene

PARTS = ("others", "halves", "peers", "trajectories")
ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "multi-feature.md"
MARKS = Marks.of("bench/multifeature_paper.py", PAGE)
FIGURES = ("M1", "M2", "M3", "M", "IDF1", "HOTA")
TRAJECTORIES = ("tracks_TP", "tracks_FN", "tracks_FP")
EQUAL, FITTED, LEARNT, BUILT_IN = "equal", "equal, Th1 learnt", "learnt", "built in"


def main() -> None:
    arguments = _arguments()
    try:
        cv2.setNumThreads(1)
        result = measure(arguments)
        given(result, arguments, PAGE, MARKS, section)
    except (PerdureError, peers.PeersError) as error:
        print(f"multifeature_paper.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--parts", nargs="+", metavar="NAME", default=PARTS, help=", ".join(PARTS))
    parser.add_argument("--settings", nargs="+", metavar="NAME", default=tuple(SETTINGS), help=", ".join(SETTINGS))
    parser.add_argument("--data", type=Path, default=root, help="where the sequences are")
    parser.add_argument("--environment", type=Path, default=peers.ENVIRONMENT, metavar="DIR", help="of the peers")
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the tables in docs/multi-feature.md")
    return parser.parse_args()


@dataclass(frozen=True)
class Result:
    """The tables of the parts that were asked for, and everything as plain values."""

    tables: tuple[Table, ...]
    told: Mapping[str, Any]


def measure(arguments: argparse.Namespace) -> Result:
    """Run the parts that the arguments name."""
    parts = chosen(arguments.parts, {name: [name] for name in PARTS}, "part")
    settings = chosen(arguments.settings, {name: [name] for name in SETTINGS}, "settings")
    bench = Bench(arguments.data)
    tables: list[Table] = []
    told: dict[str, Any] = {"versions": versions()}
    for part, trials in (("others", OTHERS), ("halves", HALVES)):
        if part in parts:
            found = {name: bench.compared(trials, name) for name in settings}
            tables += [table_1(part, name, one) for name, one in found.items() if one]
            told[part] = {name: [both.as_json() for both in one] for name, one in found.items()}
    if "peers" in parts:
        beside = bench.beside_peers(arguments.environment)
        tables += [table_2(beside)] if beside else []
        told["peers"] = beside
    if "trajectories" in parts:
        found = {name: bench.compared(FIRST, name) for name in settings}
        tables += [table_3(name, one) for name, one in found.items() if one]
        told["trajectories"] = {name: [both.as_json() for both in one] for name, one in found.items()}
    told["weights"] = {f"{name}: {words(views)}": weights for name, views, weights in bench.learnt_weights()}
    return Result(tuple(tables), told)


# Sequences --------------------------------------------------------------------------------------------------


class Clip(NamedTuple):
    """A sequence with what was detected in it."""

    folder: str
    source: (
        str | None
    )  # in it; nothing where the folder itself is read, without pictures; None: as the peers have it
    detections: str  # in it; nothing for our background detector

    def at(self, data: Path) -> Path:
        """Where it is read from."""
        return data / self.folder / (self.source or "")


YOLOX, FRCNN = "det/det_yolox_x_ablation.txt", "det/det_FRCNN.txt"
CLIPS: Mapping[str, Clip] = {  # by the names that bench/peers.py has
    **{
        f"MOT17-{number}-{short}": Clip(f"mot17-text/MOT17-{number}", "", file)
        for short, file in (("yolox", YOLOX), ("frcnn", FRCNN))
        for number in ("02", "04", "10")
    },
    "tud-campus": Clip("tud-campus-text", None, "det/det_sort_frrcnn.txt"),
    "pets09-det": Clip("pets09-s2l1", "video.avi", "det/det.txt"),
    **{
        name: Clip(f"composites/{name}", "video.mp4", "")
        for name in ("crowd8", "group4", "crossing2", "behind2", "huddle4")
    },
}


class View(NamedTuple):
    """A clip, or a half of it."""

    clip: str
    half: int = 0  # 0: all of it

    def __str__(self) -> str:
        return self.clip + ("", ", 1st half", ", 2nd half")[self.half]


Views = tuple[View, ...]


class Trial(NamedTuple):
    """What is learnt from, and what is tested."""

    learnt: Views
    tested: View


def words(views: Iterable[View]) -> str:
    """Return the names of views as one."""
    return " + ".join(map(str, views))


def _tested(name: str) -> View:
    """What is tested of a clip: of MOT17 the second half, of others all."""
    return View(name, 2 if name.startswith("MOT17") else 0)


def _trial(learnt: str, tested: str) -> Trial:
    return Trial(tuple(View(name) for name in learnt.split()), _tested(tested))


FIRST = tuple(  # one trial for each clip that the peers are given too
    _trial(learnt, tested)
    for learnt, tested in (
        ("MOT17-04-yolox", "MOT17-02-yolox"),
        ("MOT17-02-yolox", "MOT17-04-yolox"),
        ("MOT17-02-yolox", "MOT17-10-yolox"),
        ("MOT17-04-frcnn", "MOT17-02-frcnn"),
        ("MOT17-02-frcnn", "MOT17-04-frcnn"),
        ("MOT17-02-frcnn", "MOT17-10-frcnn"),
        ("MOT17-02-frcnn", "tud-campus"),
        ("crowd8 group4", "pets09-det"),
        ("pets09-det", "crowd8"),
        ("pets09-det", "group4"),
        ("pets09-det", "crossing2"),
    )
)
CROSSED = tuple(
    _trial(f"MOT17-{one}-{mine}", f"MOT17-{other}-{theirs}")
    for one, other in (("04", "02"), ("02", "04"))
    for mine, theirs in (("frcnn", "yolox"), ("yolox", "frcnn"))
)
SIMILAR = tuple(_trial("behind2 huddle4", name) for name in ("crowd8", "group4"))  # of the same kind and detector
OTHERS = FIRST + CROSSED + SIMILAR
HALVES = tuple(
    Trial((View(name, 1),), View(name, 2))
    for name in ("MOT17-02-yolox", "MOT17-04-yolox", "MOT17-02-frcnn", "MOT17-04-frcnn", "pets09-det")
)


class Opened(NamedTuple):
    """A view, ready to be read."""

    scene: Scene
    seen: Iterable[tuple[Frame, Regions]]
    pictures: bool


@contextlib.contextmanager
def opened(data: Path, view: View) -> Iterator[Opened]:
    """Open a clip, or a half of it, while this lasts."""
    clip = CLIPS[view.clip]
    if clip.source is None:
        given = seen_by_peers(data, view.clip)
        yield Opened(given.scene, zip(given.frames, given.regions, strict=True), False)
        return
    detector = data / clip.folder / clip.detections if clip.detections else None
    made = plan(str(clip.at(data)), detector=detector)
    if view.half:
        middle = f"{(made.source.count or 0) // 2}f"
        made.source.close()
        span = {"end": middle} if view.half == 1 else {"start": middle}
        made = plan(str(clip.at(data)), detector=detector, **span)
    try:
        ready = made.prepared()
        yield Opened(ready.scene, ready.seen(), ready.source.has_images)
    finally:
        made.source.close()


def seen_by_peers(data: Path, name: str) -> peers.Seen:
    """Return what every peer is given of a clip."""
    (clip,) = [one for one in peers.CLIPS if one.name == name]
    return clip.read(data)


# Settings ---------------------------------------------------------------------------------------------------


class Setting(NamedTuple):
    """How is tracked, and how learnt."""

    parameters: Mapping[str, Any]  # of the tracker
    learning: Learning
    pool: tuple[str, ...]  # features that may be chosen


PAIRS = 60_000  # that are kept: as in bench/contexts.py
SETTINGS: Mapping[str, Setting] = {
    "paper": Setting(
        {
            "similar": 0.5,
            "assignment": "once",
            "inertia": 0.01,  # s: the last object alone tells where it is
            "believed_after": 60.0,  # s: no speed
            "waning": 0.0,
            "sure_score": 0.6,  # one score for all: there is no second look
            "weak_score": 0.6,
            "birth_score": 0.6,
            "recall": 0.0,
            "exchange": 100.0,
            "smooth": 0.0,
        },
        replace(PAPER, most=PAIRS),
        EIGHT,
    ),
    "defaults": Setting({}, Learning(most=PAIRS), tuple(POOL)),
}


def limited(samples: Samples, pool: Sequence[str]) -> Samples:
    """Return samples in which nothing is known of features outside a pool."""
    there = [name in pool for name in POOL]
    return replace(samples, known=samples.known & there)


def fitted_to(samples: Samples, kept: float) -> Context:
    """Return equal weights of the eight, with the Th1 that lets a share of the same pairs be linked."""
    even = Context(EQUAL, dict.fromkeys(EIGHT, 1.0))
    link, told = link_similarity(even, samples)
    return replace(even, similar=float(np.quantile(link[samples.same & told], 1.0 - kept)))


# Runs -------------------------------------------------------------------------------------------------------


class Run(NamedTuple):
    """What came of a tracker on a view."""

    figures: Mapping[str, float]
    ms: float  # of CPU, the median step
    features: int

    def as_json(self) -> dict[str, Any]:
        figures = {name: self.figures[name] for name in (*FIGURES, *TRAJECTORIES)}
        return {**figures, "ms": self.ms, "features": self.features}


class Both(NamedTuple):
    """A trial without and with learning."""

    trial: Trial
    equal: Run
    learnt: Run
    fitted: Run | None = None  # equal weights, Th1 learnt; where Th1 is not the same for all

    @property
    def gain(self) -> float:
        """By how much the mean of the three scores rises."""
        return self.learnt.figures["M"] - self.equal.figures["M"]

    @property
    def further(self) -> float:
        """By how much it rises over equal weights whose Th1 is learnt; 0 where there are none."""
        return 0.0 if self.fitted is None else self.learnt.figures["M"] - self.fitted.figures["M"]

    def as_json(self) -> dict[str, Any]:
        return {
            "learnt from": words(self.trial.learnt),
            "tested on": str(self.trial.tested),
            EQUAL: self.equal.as_json(),
            LEARNT: self.learnt.as_json(),
            FITTED: self.fitted and self.fitted.as_json(),
            "gain": self.gain,
            "further": self.further,
        }


@dataclass(frozen=True)
class Bench:
    """The data, and what has been measured on it already."""

    data: Path
    contexts: dict[tuple[str, str, Views], Context] = field(default_factory=dict)
    runs: dict[tuple[str, str, Views, View], Run] = field(default_factory=dict)

    def compared(self, trials: Iterable[Trial], setting: str) -> list[Both]:
        """Return every trial whose clips are there."""
        found = []
        for trial in trials:
            clips = {one.clip for one in (*trial.learnt, trial.tested)}
            if any(absent(CLIPS[name].at(self.data)) for name in sorted(clips)):
                continue
            equal = self.run(setting, EQUAL, (), trial.tested)
            learnt = self.run(setting, LEARNT, trial.learnt, trial.tested)
            fixed = "similar" in SETTINGS[setting].parameters
            fitted = None if fixed else self.run(setting, FITTED, trial.learnt, trial.tested)
            found.append(Both(trial, equal, learnt, fitted))
            note = f"{setting}: {words(trial.learnt)} -> {trial.tested}: M {found[-1].gain:+.3f}"
            print(note, file=sys.stderr, flush=True)
        return found

    def run(self, setting: str, way: str, learnt: Views, tested: View) -> Run:
        """Follow a view with equal weights, with learnt ones, or with those built in."""
        key = setting, way, learnt, tested
        if key not in self.runs:
            parameters: dict[str, Any] = dict(SETTINGS[setting].parameters)
            weights: Mapping[str, float] = dict.fromkeys(EIGHT, 1.0)
            if way in (LEARNT, FITTED):
                context = self.context(setting, way, learnt)
                parameters["contexts"], weights = (context,), context.weights
            elif way == EQUAL:
                parameters["weights"] = ",".join(f"{name}=1" for name in EIGHT)
            with opened(self.data, tested) as film:
                self.runs[key] = followed(MultiFeature(**parameters), film, self.truth(tested), weights)
        return self.runs[key]

    def context(self, setting: str, way: str, views: Views) -> Context:
        """Learn from views: everything, or for equal weights only their Th1."""
        if (setting, way, views) not in self.contexts:
            one = SETTINGS[setting]
            found = learn(self.films(views), one.learning)
            if one.pool != tuple(POOL):
                found = context_of(limited(found.samples, one.pool), one.learning, "learnt")
            self.contexts[setting, LEARNT, views] = found.context
            self.contexts[setting, FITTED, views] = fitted_to(found.samples, one.learning.kept)
        return self.contexts[setting, way, views]

    def films(self, views: Views) -> Iterator[Film]:
        """Yield views with their truths; each is closed when the next one is asked for."""
        for view in views:
            with opened(self.data, view) as film:
                yield Film(str(view), film.seen, self.truth(view), film.scene, True)

    def truth(self, view: View) -> Rows:
        return read_truth(self.data / CLIPS[view.clip].folder / "gt" / "gt.txt")

    def learnt_weights(self) -> Iterator[tuple[str, Views, dict[str, float]]]:
        for (setting, way, views), context in self.contexts.items():
            if way == LEARNT:
                yield setting, views, dict(context.weights)

    def beside_peers(self, environment: Path) -> list[dict[str, Any]]:
        """Return, for each clip that they are given too, the scores of the peers and ours."""
        if not environment.exists():
            print(f"note: {environment.name} is not there; the peers are left out", file=sys.stderr)
            return []
        there = [trial for trial in FIRST if not absent(CLIPS[trial.tested.clip].at(self.data))]
        given = {one.tested.clip: seen_by_peers(self.data, one.tested.clip) for one in there}
        means = peers_means(given, environment)
        lines = []
        for both in self.compared(there, "defaults"):
            name = both.trial.tested.clip
            usual = self.run("defaults", BUILT_IN, (), both.trial.tested)
            own = {EQUAL: both.equal, LEARNT: both.learnt, BUILT_IN: usual}
            ours = {way: one.figures["M"] for way, one in own.items()}
            lines.append({"clip": name, "ours": ours, "peers": means[name]})
        return lines


def followed(tracker: MultiFeature, film: Opened, truth: Rows, weights: Mapping[str, float]) -> Run:
    """Follow a film; only the tracker's own steps are timed."""
    state, reports, spent, frames = tracker.start(film.scene), [], [], []
    for frame, regions in film.seen:
        begun = time.thread_time()
        state, report = tracker.step(state, frame, regions)
        spent.append(time.thread_time() - begun)
        reports.append(report)
        frames.append(frame.index)
    reports.append(tracker.finish(state))
    figures = score(fold.settle(reports), truth.between(frames[0], frames[-1])).figures
    features = features_used(weights, pictures=film.pictures, ground=film.scene.ground is not None)
    return Run(figures, 1e3 * statistics.median(spent), features)


def features_used(weights: Mapping[str, float], *, pictures: bool, ground: bool) -> int:
    """Return how many features weigh something and can be known."""
    return sum(
        weight > 0 and (pictures or not needs_pixels(name)) and (ground or name != ON_GROUND)
        for name, weight in weights.items()
    )


def peers_means(given: Mapping[str, peers.Seen], environment: Path) -> dict[str, dict[str, float]]:
    """Return, by clip, the mean score of each peer at the better of its settings."""
    python = peers.environment(environment)
    found: dict[str, dict[str, float]] = {name: {} for name in given}
    for runner in peers.runners():
        if runner.job is None:
            continue
        print(f"{runner.tracker}, {runner.settings}", file=sys.stderr, flush=True)
        for name, outcome in peers.follow_there(runner, given, python).items():
            if outcome.rows is not None:
                mean = score(outcome.rows, given[name].truth).figures["M"]
                found[name][runner.tracker] = max(mean, found[name].get(runner.tracker, 0.0))
    return found


# Tables -----------------------------------------------------------------------------------------------------


def table_1(part: str, setting: str, found: Sequence[Both]) -> Table:
    """Lines for each trial: without learning, with Th1 learnt where it may be, with weights learnt."""
    rows = []
    for both in found:
        learnt = words(both.trial.learnt)
        rows.append([str(both.trial.tested), "nothing", *_cells(both.equal), ""])
        if both.fitted is not None:
            gain = both.fitted.figures["M"] - both.equal.figures["M"]
            rows.append(["", f"{learnt}: Th1 only", *_cells(both.fitted), f"{100 * gain:+.1f}"])
        rows.append(["", learnt, *_cells(both.learnt), f"{100 * both.gain:+.1f}"])
    higher = sum(both.gain > 0 for both in found)
    faster = sum(both.learnt.ms < both.equal.ms for both in found)
    further = ""
    if any(both.fitted is not None for both in found):
        further = f" (weights beyond Th1 on {sum(both.further > 0 for both in found)})"
    title = (
        f"{part}: {SETTING_WORDS[setting]}; learning raises M on {higher} of {len(found)}{further} "
        f"and takes less time on {faster}; scores in percent"
    )
    return Table(title, ["tested on", "learnt from", *FIGURES, "ms a frame", "features", "M gained"], rows)


SETTING_WORDS = {"paper": "as the paper has it", "defaults": "at our defaults"}


def _cells(run: Run) -> list[str]:
    figures = [f"{100 * run.figures[name]:.1f}" for name in FIGURES]
    return [*figures, peers.two_digits(run.ms), str(run.features)]


def table_2(beside: Sequence[Mapping[str, Any]]) -> Table:
    """A row for each clip, a column for each tracker; the highest is in bold."""
    names = sorted({name for one in beside for name in one["peers"]})
    rows = []
    for one in beside:
        values = {**{f"ours, {way}": mean for way, mean in one["ours"].items()}, **one["peers"]}
        best = max(values.values())
        rows.append([one["clip"], *(_bold(values.get(name), best) for name in _columns(names))])
    title = (
        "peers: M, the mean of M1, M2 and M3 in percent, ours at defaults, each peer at the better of its settings"
    )
    return Table(title, ["clip", *_columns(names)], rows)


def _columns(names: Sequence[str]) -> list[str]:
    return [*(f"ours, {way}" for way in (LEARNT, BUILT_IN, EQUAL)), *names]


def _bold(value: float | None, best: float) -> str:
    if value is None:
        return "failed"
    return f"**{100 * value:.1f}**" if value == best else f"{100 * value:.1f}"


def table_3(setting: str, found: Sequence[Both]) -> Table:
    """A row for each clip, and all together."""
    rows = []
    total = [0] * (1 + 2 * len(TRAJECTORIES))
    for both in found:
        counts = [round(run.figures[name]) for run in (both.equal, both.learnt) for name in TRAJECTORIES]
        counts = [counts[0] + counts[1], *counts]
        total = [one + other for one, other in zip(total, counts, strict=True)]
        rows.append([str(both.trial.tested), *map(str, counts)])
    rows.append(["all", *map(str, total)])
    head = [f"{short}, {way}" for way in (EQUAL, LEARNT) for short in ("TP", "FN", "FP")]
    return Table(f"trajectories: {SETTING_WORDS[setting]}", ["tested on", "trajectories", *head], rows)


# The page ---------------------------------------------------------------------------------------------------


def section(command: str, result: Result, page: str = "") -> str:
    """Return what stands between the marks in docs/multi-feature.md; a page's tables that were not made anew stay."""
    made = {_place(one.title) for one in result.tables}
    kept = [(title, table) for title, table in MARKS.tables(page) if _place(title) not in made]
    written = [*kept, *((one.title, markdown(one)) for one in result.tables)]
    order = [(part, setting) for part in PARTS for setting in (*SETTINGS, "")]
    tables = [table for _, table in sorted(written, key=lambda one: order.index(_place(one[0])))]
    told = ", ".join(f"{name} {version}" for name, version in result.told["versions"].items())
    return "\n\n".join([f"`{command}`", *tables, f"Versions: {told}."])


def _place(title: str) -> tuple[str, str]:
    """The part and the setting that a table is of; no setting where it is of one only."""
    part, _, rest = title.partition(": ")
    return part, next((name for name, told in SETTING_WORDS.items() if rest.startswith(told)), "")


if __name__ == "__main__":
    main()

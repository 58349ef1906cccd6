"""Our trackers and those that a user might take instead, on exactly the same regions.

    python bench/peers.py [--sequences NAME ...] [--trackers NAME ...] [--environment DIR] [--write] [--json]

The peers run in an environment of their own ($PERDURE_PEERS or bench/peers/.venv, made on first use by pip from
bench/peers/requirements.txt), a process for each peer and settings: bench/peers/run.py. They are run twice, at their
library's defaults and as their paper published; bench/peers/settings.toml says how. Our trackers run here at their defaults. Nobody is given pictures;
our own get the silhouettes too where our detector made the regions. What a tracker says in a frame is scored as it
is (ours: settled, the rows that count); the time is that of the update calls alone, after a warm-up, best of three.

The data is read from $PERDURE_DATA or ../shared/data beside the repository; what is not there is skipped with a note.
--write puts the tables into docs/benchmarks.md, --json prints everything as one object in the last line.
"""

from __future__ import annotations

import argparse
import configparser
import dataclasses
import json
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
import venv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from perdure import fold
from perdure.errors import PerdureError
from perdure.files.mot import read_detections, read_truth
from perdure.files.whole import whole_file
from perdure.metrics import Score, score
from perdure.params import unknown_name
from perdure.pipeline import plan
from perdure.trackers import TRACKERS
from perdure.types import Frame, Regions, Rows, Scene, Use

HERE = Path(__file__).resolve().parent / "peers"
ENVIRONMENT = Path(os.environ.get("PERDURE_PEERS") or HERE / ".venv")
PAGE = HERE.parents[1] / "docs" / "benchmarks.md"
HEADING, BEGINS, ENDS = (
    "## Against other trackers",
    "<!-- bench/peers.py begins -->",
    "<!-- bench/peers.py ends -->",
)
WARM_UP, TURNS = 50, 3  # frames; timed runs of which the best counts: as in bench/peers/run.py
LONGEST = 1800  # s, for one peer over all sequences
FIGURES = ("HOTA", "AssA", "DetA", "MOTA", "IDF1", "IDSW")
COMPOSITES = (
    "crossing2", "group4", "whiteband", "attractive", "turning", "crowd8", "illumination", "behind2", "huddle4",
    "lights",
)  # fmt: skip


class PeersError(Exception):
    """The caller's mistake, or an environment that does not do; in one line."""


@dataclass(frozen=True)
class Clip:
    """A sequence by name: the table it belongs to, and how to read it from the data folder."""

    name: str
    group: str
    read: Callable[[Path], Seen]


@dataclass(frozen=True, eq=False)
class Seen:
    """What every tracker is given of a sequence, and the truth of the same frames."""

    scene: Scene
    frames: tuple[Frame, ...]  # without pictures
    regions: tuple[Regions, ...]  # of each frame
    truth: Rows


@dataclass(frozen=True, eq=False)
class Runner:
    """A tracker with its settings."""

    tracker: str
    settings: str
    how: str  # settings and notes, for the reader
    job: Mapping[str, Any] | None  # for bench/peers/run.py; None for our own trackers


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of one runner on one sequence: rows and seconds, or a fault."""

    rows: Rows | None
    seconds: float
    fault: str = ""


@dataclass(frozen=True, eq=False)
class Line:
    """A line of a table: one runner on the sequences of a group together."""

    runner: Runner
    score: Score | None
    ms: float  # a frame
    fault: str


@dataclass(frozen=True, eq=False)
class Table:
    """All runners on the sequences of one group."""

    title: str
    sequences: tuple[str, ...]
    whole: bool  # all sequences of the group are there
    frames: int
    regions: int
    objects: int
    lines: tuple[Line, ...]


GROUPS: Mapping[str, str] = {
    "pets09-own": "PETS09-S2L1, fixed camera, regions of our background detector",
    "pets09-det": "PETS09-S2L1, fixed camera, FRCNN detections (`det/det.txt`)",
    "mot17-fixed-yolox": "MOT17-02 and -04 together, fixed cameras, second halves, YOLOX-x detections with low scores",
    "mot17-fixed-frcnn": "MOT17-02 and -04 together, fixed cameras, second halves, public FRCNN detections",
    "mot17-moving-yolox": "MOT17-10, moving camera, second half, YOLOX-x detections with low scores",
    "mot17-moving-frcnn": "MOT17-10, moving camera, second half, public FRCNN detections",
    "tud-campus": "TUD-Campus, fixed camera, FRCNN detections (`det_sort_frrcnn.txt`)",
    "composites": "Ten composite clips together, fixed cameras, regions of our background detector",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sequences", nargs="+", default=[], metavar="NAME", help="sequences or tables, by name")
    parser.add_argument("--trackers", nargs="+", default=[], metavar="NAME", help="trackers or libraries, by name")
    parser.add_argument("--environment", type=Path, default=ENVIRONMENT, metavar="DIR", help="of the peers")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/benchmarks.md")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    try:
        compare(arguments)
    except (PeersError, PerdureError) as error:
        sys.exit(f"bench/peers.py: {error}")


def compare(arguments: argparse.Namespace) -> None:
    """Run what the arguments name, print and write the tables."""
    wanted = chosen("sequence", arguments.sequences, {one.name: one for one in CLIPS}, lambda one: one.group)
    named = {f"{one.tracker} {one.settings}": one for one in runners()}
    trackers = chosen("tracker", arguments.trackers, named, lambda one: one.tracker)
    python = environment(arguments.environment) if any(one.job for one in trackers) else None
    seen = read_all(wanted)
    outcomes: dict[tuple[Runner, str], Outcome] = {}
    for number, runner in enumerate(trackers, 1):
        print(f"{number}/{len(trackers)}  {runner.tracker}, {runner.settings}", file=sys.stderr, flush=True)
        found = follow_here(runner, seen) if runner.job is None else follow_there(runner, seen, python)
        outcomes |= {(runner, name): outcome for name, outcome in found.items()}
    tables = [
        tabulate(group, seen, wanted, trackers, outcomes) for group in GROUPS if group_of(group, wanted, seen)
    ]
    versions = {"cpu": cpu(), "python": platform.python_version(), "perdure": metadata.version("perdure")}
    versions |= library_versions(python) if python else {}
    for block in report(tables, versions, text_table):
        print(block, end="\n\n")
    if arguments.write:
        page = with_section(PAGE.read_text(encoding="utf-8"), section(tables, versions, arguments))
        with whole_file(PAGE) as file:
            file.write(page)
    if arguments.json:
        print(json.dumps({"versions": versions, "tables": [as_json(table) for table in tables]}))


def chosen(what: str, names: Sequence[str], known: Mapping[str, Any], group: Callable[[Any], str]) -> list[Any]:
    """Return the named ones in the order known, or all; a name may be that of a group, or what stands before `/`."""
    words = {name: {name, group(one), group(one).partition("/")[0]} for name, one in known.items()}
    for name in names:
        if not any(name in mine for mine in words.values()):
            raise PeersError(unknown_name(what, name, set().union(*words.values())))
    return [one for name, one in known.items() if not names or words[name] & set(names)]


def runners() -> list[Runner]:
    """Return our trackers at their defaults, then every peer twice."""
    ours = [
        Runner(f"perdure/{name}", "defaults", "", None) for name, made in TRACKERS.items() if not made.needs_pixels
    ]
    peers = tomllib.loads((HERE / "settings.toml").read_text(encoding="utf-8"))["peer"]
    return ours + [
        Runner(peer["name"], settings, explained(peer[settings]), {"scores_above": None, **peer, **peer[settings]})
        for peer in peers
        for settings in ("defaults", "published")
    ]


def explained(settings: Mapping[str, Any]) -> str:
    """Return the settings of a run in one line, with its note."""
    words = [f"{name} {value}" for name, value in settings["arguments"].items()]
    if "scores_above" in settings:
        words.insert(0, f"regions with scores above {settings['scores_above']} only")
    return "; ".join(filter(None, [", ".join(words), settings.get("note", "")]))


# The peers' environment.


def environment(folder: Path) -> Path:
    """Return the peers' interpreter; make its environment where there is none."""
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        print(
            f"making the peers' environment in {folder} (pip install, a few minutes)", file=sys.stderr, flush=True
        )
        make_environment(folder, python)
    missing = [name for name, version in library_versions(python).items() if version is None]
    if missing:
        raise PeersError(f"{folder} lacks {', '.join(missing)}; remove the folder and run this again")
    return python


def make_environment(folder: Path, python: Path) -> None:
    """Make a virtual environment with the requirements; nothing is left behind where that fails."""
    if folder.exists() and any(folder.iterdir()):
        raise PeersError(
            f"{folder} is no environment (it has no {python.name}) and not empty; name another folder"
        )
    try:
        venv.create(folder, with_pip=True)
        install = [str(python), "-m", "pip", "install", "--quiet", "-r", str(HERE / "requirements.txt")]
        subprocess.run(install, check=True, capture_output=True, text=True)
    except KeyboardInterrupt:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    except (OSError, subprocess.CalledProcessError) as error:
        shutil.rmtree(folder, ignore_errors=True)
        why = last_line(getattr(error, "stderr", None) or str(error))
        raise PeersError(f"cannot make {folder}: {why}; give a ready one with --environment") from error


def library_versions(python: Path) -> dict[str, str | None]:
    """Return the installed version of every requirement, None where it is absent."""
    lines = (HERE / "requirements.txt").read_text(encoding="utf-8").splitlines()
    names = [line.partition("==")[0] for line in lines if "==" in line]
    try:
        done = subprocess.run(
            [str(python), str(HERE / "run.py"), "--versions", *names], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError) as error:
        raise PeersError(f"{python} does not run ({error}); remove its environment and run this again") from error
    return json.loads(done.stdout)


def last_line(text: str) -> str:
    return ([line.strip() for line in text.splitlines() if line.strip()] or ["no reason given"])[-1]


def cpu() -> str:
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")


# The sequences.


def data_folder() -> Path:
    return Path(os.environ.get("PERDURE_DATA") or HERE.parents[2] / "shared" / "data")


def read_all(wanted: Iterable[Clip]) -> dict[str, Seen]:
    """Read the sequences by name; what is not there is left out with a note."""
    root, seen = data_folder(), {}
    for one in wanted:
        try:
            seen[one.name] = one.read(root)
        except (PerdureError, OSError) as error:
            print(f"note: {one.name} is left out: {last_line(str(error))}", file=sys.stderr)
    if not seen:
        raise PeersError(f"no sequence can be read from {root}; name the data's folder with PERDURE_DATA")
    return seen


def from_video(video: str, truth: str, root: Path) -> Seen:
    """Read a film: the regions are those of our background detector, after its first look over the file."""
    made = plan(root / video).prepared()
    try:
        steps = [(dataclasses.replace(frame, image=None), regions) for frame, regions in made.seen()]
    finally:
        made.source.close()
    frames, regions = zip(*steps, strict=True)
    return Seen(made.scene, frames, regions, read_truth(root / truth))


def from_detections(folder: str, detections: str, scene: Scene, first: int, count: int, root: Path) -> Seen:
    """Read frames `first` to `count` - 1 of a MOTChallenge folder: the regions are recorded detections."""
    by_frame = read_detections(root / folder / "det" / detections)
    span = range(first, count)
    return Seen(
        scene,
        tuple(Frame(index, index / scene.fps) for index in span),
        tuple(by_frame.get(index, Regions.empty()) for index in span),
        read_truth(root / folder / "gt" / "gt.txt").between(first, count - 1),
    )


def from_second_half(name: str, detections: str, root: Path) -> Seen:
    """Read the second half of a MOT17 sequence."""
    folder = f"mot17-text/{name}"
    ini = configparser.ConfigParser()
    ini.read_string((root / folder / "seqinfo.ini").read_text(encoding="utf-8"))
    told = ini["Sequence"]
    scene = Scene(told.getint("imWidth"), told.getint("imHeight"), told.getfloat("frameRate"))
    count = told.getint("seqLength")
    return from_detections(folder, detections, scene, second_half(count), count, root)


def second_half(count: int) -> int:
    """Return the first frame (from 0) of the second half: counted from 1, the frames above count // 2."""
    return count // 2


CLIPS = (
    Clip("pets09-own", "pets09-own", partial(from_video, "pets09-s2l1/video.avi", "pets09-s2l1/gt/gt.txt")),
    Clip(
        "pets09-det",
        "pets09-det",
        # 10 frames per second as the film's header says, so that both tables have the same clock
        partial(from_detections, "pets09-s2l1", "det.txt", Scene(768, 576, 10.0), 0, 795),
    ),
    *(
        Clip(f"{name}-{short}", f"mot17-{camera}-{short}", partial(from_second_half, name, file))
        for short, file in (("yolox", "det_yolox_x_ablation.txt"), ("frcnn", "det_FRCNN.txt"))
        for name, camera in (("MOT17-02", "fixed"), ("MOT17-04", "fixed"), ("MOT17-10", "moving"))
    ),
    Clip(
        "tud-campus",
        "tud-campus",
        partial(from_detections, "tud-campus-text", "det_sort_frrcnn.txt", Scene(640, 480, 25.0), 0, 71),
    ),
    *(
        Clip(
            name,
            "composites",
            partial(from_video, f"composites/{name}/video.mp4", f"composites/{name}/gt/gt.txt"),
        )
        for name in COMPOSITES
    ),
)


# The runs.


def follow_here(runner: Runner, seen: Mapping[str, Seen]) -> dict[str, Outcome]:
    """Run one of our trackers over every sequence; only its own calls are timed."""
    make = TRACKERS[runner.tracker.partition("/")[2]]
    outcomes = {}
    for name, given in seen.items():
        try:
            run_ours(make(), given, WARM_UP)
            turns = [run_ours(make(), given, None) for _ in range(TURNS)]
            outcomes[name] = Outcome(turns[0][0], min(seconds for _, seconds in turns))
        except Exception as error:  # a defect of one tracker must not lose the lines of the others
            outcomes[name] = Outcome(None, 0.0, f"{type(error).__name__}: {last_line(str(error))}")
    return outcomes


def run_ours(tracker: fold.Tracker[Any], given: Seen, limit: int | None) -> tuple[Rows, float]:
    """Return the settled rows that count, and the seconds spent in start, step and finish."""
    if tracker.needs_pixels:
        raise PeersError("it needs pictures, which nobody is given here")
    begun = time.perf_counter()
    state = tracker.start(given.scene)
    seconds, reports = time.perf_counter() - begun, []
    for frame, regions in zip(given.frames[:limit], given.regions[:limit], strict=True):
        begun = time.perf_counter()
        state, report = tracker.step(state, frame, regions)
        seconds += time.perf_counter() - begun
        reports.append(report)
    begun = time.perf_counter()
    reports.append(tracker.finish(state))
    seconds += time.perf_counter() - begun
    said = fold.settle(reports).counted()
    return Rows.of(frames=said.frames, ids=said.ids, boxes=said.boxes), seconds


def follow_there(runner: Runner, seen: Mapping[str, Seen], python: Path) -> dict[str, Outcome]:
    """Run a peer over every sequence in a process of its own."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name, given in seen.items():
            save_regions(folder / f"{name}.regions.npz", given)
        job = folder / "job.json"
        job.write_text(json.dumps({**runner.job, "folder": place, "sequences": list(seen)}), encoding="utf-8")
        command = [str(python), str(HERE / "run.py"), str(job)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST)
            fault = f"its process ended with {done.returncode}: {last_line(done.stderr)}"
        except subprocess.TimeoutExpired:
            fault = f"it was stopped after {LONGEST} s"
        return {name: load_outcome(folder, name, fault) for name in seen}


def save_regions(path: Path, given: Seen) -> None:
    """Write what a peer is given: all boxes one after the other, and how many each frame has."""
    np.savez(
        path,
        frames=[frame.index for frame in given.frames],
        counts=[len(one) for one in given.regions],
        boxes=np.concatenate([one.boxes for one in given.regions], dtype=np.float64),
        scores=np.concatenate([one.scores for one in given.regions], dtype=np.float64),
        fps=given.scene.fps,
        width=given.scene.width,
        height=given.scene.height,
    )


def load_outcome(folder: Path, name: str, fault: str) -> Outcome:
    """Read what a peer said of a sequence; `fault` says why there may be nothing."""
    if (folder / f"{name}.rows.npz").exists():
        with np.load(folder / f"{name}.rows.npz") as said:
            rows = Rows.of(frames=said["frames"], ids=said["ids"], boxes=said["boxes"])
            return Outcome(rows, float(said["seconds"]))
    if (folder / f"{name}.fault").exists():
        fault = (folder / f"{name}.fault").read_text(encoding="utf-8")
    return Outcome(None, 0.0, fault)


# The tables.


def group_of(group: str, wanted: Iterable[Clip], seen: Mapping[str, Seen]) -> list[str]:
    """Return the names of the sequences of a group that were read."""
    return [one.name for one in wanted if one.group == group and one.name in seen]


def tabulate(
    group: str,
    seen: Mapping[str, Seen],
    wanted: Iterable[Clip],
    trackers: Iterable[Runner],
    outcomes: Mapping[tuple[Runner, str], Outcome],
) -> Table:
    """Score every runner on a group's sequences together; best HOTA first, faults last."""
    names = group_of(group, wanted, seen)
    given = [seen[name] for name in names]
    frames = sum(len(one.frames) for one in given)
    lines = [line(runner, given, [outcomes[runner, name] for name in names], frames) for runner in trackers]
    return Table(
        title=GROUPS[group],
        sequences=tuple(names),
        whole=len(names) == sum(one.group == group for one in CLIPS),
        frames=frames,
        regions=sum(len(regions) for one in given for regions in one.regions),
        objects=sum(len(np.unique(one.truth.ids[one.truth.use == Use.SCORED])) for one in given),
        lines=tuple(sorted(lines, key=lambda one: -one.score.figures["HOTA"] if one.score else 1.0)),
    )


def line(runner: Runner, given: Sequence[Seen], outcomes: Sequence[Outcome], frames: int) -> Line:
    """Return a runner's line: scores together, milliseconds a frame over all frames."""
    fault = next((one.fault for one in outcomes if one.rows is None), "")
    if fault:
        return Line(runner, None, 0.0, fault)
    try:
        parts = [score(one.rows, sequence.truth) for one, sequence in zip(outcomes, given, strict=True)]
    except ValueError as error:  # rows that cannot be: an id twice in a frame
        return Line(runner, None, 0.0, str(error))
    return Line(runner, Score.together(parts), 1e3 * sum(one.seconds for one in outcomes) / frames, "")


HEAD = ("tracker", "settings", *FIGURES, "ms a frame", "× fastest")


def cells(table: Table) -> list[tuple[str, ...]]:
    """Return the lines of a table as words; ratios in percent, times with two digits."""
    fastest = min((one.ms for one in table.lines if one.score), default=1.0)
    return [
        (one.runner.tracker, one.runner.settings, *figures(one), two_digits(one.ms), two_digits(one.ms / fastest))
        if one.score
        else (one.runner.tracker, one.runner.settings, f"failed: {one.fault}", *[""] * (len(HEAD) - 3))
        for one in table.lines
    ]


def figures(one: Line) -> list[str]:
    values = one.score.figures
    return [f"{values[name]:.0f}" if name == "IDSW" else f"{100 * values[name]:.1f}" for name in FIGURES]


def two_digits(value: float) -> str:
    """Write a number with two digits that count: 0.012, 1.3, 430."""
    return np.format_float_positional(value, precision=2, fractional=False, trim="-")


def text_table(rows: Sequence[tuple[str, ...]]) -> str:
    """Lay out cells for a terminal: names to the left, numbers to the right."""
    widths = [
        max(len(row[k]) for row in (HEAD, *rows) if not row[2].startswith("failed")) for k in range(len(HEAD))
    ]
    return "\n".join(
        "  ".join(
            word.ljust(width) if k < 3 else word.rjust(width)
            for k, (word, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in (HEAD, *rows)
    )


def markdown_table(rows: Sequence[tuple[str, ...]]) -> str:
    """Lay out cells as a Markdown table."""
    return "\n".join(
        "| " + " | ".join(word.replace("|", "\\|") for word in row) + " |"
        for row in (HEAD, ("---",) * len(HEAD), *rows)
    )


def report(
    tables: Sequence[Table], versions: Mapping[str, Any], lay_out: Callable[[Sequence[tuple[str, ...]]], str]
) -> list[str]:
    """Return the paragraphs of the report: tables with the size of the work, settings, protocol, versions."""
    blocks = []
    for table in tables:
        size = f"{table.frames} frames, {table.regions} regions, {table.objects} objects"
        part = "" if table.whole else f" Only {', '.join(table.sequences)}."
        blocks += [f"{table.title}: {size}.{part}", lay_out(cells(table))]
    used = {(one.runner.tracker, one.runner.settings): one.runner.how for table in tables for one in table.lines}
    notes = [f"- {tracker}, {settings}: {how}" for (tracker, settings), how in sorted(used.items()) if how]
    told = ", ".join(f"{name} {version}" for name, version in versions.items())
    return [*blocks, PROTOCOL, *(["Settings:\n\n" + "\n".join(notes)] if notes else []), f"Versions: {told}."]


PROTOCOL = """\
Every tracker is given the same regions of the same frames in one run, frame by frame, and no pictures; our own get
the silhouettes too where our background detector made the regions, and run at their defaults. Scores are those of
`perdure score`: HOTA, AssA and DetA over all thresholds, MOTA, IDF1 and IDSW at IoU 0.5, ratios in percent. The
peers' rows are what they said in each frame, ours are settled. Times are those of the update calls alone, the best of
three turns; while others use the machine, two runs of one tracker may still differ by a factor of two. "defaults" are
the library's, with the sequence's frames per second where it asks for them; "published" are the settings of the
method's paper or its authors' code, buffers in frames whatever the rate."""


def section(tables: Sequence[Table], versions: Mapping[str, Any], arguments: argparse.Namespace) -> str:
    """Return the section of docs/benchmarks.md, naming the command that made it."""
    words = ["python", "bench/peers.py"]
    for name in ("sequences", "trackers"):
        values = getattr(arguments, name)
        words += [f"--{name}", *values] if values else []
    return "\n\n".join([f"`{shlex.join([*words, '--write'])}`", *report(tables, versions, markdown_table)])


def with_section(page: str, text: str) -> str:
    """Return a page with the text between our marks; these come under a heading at its end where there are none."""
    if (BEGINS in page) != (ENDS in page):
        raise PeersError(
            f"{PAGE.name} has one of the lines {BEGINS} and {ENDS} without the other; put it right first"
        )
    if BEGINS not in page:
        page = f"{page.rstrip()}\n\n{HEADING}\n\n{BEGINS}{ENDS}\n"
    before, _, rest = page.partition(BEGINS)
    after = rest.partition(ENDS)[2]
    return f"{before}{BEGINS}\n\n{text}\n\n{ENDS}{after}"


def as_json(table: Table) -> dict[str, Any]:
    """Return a table as plain values: every figure, unrounded."""
    told = {name: getattr(table, name) for name in ("title", "sequences", "frames", "regions", "objects")}
    lines = [
        {
            "tracker": one.runner.tracker,
            "settings": one.runner.settings,
            "how": one.runner.how,
            **({"ms": one.ms, **one.score.figures} if one.score else {"fault": one.fault}),
        }
        for one in table.lines
    ]
    return {**told, "lines": lines}


if __name__ == "__main__":
    main()

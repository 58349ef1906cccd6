"""What the contour observer costs: with the contour's length, with the frame's area, and stage by stage.

    python bench/contour.py [--parts updates length area stages] [--rounds N] [--data DIR] [--json] [--write]

An update is `perdure.trackers.contour.observer.updated`: window 5, 10 steps, rigid motions, L_μ = .8, L_v = .6, curvature
.02, reach 8. A binary shape walks 2.3 px right and .4 px down a frame and breathes by 5 %; it is measured in a window RING
pixels wider than it, as the tracker does, before the clock runs. The first WARM updates do not count.

updates  objects of several sizes, the one that is asked for among them.
length   shapes in one box of 100x200 with 0 to 30 waves round them: the contour's length alone changes.
area     one object of 100x200 in frames of several sizes: an update, with its window cut from the frame's measurement, and
         a whole step of the tracker on a film of noise in which that object walks.
stages   a whole step on composites, each object marked where it is first seen whole: the share of each stage, and beside
         it one bare pass of DIS (medium preset) on the same pictures, in turn, frame by frame. What a stage calls counts
         as its own; the rest of the step is what the stages leave. Frames in which every object has been marked.

Milliseconds are medians over all timed updates or steps (in `stages` means), by the clock, and by the processor: of all
threads of this process, without waiting for other programs. Slopes are exponents, time ~ length^slope, time ~ area^slope,
by the processor; 0 is flat. --write puts the tables into docs/contour-observer.md and leaves those of other parts there;
--json prints all as one object in the last line.
Clips are read from $PERDURE_DATA or ../shared/data beside the repository; what is not there is left out with a note.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import cv2
import numpy as np
from pages import Marks, given, versions
from regions import Table, chosen, markdown

from perdure.errors import ParameterError, PerdureError
from perdure.files.mask_pngs import read_indices
from perdure.files.video import open_source
from perdure.maths import levelset, lie
from perdure.trackers.contour import Contour, births, looking, measuring, observer, tracker, updating
from perdure.types import Bits, Frame, Mask, Regions, Scene

PARTS = ("updates", "length", "area", "stages")
ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "contour-observer.md"
MARKS = Marks.of("bench/contour.py", PAGE)
WINDOW, STEPS, REACH, RING = 5, 10, 8, 40
FRAMES, WARM = 26, 6  # of a walk; frames of it that do not count
SIZES = ((50, 100), (100, 200), (150, 300), (200, 400))  # of objects, width and height
WAVES = (0, 10, 20, 30)
PICTURES = ((384, 288), (768, 576), (1536, 1152))
CLIPS = ("attractive", "whiteband", "behind2")


def main() -> None:
    arguments = _arguments()
    try:
        result = measure(arguments.parts, arguments.rounds, arguments.data)
        given(result, arguments, PAGE, MARKS, section)
    except PerdureError as error:
        print(f"contour.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--parts", nargs="+", metavar="NAME", default=PARTS, help=", ".join(PARTS))
    parser.add_argument("--rounds", type=int, default=5, help="walks of each kind")
    parser.add_argument("--data", type=Path, default=root, help="where the clips are")
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the tables in docs/contour-observer.md")
    return parser.parse_args()


@dataclass(frozen=True)
class Result:
    """The tables of the parts that were asked for, and everything as plain values."""

    tables: tuple[Table, ...]
    told: Mapping[str, Any]


def measure(parts: Sequence[str], rounds: int, data: Path) -> Result:
    """Run the parts that are named."""
    wanted = chosen(parts, {name: [name] for name in PARTS}, "part")
    if rounds < 1:
        raise ParameterError(f"rounds = {rounds} is out of range: it must be 1 or more")
    tables: list[Table] = []
    told: dict[str, Any] = {"versions": versions()}
    if "updates" in wanted:
        timed = [walk(width, height, 0, rounds) for width, height in SIZES]
        tables.append(updates_table(timed))
        told["updates"] = [one.as_json() for one in timed]
    if "length" in wanted:
        timed = [walk(100, 200, waves, rounds) for waves in WAVES]
        slope = exponent([one.length for one in timed], [one.processor for one in timed])
        tables.append(length_table(timed, slope))
        told["length"] = {"shapes": [one.as_json() for one in timed], "slope": slope}
    if "area" in wanted:
        frames = [area_of(*size, rounds) for size in PICTURES]
        tables.append(area_table(frames))
        told["area"] = [one._asdict() for one in frames]
    if "stages" in wanted:
        steps = [found for name in CLIPS if (found := stages_of(data / "composites" / name)) is not None]
        tables += [stages_table(steps)] if steps else []
        told["stages"] = [one.as_json() for one in steps]
    return Result(tuple(tables), told)


def exponent(sizes: Sequence[float], times: Sequence[float]) -> float:
    """Return how time grows: by the power of the size that fits best."""
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])


# Updates ----------------------------------------------------------------------------------------------------


class Walk(NamedTuple):
    """What an update of one shape takes, in milliseconds."""

    object: str
    waves: int
    length: float  # of the contour, pixels
    clock: float
    processor: float

    @property
    def rate(self) -> float:
        """Updates a second, by the clock."""
        return 1e3 / self.clock

    def as_json(self) -> dict[str, Any]:
        return self._asdict() | {"updates/s": self.rate}


def shape_at(frame: int, width: int, height: int, waves: int, size: tuple[int, int]) -> Bits:
    """Draw the shape of a frame into a picture (height, width)."""
    rows, columns = np.mgrid[: size[0], : size[1]]
    x = (columns - size[1] / 2 + 25 - 2.3 * frame) / (width / 2)
    y = (rows - size[0] / 2 + 4 - 0.4 * frame) / (height / 2 * (1 + 0.05 * np.sin(frame / 3)))
    edge = 1 - 0.15 * (waves > 0) * (1 - np.cos(waves * np.arctan2(y, x))) / 2
    return np.asarray(np.hypot(x, y) < edge)


def cut(shape: Bits) -> measuring.Measured:
    """Measure a shape (H, W) in the window that holds it and RING pixels round it."""
    x1, y1, x2, y2 = Mask.of_image(shape).box
    left, top = max(x1 - RING, 0), max(y1 - RING, 0)
    part = shape[top : y2 + RING, left : x2 + RING]
    return measuring.measured(1 - 2.0 * part, REACH, left, top)


def walk(width: int, height: int, waves: int, rounds: int, size: tuple[int, int] | None = None) -> Walk:
    """Time updates along a walk."""
    height_, width_ = size or (height + 2 * RING + 40, width + 2 * RING + 100)
    shapes = [shape_at(frame, width, height, waves, (height_, width_)) for frame in range(FRAMES)]
    seen = [cut(shape) for shape in shapes]
    first = observer.initial(shapes[0], 0, 0, lie.SE2)
    clock, processor = [], []
    for _ in range(rounds):
        state = first
        for number, one in enumerate(seen[1:]):
            begun, worked = time.perf_counter(), time.process_time()
            state = updated(state, one)
            if number >= WARM:
                clock.append(time.perf_counter() - begun)
                processor.append(time.process_time() - worked)
    there = levelset.length(levelset.contour(first.shape))
    return Walk(
        f"{width}x{height}", waves, there, 1e3 * float(np.median(clock)), 1e3 * float(np.median(processor))
    )


def updated(state: observer.State, one: measuring.Measured) -> observer.State:
    return observer.updated(
        state,
        one,
        observer.Gains(shape=0.8, motion=0.6),
        lie.SE2,
        window=WINDOW,
        steps=STEPS,
        motion=observer.constant_velocity,
        reach=REACH,
        curvature=0.02,
    )


def updates_table(timed: Sequence[Walk]) -> Table:
    rows = [
        [
            one.object,
            f"{one.length:.0f}",
            f"{one.clock:.1f}",
            f"{one.processor:.1f}",
            f"{one.rate:.0f}",
            f"{1e3 / one.processor:.0f}",
        ]
        for one in timed
    ]
    title = f"updates: window {WINDOW}, {STEPS} steps; milliseconds an update"
    return Table(
        title, ["object", "contour, px", "clock, ms", "processor, ms", "updates/s", "by the processor"], rows
    )


def length_table(timed: Sequence[Walk], slope: float) -> Table:
    rows = [[str(one.waves), f"{one.length:.0f}", f"{one.clock:.1f}", f"{one.processor:.1f}"] for one in timed]
    title = f"length: one box of 100x200, the contour's length alone changes; slope {slope:.2f}"
    return Table(title, ["waves", "contour, px", "clock, ms", "processor, ms"], rows)


# The frame's area -------------------------------------------------------------------------------------------


class Area(NamedTuple):
    """Milliseconds of the processor in frames of one size."""

    frame: str
    pixels: int
    update: float
    step: float


def area_of(width: int, height: int, rounds: int) -> Area:
    """Time an update and a whole step of the tracker in frames of one size."""
    return Area(
        f"{width}x{height}",
        width * height,
        walk(100, 200, 0, rounds, (height, width)).processor,
        step_of(width, height),
    )


def step_of(width: int, height: int) -> float:
    """Time whole steps of the tracker, in milliseconds of the processor."""
    rng = np.random.default_rng(0)
    ground = cv2.GaussianBlur(rng.integers(0, 256, (height, width, 3), np.uint8), (5, 5), 0)
    ours = Contour(smallest=1.0)
    state, spent = ours.start(Scene(width, height, 25.0)), []
    for number in range(FRAMES):
        shape = shape_at(number, 100, 200, 0, (height, width))
        image = np.where(shape[..., None], ground // 3 + np.array([160, 20, 20], np.uint8), ground)
        frame, regions = Frame(number, number / 25, image), marked({1: shape}) if not number else Regions.empty()
        worked = time.process_time()
        state, _ = ours.step(state, frame, regions)
        if number > WARM:
            spent.append(time.process_time() - worked)
    return 1e3 * float(np.median(spent))


def marked(shapes: Mapping[int, Bits]) -> Regions:
    """Return what a user marks: ids and masks (H, W)."""
    if not shapes:
        return Regions.empty()
    masks = [Mask.of_image(shape) for shape in shapes.values()]
    return Regions.of([mask.box for mask in masks], masks=masks, data={"mark": np.array(list(shapes))})


def area_table(frames: Sequence[Area]) -> Table:
    rows = [[one.frame, f"{one.update:.1f}", f"{one.step:.1f}"] for one in frames]
    pixels = [one.pixels for one in frames]
    slopes = [exponent(pixels, times) for times in zip(*((one.update, one.step) for one in frames), strict=True)]
    rows.append(["slope", *(f"{slope:.2f}" for slope in slopes)])
    title = "area: one object of 100x200, milliseconds of the processor"
    return Table(title, ["frame", "an update", "a whole step of the tracker"], rows)


# Stages -----------------------------------------------------------------------------------------------------

STAGES: dict[
    str, tuple[tuple[Any, str], ...]
] = {  # stage -> where its functions are looked up, and their names there
    "place and camera": tuple((tracker, name) for name in ("lab_of", "small_grey", "moved_on", "learnt_place")),
    "flow": ((looking, "velocity_by_flow"),),
    "evidence": ((looking, "evidence"),),
    "search": ((looking, "_shifted"),),
    "registration": ((looking, "registered"),),
    "update": ((updating, "observed"),),
    "looks": ((updating, "_learnt"),),
    "silhouettes": tuple((room, "silhouette_of") for room in (births, looking, tracker)),
    "saying": ((tracker, "rows_of"),),
}


class Stopwatch:
    """Seconds spent by name; what a stage calls counts as its own."""

    def __init__(self) -> None:
        self.spent: Counter[str] = Counter()
        self._within = False

    def wrapped(self, name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function, its time counted."""

        def timed(*given: Any, **named: Any) -> Any:
            if self._within:
                return work(*given, **named)
            self._within, begun = True, time.perf_counter()
            try:
                return work(*given, **named)
            finally:
                self.spent[name] += time.perf_counter() - begun
                self._within = False

        return timed


@contextlib.contextmanager
def stages_timed(watch: Stopwatch) -> Iterator[None]:
    """Count the time of every stage while this lasts."""
    with contextlib.ExitStack() as stack:
        for stage, (place, name) in ((stage, one) for stage, all_ in STAGES.items() for one in all_):
            stack.enter_context(mock.patch.object(place, name, watch.wrapped(stage, getattr(place, name))))
        yield


class Steps(NamedTuple):
    """Milliseconds a frame of a clip."""

    clip: str
    frames: int
    objects: float  # a frame
    stages: Mapping[str, float]
    whole: float
    bare: float  # a pass of DIS
    processor: float  # of the whole, by the processor

    def as_json(self) -> dict[str, Any]:
        return self._asdict() | {"stages": dict(self.stages), "ratio": self.whole / self.bare}


def stages_of(folder: Path) -> Steps | None:
    """Time the tracker on a composite; None if it is not there."""
    if not (folder / "clip.json").exists():
        print(f"note: composites/{folder.name} is not there; it is left out", file=sys.stderr)
        return None
    marks: dict[int, dict[int, Bits]] = {}
    for one in json.loads((folder / "clip.json").read_text(encoding="utf-8"))["objects"]:
        drawn = read_indices(folder / one["first_full"]["mask"]) > 0
        marks.setdefault(one["first_full"]["frame"] - 1, {})[one["id"]] = drawn
    source = open_source(str(folder / "video.mp4"))
    try:
        return steps_of(folder.name, source, source.scene(None), marks)
    finally:
        source.close()


def steps_of(
    clip: str, frames: Iterator[Frame] | Any, scene: Scene, marks: Mapping[int, Mapping[int, Bits]]
) -> Steps:
    """Time the steps in which what was marked is followed."""
    ours, watch = Contour(smallest=1.0), Stopwatch()
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    state, before, counted, rows = ours.start(scene), None, 0, 0
    whole = bare = processor = 0.0
    for frame in frames:
        now = cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY)
        regions = marked(marks.get(frame.index, {}))
        if frame.index > max(marks) + WARM and state.targets:
            begun = time.perf_counter()
            search.calc(before, now, None)
            bare += time.perf_counter() - begun
            with stages_timed(watch):
                begun, worked = time.perf_counter(), time.process_time()
                state, report = ours.step(state, frame, regions)
                whole, processor = whole + time.perf_counter() - begun, processor + time.process_time() - worked
            counted, rows = counted + 1, rows + len(report.rows)
        else:
            state, _ = ours.step(state, frame, regions)
        before = now
    if not counted:
        raise ParameterError(f"{clip}: nothing is followed for more than {WARM} frames")
    a_frame = {stage: 1e3 * watch.spent[stage] / counted for stage in STAGES}
    step = 1e3 * whole / counted
    parts = a_frame | {"the rest": step - sum(a_frame.values())}
    return Steps(clip, counted, rows / counted, parts, step, 1e3 * bare / counted, 1e3 * processor / counted)


def stages_table(steps: Sequence[Steps]) -> Table:
    """A row per stage, the whole, and the bare pass; a column per clip."""
    rows = [
        [stage, *(f"{one.stages[stage]:.1f} ({one.stages[stage] / one.whole:.0%})" for one in steps)]
        for stage in steps[0].stages
    ]
    rows.append(["whole step", *(f"{one.whole:.1f}" for one in steps)])
    rows.append(["the same, by the processor", *(f"{one.processor:.1f}" for one in steps)])
    rows.append(["a bare pass of DIS", *(f"{one.bare:.1f}" for one in steps)])
    rows.append(["step / pass", *(f"{one.whole / one.bare:.2f}" for one in steps)])
    head = [f"{one.clip}, {one.objects:.1f} objects" for one in steps]
    return Table("stages: milliseconds a frame, by the clock", ["stage", *head], rows)


# The page ---------------------------------------------------------------------------------------------------


def section(command: str, result: Result, page: str = "") -> str:
    """Return what stands between the marks in docs/contour-observer.md; tables of parts that were not run stay."""
    kept = [(title, table) for title, table in MARKS.tables(page) if title.partition(":")[0] not in result.told]
    written = [*kept, *((one.title, markdown(one)) for one in result.tables)]
    told = ", ".join(f"{name} {version}" for name, version in result.told["versions"].items())
    tables = [table for part in PARTS for title, table in written if title.startswith(f"{part}:")]
    return "\n\n".join([f"`{command}`", *tables, f"Versions: {told}."])


if __name__ == "__main__":
    main()

"""What the pool of features and the multi-feature tracker cost.

    python bench/features.py [--parts pool steps] [--frames N] [--json] [--write]

pool   OBJECTS objects of SIZE pixels in a drawn film of PICTURE pixels, each feature of the pool: `describe`, of all
       regions of a frame, and `similarity`, of the pairs of two consecutive frames that pass the gate: those whose
       displacement_2d similarity is above 0, as the tracker has it. Beside it what the same costs pair by pair: for
       each such pair both regions are described anew, and the kernels are their twins in NumPy and SciPy (of
       PAIRWISE pairs a frame; of hog, each is a film of two frames with one region).
steps  whole steps of the tracker: on that film with the eight features of the paper, each of weight 1, and at its
       defaults; and on CROWD boxes without pictures, at its defaults and with the eight (of which three are known).
       One detection of ten is missing, and boxes jitter by a pixel.

Milliseconds are CPU time of one thread (OpenCV has one too), medians over the frames after WARM; the ground plane is
known, so that distances in metres are computed. --write puts the tables into docs/benchmarks.md and leaves those of
other parts there; --json prints everything as one object in the last line.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import cv2
import numpy as np
from numpy.typing import NDArray
from pages import Marks, given, versions
from regions import Table, chosen, markdown

from perdure.errors import ParameterError, PerdureError
from perdure.features.feature import Feature, Float
from perdure.features.pool import PAPER, POOL
from perdure.scene.ground import Ground
from perdure.trackers.multifeature import MultiFeature
from perdure.types import Frame, Regions, Scene

PARTS = ("pool", "steps")
ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "benchmarks.md"
MARKS = Marks.of("bench/features.py", PAGE)
OBJECTS, CROWD = 50, 200
SIZE = (40, 100)  # width and height of an object
PICTURE, WIDE = (768, 576), (1920, 1080)  # width and height: of the film, of the crowd without pictures
FPS = 25.0
WARM = 5  # frames that do not count
PAIRWISE = 4  # pairs of a frame that are compared one by one
GATE = "displacement_2d"
MARGIN = 16  # pixels round two regions that are compared by themselves
KERNELS = ("colours", "covariances", "dominant", "nearest_alike")


def main() -> None:
    arguments = _arguments()
    try:
        cv2.setNumThreads(1)
        result = measure(arguments.parts, arguments.frames)
        given(result, arguments, PAGE, MARKS, section)
    except PerdureError as error:
        print(f"features.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", metavar="NAME", default=PARTS, help=", ".join(PARTS))
    parser.add_argument("--frames", type=int, default=60, help="of every film")
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the tables in docs/benchmarks.md")
    return parser.parse_args()


@dataclass(frozen=True)
class Result:
    """The tables of the parts that were asked for, and everything as plain values."""

    tables: tuple[Table, ...]
    told: Mapping[str, Any]


def measure(parts: Sequence[str], frames: int) -> Result:
    """Run the parts that are named."""
    wanted = chosen(parts, {name: [name] for name in PARTS}, "part")
    if frames < WARM + 2:
        raise ParameterError(f"frames = {frames} is out of range: it must be {WARM + 2} or more")
    tables: list[Table] = []
    told: dict[str, Any] = {"versions": versions()}
    if "pool" in wanted:
        film = drawn(OBJECTS, PICTURE, frames)
        costs = [cost_of(name, film) for name in POOL]
        tables.append(pool_table(costs))
        told["pool"] = [one.as_json() for one in costs]
    if "steps" in wanted:
        steps = [*steps_of(drawn(OBJECTS, PICTURE, frames)), *steps_of(drawn(CROWD, WIDE, frames, pictures=False))]
        tables.append(steps_table(steps))
        told["steps"] = [one._asdict() for one in steps]
    return Result(tuple(tables), told)


# The film ---------------------------------------------------------------------------------------------------


Seen = tuple[Frame, Regions]


class Film(NamedTuple):
    """Frames and what is detected in them."""

    scene: Scene
    seen: tuple[Seen, ...]


def drawn(objects: int, picture: tuple[int, int], frames: int, *, pictures: bool = True) -> Film:
    """Draw objects that walk straight on, each in clothes of its own, over a still background."""
    rng = np.random.default_rng(7)
    width, height = picture
    half = np.array(SIZE) / 2
    begin = rng.uniform(half, np.array(picture) - half, (objects, 2))
    speed = rng.normal(0, 1.5, (objects, 2))  # pixels a frame
    place = cloth(rng, height, width, 8.0)
    clothes = [cloth(rng, SIZE[1], SIZE[0], 3.0) for _ in range(objects)]
    ground = Ground(np.diag([0.02, 0.02, 1.0]), picture, np.zeros((9, 9)), np.zeros(3))
    seen = []
    for index in range(frames):
        middle = np.clip(begin + speed * index, half, np.array(picture) - half)
        order = np.argsort(middle[:, 1])
        jitter = rng.normal(0, 1.0, (objects, 4))
        boxes = np.concatenate([middle - half, middle + half], axis=1) + jitter
        there = rng.random(objects) > 0.1
        image = _painted(place, clothes, middle - half, order) if pictures else None
        regions = Regions.of(boxes[there].astype(np.float32), scores=np.full(there.sum(), 0.9))
        seen.append((Frame(index, index / FPS, image), regions))
    return Film(Scene(width, height, FPS, ground=ground), tuple(seen))


def cloth(rng: np.random.Generator, height: int, width: int, blur: float) -> NDArray[np.uint8]:
    """Return a pattern (height, width, 3) of colours about one of its own."""
    noise = cv2.GaussianBlur(rng.normal(0, 1, (height, width, 3)), (0, 0), blur)
    shades = rng.uniform(60, 190, 3) + 35 * noise / noise.std()
    return np.asarray(np.clip(shades + rng.normal(0, 2, shades.shape), 0, 255), np.uint8)


def _painted(
    place: NDArray[np.uint8],
    clothes: Sequence[NDArray[np.uint8]],
    corners: NDArray[np.float64],
    order: NDArray[np.intp],
) -> NDArray[np.uint8]:
    """The picture: who stands lowest is in front."""
    image = place.copy()
    for k in order.tolist():
        x, y = np.rint(corners[k]).astype(int).tolist()
        image[y : y + SIZE[1], x : x + SIZE[0]] = clothes[k]
    return image


# The pool ---------------------------------------------------------------------------------------------------


class Cost(NamedTuple):
    """Milliseconds a frame of one feature."""

    feature: str
    describe: float
    similarity: float
    pairs: float  # a frame
    plain: float  # pair by pair

    @property
    def whole(self) -> float:
        return self.describe + self.similarity

    @property
    def ratio(self) -> float:
        return self.plain / self.whole

    def as_json(self) -> dict[str, Any]:
        return self._asdict() | {"whole": self.whole, "ratio": self.ratio}


class Pairs(NamedTuple):
    """Regions of two frames that pass the gate."""

    one: NDArray[np.intp]  # (P,)
    other: NDArray[np.intp]
    elapsed: NDArray[np.float64]


def gated(scene: Scene, before: Seen, now: Seen) -> Pairs:
    """Return the pairs of two frames that are near enough to be linked."""
    gate = POOL[GATE](scene)
    (_, mine), (_, theirs) = (gate.describe({}, *one) for one in (before, now))
    one, other = (part.ravel() for part in np.meshgrid(*map(np.arange, (len(mine), len(theirs))), indexing="ij"))
    elapsed = np.full(len(one), now[0].time - before[0].time)
    near = gate.similarity(mine[one], theirs[other], elapsed) > 0
    return Pairs(one[near], other[near], elapsed[near])


def cost_of(name: str, film: Film) -> Cost:
    """Time one feature on a film, and a few pairs of each frame one by one."""
    feature = POOL[name](film.scene)
    memory, rows = feature.start(film.scene), np.zeros(0, np.float32)
    describe, similarity, counts, plainly = [], [], [], []
    for number, now in enumerate(film.seen):
        begun = time.thread_time()
        memory, new = feature.describe(memory, *now)
        middle = time.thread_time()
        if number >= WARM:
            describe.append(middle - begun)
            before = film.seen[number - 1]
            pairs = gated(film.scene, before, now)
            begun = time.thread_time()
            feature.similarity(rows[pairs.one], new[pairs.other], pairs.elapsed)
            similarity.append(time.thread_time() - begun)
            counts.append(len(pairs.one))
            if number < 3 * WARM:  # some frames do: it is slow
                with twins():
                    plainly += [pair_by_pair(POOL[name], film.scene, before, now, *one) for one in some(pairs)]
        rows = new
    ms = [1e3 * statistics.median(one) for one in (describe, similarity, plainly)]
    mean = float(np.mean(counts))
    return Cost(name, ms[0], ms[1], mean, ms[2] * mean)


def some(pairs: Pairs) -> Iterator[tuple[int, int]]:
    """Yield a few of the pairs, evenly spread."""
    for k in np.linspace(0, len(pairs.one) - 1, PAIRWISE).astype(int).tolist():
        yield int(pairs.one[k]), int(pairs.other[k])


def pair_by_pair(
    feature: Callable[[Scene], Feature], scene: Scene, before: Seen, now: Seen, one: int, other: int
) -> float:
    """Return the seconds that it takes to describe and compare two regions by themselves."""
    pair = cut_out(scene, (before[0], before[1].take([one])), (now[0], now[1].take([other])))
    begun = time.thread_time()
    alone(feature, pair)
    return time.thread_time() - begun


def cut_out(scene: Scene, before: Seen, now: Seen) -> Film:
    """Return two frames with a region each as a film of the part of the picture that has both."""
    both = np.concatenate([before[1].boxes, now[1].boxes])
    left, top = np.maximum(np.floor(both[:, :2].min(axis=0)).astype(int) - MARGIN, 0).tolist()
    right, bottom = (np.ceil(both[:, 2:].max(axis=0)).astype(int) + MARGIN).tolist()
    parts = []
    for frame, regions in (before, now):
        image = None if frame.image is None else np.ascontiguousarray(frame.image[top:bottom, left:right])
        shifted = Regions.of(regions.boxes - np.array([left, top, left, top], np.float32), scores=regions.scores)
        parts.append((replace(frame, image=image), shifted))
    size = min(right, scene.width) - left, min(bottom, scene.height) - top
    return Film(Scene(*size, scene.fps, ground=scene.ground), tuple(parts))


def alone(make: Callable[[Scene], Feature], pair: Film) -> Float:
    """Return the similarity (1,) of the regions of two frames, described for this pair alone."""
    feature = make(pair.scene)
    before, now = pair.seen
    memory, mine = feature.describe(feature.start(pair.scene), *before)
    _, theirs = feature.describe(memory, *now)
    return feature.similarity(mine, theirs, np.array([now[0].time - before[0].time]))


@contextlib.contextmanager
def twins() -> Iterator[None]:
    """Let the features' kernels be their twins in NumPy and SciPy while this lasts."""
    with contextlib.ExitStack() as stack:
        for name in KERNELS:
            module = importlib.import_module(f"perdure.maths.kernels.{name}")
            for twin in [one for one in vars(module) if one.endswith("_twin")]:
                stack.enter_context(mock.patch.object(module, twin.removesuffix("_twin"), getattr(module, twin)))
        yield


def pool_table(costs: Sequence[Cost]) -> Table:
    """A row for each feature, one for the paper's eight together."""
    rows = [[one.feature, *_times(one)] for one in costs]
    eight = [one for one in costs if one.feature in PAPER]
    describe, similarity, plainly = (
        sum(getattr(one, name) for one in eight) for name in ("describe", "similarity", "plain")
    )
    rows.append(["the paper's eight", *_times(Cost("", describe, similarity, 0.0, plainly))])
    title = (
        f"pool: {OBJECTS} objects of {SIZE[0]}x{SIZE[1]} at {PICTURE[0]}x{PICTURE[1]}, "
        f"{costs[0].pairs:.0f} pairs a frame through the gate"
    )
    return Table(
        title, ["feature", "describe, ms", "similarity, ms", "both, ms", "pair by pair, ms", "ratio"], rows
    )


def _times(one: Cost) -> list[str]:
    return [f"{value:.2f}" for value in (one.describe, one.similarity, one.whole)] + [
        f"{one.plain:.0f}",
        f"{one.ratio:.0f}",
    ]


# Steps ------------------------------------------------------------------------------------------------------


class Step(NamedTuple):
    """What a step of the tracker takes."""

    given: str
    weights: str
    ms: float
    slowest: float  # ms, of the slowest tenth the fastest


def steps_of(film: Film) -> list[Step]:
    """Time the tracker with the eight features, and at its defaults."""
    eight = ",".join(f"{name}=1" for name in PAPER)
    ways: dict[str, Callable[[], MultiFeature]] = {
        "the eight": lambda: MultiFeature(weights=eight),
        "defaults": MultiFeature,
    }
    return [timed(film, name, make()) for name, make in ways.items()]


def timed(film: Film, name: str, tracker: MultiFeature) -> Step:
    """Time every step of a tracker on a film."""
    state, spent = tracker.start(film.scene), []
    for frame, regions in film.seen:
        begun = time.thread_time()
        state, _ = tracker.step(state, frame, regions)
        spent.append(time.thread_time() - begun)
    counted = 1e3 * np.array(spent[WARM:])
    boxes = float(np.mean([len(regions) for _, regions in film.seen]))
    seen = "pictures" if film.seen[0][0].image is not None else "no pictures"
    given = (
        f"{len(state.targets)} targets, {boxes:.0f} boxes a frame, {film.scene.width}x{film.scene.height}, {seen}"
    )
    return Step(given, name, float(np.median(counted)), float(np.quantile(counted, 0.9)))


def steps_table(steps: Sequence[Step]) -> Table:
    """A row for each film and set of weights."""
    rows = [[one.given, one.weights, f"{one.ms:.1f}", f"{one.slowest:.1f}"] for one in steps]
    title = "steps: whole steps of `multifeature`"
    return Table(title, ["given", "weights", "ms a frame", "9 of 10 within, ms"], rows)


# The page ---------------------------------------------------------------------------------------------------


def section(command: str, result: Result, page: str = "") -> str:
    """Return what stands between the marks in docs/benchmarks.md; a page's tables of parts that were not run stay."""
    kept = [(title, table) for title, table in MARKS.tables(page) if title.partition(":")[0] not in result.told]
    written = [*kept, *((one.title, markdown(one)) for one in result.tables)]
    told = ", ".join(f"{name} {version}" for name, version in result.told["versions"].items())
    tables = [table for part in PARTS for title, table in written if title.startswith(f"{part}:")]
    return "\n\n".join([f"`{command}`", *tables, f"Versions: {told}."])


if __name__ == "__main__":
    main()

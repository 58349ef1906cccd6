"""How good regions are before any tracker: our detectors beside OpenCV's background subtractors.

    python bench/regions.py [--data DIR] [--clips NAME ...] [--methods NAME ...] [--json] [--write] [--draw DIR]

`measure(method, clip)` is the whole of it; everything else reads truth or prints tables.

Methods: every detector of `perdure.detect` that needs pixels and gives silhouettes, as `perdure track` runs it on a file, its first
look over all of it included, and as NAME-cold without that look, as on a live source; MOG2, KNN, GSOC, LSBP,
CNT of cv2 at their defaults, each cold at the first frame, fed BGR, shadow pixels (127) counted as background.
A peer's foreground becomes regions by the stage that ours uses: `regions_of` of
`perdure.detect.components` with the parameters of `Background()`, without a model. GSOC and LSBP draw at random: their figures
differ by up to .01 from run to run, all others are the same.

Every frame of a clip is seen by every method. Scored are those with truth, from the 26th of the video on
(`SETTLING`): KNN and CNT call everything foreground in their first frames, whatever they see.

Pixels: true and false positives and negatives are summed over the scored frames; precision, recall and
F-measure come from the sums. `raw` is the foreground as the model gives it, `regions` the union of the
regions' masks. Truth is CDnet's (255 moving; 0 and 50, shadow, background; 85 and 170 not counted, nor what
lies outside ROI.bmp) or the union of a composite's gt/visible.txt (cast shadows are background).

Regions: in each frame regions are paired with truth boxes, as many pairs of IoU >= 0.5 as possible and of
those the most IoU. A truth row with flag 0 is ignored: it is not sought, and a region without a pair that
overlaps one by IoU >= 0.5 is not counted.
  all        precision = pairs / counted regions, recall = pairs / truth boxes
  isolated   a truth box is isolated if it shares no area with any other truth box of the frame, ignored ones
             included, after each grew by a tenth of its width and height about its centre.
             recall = pairs with isolated boxes / isolated boxes; precision = the same pairs / (these pairs
             + counted regions without a pair that touch no box that is not isolated)
A composite's truth boxes are amodal (gt/gt.txt): a hidden object is sought too, so recall has a ceiling.
PETS's truth leaves out some people who are far away or half in the picture: precision has a ceiling there.
A share of nothing (no region, no truth) is 0.

Changes of light: where a composite's clip.json tells the light's gain of every frame, false pixels of the regions a frame
that lie outside of the truth boxes (grown as above), mean over the second before a change and over the second that begins two seconds after it. A change begins where the
gain has gone .02 from where it stood and ends where it is within .02 of the next turning point.

Time: on the first clip of each group, in a pass of its own, all methods and MOG2 take turns on each decoded
frame; medians over frames 26 to 100. `foreground` is the model alone, `regions` with the stage behind it.
Threads are as each library has them by default.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, reduce
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import cv2
import numpy as np

from perdure.detect import DETECTORS, Background
from perdure.detect.components import regions_of
from perdure.errors import ParameterError, PerdureError
from perdure.features.boxes import centres, intersections, overlaps, sizes
from perdure.files.video import Source, open_source
from perdure.files.whole import whole_file
from perdure.maths.assign import Assignment, assign
from perdure.pipeline import FIRST_LOOKS
from perdure.types import Bits, Boxes, Frame, Image, Regions

PEERS: dict[str, Callable[[], Any]] = {
    "MOG2": cv2.createBackgroundSubtractorMOG2,
    "KNN": cv2.createBackgroundSubtractorKNN,
    "GSOC": cv2.bgsegm.createBackgroundSubtractorGSOC,
    "LSBP": cv2.bgsegm.createBackgroundSubtractorLSBP,
    "CNT": cv2.bgsegm.createBackgroundSubtractorCNT,
}
OURS = ("background",)  # others see boxes alone
COLD = {f"{name}-cold": name for name in OURS if hasattr(DETECTORS[name], "prepare")}
METHODS = (*OURS, *COLD, *PEERS)
COMPOSITES = ("attractive", "behind2", "crossing2", "crowd8", "group4")
COMPOSITES += ("huddle4", "illumination", "lights", "turning", "whiteband")
CDNET = ("cdnet-highway", "cdnet-fall")
PETS = "pets09-s2l1"
CLIPS = (*CDNET, PETS, *COMPOSITES)

SETTLING = 25  # frames at the beginning of a video that are not scored
TIMED = 100  # frames, of which the first SETTLING warm up
SMALL = 0.02  # of the light's gain: no change yet
WINDOW, AFTER = 1.0, 2.0  # s: false pixels are counted for so long, before a change and so long after it
LEAST = 5  # scored frames before and after
SAME = 0.5  # IoU from which a region is a truth box's
GROWTH = 0.1  # of its size, by which a box grows before it may be isolated
ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "benchmarks.md"
BEGIN, END = "<!-- bench/regions.py begins -->", "<!-- bench/regions.py ends -->"
HEADING = "## Regions before any tracker"


def main() -> None:
    arguments = _arguments()
    try:
        methods = chosen(arguments.methods, {name: [name] for name in METHODS}, "method")
        names = chosen(arguments.clips, _clip_words(), "clip")
        result = run(arguments.data, names, methods, arguments.draw)
        tables = tables_of(result)
        print("\n\n".join(plain(one) for one in tables))
        if arguments.write:
            text = PAGE.read_text(encoding="utf-8")
            with whole_file(PAGE) as file:
                file.write(replaced(text, section(" ".join(["python bench/regions.py", *sys.argv[1:]]), tables)))
        if arguments.json:
            print(json.dumps(as_json(result)))
    except PerdureError as error:
        print(f"regions.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--data", type=Path, default=root, help="where the clips are")
    parser.add_argument("--clips", nargs="+", metavar="NAME", default=CLIPS, help=", ".join(_clip_words()))
    parser.add_argument("--methods", nargs="+", metavar="NAME", default=METHODS, help=", ".join(METHODS))
    parser.add_argument("--draw", type=Path, metavar="DIR", help="a picture per clip and method goes here")
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the section in docs/benchmarks.md")
    return parser.parse_args()


def _clip_words() -> dict[str, list[str]]:
    return {**{name: [name] for name in CLIPS}, "composites": list(COMPOSITES)}


def chosen(words: Iterable[str], known: Mapping[str, list[str]], what: str) -> list[str]:
    """Return what the user's words stand for, each once; ParameterError names all that is known."""
    for word in words:
        if word not in known:
            raise ParameterError(f"{word!r} is no {what}; there are: {', '.join(known)}")
    return list(dict.fromkeys(name for word in words for name in known[word]))


# Counts and scores


@dataclass(frozen=True)
class Counts:
    """Hits, false alarms and misses, of pixels or of boxes."""

    hits: int = 0
    false: int = 0
    missed: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(self.hits + other.hits, self.false + other.false, self.missed + other.missed)

    @property
    def precision(self) -> float:
        return _share(self.hits, self.hits + self.false)

    @property
    def recall(self) -> float:
        return _share(self.hits, self.hits + self.missed)

    @property
    def f_measure(self) -> float:
        return _share(2 * self.hits, 2 * self.hits + self.false + self.missed)


@dataclass(frozen=True)
class Scores:
    """Counts of some frames by what was counted: raw and union (pixels), all and isolated (regions)."""

    frames: int = 0
    pixels: int = 0  # counted ones, foreground or not
    counts: Mapping[str, Counts] = field(default_factory=dict)

    def __add__(self, other: Scores) -> Scores:
        keys = {**self.counts, **other.counts}
        counts = {key: self.counts.get(key, Counts()) + other.counts.get(key, Counts()) for key in keys}
        return Scores(self.frames + other.frames, self.pixels + other.pixels, counts)


@dataclass(frozen=True, eq=False)
class Labels:
    """The pixel truth of a frame."""

    moving: Bits  # (H, W)
    counted: Bits  # (H, W)


@dataclass(frozen=True, eq=False)
class Sought:
    """The boxes of a frame's truth."""

    counted: Boxes  # (N, 4)
    ignored: Boxes  # (M, 4)


@dataclass(frozen=True, eq=False)
class Look:
    """What a method sees in a frame."""

    regions: Regions
    raw: Bits | None  # (H, W) foreground before the region stage, if the method shows it
    foreground_time: float | None  # s of the model alone, if it shows it
    time: float  # s with the region stage


def score(look: Look, labels: Labels | None, sought: Sought | None) -> Scores:
    """Score one frame."""
    counts = {}
    if labels is not None:
        if look.raw is not None:
            counts["raw"] = pixel_counts(look.raw, labels)
        counts["union"] = pixel_counts(union(look.regions, *labels.moving.shape), labels)
    if sought is not None:
        counts["all"], counts["isolated"] = region_counts(look.regions.boxes, sought)
    return Scores(1, 0 if labels is None else int(np.count_nonzero(labels.counted)), counts)


def pixel_counts(foreground: Bits, labels: Labels) -> Counts:
    """Count the pixels of one frame."""
    seen, moving = foreground & labels.counted, labels.moving & labels.counted
    hits = np.count_nonzero(seen & moving)
    return Counts(int(hits), int(np.count_nonzero(seen) - hits), int(np.count_nonzero(moving) - hits))


def region_counts(found: Boxes, sought: Sought) -> tuple[Counts, Counts]:
    """Count the regions of one frame over all truth boxes and over the isolated ones."""
    pairs, left, missed = paired(found, sought.counted)
    left = left[~(overlaps(found[left], sought.ignored) >= SAME).any(axis=1)]
    alone = isolated(sought)
    crowd = np.concatenate([sought.counted[~alone], sought.ignored])
    clear = ~(intersections(found[left], crowd) > 0).any(axis=1)
    hits = np.count_nonzero(alone[pairs[:, 1]])
    return (
        Counts(len(pairs), len(left), len(missed)),
        Counts(int(hits), int(np.count_nonzero(clear)), int(np.count_nonzero(alone) - hits)),
    )


def paired(found: Boxes, sought: Boxes) -> Assignment:
    """Pair regions with truth boxes: as many as possible, of those the most IoU."""
    iou = overlaps(found, sought)
    return assign(np.where(iou >= SAME, 1.0 - iou, np.inf))


def isolated(sought: Sought) -> Bits:
    """Return which of the counted boxes share no area with any other box, each grown by GROWTH."""
    boxes = np.concatenate([sought.counted, sought.ignored])
    larger = grown(boxes)
    meets = intersections(larger, larger) > 0
    np.fill_diagonal(meets, False)
    return ~meets[: len(sought.counted)].any(axis=1)


def grown(boxes: Boxes) -> Boxes:
    """Return boxes grown by GROWTH about their centres."""
    middle, half = centres(boxes), sizes(boxes) * (1 + GROWTH) / 2
    return np.concatenate([middle - half, middle + half], axis=1)


def union(regions: Regions, height: int, width: int) -> Bits:
    """Return the pixels of all regions."""
    picture = np.zeros((height, width), np.bool_)
    for mask in regions.masks:
        picture |= mask.to_image(height, width)
    return picture


def _share(part: float, whole: float) -> float:
    return part / whole if whole else 0.0


# Methods


class Method(Protocol):
    """A model at work on one video."""

    def look(self, frame: Frame) -> Look:
        """Return what is seen in the next frame."""
        ...


class Ours:
    """A detector of ours; its foreground, where it shows it, comes from a second state that takes no time."""

    def __init__(self, detector: Any, source: Source) -> None:
        self.detector = detector
        self.state = detector.start(source.scene(None))
        self.beside = detector.start(source.scene(None))

    def look(self, frame: Frame) -> Look:
        begun = time.perf_counter()
        self.state, regions = self.detector.step(self.state, frame)
        taken, raw, foreground_time = time.perf_counter() - begun, None, None
        if hasattr(self.detector, "foreground"):
            begun = time.perf_counter()
            self.beside, foreground = self.detector.foreground(self.beside, frame)
            foreground_time, raw = time.perf_counter() - begun, foreground == 255
        return Look(regions, raw, foreground_time, taken)


class Peer:
    """A background subtractor of cv2, with our stage from foreground to regions behind it."""

    def __init__(self, name: str) -> None:
        self.model, self.stage = PEERS[name](), Background()

    def look(self, frame: Frame) -> Look:
        image = cv2.cvtColor(np.asarray(frame.image), cv2.COLOR_RGB2BGR)
        begun = time.perf_counter()
        said = self.model.apply(image)
        applied = time.perf_counter()
        foreground = cv2.threshold(said, 254, 255, cv2.THRESH_BINARY)[1]  # 127 is shadow
        regions = regions_of(foreground, self.stage.stage(image.shape[0], foreground.size))
        return Look(regions, foreground > 0, applied - begun, time.perf_counter() - begun)


def start(method: str, source: Source) -> Method:
    """Return a method before the first frame of a source."""
    if method in PEERS:
        return Peer(method)
    detector = DETECTORS[COLD.get(method, method)]()
    if method not in COLD and source.rereadable and hasattr(detector, "prepare"):
        detector = detector.prepare(source.sample(FIRST_LOOKS))
    return Ours(detector, source)


# Clips and their truth


class Change(NamedTuple):
    """A change of light; frames from 0."""

    begin: int
    end: int
    gain: float  # brightness after it, of that before it


@dataclass(frozen=True)
class Clip:
    """A video and its truth; a truth frame's number is the video's index plus `begins`."""

    name: str
    group: str
    source: Path
    begins: int
    numbers: range  # of the frames that have truth
    labels: Callable[[int], Labels] | None = None
    sought: Callable[[int], Sought] | None = None
    changes: tuple[Change, ...] = ()

    def scored(self, index: int) -> bool:
        """Return whether a video frame is scored."""
        return index >= SETTLING and index + self.begins in self.numbers

    def truth(self, index: int) -> tuple[Labels | None, Sought | None]:
        """Return the truth of a video frame."""
        number = index + self.begins
        return self.labels and self.labels(number), self.sought and self.sought(number)


def open_clip(data: Path, name: str) -> Clip | None:
    """Return a clip by name, None if it is not in the data folder."""
    folder = data / "composites" / name if name in COMPOSITES else data / name
    if not folder.is_dir():
        return None
    if name in CDNET:
        return _open_cdnet(folder)
    boxes = BoxTruth(folder / "gt" / "gt.txt")
    if name == PETS:
        return Clip(name, name, folder / "video.avi", 1, range(1, boxes.last + 1), sought=boxes)
    told = json.loads((folder / "clip.json").read_text(encoding="utf-8"))
    masks = MaskTruth(folder / "gt" / "visible.txt", told["height"], told["width"])
    gains = told.get("illumination")
    changes = tuple(changes_of(gains)) if isinstance(gains, list) else ()
    return Clip(name, "composites", folder / "video.mp4", 1, range(1, told["frames"] + 1), masks, boxes, changes)


def changes_of(gains: Sequence[float]) -> Iterable[Change]:
    """Yield the changes of light that the gain of every frame tells."""
    level, k = 0, 0
    while k < len(gains):
        if abs(gains[k] - gains[level]) <= SMALL:
            k += 1
            continue
        sign, turn = np.sign(gains[k] - gains[level]), k
        while turn + 1 < len(gains) and sign * (gains[turn + 1] - gains[turn]) > 0:
            turn += 1
        end = next(j for j in range(k, turn + 1) if abs(gains[j] - gains[turn]) <= SMALL)
        yield Change(k, end, gains[turn] / gains[level])
        level, k = turn, turn + 1


def _open_cdnet(folder: Path) -> Clip:
    images = folder / "input"
    source = images if images.is_dir() else folder / "video.avi"
    begins = min(int(one.stem[2:]) for one in images.iterdir()) if images.is_dir() else 1
    there = [int(one.stem[2:]) for one in (folder / "groundtruth").glob("gt*.png")]
    first, last = (int(word) for word in (folder / "temporalROI.txt").read_text().split())
    numbers = range(max(first, min(there)), min(last, max(there)) + 1)
    return Clip(folder.name, folder.name, source, begins, numbers, labels=PixelTruth(folder))


@dataclass(frozen=True)
class PixelTruth:
    """CDnet's label pictures."""

    folder: Path

    def __call__(self, number: int) -> Labels:
        labels = _grey(self.folder / "groundtruth" / f"gt{number:06d}.png")
        return cdnet_labels(labels, self.inside)

    @cached_property
    def inside(self) -> Bits:
        return _grey(self.folder / "ROI.bmp") > 0


def cdnet_labels(labels: Image, inside: Bits) -> Labels:
    """Return what CDnet's values say: 255 moving, 85 (outside) and 170 (unknown) not counted."""
    return Labels(labels == 255, inside & (labels != 85) & (labels != 170))


@dataclass(frozen=True)
class MaskTruth:
    """MOTS text: `frame id class H W RLE`, the union of all objects."""

    path: Path
    height: int
    width: int

    def __call__(self, number: int) -> Labels:
        from pycocotools import mask as coding

        moving = np.zeros((self.height, self.width), np.bool_)
        for code in self.codes.get(number, ()):
            moving |= coding.decode({"size": [self.height, self.width], "counts": code}).view(np.bool_)
        return Labels(moving, np.ones_like(moving))

    @cached_property
    def codes(self) -> dict[int, list[str]]:
        codes: dict[int, list[str]] = {}
        for line in self.path.read_text(encoding="ascii").splitlines():
            number, *_, code = line.split(" ")
            codes.setdefault(int(number), []).append(code)
        return codes


@dataclass(frozen=True)
class BoxTruth:
    """MOT text: `frame,id,left,top,width,height,flag,...`, frames and pixels from 1."""

    path: Path

    def __call__(self, number: int) -> Sought:
        rows = self.table[self.table[:, 0] == number]
        corner = rows[:, 2:4] - 1.0
        boxes = np.concatenate([corner, corner + rows[:, 4:6]], axis=1).astype(np.float32)
        return Sought(boxes[rows[:, 6] != 0], boxes[rows[:, 6] == 0])

    @cached_property
    def table(self) -> np.ndarray:
        return np.loadtxt(self.path, delimiter=",", ndmin=2)

    @property
    def last(self) -> int:
        return int(self.table[:, 0].max())


def _grey(path: Path) -> Image:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise ParameterError(f"{path} is not an image that can be read")
    return np.asarray(image, np.uint8)


# Measuring

Watch = Callable[[Frame, Look, "Labels | None", "Sought | None"], None]


class Times(NamedTuple):
    """Milliseconds a frame."""

    foreground: float | None  # the model alone; None if it does not show its foreground
    regions: float  # with the stage that makes regions


class Lit(NamedTuple):
    """False pixels a frame, before and after a change of light."""

    before: float
    after: float


class FalsePixels:
    """The false pixels of every frame of a clip, in its regions, outside of the truth boxes: not those of outlines."""

    def __init__(self) -> None:
        self.counts: dict[int, int] = {}

    def __call__(self, frame: Frame, look: Look, labels: Labels | None, sought: Sought | None) -> None:
        if labels is None or sought is None:
            return
        false = union(look.regions, *labels.moving.shape) & ~labels.moving
        for x1, y1, x2, y2 in grown(sought.counted).round().astype(int).clip(0).tolist():
            false[y1:y2, x1:x2] = False
        self.counts[frame.index] = int(np.count_nonzero(false))

    def around(self, change: Change, fps: float) -> Lit | None:
        """Return their mean before and after a change, None if fewer than LEAST scored frames show one of them."""
        long, wait = round(WINDOW * fps), round(AFTER * fps)
        spans = range(change.begin - long, change.begin), range(change.end + wait, change.end + wait + long)
        there = [[self.counts[index] for index in span if index in self.counts] for span in spans]
        return Lit(*map(statistics.fmean, there)) if min(map(len, there)) >= LEAST else None


@dataclass(frozen=True)
class Result:
    """Everything that was measured, by clip and method."""

    methods: list[str]
    groups: dict[str, list[str]]  # clips by group
    scores: dict[tuple[str, str], Scores]  # by clip and method
    times: dict[tuple[str, str], Times]  # by group and method
    lights: dict[tuple[str, Change, str], Lit]  # by clip, change and method

    def pooled(self, group: str, method: str) -> Scores:
        return reduce(Scores.__add__, (self.scores[clip, method] for clip in self.groups[group]))


def run(data: Path, names: Sequence[str], methods: list[str], drawings: Path | None = None) -> Result:
    """Measure every method on every clip that is there."""
    groups: dict[str, list[str]] = {}
    scores, times, lights = {}, {}, {}
    for name in names:
        clip = open_clip(data, name)
        if clip is None:
            print(f"note: {name} is not in {data}; it is left out", file=sys.stderr)
            continue
        if clip.group not in groups:
            times |= {(clip.group, method): taken for method, taken in time_methods(methods, clip).items()}
        groups.setdefault(clip.group, []).append(name)
        for method in methods:
            sheet = Sheet(clip) if drawings else None
            false = FalsePixels() if clip.changes else None
            scores[name, method] = measure(method, clip, *(one for one in (sheet, false) if one))
            for change in clip.changes if false else ():
                if lit := false.around(change, open_source(clip.source).scene(None).fps):
                    lights[name, change, method] = lit
            if sheet and drawings:
                sheet.save(drawings / f"{name}-{method}.png")
            print(f"{name} {method} measured", file=sys.stderr)
    if not groups:
        raise ParameterError(f"there is no clip in {data}; name another place with --data")
    return Result(methods, groups, scores, times, lights)


def measure(method: str, clip: Clip, *watches: Watch) -> Scores:
    """Run one method over one clip and score it; `watches` see every scored frame."""
    source, total = open_source(clip.source), Scores()
    try:
        model = start(method, source)
        for frame in source:
            look = model.look(frame)
            if clip.scored(frame.index):
                labels, sought = clip.truth(frame.index)
                total += score(look, labels, sought)
                for watch in watches:
                    watch(frame, look, labels, sought)
    finally:
        source.close()
    return total


def time_methods(methods: Sequence[str], clip: Clip) -> dict[str, Times]:
    """Return the times of each method and of MOG2, which take turns on each frame."""
    source = open_source(clip.source)
    try:
        models = {name: start(name, source) for name in dict.fromkeys([*methods, "MOG2"])}
        taken: dict[str, list[tuple[float | None, float]]] = {name: [] for name in models}
        for frame in islice(source, TIMED):
            for name, model in models.items():
                look = model.look(frame)
                taken[name].append((look.foreground_time, look.time))
    finally:
        source.close()
    return {name: _median_times(several[SETTLING:]) for name, several in taken.items()}


def _median_times(taken: Sequence[tuple[float | None, float]]) -> Times:
    alone = [1e3 * one for one, _ in taken if one is not None]
    return Times(statistics.median(alone) if alone else None, statistics.median(1e3 * one for _, one in taken))


# Tables


@dataclass(frozen=True)
class Table:
    """A title, the names of the columns and rows of cells."""

    title: str
    head: list[str]
    rows: list[list[str]]


def tables_of(result: Result) -> list[Table]:
    """Return all that was measured as tables: pooled by group, each composite, times."""
    tables = []
    for group, clips in result.groups.items():
        pooled = {method: result.pooled(group, method) for method in result.methods}
        title = clips[0] if len(clips) == 1 else f"{group}, {len(clips)} clips pooled"
        tables += _pooled_tables(title, pooled)
        if len(clips) > 1:
            tables += [_clip_table(result, clips, what, key) for what, key in _EACH.items()]
    return [*tables, *([_light_table(result)] if result.lights else []), _time_table(result)]


_EACH = {
    "F-measure of pixels": "union",
    "F-measure of regions": "all",
    "F-measure of isolated regions": "isolated",
}
_PAIRS = {"pixels": {"raw": "raw", "union": "in regions"}, "regions": {"all": "all", "isolated": "isolated"}}


def _pooled_tables(title: str, pooled: Mapping[str, Scores]) -> Iterable[Table]:
    """Yield a table of pixels and one of regions, as far as there is truth for them."""
    for what, columns in _PAIRS.items():
        keys = [key for key in columns if any(key in one.counts for one in pooled.values())]
        if keys:
            head = ["method", *(f"{columns[key]} {letter}" for key in keys for letter in "PRF")]
            rows = [[name, *(cell for key in keys for cell in _cells(one, key))] for name, one in pooled.items()]
            yield Table(f"{title}: {what} ({_size(pooled, what)})", head, rows)


def _cells(scores: Scores, key: str) -> list[str]:
    counts = scores.counts.get(key)
    if counts is None:
        return ["-"] * 3
    return [f"{value:.3f}" for value in (counts.precision, counts.recall, counts.f_measure)]


def _size(pooled: Mapping[str, Scores], what: str) -> str:
    scores = next(iter(pooled.values()))
    if what == "pixels":
        moving = scores.counts["union"].hits + scores.counts["union"].missed
        return f"{scores.frames} frames, {scores.pixels:,} pixels, {moving:,} of them moving"
    boxes, alone = (one.hits + one.missed for one in (scores.counts["all"], scores.counts["isolated"]))
    return f"{scores.frames} frames, {boxes} truth boxes, {alone} of them isolated"


def _clip_table(result: Result, clips: Sequence[str], what: str, key: str) -> Table:
    """A row per clip, a column per method."""
    rows = [
        [clip, *(f"{result.scores[clip, method].counts[key].f_measure:.3f}" for method in result.methods)]
        for clip in clips
    ]
    return Table(f"each clip: {what}", ["clip", *result.methods], rows)


def _light_table(result: Result) -> Table:
    """A row per change of light, a column per method."""
    changes = dict.fromkeys((clip, change) for clip, change, _ in result.lights)
    rows = [
        [
            clip,
            f"{change.begin} to {change.end}: x {change.gain:.2f}",
            *(
                f"{lit.before:.0f} → {lit.after:.0f}"
                for lit in (result.lights[clip, change, method] for method in result.methods)
            ),
        ]
        for clip, change in changes
    ]
    return Table(
        "false pixels a frame outside of the truth boxes, in the second before a change of light → in the third after it",
        ["clip", "frames, gain", *result.methods],
        rows,
    )


def _time_table(result: Result) -> Table:
    """A row per group and method: milliseconds, and how many times MOG2's they are."""
    rows = []
    for group in result.groups:
        reference = result.times[group, "MOG2"]
        for method in result.methods:
            own = result.times[group, method]
            alone = ["-", "-"]
            if own.foreground is not None and reference.foreground is not None:
                alone = [f"{own.foreground:.2f}", f"{own.foreground / reference.foreground:.2f}"]
            rows.append([group, method, *alone, f"{own.regions:.2f}", f"{own.regions / reference.regions:.2f}"])
    head = ["first clip of", "method", "foreground, ms", "x MOG2", "to regions, ms", "x MOG2 to regions"]
    return Table("milliseconds a frame", head, rows)


def plain(table: Table) -> str:
    """Return a table as text in columns."""
    widths = [max(len(row[i]) for row in (table.head, *table.rows)) for i in range(len(table.head))]
    lines = [
        "  ".join(
            cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in (table.head, *table.rows)
    ]
    return "\n".join([table.title, "", *lines])


def markdown(table: Table) -> str:
    """Return a table as Markdown under its title."""
    rows = [table.head, ["---"] * len(table.head), *table.rows]
    return "\n".join([f"**{table.title}**", "", *(f"| {' | '.join(row)} |" for row in rows)])


def section(command: str, tables: Iterable[Table]) -> str:
    """Return what stands between the marks in docs/benchmarks.md."""
    return "\n\n".join(
        [
            f"`{command}`",
            f"What is foreground, and which regions it makes, before any tracker: ours beside OpenCV's background\n"
            f"subtractors (cv2 {cv2.__version__}, Python {platform.python_version()}). {_PROTOCOL}",
            *(markdown(one) for one in tables),
        ]
    )


_PROTOCOL = f"""Peers run at their defaults and start cold;
`background` takes its first look over the whole file, as `perdure track` does, `background-cold` does not: like with
like is the second beside the peers. All see every frame, none is scored on the first {SETTLING}. Shadows are background.
*raw* is the model's own foreground, *in regions* what is left of it after the stage that makes regions, the same for
all. Regions are right at IoU {SAME} with a truth box, one to one; *isolated* boxes touch no other box of the frame, so
merged regions weigh on *all* only. P, R, F: precision, recall, F-measure of the summed counts. The script's docstring
has every definition."""


def replaced(page: str, inside: str) -> str:
    """Return a page with the section between the marks replaced, or put at the end with its heading.

    Raises
    ------
    ParameterError
        If only one of the marks is there, or they stand in the wrong order.
    """
    block = f"{BEGIN}\n{inside}\n{END}"
    if BEGIN not in page and END not in page:
        return f"{page.rstrip()}\n\n{HEADING}\n\n{block}\n"
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ParameterError(f"{PAGE} must have the lines {BEGIN!r} and {END!r}, in this order, or neither")
    return f"{before}{block}{after}"


def as_json(result: Result) -> dict[str, Any]:
    """Return everything as plain values."""
    return {
        "cv2": cv2.__version__,
        "python": platform.python_version(),
        "clips": {
            clip: {method: _score_json(result.scores[clip, method]) for method in result.methods}
            for clips in result.groups.values()
            for clip in clips
        },
        "pooled": {
            group: {method: _score_json(result.pooled(group, method)) for method in result.methods}
            for group in result.groups
        },
        "lights": [
            {"clip": clip, "begin": change.begin, "end": change.end, "method": method, **lit._asdict()}
            for (clip, change, method), lit in result.lights.items()
        ],
        "milliseconds": {
            group: {
                name: {"foreground": own.foreground, "regions": own.regions}
                for (where, name), own in result.times.items()
                if where == group
            }
            for group in result.groups
        },
    }


def _score_json(scores: Scores) -> dict[str, Any]:
    shares = ("precision", "recall", "f_measure")
    counts = {
        key: {**vars(one), **{share: round(getattr(one, share), 5) for share in shares}}
        for key, one in scores.counts.items()
    }
    return {"frames": scores.frames, "pixels": scores.pixels, **counts}


# Drawing

GREEN, RED, BLUE, GREY = (40, 220, 40), (230, 40, 40), (70, 110, 255), (150, 150, 150)
PANEL = 480  # pixels wide


class Sheet:
    """Four scored frames of a clip: the image, the truth, the raw foreground, the regions.

    Hits are green, misses red, false alarms blue, what is not counted dark; without a pixel truth the
    foreground is grey. Frames of the boxes: truth green if a region is paired with it and red if not,
    regions without a pair blue.
    """

    def __init__(self, clip: Clip) -> None:
        first = max(clip.numbers.start - clip.begins, SETTLING)
        last = clip.numbers.stop - 1 - clip.begins
        self.wanted = {first + (last - first) * share // 100 for share in (20, 40, 60, 80)}
        self.rows: list[Image] = []

    def __call__(self, frame: Frame, look: Look, labels: Labels | None, sought: Sought | None) -> None:
        if frame.index not in self.wanted:
            return
        image = np.array(frame.image)
        height, width = image.shape[:2]
        raw = np.zeros((height, width), np.bool_) if look.raw is None else look.raw
        truth = image // 2 if labels is None else coloured(labels.moving, labels)
        panels = [image, truth, coloured(raw, labels), coloured(union(look.regions, height, width), labels)]
        if sought is not None:
            draw_boxes(panels[1], sought.counted, GREEN)
            draw_boxes(panels[1], sought.ignored, GREY)
            draw_found(panels[3], look.regions.boxes, sought)
        size = (PANEL, round(PANEL * height / width))
        small = [cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in panels]
        cv2.putText(small[0], str(frame.index), (5, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 0), 2)
        for one in small:
            one[-2:] = one[:, -2:] = GREY
        self.rows.append(np.hstack(small))

    def save(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), cv2.cvtColor(np.vstack(self.rows), cv2.COLOR_RGB2BGR))


def coloured(foreground: Bits, labels: Labels | None) -> Image:
    """Return hits, misses and false alarms as colours, (H, W, 3) RGB."""
    picture = np.zeros((*foreground.shape, 3), np.uint8)
    if labels is None:
        picture[foreground] = GREY
        return picture
    picture[foreground & labels.moving] = GREEN
    picture[~foreground & labels.moving] = RED
    picture[foreground & ~labels.moving] = BLUE
    picture[~labels.counted] //= 3
    return picture


def draw_found(picture: Image, found: Boxes, sought: Sought) -> None:
    """Draw truth boxes, paired and missed, and the regions without a pair."""
    pairs, left, missed = paired(found, sought.counted)
    draw_boxes(picture, sought.counted[pairs[:, 1]], GREEN)
    draw_boxes(picture, sought.counted[missed], RED)
    draw_boxes(picture, found[left], BLUE)


def draw_boxes(picture: Image, boxes: Boxes, colour: tuple[int, int, int]) -> None:
    """Draw boxes into a picture."""
    for x1, y1, x2, y2 in boxes.round().astype(int).tolist():
        cv2.rectangle(picture, (x1, y1), (x2 - 1, y2 - 1), colour, 2)


if __name__ == "__main__":
    main()

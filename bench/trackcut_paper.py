"""What the paper of `trackcut` shows, repeated, and what is asked of masks elsewhere.

    python bench/trackcut_paper.py [--parts davis composites pets domain speed] [--data DIR] [--draw DIR] [--json] [--write]

davis       six sequences of DAVIS 2016 (val), from the mask of the first frame, at defaults, online. J is the mean
            IoU of mask and truth over all frames but the first and the last, as DAVIS counts. Beside it `contour`, and
            two baselines that see the same: `flow` carries each pixel of the mask by dense flow (DIS, the preset that the tracker
            has, on the whole picture), `flow + GrabCut` gives the carried mask to cv2.grabCut (2 iterations, in a box
            round it; GROWN pixels round its edge are open, the rest is certain), and goes on from what comes of it.
            OFL and BVS are published figures (PUBLISHED), not run here. Milliseconds are of the step alone, pictures
            decoded before, after a warm-up.
composites  the paper's 5.1 to 5.3 on drawn-together clips, from pixels, as `perdure track --tracker trackcut` runs:
            with everything, without the second energy (`--no-second`), and with observations in one frame of three.
            IoU is of the pixels of an object that are seen (gt/visible.txt, LEAST pixels or more) with the mask that
            bears its id in that frame, 0 where there is none; the mean over objects and frames. An object's id is
            the one that stands on it (IoU >= SAME, the best of the frame) most often; it is kept if no other ever
            does, and if it is no other object's. `whoever` is the IoU with the best mask of the frame, whatever its
            id. Silhouettes touch where those of gt/amodal.txt have a common pixel or neighbouring ones. An object is
            hidden while less than SEEN of its silhouette is seen, for GAP frames or more; told are the frames from
            the first one with more until its id stands on it again.
pets        PETS 2009 S2.L1 from pixels: `trackcut` beside `compound` on the same regions, those of the background
            detector with its first look over the file, found once and not told what a tracker believes; both are
            given the pictures. The figures are those of `perdure score` against gt/gt.txt: boxes of the settled rows
            that count. Frames/s are of the tracker's own calls, pictures decoded and regions found before.
domain      what it costs to cut an object out of a window and not of the whole picture: cut_domain.py says what is
            compared. On PETS and two composites with the background detector's regions, and on a sequence of DAVIS
            with the first mask, in one frame of SAMPLED (n of each).
speed       the share of each stage, on PETS 2009 S2.L1 at 768x576 with five objects (the five largest regions of a
            frame; when one of them is gone, five others), observations from the background detector; the rest of the
            step is what the stages leave. Beside it one bare pass of DIS on the same pictures (whole, the preset
            that the tracker has), in turn, frame by frame.

The data is read from $PERDURE_DATA or ../shared/data beside the repository; what is not there is left out with a note.
--draw writes film strips as the paper's figures 4 to 7; --write puts the tables into docs/track-and-cut.md, and leaves
those of other parts there; --json prints everything as one object in the last line. Threads are as OpenCV has them by default.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import cv2
import numpy as np
from cut_domain import Compared, compared, domain_table
from pages import Marks, absent, given, versions
from regions import Table, chosen, markdown

from perdure import fold
from perdure.detect import Background
from perdure.draw import Trails, paint
from perdure.errors import ParameterError, PerdureError
from perdure.features.masks import mask_overlaps
from perdure.files.mot import read_truth
from perdure.files.mots import read_masks
from perdure.files.video import open_source
from perdure.maths import flow
from perdure.metrics import score
from perdure.pipeline import FIRST_LOOKS, AnySource, plan
from perdure.trackers import TRACKERS
from perdure.trackers.trackcut import tracker as trackcut
from perdure.types import Bits, Frame, Image, Mask, Regions, Rows, Scene, Tracks

TRACKER = "trackcut"
PARTS = ("davis", "composites", "pets", "domain", "speed")
ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "track-and-cut.md"
WARM = 5  # frames of a new start that are not timed
MARKS = Marks.of("bench/trackcut_paper.py", PAGE)


def main() -> None:
    arguments = _arguments()
    try:
        result = measure(arguments)
        given(result, arguments, PAGE, MARKS, section)
    except PerdureError as error:
        print(f"trackcut_paper.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--parts", nargs="+", metavar="NAME", default=PARTS, help=", ".join(PARTS))
    parser.add_argument("--data", type=Path, default=root, help="where the clips are")
    parser.add_argument("--draw", type=Path, metavar="DIR", help="film strips go here")
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the tables in docs/track-and-cut.md")
    return parser.parse_args()


@dataclass(frozen=True)
class Result:
    """The tables of the parts that were asked for, and everything as plain values."""

    tables: tuple[Table, ...]
    told: Mapping[str, Any]


def measure(arguments: argparse.Namespace) -> Result:
    """Run the parts that the arguments name."""
    parts = chosen(arguments.parts, {name: [name] for name in PARTS}, "part")
    tables: list[Table] = []
    told: dict[str, Any] = {"versions": versions()}
    if "davis" in parts:
        carried = davis(arguments.data / "davis2016", arguments.draw)
        tables += [davis_table(carried)] if carried else []
        told["davis"] = [one.as_json() for one in carried]
    if "composites" in parts:
        watched = composites(arguments.data / "composites", arguments.draw)
        tables += composite_tables(watched) if watched else []
        told["composites"] = [one.as_json() for one in watched]
    if "pets" in parts:
        told_of = pets(arguments.data / "pets09-s2l1", arguments.draw)
        tables += [pets_table(told_of)] if told_of else []
        told["pets"] = [one.as_json() for one in told_of]
    if "domain" in parts:
        cut_twice = domain(arguments.data)
        tables += [domain_table(cut_twice)] if cut_twice else []
        told["domain"] = [one.as_json() for one in cut_twice]
    if "speed" in parts:
        speed = speed_of(arguments.data / "pets09-s2l1" / "video.avi")
        tables += [speed_table(speed)] if speed else []
        told["speed"] = speed and speed.as_json()
    return Result(tuple(tables), told)


# Masks from the first frame's -------------------------------------------------------------------------------

PUBLISHED = {  # J in hundredths: OFL (Tsai et al. 2016), BVS (Märki et al. 2016), as published for DAVIS 2016
    "car-shadow": (84.9, 57.7),
    "libby": (55.7, 78.2),
    "bmx-trees": (14.2, 37.6),
    "breakdance": (51.9, 49.7),
    "cows": (91.1, 89.5),
    "drift-chicane": (9.1, 2.3),
}
DAVIS_FPS = 24.0
ROUND = 40  # pixels round the carried mask in which GrabCut looks
GROWN = 10  # pixels within which of the carried edge a pixel is open
ITERATIONS = 2


class Film(NamedTuple):
    """A film and its truth, held in memory."""

    name: str
    frames: Sequence[Frame]
    truth: Sequence[Bits]  # (H, W) each


class Carried(NamedTuple):
    """How well a mask was carried through a film by a method."""

    film: str
    method: str
    overlaps: tuple[float, ...]  # IoU of each frame but the first
    milliseconds: float  # a frame

    @property
    def j(self) -> float:
        """The mean, without the last frame."""
        return float(np.mean(self.overlaps[:-1]))

    def as_json(self) -> dict[str, Any]:
        overlaps = [round(one, 4) for one in self.overlaps]
        return {"film": self.film, "method": self.method, "J": self.j, "ms": self.milliseconds, "IoU": overlaps}


Step = Callable[[Frame], Bits]
Begin = Callable[[Frame, Bits], Step]  # the first frame and its mask -> what finds the mask of each next one


def by_tracker(name: str, first: Frame, marked: Bits) -> Step:
    """Follow the mask by a tracker of ours."""
    tracker = TRACKERS[name]()
    height, width = marked.shape
    state, _ = tracker.step(tracker.start(Scene(width, height, DAVIS_FPS)), first, marked_regions(marked))

    def step(frame: Frame) -> Bits:
        nonlocal state
        state, report = tracker.step(state, frame, Regions.empty())
        found = [mask for number, mask in zip(report.rows.ids, report.rows.masks, strict=True) if number == 1]
        return found[0].to_image(height, width) if found else np.zeros((height, width), np.bool_)

    return step


def marked_regions(marked: Bits) -> Regions:
    """Return what a user marks with a mask (H, W)."""
    mask = Mask.of_image(marked)
    return Regions.of([mask.box], masks=[mask], data={"mark": np.array([1])})


def by_flow(first: Frame, marked: Bits) -> Step:
    """Carry each pixel of the mask by dense flow."""
    before, mask = grey_of(first), marked

    def step(frame: Frame) -> Bits:
        nonlocal before, mask
        now = grey_of(frame)
        before, mask = now, warped(mask, before, now)
        return mask

    return step


def by_flow_and_grabcut(first: Frame, marked: Bits) -> Step:
    """Carry the mask by dense flow, and cut it out anew."""
    before, mask = grey_of(first), marked

    def step(frame: Frame) -> Bits:
        nonlocal before, mask
        now = grey_of(frame)
        before, mask = now, grabcut(frame.image, warped(mask, before, now))
        return mask

    return step


def grey_of(frame: Frame) -> Image:
    return cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY)


def warped(mask: Bits, before: Image, now: Image) -> Bits:
    """Return a mask (H, W) of the picture before, each pixel where it is now."""
    vectors = flow.dense(before, now, preset="medium", astray=1e6).vectors  # (H, W, 2)
    height, width = mask.shape
    x = np.arange(width, dtype=np.float32) - vectors[..., 0]
    y = np.arange(height, dtype=np.float32)[:, None] - vectors[..., 1]
    return cv2.remap(mask.astype(np.float32), x, y, cv2.INTER_LINEAR, borderValue=0) > 0.5


def grabcut(image: Image, mask: Bits) -> Bits:
    """Return what GrabCut makes of a mask (H, W); the mask itself where it is too small to have an inside."""
    height, width = mask.shape
    x1, y1, x2, y2 = Mask.of_image(mask).box
    x1, y1, x2, y2 = max(x1 - ROUND, 0), max(y1 - ROUND, 0), min(x2 + ROUND, width), min(y2 + ROUND, height)
    inside = mask[y1:y2, x1:x2].astype(np.uint8)
    brush = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * GROWN + 1, 2 * GROWN + 1))
    core, near = cv2.erode(inside, brush), cv2.dilate(inside, brush)
    labels = np.where(near > 0, cv2.GC_PR_BGD, cv2.GC_BGD).astype(np.uint8)
    labels[inside > 0], labels[core > 0] = cv2.GC_PR_FGD, cv2.GC_FGD
    if not inside.any() or (near > 0).all():
        return mask
    cv2.setRNGSeed(0)
    part = cv2.cvtColor(image[y1:y2, x1:x2], cv2.COLOR_RGB2BGR)
    none = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(part, labels, (0, 0, 0, 0), *none, ITERATIONS, cv2.GC_INIT_WITH_MASK)
    found = np.zeros_like(mask)
    found[y1:y2, x1:x2] = (labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)
    return found


METHODS: dict[str, Begin] = {
    **{name: partial(by_tracker, name) for name in (TRACKER, "contour")},
    "flow": by_flow,
    "flow + GrabCut": by_flow_and_grabcut,
}


def davis(folder: Path, drawings: Path | None) -> list[Carried]:
    """Carry the first mask of every sequence that is there, by every method."""
    names = [name for name in PUBLISHED if not absent(folder / "JPEGImages" / name)]
    carried = []
    for name in names:
        film = davis_film(folder, name)
        if not carried:
            warm = Film(name, film.frames[:WARM], film.truth[:WARM])
            for method, begin in METHODS.items():
                carry(warm, method, begin)
        strips = {}
        for method, begin in METHODS.items():
            found, one = carry(film, method, begin)
            carried.append(one)
            strips[method] = found
        if drawings:
            wanted = np.linspace(0, len(film.frames) - 2, COLUMNS).astype(int).tolist()
            rows = [[(film.frames[k], found[k]) for k in wanted] for found in strips.values()]
            save_strip(drawings / f"davis-{name}.png", rows)
    return carried


def davis_film(folder: Path, name: str) -> Film:
    """Read a sequence."""
    frames, truth = [], []
    for number, path in enumerate(sorted((folder / "JPEGImages" / name).glob("*.jpg"))):
        image = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)
        frames.append(Frame(number, number / DAVIS_FPS, image))
        mask = cv2.imread(str(folder / "Annotations" / name / f"{path.stem}.png"), cv2.IMREAD_GRAYSCALE)
        if mask is None:
            raise ParameterError(f"{name} has no truth for the picture {path.name}")
        truth.append(mask > 0)
    if len(frames) < 3:
        raise ParameterError(f"{name} has {len(frames)} pictures; three or more are wanted")
    return Film(name, frames, truth)


def carry(film: Film, method: str, begin: Begin) -> tuple[list[Tracks], Carried]:
    """Carry the first mask through a film by a method: what was found in each frame, and how well."""
    step = begin(film.frames[0], film.truth[0])
    found, overlaps, spent = [rows_of(film.frames[0], film.truth[0])], [], 0.0
    for frame, truth in zip(film.frames[1:], film.truth[1:], strict=True):
        begun = time.perf_counter()
        mask = step(frame)
        spent += time.perf_counter() - begun
        overlaps.append(iou(mask, truth))
        found.append(rows_of(frame, mask))
    return found, Carried(film.name, method, tuple(overlaps), 1e3 * spent / len(overlaps))


def iou(one: Bits, other: Bits) -> float:
    """Return intersection over union; 1 for two empty masks."""
    either = np.count_nonzero(one | other)
    return np.count_nonzero(one & other) / either if either else 1.0


def rows_of(frame: Frame, mask: Bits) -> Tracks:
    """Return the row of the one object of a frame; none where nothing of it is seen."""
    one = Mask.of_image(mask)
    if not one.area:
        return Tracks.empty()
    return Tracks.of(frames=frame.index, times=frame.time, ids=[1], boxes=[one.box], masks=[one])


def davis_table(carried: Sequence[Carried]) -> Table:
    """A row per sequence, and their mean; the published figures behind."""
    found = {(one.film, one.method): one for one in carried}
    films = list(dict.fromkeys(one.film for one in carried))
    values = [
        [
            *(100 * found[film, method].j for method in METHODS),
            *PUBLISHED[film],
            *(found[film, method].milliseconds for method in METHODS),
        ]
        for film in films
    ]
    rows = [[film, *_told(one)] for film, one in zip(films, values, strict=True)]
    rows.append(["mean", *_told(np.mean(values, axis=0).tolist())])
    head = ["sequence", *METHODS, "OFL", "BVS", *(f"{method}, ms" for method in METHODS)]
    title = "davis: J in hundredths from the first frame's mask; OFL and BVS as published; milliseconds a frame"
    return Table(title, head, rows)


def _told(values: Sequence[float]) -> list[str]:
    """J with a decimal, times without."""
    last = len(METHODS)
    return [*(f"{one:.1f}" for one in values[:-last]), *(f"{one:.0f}" for one in values[-last:])]


# Composites -------------------------------------------------------------------------------------------------

CLIPS = {"crossing2": 0.85, "group4": 0.85, "whiteband": 0.85, "behind2": 0.75, "huddle4": 0.75}  # and the aim
SAME = 0.5  # IoU from which a mask stands on an object
LEAST = 40  # pixels seen, from which an object counts in a frame
SEEN = 0.1  # share of the silhouette below which an object is hidden
GAP = 5  # frames for which it is, at least


class Setting(NamedTuple):
    """How the tracker is run."""

    parameters: Mapping[str, object]
    every: int  # n: observations in one frame of n


SETTINGS = {
    "everything": Setting({}, 1),
    "no second energy": Setting({"second": False}, 1),
    "observed one frame in three": Setting({}, 3),
}


@dataclass(frozen=True)
class Seldom:
    """A detector whose regions are told in one frame of `every`; in the others nothing is observed."""

    detector: Any
    every: int
    needs_pixels = True

    def start(self, scene: Scene) -> Any:
        return self.detector.start(scene)

    def step(self, state: Any, frame: Frame) -> tuple[Any, Regions]:
        state, regions = self.detector.step(state, frame)
        return state, regions if frame.index % self.every == 0 else Regions.empty()

    def heed(self, state: Any, report: Any) -> Any:
        return self.detector.heed(state, report)


class Truth(NamedTuple):
    """What is seen of each object, and its whole silhouette."""

    visible: Rows
    whole: Rows


class Reading(NamedTuple):
    """An object in a frame in which it is seen."""

    frame: int
    object: int
    overlaps: Mapping[int, float]  # id -> IoU, of the masks that share a pixel with it
    touching: bool  # whether its silhouette touches another's

    @property
    def best(self) -> int:
        """The id whose mask fits best; 0 for none."""
        return max(self.overlaps, key=self.overlaps.__getitem__, default=0)

    @property
    def standing(self) -> int:
        """The id that stands on it; 0 for none."""
        return self.best if self.overlaps.get(self.best, 0.0) >= SAME else 0


class Hiding(NamedTuple):
    """A stretch of frames in which an object is hidden."""

    object: int
    begin: int
    end: int  # the first frame in which it is seen again


@dataclass(frozen=True)
class Watched:
    """What was told of a clip under a setting."""

    clip: str
    setting: str
    readings: tuple[Reading, ...]
    hidings: tuple[Hiding, ...]

    def own(self) -> dict[int, int]:
        """Object -> the id that stands on it most often; 0 where none ever does."""
        stands: dict[int, Counter[int]] = {}
        for one in self.readings:
            stands.setdefault(one.object, Counter())[one.standing] += 1
        return {number: _commonest(seen) for number, seen in sorted(stands.items())}

    def kept(self) -> list[int]:
        """The objects that have had one id, which no other has."""
        own = self.own()
        shared = Counter(own.values())
        return [
            number
            for number, name in own.items()
            if name
            and shared[name] == 1
            and {one.standing for one in self.readings if one.object == number} <= {0, name}
        ]

    def iou(self, touching: bool = False) -> float:
        """Return the mean IoU with the mask that has the object's id; of objects that touch another alone, if asked."""
        own = self.own()
        return _mean(
            one.overlaps.get(own[one.object], 0.0) for one in self.readings if one.touching or not touching
        )

    def whoever(self) -> float:
        """Return the mean IoU with the best mask, whatever its id."""
        return _mean(one.overlaps.get(one.best, 0.0) for one in self.readings)

    def again(self, hiding: Hiding) -> int | None:
        """Return after how many frames of being seen again its id stands on an object; None for never."""
        name = self.own()[hiding.object]
        frames = [
            one.frame
            for one in self.readings
            if one.object == hiding.object and one.frame >= hiding.end and one.standing == name != 0
        ]
        return min(frames) - hiding.end if frames else None

    def as_json(self) -> dict[str, Any]:
        return {
            "clip": self.clip,
            "setting": self.setting,
            "seen": len(self.readings),
            "IoU": self.iou(),
            "IoU touching": self.iou(touching=True),
            "IoU whoever": self.whoever(),
            "ids": self.own(),
            "kept": self.kept(),
            "found again": [one._asdict() | {"after": self.again(one)} for one in self.hidings],
        }


def _commonest(seen: Counter[int]) -> int:
    """The commonest id but 0; 0 where there is none."""
    return max((name for name in seen if name), key=seen.__getitem__, default=0)


def _mean(values: Iterator[float]) -> float:
    """The mean; NaN-free: 0 of nothing."""
    taken = list(values)
    return float(np.mean(taken)) if taken else 0.0


def composites(folder: Path, drawings: Path | None) -> list[Watched]:
    """Watch every clip that is there under every setting."""
    watched = []
    for name in CLIPS:
        if absent(folder / name):
            continue
        truth = Truth(*(read_masks(folder / name / "gt" / f"{which}.txt") for which in ("visible", "amodal")))
        video = folder / name / "video.mp4"
        strips = {}
        for setting, how in SETTINGS.items():
            strips[setting] = watch(str(video), how)
            watched.append(look(name, setting, strips[setting], truth))
            print(f"{name}, {setting}: IoU {watched[-1].iou():.3f}", file=sys.stderr, flush=True)
        if drawings:
            wanted = columns_of(watched[-1])
            source = open_source(str(video))
            frames = [frame for frame in source if frame.index in wanted]
            source.close()
            rows = [[(frame, said.in_frame(frame.index)) for frame in frames] for said in strips.values()]
            save_strip(drawings / f"composite-{name}.png", rows)
    return watched


def watch(source: AnySource, setting: Setting) -> Tracks:
    """Track a clip as `perdure track --tracker trackcut` does, in a setting."""
    run = plan(source, tracker=TRACKER, parameters=setting.parameters)
    try:
        run = run.prepared()
        if setting.every > 1:
            run = dataclasses.replace(run, detector=Seldom(run.detector, setting.every))
        return fold.settle(step.report for step in run.steps())
    finally:
        run.source.close()


def look(clip: str, setting: str, said: Tracks, truth: Truth) -> Watched:
    """Compare what was said with the truth."""
    readings = []
    for frame in np.unique(truth.visible.frames).tolist():
        rows = truth.visible.take(truth.visible.frames == frame)
        rows = rows.take([mask.area >= LEAST for mask in rows.masks])
        told = said.in_frame(frame)
        overlaps = mask_overlaps(rows.masks, told.masks)  # (N, M)
        close = touching(truth.whole.take(truth.whole.frames == frame))
        for number, row in zip(rows.ids.tolist(), overlaps, strict=True):
            ious = {int(name): float(value) for name, value in zip(told.ids, row, strict=True) if value > 0}
            readings.append(Reading(frame, number, ious, number in close))
    return Watched(clip, setting, tuple(readings), tuple(hidings(truth)))


def touching(rows: Rows) -> set[int]:
    """Return the ids whose silhouettes share a pixel with another's or lie next to it."""
    if len(rows) < 2:
        return set()
    height, width = rows.size
    grown = [
        cv2.dilate(one.to_image(height, width).astype(np.uint8), np.ones((3, 3), np.uint8)) for one in rows.masks
    ]
    total = np.sum([one.to_image(height, width) for one in rows.masks], axis=0)  # (H, W)
    own = [one.to_image(height, width) for one in rows.masks]
    return {
        int(name) for name, near, mine in zip(rows.ids, grown, own, strict=True) if (total - mine)[near > 0].any()
    }


def hidings(truth: Truth) -> Iterator[Hiding]:
    """Yield the stretches in which an object that is inside the picture is hidden, and after which it is seen again."""
    keys = zip(truth.visible.frames.tolist(), truth.visible.ids.tolist(), truth.visible.masks, strict=True)
    seen = {(frame, name): mask.area for frame, name, mask in keys}
    for name in np.unique(truth.whole.ids).tolist():
        rows = truth.whole.take(truth.whole.ids == name)
        order = np.argsort(rows.frames)
        frames = rows.frames[order].tolist()
        areas = [rows.masks[k].area for k in order]
        shares = [seen.get((frame, name), 0) / max(area, 1) for frame, area in zip(frames, areas, strict=True)]
        begun, before = None, False  # where it was hidden from, whether it was ever seen
        for frame, share in zip(frames, shares, strict=True):
            if share < SEEN:
                begun = frame if begun is None else begun
                continue
            if begun is not None and before and frame - begun >= GAP:
                yield Hiding(name, begun, frame)
            begun, before = None, True


def composite_tables(watched: Sequence[Watched]) -> list[Table]:
    """IoU, IoU where silhouettes touch, identities, and who was found again when."""
    found = {(one.clip, one.setting): one for one in watched}
    clips = list(dict.fromkeys(one.clip for one in watched))
    first = next(iter(SETTINGS))
    whole, close, ids, again = [], [], [], []
    for clip in clips:
        ours = [found[clip, setting] for setting in SETTINGS]
        base = found[clip, first]
        touch = sum(one.touching for one in base.readings)
        values = [f"{one.iou():.3f}" for one in ours]
        whole.append([clip, str(len(base.readings)), f"{CLIPS[clip]:.2f}", *values, f"{base.whoever():.3f}"])
        close.append([clip, str(touch), *(f"{one.iou(touching=True):.3f}" if touch else "-" for one in ours)])
        ids.append([clip, *(f"{len(one.kept())} of {len(one.own())}" for one in ours)])
        for hiding in base.hidings:
            after = ["never" if (frames := one.again(hiding)) is None else str(frames) for one in ours]
            again.append([clip, str(hiding.object), f"{hiding.begin} to {hiding.end - 1}", *after])
    head = list(SETTINGS)
    return [
        Table(
            "composites: mean IoU of the pixels seen of an object and of the mask with its id",
            ["clip", "objects x frames", "aim", *head, f"{first}, whoever"],
            whole,
        ),
        Table(
            "composites: the same where its silhouette touches another's",
            ["clip", "objects x frames", *head],
            close,
        ),
        Table("composites: objects that keep one id throughout", ["clip", *head], ids),
        Table(
            "composites: frames from being seen again until found", ["clip", "object", "hidden in", *head], again
        ),
    ]


# People from pixels -----------------------------------------------------------------------------------------

BESIDE = (TRACKER, "compound")
FIGURES = ("MOTA", "IDF1", "HOTA", "IDSW", "ids", "FP", "FN")


class Told(NamedTuple):
    """What a tracker made of the regions of a film."""

    tracker: str
    frames: int
    rate: float  # frames/s
    figures: Mapping[str, float]

    def as_json(self) -> dict[str, Any]:
        figures = {name: self.figures[name] for name in FIGURES}
        return {"tracker": self.tracker, "frames": self.frames, "frames/s": self.rate, **figures}


def pets(folder: Path, drawings: Path | None, limit: int | None = None) -> list[Told]:
    """Follow the people of a film by every tracker, on the same regions; of its first `limit` frames, if asked."""
    if absent(folder / "video.avi"):
        return []
    truth = read_truth(folder / "gt" / "gt.txt")
    source = open_source(str(folder / "video.avi"), end=None if limit is None else f"{limit}f")
    try:
        scene = source.scene(None)
        detector = Background().prepare(source.sample(FIRST_LOOKS))
        regions = [found for _, found in fold.detect(source, detector, scene)]
        truth = truth.between(0, len(regions) - 1)
        told, strips = [], []
        for name in BESIDE:
            said, seconds = told_by(TRACKERS[name](), zip(source, regions, strict=True), scene)
            told.append(Told(name, len(regions), len(regions) / seconds, score(said, truth).figures))
            print(f"{folder.name}, {name}: MOTA {told[-1].figures['MOTA']:.3f}", file=sys.stderr, flush=True)
            strips.append(said)
        if drawings:
            wanted = set(np.linspace(0, len(regions) - 1, COLUMNS + 2).astype(int)[1:-1].tolist())
            frames = [frame for frame in source if frame.index in wanted]
            rows = [[(frame, said.in_frame(frame.index)) for frame in frames] for said in strips]
            save_strip(drawings / f"{folder.name}.png", rows)
    finally:
        source.close()
    return told


def told_by(
    tracker: fold.Tracker[Any], seen: Iterable[tuple[Frame, Regions]], scene: Scene
) -> tuple[Tracks, float]:
    """Return the settled rows, and the seconds that the tracker itself took."""
    watch = Stopwatch()
    watch.runs = True
    start, step, finish = (watch.wrapped("own", one) for one in (tracker.start, tracker.step, tracker.finish))
    state, reports = start(scene), []
    for frame, regions in seen:
        state, report = step(state, frame, regions)
        reports.append(report)
    reports.append(finish(state))
    return fold.settle(reports), watch.spent["own"]


def pets_table(told: Sequence[Told]) -> Table:
    """A row per tracker."""
    rows = []
    for one in told:
        shares = [f"{100 * one.figures[name]:.1f}" for name in FIGURES[:3]]
        counts = [f"{one.figures[name]:.0f}" for name in FIGURES[3:]]
        rows.append([one.tracker, *shares, *counts, f"{one.rate:.1f}"])
    title = (
        f"pets: people of {told[0].frames} frames from pixels, on the same regions; MOTA, IDF1 and HOTA in percent"
    )
    return Table(title, ["tracker", *FIGURES[:3], "switches", *FIGURES[4:], "frames/s"], rows)


# The domain of a cut ----------------------------------------------------------------------------------------

SAMPLED = {  # clip -> n: one frame of n
    "pets09-s2l1/video.avi": 40,
    "composites/crossing2/video.mp4": 10,
    "composites/group4/video.mp4": 10,
    "davis2016/JPEGImages/breakdance": 4,
}


def domain(data: Path) -> list[Compared]:
    """Compare cuts in windows and over the whole picture, on every clip that is there."""
    found = []
    for clip, every in SAMPLED.items():
        if absent(data / clip):
            continue
        scene, seen = marked_first(data / clip) if "davis" in clip else observed(data / clip)
        found.append(compared(clip.split("/")[-1 if "davis" in clip else -2], seen, scene, every))
        print(f"{found[-1].clip}: {len(found[-1].cuts)} cuts", file=sys.stderr, flush=True)
    return found


Seen = tuple[Scene, Iterator[tuple[Frame, Regions]]]


def observed(path: Path) -> Seen:
    """Return every frame of a video with the background detector's regions."""
    source = open_source(str(path))
    scene = source.scene(None)
    return scene, fold.detect(source, Background().prepare(source.sample(FIRST_LOOKS)), scene)


def marked_first(path: Path) -> Seen:
    """Return every frame of a sequence of DAVIS, the first with its mask."""
    film = davis_film(path.parents[1], path.name)
    height, width = film.truth[0].shape
    regions = [marked_regions(film.truth[0]), *[Regions.empty()] * (len(film.frames) - 1)]
    return Scene(width, height, DAVIS_FPS), zip(film.frames, regions, strict=True)


# Speed ------------------------------------------------------------------------------------------------------

OBJECTS = 5
TIMED = 100  # frames
STAGES: dict[str, tuple[Any, str]] = {  # stage -> where its function is looked up, and its name there
    "look at the frame": (trackcut, "look_at"),
    "motion": (trackcut, "motion_between"),
    "expect": (trackcut, "expect"),
    "cut": (trackcut.TrackCut, "_cut"),
    "separate": (trackcut.TrackCut, "_separated"),
    "learn": (trackcut, "learnt"),
}


class Speed(NamedTuple):
    """Milliseconds a frame."""

    frames: int
    observed: float  # regions a frame
    stages: Mapping[str, float]
    whole: float
    bare: float  # a pass of DIS

    @property
    def ratio(self) -> float:
        return self.whole / self.bare

    def as_json(self) -> dict[str, Any]:
        return self._asdict() | {"stages": dict(self.stages), "ratio": self.ratio}


class Stopwatch:
    """Seconds spent by name, while it runs."""

    def __init__(self) -> None:
        self.spent: Counter[str] = Counter()
        self.runs = False

    def wrapped(self, name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function, its time counted."""

        def timed(*given: Any, **named: Any) -> Any:
            begun = time.perf_counter()
            try:
                return work(*given, **named)
            finally:
                if self.runs:
                    self.spent[name] += time.perf_counter() - begun

        return timed


@contextlib.contextmanager
def stages_timed(watch: Stopwatch) -> Iterator[None]:
    """Count the time of every stage while this lasts."""
    with contextlib.ExitStack() as stack:
        for stage, (place, name) in STAGES.items():
            stack.enter_context(mock.patch.object(place, name, watch.wrapped(stage, getattr(place, name))))
        yield


def speed_of(path: Path) -> Speed | None:
    """Time the tracker on a video; None if it is not there."""
    if absent(path):
        return None
    source = open_source(str(path))
    try:
        detector = Background().prepare(source.sample(FIRST_LOOKS))
        scene = source.scene(None)
        return timed(fold.detect(source, detector, scene), scene)
    finally:
        source.close()


def timed(seen: Iterator[tuple[Frame, Regions]], scene: Scene, wanted: int = TIMED) -> Speed:
    """Time the steps in which OBJECTS are followed, until `wanted` have been."""
    tracker = TRACKERS[TRACKER](smallest=1.0)  # what is not marked founds nothing
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    watch = Stopwatch()
    step, bare = watch.wrapped("step", tracker.step), watch.wrapped("bare", search.calc)
    state, before, since, frames, observed = tracker.start(scene), None, 0, 0, 0
    with stages_timed(watch):
        for frame, regions in seen:
            now = grey_of(frame)
            watch.runs = len(state.targets) == OBJECTS and since >= WARM
            if watch.runs:
                bare(before, now, None)
                frames, observed = frames + 1, observed + len(regions)
            elif len(state.targets) != OBJECTS:
                state, since = tracker.start(scene), 0
                regions = largest(regions)
            state, _ = step(state, frame, regions)
            before, since = now, since + 1
            if frames == wanted:
                break
    if not frames:
        raise ParameterError(f"there are never {OBJECTS} objects for more than {WARM} frames")
    a_frame = {name: 1e3 * seconds / frames for name, seconds in watch.spent.items()}
    parts = {stage: a_frame.get(stage, 0.0) for stage in STAGES}
    parts["the rest"] = a_frame["step"] - sum(parts.values())
    return Speed(frames, observed / frames, parts, a_frame["step"], a_frame["bare"])


def largest(regions: Regions) -> Regions:
    """Return the OBJECTS largest regions, marked; none where there are fewer."""
    areas = np.array([mask.area for mask in regions.masks])
    if len(regions) < OBJECTS:
        return Regions.empty()
    kept = regions.take(np.sort(np.argsort(-areas, kind="stable")[:OBJECTS]))
    return dataclasses.replace(kept, data={"mark": np.arange(1, OBJECTS + 1)})


def speed_table(speed: Speed) -> Table:
    """A row per stage, the whole, and the bare pass."""
    rows = [[name, f"{value:.1f}", f"{value / speed.whole:.0%}"] for name, value in speed.stages.items()]
    rows.append(["whole step", f"{speed.whole:.1f}", "100%"])
    rows.append(["a bare pass of DIS", f"{speed.bare:.1f}", f"step / pass = {speed.ratio:.2f}"])
    title = f"speed: {OBJECTS} objects, {speed.observed:.1f} observations a frame, {speed.frames} frames: "
    return Table(f"{title}{1e3 / speed.whole:.1f} frames/s", ["stage", "ms a frame", "share"], rows)


# Film strips ------------------------------------------------------------------------------------------------

COLUMNS = 6
STRIP_WIDTH = 400  # pixels of a picture in a strip


def columns_of(watched: Watched) -> set[int]:
    """Return the frames of a strip: from before objects first touch or hide until after they last do."""
    busy = [one.frame for one in watched.readings if one.touching]
    busy += [frame for one in watched.hidings for frame in (one.begin, one.end)]
    frames = [one.frame for one in watched.readings]
    begin, end = max(min(busy, default=0) - 8, min(frames)), min(max(busy, default=10**9) + 8, max(frames))
    return set(np.linspace(begin, end, COLUMNS).astype(int).tolist())


def save_strip(path: Path, rows: Sequence[Sequence[tuple[Frame, Tracks]]]) -> None:
    """Write a picture whose rows are films, and whose columns are frames."""
    painted = [[_small(frame, said) for frame, said in row] for row in rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    picture = np.vstack([np.hstack(row) for row in painted])
    cv2.imwrite(str(path), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))


def _small(frame: Frame, said: Tracks) -> Image:
    height, width = frame.image.shape[:2]
    picture = paint(frame, said, Trails.empty(), Scene(width, height))
    size = STRIP_WIDTH, max(1, round(STRIP_WIDTH * height / width))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


# The page ---------------------------------------------------------------------------------------------------


def section(command: str, result: Result, page: str = "") -> str:
    """Return what stands between the marks in docs/track-and-cut.md; a page's tables of parts that were not run stay."""
    kept = [(title, table) for title, table in MARKS.tables(page) if title.partition(":")[0] not in result.told]
    written = [*kept, *((one.title, markdown(one)) for one in result.tables)]
    told = ", ".join(f"{name} {version}" for name, version in result.told["versions"].items())
    tables = [table for part in PARTS for title, table in written if title.startswith(f"{part}:")]
    return "\n\n".join([f"`{command}`", *tables, f"Versions: {told}."])


if __name__ == "__main__":
    main()

"""What the paper of `contour` shows, repeated, and what is asked of silhouettes behind things.

    python bench/contour_paper.py [--parts binary figures grid fall] [--clips NAME ...] [--data DIR] [--draw DIR]
                                  [--json] [--write]

binary      a drawn shape that moves by a constant velocity, measured as it is, and a contour that begins OFF beside it,
            at rest: the errors of place (px) and velocity (px/frame), by gain, one for motion and shape. The envelope
            decays if the largest error of place in ten frames is no larger than that in the ten before, or below FLAT.
figures     section IV on drawn-together clips, a row a gain: Fig. 1 on attractive, Fig. 2 on whiteband (gains that
            are low at first and rise when the object has been followed for LOW frames), Fig. 3 on turning, and behind2 (two objects, of which one is hidden by the other, twice)
            with the gains of Fig. 2. Beside them the tracker's defaults, `automatic`. Objects are marked on their
            first full frame, as `perdure track --init` does. IoU is of whole silhouettes, what is believed with
            gt/amodal.txt, in frames after the mark in which the truth does not touch the picture's border.
            An object is partly hidden while less than SEEN of its silhouette is seen and more than NOTHING; hidden
            while less. It has reappeared when as much as SEEN is seen again; told is after how many frames IoU is
            AGAIN (the worst of them, where there are several). The same target: the silhouette with its id is the
            best on it, with IoU of SAME, in the last frame.
grid        the same clips with one gain for motion and shape, and with two, against `automatic`: IoU while partly
            hidden. What is marked, and how it is counted, is as in the figures.
fall        cdnet-fall, a truck that passes behind a tree, marked in the first frame in which it is seen whole: nothing
            but a film strip, with --draw.

The data is read from $PERDURE_DATA or ../shared/data beside the repository; what is not there is left out with a note.
--draw writes a figure per clip, a row a gain, with the IoU of each frame beside it; --write puts the tables into
docs/contour-observer.md, and leaves the others there; --json prints everything, with the IoU of each frame,
as one object in the last line.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from pages import Marks, absent, given, versions
from regions import Table, chosen, markdown

from perdure import fold
from perdure.errors import ParameterError, PerdureError
from perdure.files.mots import read_masks
from perdure.files.video import open_source
from perdure.maths import levelset, lie
from perdure.pipeline import plan
from perdure.trackers.contour import Contour, observer
from perdure.trackers.contour.measuring import of_shape
from perdure.trackers.contour.observer import Gains
from perdure.types import Bits, Frame, Image, Mask, Rows, Tracks

TRACKER = "contour"
PARTS = ("binary", "figures", "grid", "fall")
CLIPS = ("attractive", "whiteband", "turning", "behind2")
ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "contour-observer.md"
MARKS = Marks.of("bench/contour_paper.py", PAGE)


def main() -> None:
    arguments = _arguments()
    try:
        result = measure(arguments)
        given(result, arguments, PAGE, MARKS, section)
    except PerdureError as error:
        print(f"contour_paper.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--parts", nargs="+", metavar="NAME", default=PARTS, help=", ".join(PARTS))
    parser.add_argument("--clips", nargs="+", metavar="NAME", default=CLIPS, help=", ".join(CLIPS))
    parser.add_argument("--data", type=Path, default=root, help="where the clips are")
    parser.add_argument("--draw", type=Path, metavar="DIR", help="figures and film strips go here")
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the tables in docs/contour-observer.md")
    return parser.parse_args()


@dataclass(frozen=True)
class Result:
    """The tables of the parts that were asked for, and everything as plain values."""

    tables: tuple[Table, ...]
    told: Mapping[str, Any]


def measure(arguments: argparse.Namespace) -> Result:
    """Run the parts that the arguments name."""
    parts = chosen(arguments.parts, {name: [name] for name in PARTS}, "part")
    names = chosen(arguments.clips, {name: [name] for name in CLIPS}, "clip")
    clips = []
    if {"figures", "grid"} & set(parts):
        folders = [arguments.data / "composites" / name for name in names]
        clips = [read_clip(folder) for folder in folders if not absent(folder)]
    tables: list[Table] = []
    told: dict[str, Any] = {"versions": versions()}
    if "binary" in parts:
        decays = [decay(gain) for gain in BINARY_GAINS]
        tables.append(binary_table(decays))
        told["binary"] = [one.as_json() for one in decays]
    if "figures" in parts:
        rows = [row for clip in clips for row in figure(clip, arguments.draw)]
        tables += figure_tables(rows)
        told["figures"] = [one.as_json() for one in rows]
    if "grid" in parts:
        cells = [watch(clip, setting) for setting in GRID for clip in clips]
        tables += [grid_table(cells)] if cells else []
        told["grid"] = [one.as_json() for one in cells]
    if "fall" in parts:
        told["fall"] = fall(arguments.data / "cdnet-fall", arguments.draw)
    return Result(tuple(tables), told)


# Binary sequences -------------------------------------------------------------------------------------------

BINARY_GAINS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, None)  # None: the tracker's defaults
FRAMES = 60
FLAT = 0.2  # px below which an error need not decay
STEP = (3.3, 0.6)  # px a frame
OFF = (5, -3)  # px by which the contour is off at first


class Decay(NamedTuple):
    """How the errors of a contour go down, by frame."""

    gain: float | None
    places: tuple[float, ...]  # px
    speeds: tuple[float, ...]  # px/frame

    @property
    def decays(self) -> bool:
        """Whether the envelope goes down."""
        tops = [max(self.places[k : k + 10]) for k in range(0, len(self.places), 10)]
        return all(later <= max(before, FLAT) for before, later in itertools.pairwise(tops))

    def as_json(self) -> dict[str, Any]:
        return self._asdict() | {"decays": self.decays}


def decay(gain: float | None, frames: int = FRAMES) -> Decay:
    """Follow a drawn shape that moves by a constant velocity, with one gain."""
    own, group = Contour(), lie.SE2
    gains = Gains(own.shape_gain.at(0), own.motion_gain.at(0)) if gain is None else Gains(gain, gain)
    state = observer.initial(egg(0), *OFF, group)
    places, speeds = [], []
    for number in range(1, frames):
        shape = egg(number)
        state = observer.updated(
            state, of_shape(shape, own.reach), gains, group,
            window=own.window, steps=own.iterations, motion=observer.constant_velocity,
            reach=own.reach, curvature=own.curvature,
        )  # fmt: skip
        places.append(float(np.hypot(*(centroid(state, group) - middle(shape)))))
        speeds.append(float(np.hypot(*(state.velocity[:2] - STEP))))
    return Decay(gain, tuple(places), tuple(speeds))


def egg(number: int) -> Bits:
    """A shape (160, 300) bool that no turn brings onto itself, in a frame."""
    y, x = np.mgrid[:160, :300]
    across, down = x - 50 - STEP[0] * number, y - 60 - STEP[1] * number
    return np.asarray((across / 20) ** 2 + (down / 32) ** 2 + 0.3 * (across / 20) * (down / 32) ** 2 < 1)


def middle(shape: Bits) -> NDArray[np.float64]:
    """The centroid (2,) of a shape (H, W)."""
    return levelset.moments(levelset.signed_distance(shape)).centroid


def centroid(state: observer.State, group: lie.Group) -> NDArray[np.float64]:
    """Where the middle (2,) of a contour is."""
    off = levelset.moments(state.shape).centroid - (np.array(state.shape.shape[::-1]) - 1) / 2
    return np.asarray(lie.act(observer.pose_of(state, group), off[None])[0], np.float64)


def binary_table(decays: Sequence[Decay]) -> Table:
    """A row a gain."""
    rows = []
    for one in decays:
        spans = [
            one.places[:5],
            one.places[5:15],
            one.places[15:],
            one.speeds[:5],
            one.speeds[5:15],
            one.speeds[15:],
        ]
        name = "defaults" if one.gain is None else f"{one.gain:g}"
        rows.append([name, *(f"{max(span):.2f}" for span in spans), "yes" if one.decays else "no"])
    head = [
        "gain",
        *(f"{what}, {when}" for what in ("px", "px/frame") for when in ("1-5", "6-15", "16-")),
        "decays",
    ]
    return Table(
        "binary: the largest error of place and velocity in frames 1-5, 6-15 and later, by gain", head, rows
    )


# Clips ------------------------------------------------------------------------------------------------------

SEEN = 0.98  # share of a silhouette that is seen, below which it is partly hidden
NOTHING = 0.05  # share below which it is hidden
AGAIN = 0.8  # IoU of one that is found again
SAME = 0.5  # IoU from which a silhouette stands on an object
GAP = 5  # frames that a hiding lasts at least, and that lie between two of them
LEAST = 200  # pixels of a silhouette, from which it counts
LOW = 25  # frames in which a gain that is low at first is low
LOWEST = 0.1  # that low


class Setting(NamedTuple):
    """How the tracker is run."""

    name: str
    parameters: Mapping[str, object]
    rising: bool = False  # whether the shape's gain is low at first


AUTOMATIC = Setting("automatic", {})


def constant(shape: float, motion: float, model: str = "velocity", *, rising: bool = False) -> Setting:
    """Return gains as they are."""
    common = shape == motion and not rising
    name = f"L = {shape:g}" if common else f"Lμ = {shape:g}, Lv = {motion:g}"
    parameters = {"gains": "constant", "shape_gain": shape, "motion_gain": motion, "motion": model}
    return Setting(f"{name}, low at first" if rising else name, parameters, rising)


class Figure(NamedTuple):
    """A figure of the paper."""

    title: str
    settings: tuple[Setting, ...]


_HIDDEN = tuple(constant(one, 0.3, "acceleration", rising=True) for one in (0.1, 0.5, 0.8))
FIGURES = {
    "attractive": Figure("Fig. 1", tuple(constant(one, 0.3) for one in (0.1, 0.65, 0.7))),
    "whiteband": Figure("Fig. 2", _HIDDEN),
    "turning": Figure("Fig. 3", tuple(constant(one, one, "acceleration") for one in (0.1, 0.3, 0.7))),
    "behind2": Figure("ours", _HIDDEN),
}
GRID = (
    *(constant(one, one) for one in (0.1, 0.3, 0.5, 0.65, 0.8)),
    *(constant(shape, motion) for shape in (0.1, 0.3, 0.65) for motion in (0.1, 0.6) if shape != motion),
    AUTOMATIC,
)


class Truth(NamedTuple):
    """What is seen of each object, and its whole silhouette."""

    visible: Rows
    whole: Rows


class Clip(NamedTuple):
    """A video, what is true of it, and where its objects are marked."""

    name: str
    video: Path
    truth: Truth
    marks: Mapping[int, tuple[int, Bits]]  # object -> the frame of its mark, from 0, and the mark (H, W)


class Reading(NamedTuple):
    """An object in a frame after its mark."""

    frame: int
    object: int
    share: float  # of its silhouette that is seen
    overlap: float  # IoU of the whole silhouette that has its id; 0 where there is none
    best: int  # the id whose silhouette fits best; 0 for none

    @property
    def partly(self) -> bool:
        """Whether a part of it is hidden."""
        return NOTHING < self.share < SEEN


@dataclass(frozen=True)
class Watched:
    """What was believed of a clip under a setting."""

    clip: str
    setting: str
    readings: tuple[Reading, ...]

    def iou(self, which: Callable[[Reading], bool]) -> float | None:
        """Return the mean over the frames for which `which` holds; None where there are none."""
        found = [one.overlap for one in self.readings if which(one)]
        return float(np.mean(found)) if found else None

    @property
    def partly(self) -> float | None:
        """Mean IoU while partly hidden."""
        return self.iou(lambda one: one.partly)

    @property
    def hidden(self) -> float | None:
        """Mean IoU while hidden."""
        return self.iou(lambda one: one.share <= NOTHING)

    @property
    def free(self) -> float | None:
        """Mean IoU while nothing hides it."""
        return self.iou(lambda one: one.share >= SEEN)

    def of(self, number: int) -> list[Reading]:
        """Return the readings of one object, in order."""
        return [one for one in self.readings if one.object == number]

    def kept(self) -> list[int]:
        """The objects whose id stands on them in the last frame."""
        last = {one.object: one for one in sorted(self.readings)}
        return [number for number, one in sorted(last.items()) if one.best == number and one.overlap >= SAME]

    def again(self) -> list[tuple[int, int, int | None]]:
        """Return (object, frame, after how many frames IoU is AGAIN or None) of every time one has reappeared."""
        found = []
        for number in sorted({one.object for one in self.readings}):
            rows = self.of(number)
            for k in reappeared([one.share for one in rows]):
                later = (n - k for n in range(k, len(rows)) if rows[n].overlap >= AGAIN)
                found.append((number, rows[k].frame, next(later, None)))
        return found

    def as_json(self) -> dict[str, Any]:
        frames = {
            str(number): [[one.frame, round(one.share, 4), round(one.overlap, 4)] for one in self.of(number)]
            for number in sorted({one.object for one in self.readings})
        }
        figures = {"partly": self.partly, "hidden": self.hidden, "free": self.free}
        return {
            "clip": self.clip,
            "setting": self.setting,
            **figures,
            "kept": self.kept(),
            "again": self.again(),
            "frames": frames,
        }


def reappeared(shares: Sequence[float]) -> list[int]:
    """Return where (k) an object that has been hidden for GAP frames is seen again, for GAP frames."""
    found, hidden = [], 0
    for k, share in enumerate(shares):
        if share < SEEN:
            hidden += 1
        elif hidden and all(one >= SEEN for one in shares[k : k + GAP]):
            found += [k] if hidden >= GAP else []
            hidden = 0
    return found


def read_clip(folder: Path) -> Clip:
    """Read the truth of a clip, and where its objects are first seen in full."""
    truth = Truth(*(read_masks(folder / "gt" / f"{which}.txt") for which in ("visible", "amodal")))
    marks = {}
    for one in json.loads((folder / "clip.json").read_text(encoding="utf-8"))["objects"]:
        picture = cv2.imread(str(folder / one["first_full"]["mask"]), cv2.IMREAD_GRAYSCALE)
        if picture is None:
            raise ParameterError(f"{folder.name} has no picture {one['first_full']['mask']}")
        marks[int(one["id"])] = (int(one["first_full"]["frame"]) - 1, picture > 0)  # theirs count from 1
    return Clip(folder.name, folder / "video.mp4", truth, marks)


def watch(clip: Clip, setting: Setting) -> Watched:
    """Follow what is marked in a clip, as `perdure track --tracker contour --init` does, and compare."""
    one = look(clip, setting.name, believed(clip, setting))
    told = " ".join(f"{name} {_cell(value)}" for name, value in (("partly", one.partly), ("hidden", one.hidden)))
    print(f"{clip.name}, {setting.name}: {told} kept {one.kept()}", file=sys.stderr, flush=True)
    return one


def believed(clip: Clip, setting: Setting) -> Tracks:
    """Return what is said of a clip."""
    marks = [(np.where(mask, number, 0), frame) for number, (frame, mask) in clip.marks.items()]
    parameters = dict(setting.parameters)
    if setting.rising:
        since = min(frame for frame, _ in clip.marks.values())
        parameters["shape_gain"] = f"{LOWEST},{parameters['shape_gain']}@{since + LOW}"
    run = plan(str(clip.video), tracker=TRACKER, init=marks, parameters=parameters)
    try:
        return fold.settle(step.report for step in run.steps())
    finally:
        run.source.close()


def look(clip: Clip, setting: str, said: Tracks) -> Watched:
    """Compare what is believed with the truth."""
    truth = clip.truth
    seen = {
        (int(k), int(n)): one.area
        for k, n, one in zip(truth.visible.frames, truth.visible.ids, truth.visible.masks, strict=True)
    }
    readings = []
    rows = zip(truth.whole.frames.tolist(), truth.whole.ids.tolist(), truth.whole.masks, strict=True)
    for frame, number, whole in sorted(rows, key=lambda row: row[:2]):
        if number not in clip.marks or frame <= clip.marks[number][0] or whole.area < LEAST:
            continue
        if cut_off(whole, truth.whole.size):
            continue
        told = said.in_frame(frame)
        overlaps = {
            int(name): iou(one, whole) for name, one in zip(told.ids, told.believed, strict=True) if one.area
        }
        best = max(overlaps, key=overlaps.__getitem__, default=0)
        share = seen.get((frame, number), 0) / whole.area
        readings.append(Reading(frame, number, share, overlaps.get(number, 0.0), best))
    return Watched(clip.name, setting, tuple(readings))


def cut_off(mask: Mask, size: tuple[int, int]) -> bool:
    """Return whether a silhouette touches the border of a picture (height, width)."""
    x1, y1, x2, y2 = mask.box
    return x1 <= 0 or y1 <= 0 or x2 >= size[1] or y2 >= size[0]


def iou(one: Mask, other: Mask) -> float:
    """Return intersection over union of two silhouettes, of which either may leave the picture."""
    boxes = np.array([one.box, other.box])
    (x1, y1), (x2, y2) = boxes[:, :2].min(axis=0).tolist(), boxes[:, 2:].max(axis=0).tolist()
    a, b = (Mask(m.y - y1, m.x - x1, m.bits).to_image(y2 - y1, x2 - x1) for m in (one, other))
    return float(np.count_nonzero(a & b) / max(np.count_nonzero(a | b), 1))


# Figures and the grid ---------------------------------------------------------------------------------------


def figure(clip: Clip, drawings: Path | None) -> list[Watched]:
    """Watch a clip with the gains of its figure, and by the defaults."""
    settings = [*FIGURES[clip.name].settings, AUTOMATIC]
    said = [believed(clip, one) for one in settings]
    rows = [look(clip, one.name, tracks) for one, tracks in zip(settings, said, strict=True)]
    for one in rows:
        print(f"{clip.name}, {one.setting}: partly {_cell(one.partly)}", file=sys.stderr, flush=True)
    if drawings:
        draw(drawings / f"{clip.name}.png", clip, said, rows)
    return rows


def figure_tables(rows: Sequence[Watched]) -> list[Table]:
    """A table a clip, a row a gain."""
    tables = []
    for clip in dict.fromkeys(one.clip for one in rows):
        cells = []
        for one in rows:
            if one.clip != clip:
                continue
            same = ", ".join(str(number) for number in one.kept()) or "none"
            values = [_cell(value) for value in (one.free, one.partly, one.hidden)]
            cells.append([one.setting, *values, _slowest(one), same])
        title = f"figures: {clip} ({FIGURES[clip].title}), mean IoU of whole silhouettes, by gain"
        head = [
            "gain",
            "nothing hides it",
            "partly hidden",
            "hidden",
            f"{AGAIN:g} again after, frames",
            "same target, ids",
        ]
        tables.append(Table(title, head, cells))
    return tables


def grid_table(cells: Sequence[Watched]) -> Table:
    """A row a gain, a column a clip, and the mean; the best constant gain of each clip last."""
    clips = list(dict.fromkeys(one.clip for one in cells))
    settings = list(dict.fromkeys(one.setting for one in cells))
    found = {(one.setting, one.clip): one.partly or 0.0 for one in cells}
    rows = []
    for setting in settings:
        values = [found[setting, clip] for clip in clips]
        rows.append([setting, *(f"{value:.3f}" for value in values), f"{np.mean(values):.3f}"])
    fixed = [one for one in settings if one != AUTOMATIC.name]
    if fixed:
        best = [max(found[one, clip] for one in fixed) for clip in clips]
        rows.append(["best constant of each", *(f"{value:.3f}" for value in best), f"{np.mean(best):.3f}"])
    title = "grid: mean IoU of whole silhouettes while partly hidden, by gain"
    return Table(title, ["gain", *clips, "mean"], rows)


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _slowest(one: Watched) -> str:
    """The most frames after which IoU was back."""
    told = [after for _, _, after in one.again()]
    if not told:
        return "-"
    return "never" if None in told else str(max(after for after in told if after is not None))


# Drawings ---------------------------------------------------------------------------------------------------

COLUMNS = 6
TILE = 220, 180  # width and height of a picture in a figure
CURVE = 420  # width of the curve beside a row
ROUND = 60  # pixels round the objects that a picture shows
TRUE, OWN = (60, 220, 60), ((255, 220, 0), (255, 60, 220), (60, 200, 255))
GREY, PALE, DARK = (130, 130, 130), (225, 225, 225), (20, 20, 20)


def draw(path: Path, clip: Clip, said: Sequence[Tracks], rows: Sequence[Watched]) -> None:
    """Write a figure: a row a gain, pictures with the contours and the truth, and the IoU of each frame."""
    wanted = columns_of(rows[0].readings)
    source = open_source(str(clip.video))
    frames = [frame for frame in source if frame.index in wanted]
    source.close()
    lines = []
    for tracks, one in zip(said, rows, strict=True):
        tiles = [
            tile(frame, tracks.in_frame(frame.index), true_in(clip.truth.whole, frame.index)) for frame in frames
        ]
        lines.append(np.hstack([*tiles, curve(one, wanted)]))
    save(path, np.vstack(lines))


def columns_of(readings: Iterable[Reading]) -> list[int]:
    """Return the frames of a figure: from before the first hiding until after the last."""
    readings = list(readings)
    frames = [one.frame for one in readings]
    busy = [one.frame for one in readings if one.share < SEEN] or frames
    begin, end = max(min(busy) - 4, min(frames)), min(max(busy) + 6, max(frames))
    return sorted(set(np.linspace(begin, end, COLUMNS).astype(int).tolist()))


def true_in(rows: Rows, frame: int) -> list[Mask]:
    """Return the silhouettes of a frame."""
    return [one for k, one in zip(rows.frames, rows.masks, strict=True) if k == frame]


def tile(frame: Frame, rows: Tracks, truth: Sequence[Mask] = ()) -> Image:
    """Return a picture round what is believed and what is true, with their outlines and what is seen shaded."""
    height, width = frame.image.shape[:2]
    picture = outlined(frame, rows, truth)
    boxes = np.array([one.box for one in (*rows.believed, *truth) if one.area] or [(0, 0, width, height)])
    x1, y1 = np.maximum(boxes[:, :2].min(axis=0) - ROUND, 0).tolist()
    x2, y2 = np.minimum(boxes[:, 2:].max(axis=0) + ROUND, (width, height)).tolist()
    small = fitted_in(picture[y1 : max(y2, y1 + 1), x1 : max(x2, x1 + 1)], *TILE)
    return numbered(small, frame.index)


def outlined(frame: Frame, rows: Tracks, truth: Sequence[Mask] = ()) -> Image:
    """Return a frame's picture with the outlines of what is believed and what is true."""
    picture = frame.image.copy()
    for name, seen, whole in zip(rows.ids, rows.masks, rows.believed, strict=True):
        colour = OWN[int(name) % len(OWN)]
        bits = seen.to_image(*picture.shape[:2])
        picture[bits] = (0.7 * picture[bits] + 0.3 * np.array(colour)).astype(np.uint8)
        _outline(picture, whole, colour, 2)
    for one in truth:
        _outline(picture, one, TRUE, 1)
    return picture


def numbered(picture: Image, number: int) -> Image:
    """Return a picture with the number of its frame written in."""
    font = cv2.FONT_HERSHEY_SIMPLEX
    return cv2.putText(picture, str(number), (4, 14), font, 0.45, (255, 255, 255), 1, cv2.LINE_AA)


def fitted_in(picture: Image, width: int, height: int) -> Image:
    """Return a picture made to fit into a size, on black."""
    scale = min(width / picture.shape[1], height / picture.shape[0])
    size = max(1, int(picture.shape[1] * scale)), max(1, int(picture.shape[0] * scale))
    out = np.zeros((height, width, 3), np.uint8)
    out[: size[1], : size[0]] = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return out


def curve(one: Watched, wanted: Sequence[int]) -> Image:
    """Return the IoU of each frame as a picture: shaded where the object is partly hidden, darker where altogether."""
    height, edge = TILE[1], 24
    picture = np.full((height, CURVE, 3), 255, np.uint8)
    frames = [row.frame for row in one.readings]
    begin, end = min(frames), max(max(frames), min(frames) + 1)

    def x(frame: int) -> int:
        return edge + round((frame - begin) / (end - begin) * (CURVE - edge - 6))

    def y(value: float) -> int:
        return round(edge + (1 - value) * (height - 2 * edge))

    for row in one.readings:
        if row.share < SEEN:
            shade = PALE if row.partly else (190, 190, 190)
            cv2.rectangle(picture, (x(row.frame), y(1)), (x(row.frame + 1), y(0)), shade, -1)
    for value in (0.0, 0.5, 1.0):
        cv2.line(picture, (edge, y(value)), (CURVE - 6, y(value)), GREY, 1)
        cv2.putText(picture, f"{value:g}", (2, y(value) + 4), cv2.FONT_HERSHEY_SIMPLEX, 0.3, DARK, 1, cv2.LINE_AA)
    for frame in wanted:
        cv2.line(picture, (x(frame), y(0)), (x(frame), y(0) + 4), DARK, 1)
    for number in sorted({row.object for row in one.readings}):
        points = np.array([(x(row.frame), y(row.overlap)) for row in one.of(number)], np.int32)
        colour = tuple(int(0.75 * value) for value in OWN[number % len(OWN)])
        cv2.polylines(picture, [points], False, colour, 1, cv2.LINE_AA)
    name = f"{one.setting.replace('μ', '_mu').replace('Lv', 'L_v')}: partly hidden {_cell(one.partly)}"
    cv2.putText(picture, name, (edge, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.42, DARK, 1, cv2.LINE_AA)
    return picture


def save(path: Path, picture: Image) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))


def _outline(picture: Image, mask: Mask, colour: tuple[int, int, int], thick: int) -> None:
    bits = mask.to_image(*picture.shape[:2]).astype(np.uint8)
    lines, _ = cv2.findContours(bits, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, lines, -1, colour, thick)


# cdnet-fall -------------------------------------------------------------------------------------------------

FALL_COLUMNS, FALL_ROWS = 4, 3
MOVING = 255  # of a pixel of groundtruth
FALL_WIDTH = 360  # pixels of a picture in the strip


class Mark(NamedTuple):
    """What is marked in a film."""

    frame: int
    mask: Bits  # (H, W)


def fall(folder: Path, drawings: Path | None) -> dict[str, Any] | None:
    """Follow what is first seen whole behind a tree, and draw a film strip of it; None where the film is not there."""
    if absent(folder):
        return None
    source = open_source(str(folder / "input"))
    frames = list(source)
    source.close()
    truths = sorted((folder / "groundtruth").glob("*.png"))[: len(frames)]
    mark = first_whole(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) == MOVING for path in truths)
    if mark is None:
        raise ParameterError(f"nothing is ever seen whole in {folder.name}")
    run = plan(str(folder / "input"), tracker=TRACKER, init=[(mark.mask.astype(np.uint8), mark.frame)])
    try:
        said = fold.settle(step.report for step in run.steps())
    finally:
        run.source.close()
    last = int(said.frames.max())
    if drawings:
        wanted = np.linspace(mark.frame, last, FALL_COLUMNS * FALL_ROWS).astype(int).tolist()
        tiles = [strip_tile(frames[k], said.in_frame(k)) for k in wanted]
        rows = [np.hstack(tiles[k : k + FALL_COLUMNS]) for k in range(0, len(tiles), FALL_COLUMNS)]
        save(drawings / "cdnet-fall.png", np.vstack(rows))
    return {"marked": mark.frame, "last": last}


def first_whole(moving: Iterable[Bits]) -> Mark | None:
    """Return the first frame in which the largest moving thing of LEAST pixels touches no border, and its pixels."""
    for frame, bits in enumerate(moving):
        count, labels, sizes, _ = cv2.connectedComponentsWithStats(bits.astype(np.uint8))
        if count < 2:
            continue
        largest = 1 + int(np.argmax(sizes[1:, cv2.CC_STAT_AREA]))
        mask = labels == largest
        if sizes[largest, cv2.CC_STAT_AREA] >= LEAST and not cut_off(Mask.of_image(mask), bits.shape):
            return Mark(frame, mask)
    return None


def strip_tile(frame: Frame, rows: Tracks) -> Image:
    """Return a picture with the outlines of what is believed, and what is seen shaded."""
    height, width = frame.image.shape[:2]
    size = FALL_WIDTH, max(1, round(FALL_WIDTH * height / width))
    small = cv2.resize(outlined(frame, rows), size, interpolation=cv2.INTER_AREA)
    return numbered(small, frame.index)


# The page ---------------------------------------------------------------------------------------------------


def section(command: str, result: Result, page: str = "") -> str:
    """Return what stands between the marks in docs/contour-observer.md; tables that were not made anew stay."""
    written = dict(MARKS.tables(page)) | {one.title: markdown(one) for one in result.tables}
    told = ", ".join(f"{name} {version}" for name, version in result.told["versions"].items())
    tables = [table for part in PARTS for title, table in written.items() if title.startswith(f"{part}:")]
    return "\n\n".join([f"`{command}`", *tables, f"Versions: {told}."])


if __name__ == "__main__":
    main()

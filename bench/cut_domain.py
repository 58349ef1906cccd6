"""How far the cut in a window is from the cut over the whole picture; a part of bench/trackcut_paper.py.

In one frame of `every` each object is cut out again, in the same state, in a window that is the whole picture, its
cells where those of the window are. `within` is what the window alone does: inside of it the evidence and the measure
of contrast are those that it had, and only what lies outside is added. `anew` has all of it from the whole picture:
the votes' places, the observations' pixels and the mean contrast too. What is told is the number of pixels in which
the two silhouettes differ, before objects are separated, over the larger one's area; where both are empty there is
nothing to tell.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
from regions import Table

from perdure.maths.maxflow import STEPS
from perdure.trackers.trackcut import expecting
from perdure.trackers.trackcut import tracker as trackcut
from perdure.trackers.trackcut.expecting import Expected
from perdure.trackers.trackcut.windows import Window
from perdure.types import Frame, Mask, Regions, Scene

WORST = 0.01  # of the area: what differs by more is counted


class Cut(NamedTuple):
    """An object cut out in its window and in the whole picture."""

    frame: int
    object: int
    area: int  # pixels of the larger one
    within: float  # share of them that differ
    anew: float
    seconds: tuple[float, float]  # in the window, in the whole picture


class Compared(NamedTuple):
    """All cuts of a clip."""

    clip: str
    cuts: tuple[Cut, ...]

    @property
    def ratio(self) -> float:
        """Time in the whole picture over time in the window."""
        return sum(one.seconds[1] for one in self.cuts) / max(sum(one.seconds[0] for one in self.cuts), 1e-9)

    def as_json(self) -> dict[str, Any]:
        return {"clip": self.clip, "ratio": self.ratio, "cuts": [one._asdict() for one in self.cuts]}


class Call(NamedTuple):
    """One object looked for in one window, as the tracker did it."""

    given: tuple[Any, ...]  # to `expect`
    expected: Expected
    more: tuple[Any, ...]  # to `_cut`, behind the two above
    cells: Any  # (h, w) bool
    seconds: float


def compared(clip: str, seen: Iterable[tuple[Frame, Regions]], scene: Scene, every: int) -> Compared:
    """Run the tracker at its defaults, and cut everything out twice in one frame of `every`."""
    tracker = trackcut.TrackCut()
    state, cuts = tracker.start(scene), []
    for place, (frame, regions) in enumerate(seen):
        if place % every or regions.blind:
            state, _ = tracker.step(state, frame, regions)
            continue
        calls: dict[int, list[Call]] = {}
        names = {one.key: one.id for one in state.targets}
        with watched(calls):
            state, _ = tracker.step(state, frame, regions)
        cuts += [twice(tracker, frame, names[key], some, scene) for key, some in calls.items()]
    return Compared(clip, tuple(one for one in cuts if one.area))


@contextlib.contextmanager
def watched(calls: dict[int, list[Call]]) -> Iterator[None]:
    """Write down every call of `expect` and of the cut that follows it, by the object's key, while this lasts."""
    expect, cut = trackcut.expect, trackcut.TrackCut._cut
    given: dict[int, tuple[tuple[Any, ...], float]] = {}

    def expecting_it(*words: Any) -> Expected:
        begun = time.perf_counter()
        expected = expect(*words)
        given[id(expected)] = words, time.perf_counter() - begun
        return expected

    def cutting_it(tracker: Any, target: Any, expected: Expected, *more: Any) -> Any:
        begun = time.perf_counter()
        found = cut(tracker, target, expected, *more)
        words, before = given[id(expected)]
        seconds = before + time.perf_counter() - begun
        calls.setdefault(target.key, []).append(Call(words, expected, more, found[0], seconds))
        return found

    with (
        mock.patch.object(trackcut, "expect", expecting_it),
        mock.patch.object(trackcut.TrackCut, "_cut", cutting_it),
    ):
        yield


def twice(tracker: trackcut.TrackCut, frame: Frame, name: int, calls: list[Call], scene: Scene) -> Cut:
    """Compare what was found of an object, in the last of its windows, with what the whole picture says."""
    last = calls[-1]
    part, whole = last.expected.window, over_all(last.expected.window, scene)
    begun = time.perf_counter()
    with windows(lambda *_: whole):
        expected = trackcut.expect(*last.given)
    seconds = time.perf_counter() - begun
    kept = expected._replace(unary=placed(last.expected.unary, expected.unary, part, whole))
    mine = part.to_mask(last.cells, scene.height, scene.width)
    sigma = trackcut.contrast(last.expected.colours, tracker.contrast)[1]
    masks = []
    with contrast_measured(sigma):
        begun = time.perf_counter()
        masks.append(cut_in(tracker, kept, last, whole, scene))
        seconds += time.perf_counter() - begun
    masks.append(cut_in(tracker, expected, last, whole, scene))
    areas = [max(mine.area, mask.area) for mask in masks]
    within, anew = (differing(mine, mask, scene) / max(area, 1) for mask, area in zip(masks, areas, strict=True))
    return Cut(frame.index, name, areas[0], within, anew, (sum(one.seconds for one in calls), seconds))


def cut_in(tracker: trackcut.TrackCut, expected: Expected, call: Call, whole: Window, scene: Scene) -> Mask:
    cells = tracker._cut(call.given[0], expected, *call.more)[0]
    return whole.to_mask(cells, scene.height, scene.width)


def over_all(part: Window, scene: Scene) -> Window:
    """Return the window that holds the whole picture, its cells where those of a window are."""
    step = part.step
    left, top = part.x1 - -(-part.x1 // step) * step, part.y1 - -(-part.y1 // step) * step
    right, bottom = (
        begin + -(-(size - begin) // step) * step for begin, size in ((left, scene.width), (top, scene.height))
    )
    return Window(left, top, max(right, part.x2), max(bottom, part.y2), step)


def placed(inside: Any, outside: Any, part: Window, whole: Window) -> Any:
    """Return evidence (h, w) of the whole picture, that of the window in its place."""
    y, x = (part.y1 - whole.y1) // part.step, (part.x1 - whole.x1) // part.step
    both = outside.copy()
    both[y : y + inside.shape[0], x : x + inside.shape[1]] = inside
    return both


def windows(choose: Callable[..., Window]) -> Any:
    """Have the tracker look into another window while this lasts."""
    return mock.patch.object(expecting, "around", choose)


def contrast_measured(sigma: float) -> Any:
    """Have contrast measured by a given σ² while this lasts."""
    contrast = trackcut.contrast

    def by_sigma(colours: Any, weight: float) -> tuple[Any, float]:
        costs, own = contrast(colours, weight)
        free = np.float32(weight) / np.sqrt(np.array([dy * dy + dx * dx for dy, dx in STEPS], np.float32))
        free = np.maximum(free, np.float32(1e-9))[:, None, None]
        return (free * (costs / free) ** np.float32(own / sigma)).astype(np.float32), sigma

    return mock.patch.object(trackcut, "contrast", by_sigma)


def differing(one: Mask, other: Mask, scene: Scene) -> int:
    """Return the number of pixels that are in one of two masks."""
    return int(
        np.count_nonzero(one.to_image(scene.height, scene.width) ^ other.to_image(scene.height, scene.width))
    )


def domain_table(clips: Iterable[Compared]) -> Table:
    """A row per clip."""
    rows = []
    for clip in clips:
        if not clip.cuts:
            continue
        within, anew = (np.array([getattr(one, which) for one in clip.cuts]) for which in ("within", "anew"))
        shares = [np.median(within), np.percentile(within, 95), within.max(), (within > WORST).mean()]
        shares += [np.median(anew), np.percentile(anew, 95)]
        told = [f"{100 * share:.2f}" for share in shares]
        rows.append([clip.clip, str(len(clip.cuts)), *told, f"{clip.ratio:.1f}"])
    head = ["clip", "cuts", "median", "95 %", "worst", f"over {100 * WORST:.0f} %", "anew, median", "anew, 95 %"]
    title = (
        "domain: pixels in which the cut in a window and over the whole picture differ, in percent of the object"
    )
    return Table(title, [*head, "time, whole / window"], rows)

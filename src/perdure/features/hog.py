"""HOG points: how many of the interest points seen on one thing are seen on the other (feature 6, eq. 5 and 6).

FAST corners on things are followed by their histograms of oriented gradients (`perdure.features.points`); the
trajectory of each says how far it can be relied on. Two things are alike as far as the same reliable trajectories pass
through both.

Departures: eq. 5 is divided by its peak, with a floor on σ; distances are per frame time, so that a point missed for a
frame has not leapt. M of eq. 6 counts the points that a row has room for, the longest followed. Where things overlap, a
point is of the one whose feet are lowest: the nearest. Without masks, corners of the background are in a box too: those
at its border are left out, and those where the picture is as it was when no box was there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import sizes
from perdure.features.feature import Float, Memory
from perdure.features.points import HIGHEST, Corners, Trajectories, corners, looks
from perdure.params import parameter
from perdure.types import Boxes, Frame, Regions, Scene

Bits = NDArray[np.bool_]
Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]

ROOM = 32  # points that a row has room for
CROWD = 64  # corners of one region that are looked at, the strongest
MOST = 8192  # trajectories that are remembered, the newest


@dataclass(frozen=True)
class HogPoints:
    """min(Σ S / M, Σ S' / M') over the trajectories that pass through both."""

    corner: int = parameter(
        10, "how much brighter or darker than what surrounds it a corner is", unit="grey levels", low=1, high=255
    )
    least_alike: float = parameter(
        0.75, "cosine of two descriptors from which they may be of one point", low=0.0, high=1.0
    )
    leap: float = parameter(
        0.15, "how far a point may be from where it is expected", unit="heights", low=0.0, high=10.0
    )
    stride: float = parameter(
        0.6, "how fast a point seen for the first time may go on", unit="heights/s", low=0.0, high=1000.0
    )
    unseen: float = parameter(0.6, "how long a point is remembered unseen", unit="s", low=0.0, high=60.0)
    inset: float = parameter(
        0.05, "how much of a box without a mask is left out on each side", unit="sizes", low=0.0, high=0.45
    )
    still: float = parameter(
        8.0,
        "what differs less from the place without a box is background; 0: all counts",
        unit="grey levels",
        low=0.0,
        high=255.0,
    )

    name = "hog"
    needs_pixels = True
    moves = False
    varies = False

    def start(self, scene: Scene) -> Memory:
        """Return no trajectories, and a place of which nothing is known."""
        return {
            **Trajectories.none().memory(),
            "following": np.ones(1, np.int64),  # the number of the next trajectory
            "pace": np.full(1, 1.0 / scene.fps if scene.fps > 0 else 0.04),  # s, the nominal frame time
            "backdrop": np.zeros((scene.height, scene.width), np.uint8),  # grey, where no box was
            "uncovered": np.zeros((scene.height, scene.width), np.uint8),  # 255 where it is known
        }

    def describe(self, memory: Memory, frame: Frame, regions: Regions) -> tuple[Memory, Float]:
        """Return points (N, ROOM + 1, 2): number of the trajectory and S, the longest first; at the end M and 0."""
        if frame.image is None:
            return memory, np.zeros((len(regions), ROOM + 1, 2), np.float32)
        grey = np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY), np.uint8)
        pace = float(memory["pace"][0])
        known = Trajectories.of(memory)
        known = known.take(frame.time - known.seen <= max(self.unseen, 1.5 * pace))
        passed = np.asarray((frame.time - known.seen) / pace, np.float32)  # (P,) frame times
        passed = np.maximum(passed, _MOMENT)
        expected = np.asarray(known.places + known.moves * passed[:, None], np.float32)  # (P, 2)
        free = np.where(known.lengths == 1, self.stride * passed * pace, 0.0)  # (P,) of what is not known to go
        reach = np.asarray(np.maximum(known.heights * (self.leap + free), _LEAST_REACH), np.float32)

        inner = insets(regions.boxes, self.inset)
        found, owner = self._corners(memory, grey, regions, inner, expected, reach)
        look = looks(grey, found.places)
        place, alike = known.matched(expected, reach, found.places, look, self.least_alike)
        met, fresh = place >= 0, np.setdiff1d(np.flatnonzero(owner >= 0), place)
        heights = sizes(regions.boxes)[:, 1]
        onto = place[met]
        on = known.take(met).gone_on(found.places[onto], look[onto], alike[met], passed[met], frame.time)
        if len(regions):
            on = replace(on, heights=np.where(owner[onto] >= 0, heights[owner[onto]], on.heights))
        following = int(memory["following"][0]) - 1
        begun = Trajectories.begun(
            (following + np.arange(len(fresh))) % HIGHEST + 1,
            found.places[fresh],
            look[fresh],
            frame.time,
            heights[owner[fresh]],
        )
        seen, of = on.joined(begun), np.concatenate([owner[onto], owner[fresh]])
        missed = known.take(~met)
        return {
            **missed.joined(seen).take(slice(-MOST, None)).memory(),
            "following": np.array([(following + len(fresh)) % HIGHEST + 1]),
            "pace": memory["pace"],
            **_uncovered(memory, grey, regions.boxes),
        }, rows_of(seen, of, len(regions))

    def similarity(self, one: Float, other: Float, elapsed: NDArray[np.floating]) -> Float:
        """Return what share (P,) of the points of both is reliably the same (eq. 6)."""
        mine, theirs = one[:, :-1, None, 0], other[:, None, :-1, 0]
        shared = (mine == theirs) & (mine > 0)  # (P, ROOM, ROOM)
        first = (one[:, :-1, 1] * shared.any(axis=2)).sum(axis=1) / np.maximum(one[:, -1, 0], 1.0)
        second = (other[:, :-1, 1] * shared.any(axis=1)).sum(axis=1) / np.maximum(other[:, -1, 0], 1.0)
        return np.asarray(np.minimum(np.minimum(first, second), 1.0), np.float32)

    def _corners(
        self, memory: Memory, grey: Bytes, regions: Regions, inner: Boxes, expected: Float, reach: Float
    ) -> tuple[Corners, Ints]:
        """The corners of regions and those near expected points, and whose each is (N,); -1: nobody's."""
        wanted = _painted(regions, inner, grey.shape)
        cells = np.clip(expected, 0, np.array(grey.shape[::-1], np.float32) - 1).astype(np.intp)  # (P, 2)
        alone = np.flatnonzero(wanted[cells[:, 1], cells[:, 0]] == 0)
        around = np.concatenate([cells[alone] - reach[alone, None], cells[alone] + reach[alone, None]], axis=1)
        for x1, y1, x2, y2 in np.maximum(around, 0).astype(int).tolist():
            wanted[y1 : y2 + 1, x1 : x2 + 1] = 1
        found = corners(grey, wanted, self.corner)
        if self.still:
            x, y = np.floor(found.places).astype(np.intp).T
            differs = cv2.blur(cv2.absdiff(grey, memory["backdrop"]), (_PLOT, _PLOT))
            found = found.take((differs[y, x] >= self.still) | (memory["uncovered"][y, x] == 0))
        owner = owners(regions, inner, found.places)
        kept = (owner < 0) | _among_strongest(owner, found.strength, CROWD)
        return found.take(kept), owner[kept]


_PLOT = 9  # pixels, the side of what is compared with the background
_STEP = 2  # grey levels by which the background follows in a frame
_MOMENT = 1e-3  # frame times
_LEAST_REACH = 2.0  # pixels


def insets(boxes: Boxes, share: float) -> Boxes:
    """Return boxes (N, 4) without a share of their width and height on each side."""
    margin = share * sizes(boxes)
    return np.asarray(np.concatenate([boxes[:, :2] + margin, boxes[:, 2:] - margin], axis=1), np.float32)


def owners(regions: Regions, inner: Boxes, places: Float) -> Ints:
    """Return the region (N,) of each place (N, 2), of several the one that reaches lowest; -1 for none.

    A region is its mask, or without one its inner box.
    """
    owner = np.full(len(places), -1, np.int64)
    if not len(places):
        return owner
    x, y = places.T
    for k in np.argsort(regions.boxes[:, 3], kind="stable"):  # later ones in front
        mask, box = regions.masks[k], inner[k]
        if mask.bits.size:
            rows, columns = np.floor(y).astype(np.intp) - mask.y, np.floor(x).astype(np.intp) - mask.x
            height, width = mask.bits.shape
            inside = (rows >= 0) & (columns >= 0) & (rows < height) & (columns < width)
            inside[inside] = mask.bits[rows[inside], columns[inside]]
        else:
            inside = (x >= box[0]) & (x < box[2]) & (y >= box[1]) & (y < box[3])
        owner[inside] = k
    return owner


def rows_of(points: Trajectories, of: Ints, count: int) -> Float:
    """Return the rows (count, ROOM + 1, 2) of regions: numbers and scores of the points that are theirs, longest first."""
    rows = np.zeros((count, ROOM + 1, 2), np.float32)
    owned = np.flatnonzero(of >= 0)
    order = owned[np.lexsort((owned, -points.lengths[owned], of[owned]))]
    rank, owner = _ranks(of[order]), of[order]
    order, rank, owner = order[rank < ROOM], rank[rank < ROOM], owner[rank < ROOM]
    rows[owner, rank, 0] = points.numbers[order]
    rows[owner, rank, 1] = points.scores[order]
    rows[:, -1, 0] = np.bincount(owner, minlength=count)
    return rows


def _painted(regions: Regions, inner: Boxes, shape: tuple[int, ...]) -> Bytes:
    """A picture with 1 where regions are."""
    height, width = shape
    wanted = np.zeros((height, width), np.uint8)
    for mask, box in zip(regions.masks, inner, strict=True):
        box = mask.box if mask.bits.size else box
        x1, y1, x2, y2 = np.clip(np.rint(box), 0, (width, height, width, height)).astype(int)
        wanted[y1:y2, x1:x2] = 1
    return wanted


def _among_strongest(owner: Ints, strength: Float, most: int) -> Bits:
    """Whether a corner (N,) is one of the `most` strongest of its owner."""
    order = np.lexsort((-strength, owner))
    kept = np.zeros(len(owner), np.bool_)
    kept[order] = _ranks(owner[order]) < most
    return kept


def _ranks(sorted_: Ints) -> NDArray[np.intp]:
    """How many equal ones stand before each."""
    return np.arange(len(sorted_)) - np.searchsorted(sorted_, sorted_, side="left")


def _uncovered(memory: Memory, grey: Bytes, boxes: Boxes) -> dict[str, NDArray[Any]]:
    """The background as it is remembered now: at once where it was not known, then step by step."""
    height, width = grey.shape
    free = np.full(grey.shape, 255, np.uint8)
    for x1, y1, x2, y2 in np.clip(boxes, 0, (width, height, width, height)):
        free[int(y1) : int(np.ceil(y2)), int(x1) : int(np.ceil(x2))] = 0
    old, known = memory["backdrop"], memory["uncovered"]
    moved = cv2.min(cv2.max(grey, cv2.subtract(old, _STEP)), cv2.add(old, _STEP))  # type: ignore[call-overload]
    cv2.copyTo(grey, cv2.bitwise_not(known), moved)
    backdrop = old.copy()
    cv2.copyTo(moved, free, backdrop)
    return {"backdrop": backdrop, "uncovered": cv2.bitwise_or(known, free)}

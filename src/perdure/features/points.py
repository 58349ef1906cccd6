"""Interest points and their trajectories: FAST corners, HOG of a patch about each, followed from frame to frame.

A trajectory goes on where a corner within reach of its expected place looks most like it, and is itself best met by it
(mutual best). It is kept for a while unseen, so that it bridges frames in which nothing is detected.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.features.feature import Memory

Bytes = NDArray[np.uint8]
Float = NDArray[np.float32]

PATCH, CELL, BINS = 16, 8, 9  # pixels, pixels, directions over half a turn
LOOK = (PATCH // CELL) ** 2 * BINS
HIGHEST = 2**23 - 1  # numbers of trajectories: float32 is exact to 2²⁴
_GAIN = 512.0  # bytes per 1 of a HOG, whose values are rarely above .4


@dataclass(frozen=True)
class Corners:
    """Corners of one picture, in the order of y, then x."""

    places: Float  # (N, 2) x, y, the middle of the pixel
    strength: Float  # (N,)

    def take(self, rows: NDArray[Any]) -> Corners:
        """Return the named rows (indices or bool)."""
        return Corners(self.places[rows], self.strength[rows])


def corners(grey: Bytes, wanted: Bytes, threshold: int) -> Corners:
    """Return the FAST corners (Rosten & Drummond 2006) where `wanted` (H, W) is above 0.

    Parameters
    ----------
    grey, wanted : (H, W) uint8
        The picture, and where to look.
    threshold : int
        Grey levels by which nine pixels in a row of the circle about a corner are all brighter or all darker.
    """
    x, y, width, height = cv2.boundingRect(wanted)
    if not width:
        return Corners(np.zeros((0, 2), np.float32), np.zeros(0, np.float32))
    rim = 3  # a corner is told by a circle of radius 3
    left, top = max(x - rim, 0), max(y - rim, 0)
    crop = (slice(top, y + height + rim), slice(left, x + width + rim))
    detector = cv2.FastFeatureDetector.create(threshold, True, cv2.FAST_FEATURE_DETECTOR_TYPE_9_16)
    found = detector.detect(np.ascontiguousarray(grey[crop]), np.ascontiguousarray(wanted[crop]))
    places = np.asarray(cv2.KeyPoint.convert(found), np.float32).reshape(-1, 2)
    strength = np.array([one.response for one in found], np.float32)
    order = np.lexsort((places[:, 0], places[:, 1]))
    return Corners(places[order] + np.array([left + 0.5, top + 0.5], np.float32), strength[order])


def looks(grey: Bytes, places: Float) -> Bytes:
    """Return histograms of oriented gradients (N, LOOK) of a patch about each place (N, 2) (Dalal & Triggs 2005).

    One block of 2 x 2 cells, bilinear votes, L2-Hys; beyond the picture it goes on as at its border.
    """
    if not len(places):
        return np.zeros((0, LOOK), np.uint8)
    half = PATCH // 2
    low = np.floor(places).astype(int)
    left, top = np.maximum(low.min(axis=0) - half - 1, 0)
    right, bottom = low.max(axis=0) + half + 1
    crop = cv2.copyMakeBorder(grey[top:bottom, left:right], half, half, half, half, cv2.BORDER_REPLICATE)
    hog = cv2.HOGDescriptor((PATCH, PATCH), (PATCH, PATCH), (PATCH, PATCH), (CELL, CELL), BINS)
    corner = low - (left, top)  # of each patch in the crop: its middle less a half, and the border of a half
    found = hog.compute(crop, locations=list(map(tuple, corner.tolist())))
    return np.asarray(np.clip(np.rint(np.reshape(found, (-1, LOOK)) * _GAIN), 0, 255), np.uint8)


@dataclass(frozen=True)
class Trajectories:
    """Points that are followed: one row each, in the order of their beginning."""

    numbers: NDArray[np.int64]  # (P,) 1 … HIGHEST, then 1 again
    places: Float  # (P, 2) where last seen
    moves: Float  # (P, 2) its last displacement, pixels per frame time
    looks: Bytes  # (P, LOOK)
    lengths: NDArray[np.int64]  # (P,) how often seen
    seen: NDArray[np.float64]  # (P,) s, when last
    heights: Float  # (P,) of the thing on which it was last seen
    sums: NDArray[
        np.float64
    ]  # (P, 6) over frame-to-frame distances d, directions a, likenesses s: d, d², cos a, sin a, s, s²
    scores: Float  # (P,) how coherent it is at its last point (eq. 5)

    @staticmethod
    def begun(numbers: NDArray[np.int64], places: Float, look: Bytes, time: float, heights: Float) -> Trajectories:
        """Return trajectories of one point each."""
        count = len(numbers)
        return Trajectories(
            numbers,
            places,
            np.zeros((count, 2), np.float32),
            look,
            np.ones(count, np.int64),
            np.full(count, time),
            np.asarray(heights, np.float32),
            np.zeros((count, 6)),
            np.full(count, UNPROVEN, np.float32),
        )

    @staticmethod
    def none() -> Trajectories:
        """Return no trajectories."""
        nowhere = np.zeros((0, 2), np.float32)
        return Trajectories.begun(
            np.zeros(0, np.int64), nowhere, np.zeros((0, LOOK), np.uint8), 0.0, np.zeros(0, np.float32)
        )

    @staticmethod
    def of(memory: Memory) -> Trajectories:
        """Return those of a feature's memory."""
        return Trajectories(**{one.name: memory[one.name] for one in fields(Trajectories)})

    def memory(self) -> dict[str, NDArray[Any]]:
        """Return the arrays by name."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    def __len__(self) -> int:
        return len(self.numbers)

    def take(self, rows: NDArray[Any] | slice) -> Trajectories:
        """Return the named rows (indices, bool or a slice)."""
        return Trajectories(**{name: values[rows] for name, values in self.memory().items()})

    def joined(self, other: Trajectories) -> Trajectories:
        """Return these and then the others."""
        theirs = other.memory()
        return Trajectories(
            **{name: np.concatenate([values, theirs[name]]) for name, values in self.memory().items()}
        )

    def matched(
        self, expected: Float, reach: Float, places: Float, look: Bytes, least: float
    ) -> tuple[NDArray[np.int64], Float]:
        """Return which of new points (N, 2) each is (P,), -1 for none, and how alike the two are (P,)."""
        from perdure.maths.kernels.nearest_alike import nearest_alike

        found, alike = np.empty(len(self), np.int64), np.empty(len(self), np.float32)
        finder, squares = np.empty(len(places), np.int64), np.empty(len(places), np.int64)
        likest = np.empty(len(places), np.float32)
        nearest_alike(expected, reach, self.looks, places, look, least, found, alike, finder, likest, squares)
        return found, alike

    def gone_on(self, place: Float, look: Bytes, alike: Float, passed: Float, time: float) -> Trajectories:
        """Return them with one more point each, `passed` (P,) frame times after the last."""
        moves = np.asarray((place - self.places) / passed[:, None], np.float32)
        way, turn = np.hypot(*moves.T), np.arctan2(moves[:, 1], moves[:, 0])
        sums = self.sums + np.stack([way, way**2, np.cos(turn), np.sin(turn), alike, alike**2], axis=1)
        lengths = self.lengths + 1
        return replace(
            self,
            places=place,
            moves=moves,
            looks=look,
            lengths=lengths,
            seen=np.full(len(self), time),
            sums=sums,
            scores=coherence(way, turn, alike, sums, lengths),
        )


def coherence(
    way: Float, turn: Float, alike: Float, sums: NDArray[np.float64], lengths: NDArray[np.int64]
) -> Float:
    """Return how coherent (P,) in [0, 1] the last point of each trajectory is with all of it (eq. 5).

    The mean over distance, direction and likeness of a Gaussian divided by its peak, about the trajectory's own mean
    and with its own σ, but at least a floor. A direction is told by a way longer than the jitter of a corner only.
    """
    mean = sums / np.maximum(lengths - 1, 1)[:, None]  # (P, 6)
    spread = np.sqrt(np.maximum(mean[:, (1, 5)] - mean[:, (0, 4)] ** 2, 0.0))  # (P, 2) of distance, of likeness
    length = np.clip(np.hypot(mean[:, 2], mean[:, 3]), 1e-6, 1.0)  # of the mean of unit vectors
    turned = turn - np.arctan2(mean[:, 3], mean[:, 2])
    turned = np.arctan2(np.sin(turned), np.cos(turned))
    blur = np.hypot(_DIRECTION, _JITTER / np.maximum(way, _JITTER / np.pi))
    parts = (
        _peaked(way - mean[:, 0], np.maximum(spread[:, 0], _DISTANCE))
        + _peaked(turned, np.maximum(np.sqrt(-2.0 * np.log(length)), blur))
        + _peaked(alike - mean[:, 4], np.maximum(spread[:, 1], _LIKENESS))
    )
    return np.asarray(np.where(lengths < _PROVEN, UNPROVEN, parts / 3.0), np.float32)


UNPROVEN = 0.5  # the score of a trajectory that is too short to tell
_PROVEN = 3  # points
_DISTANCE, _DIRECTION, _LIKENESS = 1.0, 0.35, 0.05  # least σ: pixels per frame time, radians, cosine
_JITTER = 0.7  # pixels


def _peaked(away: NDArray[np.floating], spread: NDArray[np.floating]) -> NDArray[np.floating]:
    return np.asarray(np.exp(-(away**2) / (2.0 * spread**2)))

"""What is expected of an object in a frame, and the evidence of every cell round it (eq. 1-9, 14-16)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.scene.backdrop import Backdrop
from perdure.trackers.trackcut.likelihoods import of_backdrop, of_colours, of_looks, of_motions
from perdure.trackers.trackcut.moving import similarity
from perdure.trackers.trackcut.places import vote
from perdure.trackers.trackcut.placing import Company, placed
from perdure.trackers.trackcut.seeing import Motion, Sight
from perdure.trackers.trackcut.shapes import depth, in_window, recent_motion
from perdure.trackers.trackcut.targets import Target
from perdure.trackers.trackcut.windows import ONE_MAP, Window, around

Float = NDArray[np.float32]
Bits = NDArray[np.bool_]
Similarity = tuple[NDArray[np.float64], tuple[float, float]]
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))  # flow is the object's own where all of it is
_ENOUGH = 30  # cells of core
_MARGIN = 2.0  # cells by which the remembered silhouette counts for less than the last one
_HALF = 0.5  # share of the remembered silhouette below which the last one is not enough
_SLOPE, _LEAST_SLOPE = 0.06, 3.0  # of the object's side, cells: distance over which the prediction is unsure
_SURE = 3.0  # multiples of that, beyond which it is no surer
_INNER = 2.0  # cells


@dataclass(frozen=True)
class Weights:
    """What each evidence counts, and its bound, nats."""

    colour: float
    trust: float  # in the colours that the object had at first
    place: float
    motion: float
    shape: float
    backdrop: float
    bound: float


class Expected(NamedTuple):
    """An object in its window."""

    window: Window
    colours: Float  # (h, w, 3)
    last: Bits  # (h, w) its pixels, carried on by flow (eq. 3)
    belief: Float  # (h, w) its remembered silhouette, carried on as a whole
    predicted: Bits  # (h, w) O at t given t-1
    moved: NDArray[np.float64]  # (2,) px a frame, beyond the camera's
    unary: Float  # (h, w) cost of being the object's less that of not being
    bare: Bits  # (h, w) where it looks as if nothing were there


def middle_of(target: Target) -> tuple[float, float]:
    """Return the middle of the remembered silhouette, x, y."""
    x1, y1, x2, y2 = target.shape.box
    return (x1 + x2) / 2, (y1 + y2) / 2


def carried(target: Target, motion: Motion) -> NDArray[np.float64]:
    """Return by how much (2,) the object should have moved since the frame before, px: its own motion and the camera's."""
    x, y = middle_of(target)
    camera = motion.of_camera(np.array([x], np.float32), np.array([y], np.float32))[0]
    return np.asarray(recent_motion(target) + camera, np.float64)


def expect(
    target: Target,
    before: NDArray[np.uint8],
    sight: Sight,
    motion: Motion,
    ring: float,
    cells: int,
    weights: Weights,
    backdrop: Backdrop,
    company: Company | None = None,
) -> Expected:
    """Return what is expected of an object, and the evidence round it.

    Parameters
    ----------
    target : Target
        As of the frame before.
    before : (H, W, 3) uint8
        Colours of the frame before.
    sight, motion
        The frame, and how everything came there.
    ring : float
        Pixels round the object that are looked at.
    cells : int
        How many are looked at, at most.
    weights : Weights
        Of the evidence.
    backdrop : Backdrop
        What is behind all objects.
    company : Company, optional
        Among whom it is.
    """
    drift = carried(target, motion)
    window = _window(target, drift, ring, cells, sight)
    places = window.grid()  # (h, w, 2)
    flow = motion.at(window)  # (h, w, 2)
    camera = motion.of_camera_at(places)
    came = places - flow  # where each cell was
    last = _carry_mask(target, window, came)
    move, moved = _movement(target, drift, places, flow, motion, _core(last))
    belief = in_window(target.shape, window, move)
    colours = window.cut(sight.colours)
    if company is not None:
        observed, others = window.of_masks(company.observed), window.of_masks(company.places)
        known = observed if observed.any() else None
        across, down = placed(belief, colours.astype(np.float32), target.first, company, known, others)
        belief = _shifted(belief, across, down)
        moved = moved + np.array([across, down]) * window.step
    whole = belief > 0.5
    lost = np.count_nonzero(last) < _HALF * np.count_nonzero(whole)
    predicted = whole if target.together and whole.any() else last | whole if lost else last
    if not predicted.any():
        predicted = whole
    seen = colours.astype(np.float32)
    looks = of_colours(seen, target.first, target.last, weights.trust, weights.bound)
    inner = depth(predicted)
    sure = inner > _INNER
    own = None if not lost else recent_motion(target).astype(np.float32)
    motions = of_motions(flow - camera, sure if sure.any() else predicted, weights.bound, own)
    votes = _votes(before, came, last, colours, weights.bound) if not lost else np.zeros_like(looks)
    away = np.maximum(inner, (inner if predicted is whole else depth(whole)) - np.float32(_MARGIN))
    size = max(np.count_nonzero(predicted), np.count_nonzero(whole))
    slope = max(_SLOPE * float(np.sqrt(size)), _LEAST_SLOPE)
    shape = np.clip(away / np.float32(slope), -_SURE, _SURE)
    evidence = weights.colour * looks + weights.place * votes + weights.motion * motions + weights.shape * shape
    there, bare = of_backdrop(seen, window, backdrop)
    if weights.backdrop and bare.any():
        evidence[bare] -= weights.backdrop * np.clip(there[bare] - _own(target, seen[bare]), 0, weights.bound)
    return Expected(window, seen, last, belief, predicted, moved, -evidence, bare)


def _own(target: Target, points: Float) -> Float:
    """Return ln p (N,) of colours (N, 3) under an object's looks, at first or last."""
    return np.maximum(of_looks(points, target.first), of_looks(points, target.last))


def _window(target: Target, drift: NDArray[np.float64], ring: float, cells: int, sight: Sight) -> Window:
    """The window round where the object should be."""
    boxes = [target.shape.box, *([target.mask.box] if target.mask.area else [])]
    dx, dy = drift.tolist()
    moved = [(x1 + dx, y1 + dy, x2 + dx, y2 + dy) for x1, y1, x2, y2 in boxes]
    height, width = sight.colours.shape[:2]
    return around(moved, ring, cells, (height, width))


def _movement(
    target: Target, drift: NDArray[np.float64], places: Float, flow: Float, motion: Motion, core: Bits
) -> tuple[Similarity, NDArray[np.float64]]:
    """How the object has moved: a similarity, and (2,) px beyond the camera's; as before where little of it is seen."""
    own = np.flatnonzero(core)
    if len(own) > _ENOUGH and not target.partly:
        at = places.reshape(-1, 2)[own]
        move = similarity(at[:, 0], at[:, 1], flow.reshape(-1, 2)[own])
        if target.together:  # what is seen of it is a part, that tells little of how the whole turns
            move[0][2:] = 0
        camera = motion.of_camera_at(np.array([move[1]], np.float32))[0]  # in the middle it is as in the mean
        return move, np.asarray(move[0][:2] - camera, np.float64)
    x, y = middle_of(target)
    move = (np.array([drift[0], drift[1], 0.0, 0.0]), (x + float(drift[0]), y + float(drift[1])))
    return move, recent_motion(target)


def _core(inside: Bits) -> Bits:
    """The pixels whose four neighbours are the object's too."""
    return cv2.erode(inside.view(np.uint8), _CROSS).view(np.bool_)


def _shifted(belief: Float, across: int, down: int) -> Float:
    """Return a silhouette (h, w), moved by whole cells."""
    moved = np.zeros_like(belief)
    height, width = belief.shape
    into = (slice(max(down, 0), height + min(down, 0)), slice(max(across, 0), width + min(across, 0)))
    of = (slice(max(-down, 0), height + min(-down, 0)), slice(max(-across, 0), width + min(-across, 0)))
    moved[into] = belief[of]
    return moved


def _carry_mask(target: Target, window: Window, came: Float) -> Bits:
    """The pixels of the object, each carried on by flow."""
    if not target.mask.area:
        return np.zeros(window.shape, np.bool_)
    bits = target.mask.bits.astype(np.float32)
    x, y = came[..., 0] - np.float32(target.mask.x), came[..., 1] - np.float32(target.mask.y)
    return np.asarray(cv2.remap(bits, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0) > 0.5)


def _votes(before: NDArray[np.uint8], came: Float, own: Bits, colours: NDArray[np.uint8], bound: float) -> Float:
    """Votes of the frame before, its pixels where they are now."""
    was = cv2.remap(before, came, ONE_MAP, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    return vote(np.asarray(was, np.uint8), own, colours, bound)

"""What is learnt of an object from its pixels in a frame: silhouette, size, motion, looks (§3.3, eq. 14-16)."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.trackers.trackcut.competing import HALF, Claim
from perdure.trackers.trackcut.expecting import Expected
from perdure.trackers.trackcut.likelihoods import learn_colours, unlike
from perdure.trackers.trackcut.seeing import Motion
from perdure.trackers.trackcut.shapes import behind, of_size, to_shape
from perdure.trackers.trackcut.targets import Target
from perdure.types import Mask

FAMILIAR = 25  # frames until which an object that came in is still getting known
LONG = 5  # frames after which regions of which one object holds two are two objects
_GONE = 0.05  # share of its mean size, below which an object is not seen
_GAIN, _LOSE, _FORGET = 0.5, 0.25, 0.04  # by which the remembered silhouette takes up and gives up pixels, a frame
_LEAST_SHAPE, _MOST_SHAPE = 0.55, 1.25  # of its mean size, that a silhouette has among others
_HALF_SEEN = 0.75  # share of the remembered silhouette below which it gives up nothing
_KNOWN = 5  # frames from which a size is known (§3.3)
_SPREAD = 0.05  # of the mean size, that its deviation is at least
_ALONE, _UNSURE = 1.0, 2.0  # s of being too small, by itself, with or without observation, until it has changed
_UNSEEN = 2.0  # s for which a detector that sees others may not see an object that it founded
_RATE = 0.1  # share of a new size
_JOINED = 0.3  # frames of them, that a frame takes back in which it holds one


class Seen(NamedTuple):
    """What a frame shows of an object."""

    expected: Expected
    mask: Mask  # its pixels
    others: list[Mask]  # those of the others
    links: tuple[int, ...]  # observations matched
    shared: bool  # whether others share observations or pixels with it
    motion: Motion
    waited: float  # s since the frame before
    looked: bool  # whether a detector saw anything
    blind: bool  # whether it could not


def learnt(target: Target, seen: Seen, components: int) -> Target:
    """Return an object brought up to date with its pixels."""
    expected, mask, others, links, shared, motion, waited, looked, blind = seen
    window, size = expected.window, mask.area
    motions = np.concatenate([target.motions[1:], [expected.moved]])
    doubted = 0.0 if links or target.marked else target.doubted + (waited if looked else 0.0)
    if size < max(_GONE * target.mean, 4.0) or doubted > _UNSEEN:
        shape, covered = behind(to_shape(expected.belief, window), others, target.together)
        return replace(
            target,
            mask=Mask.empty(),
            shape=shape,
            missed=target.missed + waited,
            missing=target.missing if covered else target.missing + waited,
            together=covered,
            links=(),
            partly=False,
            alone=0,
            unseen=target.unseen + 1,
        )
    cells = window.of_mask(mask) > 0.5
    deviation = max(float(np.sqrt(target.variance)), _SPREAD * target.mean)
    partly = target.seen_frames >= _KNOWN and size < target.mean - 3 * deviation
    belief = expected.belief
    small = target.small + waited if partly and not shared else 0.0
    if small > (_ALONE if links else _UNSURE):
        partly, small = False, 0.0
    hidden = not shared and cells.sum() < _HALF_SEEN * (belief > 0.5).sum()
    lose = np.where(window.of_masks(others), 0.0, (_FORGET if links else 0.0) if hidden else _LOSE)
    rate = np.where(cells, _GAIN / 5 if shared else _GAIN, lose).astype(np.float32)
    belief = (belief + rate * (cells - belief)).astype(np.float32)
    if shared and target.seen_frames >= _KNOWN:
        whole = target.mean / window.step**2
        belief = of_size(belief, _LEAST_SHAPE * whole, _MOST_SHAPE * whole)
    shape = to_shape(belief, window)
    if not (partly or target.partly or shared or target.together) and target.mask.area:
        motions[-1] = _shift(target.mask, mask, motion) if links else motions[-1]
    motions = target.motions if partly or target.partly else motions
    target = replace(
        target,
        mask=mask,
        shape=shape,
        motions=motions,
        missed=0.0,
        missing=0.0,
        unseen=0,
        doubted=doubted,
        alone=0 if shared else target.alone + 1,
        links=links,
        partly=partly,
        small=small,
        together=shared,
    )
    if partly or blind or shared:
        return target
    own = cells if target.marked else unlike(cells, expected.bare)
    last = learn_colours(expected.colours, own, np.ones_like(cells), components, target.last)
    share = max(_RATE, 1.0 / (target.seen_frames + 1))
    off = size - target.mean
    first = last if target.seen_frames < FAMILIAR and not target.marked else target.first
    return replace(
        target,
        first=first,
        last=last,
        mean=target.mean + share * off,
        variance=(1 - share) * (target.variance + share * off**2),
        seen_frames=target.seen_frames + 1,
    )


def pieces(target: Target, claimed: list[Claim]) -> float:
    """Return for how many frames an object has held several regions, none much smaller than another, and nobody else."""
    areas = sorted(one.part.area for one in claimed if one.alone)
    if not claimed:
        return target.pieces
    several = len(areas) > 1 and areas[-2] >= HALF * areas[-1]
    return min(target.pieces + 1, LONG + 2) if several else max(target.pieces - _JOINED, 0.0)


def _shift(before: Mask, now: Mask, motion: Motion) -> NDArray[np.float64]:
    """By how much (2,) px the middle of a silhouette has moved, beyond the camera's motion."""
    (x, y), (x_before, y_before) = _middle(now), _middle(before)
    camera = motion.of_camera(np.array([x], np.float32), np.array([y], np.float32))[0]
    return np.array([x - x_before, y - y_before], np.float64) - np.asarray(camera, np.float64)


def _middle(mask: Mask) -> tuple[float, float]:
    rows, columns = np.nonzero(mask.bits)
    return mask.x + float(columns.mean()), mask.y + float(rows.mean())

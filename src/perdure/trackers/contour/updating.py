"""Shape, pose and looks of every object, brought up to date by what a frame shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from perdure.maths import lie
from perdure.trackers.contour import observer, recalling
from perdure.trackers.contour.correcting import evident, observed, steadied
from perdure.trackers.contour.hiding import hidden, holding, placed
from perdure.trackers.contour.looking import Seen, mask_of, support
from perdure.trackers.contour.measuring import Measured, measured
from perdure.trackers.contour.observer import Float, Gains
from perdure.trackers.contour.rules import HIDDEN, RESTLESS, WHOLE, Rules
from perdure.trackers.contour.seeing import fitted, learnt_layer
from perdure.trackers.contour.targets import Looks, Target
from perdure.types import Bits, Mask

_FROZEN = 0.6  # below which nothing is learnt of its shape and looks
_STEADY = 0.08  # rate at which the velocity for hidden times follows
_MORE, _LESS = 0.2, 0.015  # rates at which the usual support follows what is seen, where that is more, or less
_RATE = 0.25  # at which an object's own picture is brought up to date


def updated(
    by: Rules, targets: Sequence[Target], sights: Sequence[Seen], gains: Gains, waited: float
) -> list[Target]:
    """Return the objects with shape, pose and looks brought up to date."""
    found = []
    for number, (target, sight) in enumerate(zip(targets, sights, strict=True)):
        taken = _taken(number, sights)
        known = sight.known & ~taken
        found.append(_one_updated(by, target, sight, known, gains, waited))
    return found


def _taken(number: int, sights: Sequence[Seen]) -> Bits:
    """Return which cells (h, w) look more like another object that should be there."""
    own = sights[number]
    taken = np.zeros(own.evidence.shape, np.bool_)
    for other, sight in enumerate(sights):
        if other == number:
            continue
        there = own.window.to_cells() @ lie.inverse(sight.window.to_cells())
        claim = np.where(sight.depth < 0, sight.evidence, np.float32(-99))
        size = (own.window.width, own.window.height)
        moved = cv2.warpAffine(
            claim, there[:2], size, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=-99
        )
        taken |= (moved > 0) & ((own.depth >= 0) | (moved >= own.evidence))
    return taken


def _one_updated(by: Rules, target: Target, sight: Seen, known: Bits, gains: Gains, waited: float) -> Target:
    """Return an object that is found, of which a part is found, or of which nothing is."""
    one = evident(by, sight.window, sight.evidence, known)
    area = support(sight.depth, one, by.reach)
    visible = min(1.0, area / max(target.usual, 1.0))
    if sight.expected is not None:
        visible, place = placed(by, target, sight.expected, sight, one)
        if visible < WHOLE:
            return hidden(by, target, sight.expected, sight, one, place, visible, gains.shape, waited)
    if visible < HIDDEN and by.automatic:
        return _unseen(by, target, visible, waited)
    return _found(by, target, sight, one, gains, visible, area)


def _unseen(by: Rules, target: Target, visible: float, waited: float) -> Target:
    """Return an object of which nothing is seen: it goes on."""
    group = by.group
    state = observer.towards(target.state, observer.predicted(target.state, group), group)
    state = observer.coasted(state, measured(np.zeros((1, 1)), 0), group, window=by.window)
    return replace(
        target, state=steadied(by, state, target.steady, 0.0), seen=Mask.empty(), visible=visible,
        missed=target.missed + waited, links=(), age=target.age + 1,
    )  # fmt: skip


def _found(
    by: Rules, target: Target, sight: Seen, one: Measured, gains: Gains, visible: float, area: float
) -> Target:
    """Return an object of which so much is seen, its shape and its motion corrected (4), its looks learnt."""
    group, share = by.group, 1.0
    if by.automatic:
        share = min(max((visible - _FROZEN) / (WHOLE - _FROZEN), 0.0), 1.0)
        gains = Gains(gains.shape * share, gains.motion * visible)
    whole, least = visible >= WHOLE, target.restless >= RESTLESS
    state = observed(by, sight.state, one, gains, sight.edge, whole, least=least)
    restless, steady, past = target.restless, target.steady, target.past
    if whole:
        often = max(_STEADY, 1 / (target.frames + 1))
        restless = restless + often * (_changed(by, sight, one) - restless)
        at, raw = observer.pose_of(state, group)[:2, 2], state.shape
        if sight.expected is not None:
            state = holding(by, target, state, sight, one)
        past = recalling.kept(past, raw, target.age + 1, at)
        steady = steady + often * (state.velocities[-1] - steady)
    state = steadied(by, state, steady, share)
    pose = observer.pose_of(state, group)
    depth = sight.window.drawn(state.shape, pose)
    seen = (depth < 0) & (one.pull < 0)
    looks = target.looks
    if visible >= _FROZEN:
        looks = _learnt(by, looks, sight, depth, seen, pose)
    return replace(
        target, state=state, looks=looks, seen=mask_of(sight.window, seen), visible=visible,
        usual=target.usual + (_MORE if area > target.usual else _LESS) * (area - target.usual),
        steady=steady, past=past, recalled=-1, restless=restless, drift=np.zeros(2), straying=np.zeros(2),
        age=target.age + 1, missed=0.0, frames=target.frames + 1, links=(),
    )  # fmt: skip


def _changed(by: Rules, sight: Seen, one: Measured) -> float:
    """Return which share of an outline is another in this frame: 1 - IoU of μ and what looks like it."""
    pose = observer.pose_of(observer.coasted(sight.state, one, by.group, window=1), by.group)
    shape = sight.state.shape
    found = observer.towards_least(shape, pose[None], [one], 1.0, by.reach)
    was, now = shape < 0, found < 0
    return 1 - float((was & now).sum()) / max(float((was | now).sum()), 1.0)


def _learnt(by: Rules, looks: Looks, sight: Seen, depth: Float, seen: Bits, pose: Float) -> Looks:
    """Return what an object looks like, by what is seen (h, w) of it at a pose, too."""
    layer = learnt_layer(
        looks.layer, sight.window, sight.colours, (depth < -1) & (sight.evidence > -1), pose, _RATE
    )
    return replace(
        looks,
        last_own=fitted(sight.colours[seen], by.components, looks.last_own),
        last_other=fitted(sight.colours[depth > 2], by.components, looks.last_other),
        layer=layer,
    )

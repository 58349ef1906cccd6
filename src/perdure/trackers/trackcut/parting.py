"""Objects that part: whether each left with its own name (§4, beyond the paper).

The second energy carries on what was believed of each; where two look alike, or one was hidden for long, it may have
given the one the place of the other. When an object has left its company and is seen by itself, it is compared with the
looks that its companions had before they met.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from perdure.trackers.trackcut.likelihoods import Float, of_looks
from perdure.trackers.trackcut.targets import Target
from perdure.types import Event, Frame

ALONE = 3  # frames for which an object is seen by itself, before it is asked who it is
_WHOLE = 0.5  # of its mean size, that it must then have
_ALIKE = 1.7  # ratio of sizes, within which one may be the other
_BETTER = 1.5  # nats a pixel by which the companion's looks must fit better


def parted(targets: list[Target], pixels: dict[int, Float], frame: Frame) -> tuple[list[Target], list[Event]]:
    """Return the objects, those exchanged that have each other's place, and what is told of them.

    Parameters
    ----------
    targets : list of Target
        All of them.
    pixels : dict
        Key -> colours (N, 3) of the objects that are to be asked.
    frame : Frame
        The frame.
    """
    targets, events = list(targets), []
    for key, colours in pixels.items():
        place = next(k for k, one in enumerate(targets) if one.key == key)
        asked = targets[place]
        if asked.mask.area >= _WHOLE * asked.mean:
            gains = [
                (_gain(asked, one, colours, pixels), k)
                for k, one in enumerate(targets)
                if one.key in asked.company and one.key != key and _fits(asked, one)
            ]
            gain, other = max(gains, default=(0.0, -1))
            if gain > _BETTER:
                targets[place], targets[other] = _exchanged(asked, targets[other])
                names = (targets[place].id, targets[other].id)
                why = "after they parted each looked like the other"
                events.append(Event("exchanged", frame.index, frame.index, names, why=why))
        targets[place] = replace(targets[place], company=())
    return targets, events


def _fits(asked: Target, other: Target) -> bool:
    """Whether what one holds has about the size of the other, and what that one holds, if anything, of the first."""
    sizes = [(asked.mask.area, other.mean)] + ([(other.mask.area, asked.mean)] if other.mask.area else [])
    return all(1 / _ALIKE < area / max(mean, 1.0) < _ALIKE for area, mean in sizes)


def _gain(asked: Target, other: Target, colours: Float, pixels: dict[int, Float]) -> float:
    """By how many nats a pixel the other fits better to what one holds; and one to what the other holds, if known."""
    gain = float((of_looks(colours, other.first) - of_looks(colours, asked.first)).mean())
    theirs = pixels.get(other.key)
    if theirs is not None and len(theirs):
        back = float((of_looks(theirs, asked.first) - of_looks(theirs, other.first)).mean())
        gain = min(gain + back, 2 * max(gain, back)) / 2
    return gain


def _exchanged(one: Target, other: Target) -> tuple[Target, Target]:
    """Both, each where the other was."""
    return _placed(other, one), _placed(one, other)


def _placed(who: Target, where: Target) -> Target:
    """Return who, with the place and silhouette of another."""
    return replace(
        who,
        mask=where.mask,
        shape=where.shape,
        motions=np.array(where.motions),
        missed=where.missed,
        missing=where.missing,
        unseen=where.unseen,
        partly=where.partly,
        small=where.small,
        together=where.together,
        links=where.links,
        company=where.company,
        alone=where.alone,
    )

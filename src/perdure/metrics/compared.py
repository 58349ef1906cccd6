"""Two sides of a comparison laid frame by frame beside each other, as every score wants them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import exact_overlaps
from perdure.features.masks import mask_overlaps, mask_shares
from perdure.types import Rows, Use

Float = NDArray[np.float64]
Index = NDArray[np.intp]

EPSILON = float(np.finfo(np.float64).eps)  # an overlap this little below a threshold still reaches it
EXCUSED = 0.5  # overlap with a distractor, or share inside an ignored area, that takes a said row away


class Moment(NamedTuple):
    """One frame: which rows are true and said there, and how much they overlap."""

    frame: int
    truth: Index  # (N,) rows of `Compared.truth`
    said: Index  # (M,) rows of `Compared.said`
    overlap: Float  # (N, M) in [0, 1]


@dataclass(frozen=True, eq=False)
class Compared:
    """What is scored of both sides, and the overlaps of the two in every frame that has a row."""

    said: Rows
    truth: Rows
    moments: tuple[Moment, ...]
    excused: int  # said rows taken away because they lie on what is not asked for
    masks: bool = False  # the overlaps are those of silhouettes

    @property
    def true_ids(self) -> NDArray[np.int64]:
        """The identities of the truth, ascending."""
        return np.unique(self.truth.ids)

    @property
    def said_ids(self) -> NDArray[np.int64]:
        """The identities that were said, ascending."""
        return np.unique(self.said.ids)


def compare(said: Rows, truth: Rows, *, masks: bool = False) -> Compared:
    """Lay what was said beside what is true.

    Said rows that match a distractor best are taken away, as are, of masks, those that match no object
    and lie for the most part in an ignored area; then only SCORED rows of the truth remain.

    Parameters
    ----------
    said, truth : Rows
        Both of one sequence; the frames of both count alike.
    masks : bool
        Overlap is that of silhouettes, not of boxes.

    Raises
    ------
    ValueError
        If masks are asked for and a side that has rows has none.
    """
    if masks and any(len(side) and not side.masks for side in (said, truth)):
        raise ValueError("masks are asked for, but a side has only boxes")
    overlaps = _mask_overlaps if masks else _box_overlaps
    kept_said: list[Index] = []
    kept: list[tuple[int, Index, Index, Float]] = []
    scored = truth.use == Use.SCORED
    everything = bool(scored.all())
    for frame, there, here in _frames(truth, said):
        overlap = overlaps(truth, there, said, here)
        if everything:
            kept_said.append(here)
            kept.append((frame, there, here, overlap))
            continue
        stays = ~_excused(truth.use[there], overlap)
        if masks:
            stays &= ~_in_ignored_area(truth, there, said, here, overlap)
        asked = scored[there]
        kept_said.append(here[stays])
        kept.append((frame, there[asked], here[stays], overlap[np.ix_(asked, stays)]))
    place_true = np.cumsum(scored) - 1
    remaining = np.concatenate(kept_said) if kept_said else np.zeros(0, np.intp)
    place_said = np.zeros(len(said), np.intp)
    place_said[remaining] = np.arange(len(remaining))
    moments = tuple(
        Moment(frame, place_true[there], place_said[here], overlap)
        for frame, there, here, overlap in kept
        if len(there) or len(here)
    )
    return Compared(said.take(remaining), truth.take(scored), moments, len(said) - len(remaining), masks)


def best_pairs(worth: Float) -> tuple[Index, Index]:
    """Return rows and columns paired for the greatest total worth; pairs of no worth are left out.

    >>> [side.tolist() for side in best_pairs(np.array([[0.5, 0.6], [0.0, 0.7]]))]
    [[0, 1], [0, 1]]
    """
    if not (worth > EPSILON).any():
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    from scipy.optimize import linear_sum_assignment  # half a second to load

    rows, columns = linear_sum_assignment(worth, maximize=True)
    paired = worth[rows, columns] > EPSILON
    return rows[paired], columns[paired]


def reaching(overlap: Float, least: float) -> Float:
    """Return the overlaps with those below a threshold set to 0."""
    return np.where(overlap < least - EPSILON, 0.0, overlap)


def _frames(truth: Rows, said: Rows) -> Iterator[tuple[int, Index, Index]]:
    """Each frame with a row of either side, and the rows of both there."""
    frames = np.union1d(truth.frames, said.frames)
    bounds = [
        (np.searchsorted(side.frames, frames, "left"), np.searchsorted(side.frames, frames, "right"))
        for side in (truth, said)
    ]
    for place, frame in enumerate(frames.tolist()):
        there, here = (np.arange(low[place], high[place]) for low, high in bounds)
        yield frame, there, here


_Overlaps = Callable[[Rows, Index, Rows, Index], Float]


def _box_overlaps(truth: Rows, there: Index, said: Rows, here: Index) -> Float:
    return exact_overlaps(truth.boxes[there], said.boxes[here])


def _mask_overlaps(truth: Rows, there: Index, said: Rows, here: Index) -> Float:
    return mask_overlaps([truth.masks[i] for i in there], [said.masks[i] for i in here])


def _excused(use: NDArray[np.int8], overlap: Float) -> NDArray[np.bool_]:
    """Which columns are matched to a distractor, when all rows of the truth may match (MOT16)."""
    away = np.zeros(overlap.shape[1], np.bool_)
    if (use == Use.DISTRACTOR).any():
        rows, columns = best_pairs(reaching(overlap, EXCUSED))
        away[columns[use[rows] == Use.DISTRACTOR]] = True
    return away


def _in_ignored_area(truth: Rows, there: Index, said: Rows, here: Index, overlap: Float) -> NDArray[np.bool_]:
    """Which columns match no object and lie for more than half in an ignored area (MOTS)."""
    areas = there[truth.use[there] == Use.REGION]
    away = np.zeros(len(here), np.bool_)
    if len(areas) and len(here):
        objects = overlap[truth.use[there] == Use.SCORED]
        _, matched = best_pairs(
            np.where(objects < EXCUSED - EPSILON, -1e4, objects)
        )  # many pairs before good ones
        shares = mask_shares([said.masks[i] for i in here], [truth.masks[i] for i in areas])
        away = shares.max(axis=1) > EXCUSED + EPSILON
        away[matched] = False
    return away

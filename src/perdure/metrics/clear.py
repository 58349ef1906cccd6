"""CLEAR MOT (Bernardin & Stiefelhagen 2008): who was found, what was wrong, when an identity changed.

Ours, equal to TrackEval's: `motrics` continues a pair over any gap, TrackEval only from the frame before,
and TrackEval cannot be installed beside our build of OpenCV. The pairs are wanted anyway: the list of mistakes,
the events and the drawing rest on them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.metrics.compared import Compared, best_pairs, compare, reaching
from perdure.types import Rows, Tracks

Index = NDArray[np.intp]
_CONTINUED = 1000.0  # a pair of the frame before comes before any better overlap


@dataclass(frozen=True)
class Clear:
    """Counts over all frames; of several sequences they add up."""

    truth: int = 0  # rows of the truth
    found: int = 0  # of those matched: TP
    wrong: int = 0  # rows said that match nothing: FP
    switches: int = 0  # an object's id differs from the one it had when last found: IDSW
    breaks: int = 0  # an object is found again after frames in which it was not: Frag
    mostly_tracked: int = 0  # objects found in more than 80 % of their frames: MT
    partly_tracked: int = 0  # PT
    mostly_lost: int = 0  # in less than 20 %: ML
    overlap: float = 0.0  # summed over the found

    @property
    def missed(self) -> int:
        """Rows of the truth without a match: FN."""
        return self.truth - self.found

    @property
    def recall(self) -> float:
        """Found rows / rows of the truth; 0 without any."""
        return self.found / max(1, self.truth)

    @property
    def precision(self) -> float:
        """Right rows / rows said; 0 without any."""
        return self.found / max(1, self.found + self.wrong)

    @property
    def mota(self) -> float:
        """1 - (missed + wrong + switches) / rows of the truth, at most 1; 0 where there is no truth."""
        return (self.found - self.wrong - self.switches) / self.truth if self.truth else 0.0

    @property
    def soft_mota(self) -> float:
        """MOTA with every found row counted by its overlap (sMOTSA, Voigtlaender et al. 2019)."""
        return (self.overlap - self.wrong - self.switches) / self.truth if self.truth else 0.0

    @property
    def motp(self) -> float:
        """Mean overlap of the found rows; 0 without any."""
        return self.overlap / max(1, self.found)

    @staticmethod
    def together(parts: Sequence[Clear]) -> Clear:
        """Return the counts of several sequences as of one."""
        return Clear(*(sum(values) for values in zip(*(vars(one).values() for one in parts), strict=True)))


@dataclass(frozen=True, eq=False)
class Pairs:
    """Who was taken for whom: (K,) rows of both sides of a `Compared`, in the order of frames."""

    truth: Index
    said: Index
    overlap: NDArray[np.float64]


def clear(said: Tracks, truth: Tracks, least_overlap: float = 0.5) -> Clear:
    """Count what was found and what was wrong at one threshold of overlap.

    >>> row = Tracks.of(frames=[0, 1], times=[0, 1], ids=[7, 8], boxes=[[0, 0, 9, 9], [0, 0, 9, 9]])
    >>> clear(row, row.replace(ids=np.array([1, 1]))).switches
    1
    """
    compared = compare(Rows.of_tracks(said), Rows.of_tracks(truth))
    return count(compared, pair(compared, least_overlap))


def pair(compared: Compared, least_overlap: float = 0.5) -> Pairs:
    """Match the two sides frame by frame: pairs of the frame before first, then the greatest total overlap.

    A frame in which either side has no row breaks no pair, as in TrackEval.
    """
    before: dict[int, int] = {}
    found: list[tuple[Index, Index, NDArray[np.float64]]] = []
    true_ids, said_ids = compared.truth.ids, compared.said.ids
    for moment in compared.moments:
        if not moment.overlap.size:
            continue
        there, here = true_ids[moment.truth].tolist(), said_ids[moment.said]
        earlier = np.array([before.get(one, -1) for one in there])
        worth = _CONTINUED * (here[None, :] == earlier[:, None]) + moment.overlap
        rows, columns = best_pairs(np.where(reaching(moment.overlap, least_overlap) > 0, worth, 0.0))
        before = {there[row]: int(here[column]) for row, column in zip(rows, columns, strict=True)}
        found.append((moment.truth[rows], moment.said[columns], moment.overlap[rows, columns]))
    if not found:
        return Pairs(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))
    truth, said, overlap = (np.concatenate(column) for column in zip(*found, strict=True))
    return Pairs(truth, said, overlap)


def count(compared: Compared, pairs: Pairs) -> Clear:
    """Return the counts of a matching."""
    rows, objects = compared.truth, compared.true_ids
    which = np.searchsorted(objects, rows.ids)
    present = np.bincount(which, minlength=len(objects))
    found = np.bincount(which[pairs.truth], minlength=len(objects))
    ratio = found / np.maximum(1, present)
    mostly, partly = int((ratio > 0.8).sum()), int((ratio >= 0.2).sum())
    return Clear(
        truth=len(rows),
        found=len(pairs.truth),
        wrong=len(compared.said) - len(pairs.said),
        switches=len(switches(compared, pairs)),
        breaks=_breaks(compared, pairs),
        mostly_tracked=mostly,
        partly_tracked=partly - mostly,
        mostly_lost=len(objects) - partly,
        overlap=float(pairs.overlap.sum()),
    )


def switches(compared: Compared, pairs: Pairs) -> Index:
    """Return the places (S,) in `pairs` at which an object has another id than when it was last found."""
    order = np.lexsort((compared.truth.frames[pairs.truth], compared.truth.ids[pairs.truth]))
    objects, names = compared.truth.ids[pairs.truth][order], compared.said.ids[pairs.said][order]
    changed = (objects[1:] == objects[:-1]) & (names[1:] != names[:-1])
    return np.sort(order[1:][changed])


def _breaks(compared: Compared, pairs: Pairs) -> int:
    """How often an object is found again after a frame, of those with rows of both sides, in which it was not."""
    joint = [moment.frame for moment in compared.moments if moment.overlap.size]
    order = np.lexsort((compared.truth.frames[pairs.truth], compared.truth.ids[pairs.truth]))
    objects = compared.truth.ids[pairs.truth][order]
    places = np.searchsorted(joint, compared.truth.frames[pairs.truth][order])
    return int(((objects[1:] == objects[:-1]) & (np.diff(places) > 1)).sum())

"""ETISEO tracking scores as Chau, Brémond & Thonnat use them (section 5): M1, M2, M3 and their mean.

In every frame each reference object is matched to at most one tracked object, whose box it overlaps enough:
Dice 2|A∩B| / (|A|+|B|) ≥ 0.5, the greatest total first. Then, over a whole sequence:

M1, tracking time: for each reference the share of its frames in which it is matched by the one tracked object
that matches it most; mean over references.
M2, persistence: for each reference 1 / number of tracked ids ever matched to it, 0 for none; mean.
M3, confusion: for each tracked object that is matched at all 1 / number of references it was ever matched
to; mean, 0 if there is none.

Trajectories (Table 3): a reference is a true positive (TP) when one tracked object matches it in more than half
of its frames, else lost (FN); a tracked object is noisy (FP) when it matches nothing in at least half of its.
No other public implementation was found; the hand-worked examples in the tests are meant as the reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.metrics.compared import Compared, best_pairs, reaching

Float = NDArray[np.float64]
Index = NDArray[np.intp]
_MOST = 0.5  # of an object's life


@dataclass(frozen=True, eq=False)
class Etiseo:
    """Scores of each reference and of each tracked object; of several sequences they follow one another."""

    time: Float  # (R,) M1 of each reference
    persistence: Float  # (R,) M2 of each reference
    confusion: Float  # (T,) M3 of each tracked object that is matched at all
    noisy: int  # tracked objects that match nothing in at least half of their frames

    @property
    def m1(self) -> float:
        """Tracking time in [0, 1]."""
        return _mean(self.time)

    @property
    def m2(self) -> float:
        """Persistence of ids in [0, 1]."""
        return _mean(self.persistence)

    @property
    def m3(self) -> float:
        """Confusion of ids in [0, 1], 1 for none."""
        return _mean(self.confusion)

    @property
    def mean(self) -> float:
        """The mean of the three."""
        return (self.m1 + self.m2 + self.m3) / 3.0

    @property
    def tracked(self) -> int:
        """Trajectories tracked by one id for most of their life: TP."""
        return int((self.time > _MOST).sum())

    @property
    def lost(self) -> int:
        """The other trajectories of the truth: FN."""
        return len(self.time) - self.tracked

    @staticmethod
    def together(parts: Sequence[Etiseo]) -> Etiseo:
        """Return several sequences as one: every object counts once, whichever sequence it is of."""
        return Etiseo(
            np.concatenate([one.time for one in parts]),
            np.concatenate([one.persistence for one in parts]),
            np.concatenate([one.confusion for one in parts]),
            sum(one.noisy for one in parts),
        )


def etiseo(compared: Compared, least_dice: float = 0.5) -> Etiseo:
    """Return the scores of a sequence.

    Parameters
    ----------
    compared : Compared
        The two sides.
    least_dice : float
        In (0, 1]. For a threshold t on intersection over union give 2 t / (1 + t).
    """
    met = _meetings(compared, least_dice)
    longest = np.zeros(len(met.present), np.int64)
    np.maximum.at(longest, met.reference, met.frames)
    ids_of_reference = np.bincount(met.reference, minlength=len(met.present))
    references_of_id = np.bincount(met.track, minlength=len(met.said))
    on_somebody = np.bincount(met.track, weights=met.frames, minlength=len(met.said))
    return Etiseo(
        time=longest / met.present,
        persistence=np.where(ids_of_reference > 0, 1.0 / np.maximum(1, ids_of_reference), 0.0),
        confusion=1.0 / references_of_id[references_of_id > 0],
        noisy=int((on_somebody <= (1.0 - _MOST) * met.said).sum()),
    )


class _Meetings(NamedTuple):
    """Every pair of reference and tracked object that were ever matched, and for how many frames."""

    reference: Index  # (P,)
    track: Index  # (P,)
    frames: Index  # (P,)
    present: Index  # (R,) frames of each reference
    said: Index  # (T,) frames of each tracked object


def _meetings(compared: Compared, least_dice: float) -> _Meetings:
    references, tracked = compared.true_ids, compared.said_ids
    reference, track = (
        np.searchsorted(ids, side.ids) for ids, side in ((references, compared.truth), (tracked, compared.said))
    )
    keys = [np.zeros(0, np.int64)]
    for moment in compared.moments:
        dice = 2.0 * moment.overlap / (1.0 + moment.overlap)
        rows, columns = best_pairs(reaching(dice, least_dice))
        keys.append(reference[moment.truth[rows]] * len(tracked) + track[moment.said[columns]])
    pairs, frames = np.unique(np.concatenate(keys), return_counts=True)
    return _Meetings(
        pairs // max(1, len(tracked)),
        pairs % max(1, len(tracked)),
        frames,
        np.bincount(reference, minlength=len(references)),
        np.bincount(track, minlength=len(tracked)),
    )


def _mean(values: Float) -> float:
    return float(values.mean()) if len(values) else 0.0

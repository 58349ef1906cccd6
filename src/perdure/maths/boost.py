"""Discrete AdaBoost over similarities, each the only thing that its weak classifier looks at (eq. 11-14).

Weak classifier k says +1 (the same) of a sample if its similarity k is at least a threshold, else -1, and nothing (0)
where it is not known. The paper has no word for the unknown: by its eq. 12 who says nothing never errs. Here it counts
as half an error and leaves the sample's weight as it is, as Freund and Schapire have it (Schapire and Singer 1999,
"Improved boosting algorithms using confidence-rated predictions", section 3.2), so that what is seldom known is seldom
chosen, and the weighted error of the whole still falls at every round.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Bits = NDArray[np.bool_]
Labels = NDArray[np.integer]
LARGEST = 4.0  # α of a classifier that never errs; ε would be 3 in 10000
_EVEN = 0.5 - 1e-9  # an error from which on a classifier says nothing


class Round(NamedTuple):
    """What one round chose."""

    feature: int
    threshold: float
    alpha: float
    error: float  # weighted, of the samples as they weighed in this round


class Boosted(NamedTuple):
    """The rounds, and for each feature the sum of its α, all together 1; all 0 if no round chose any."""

    rounds: tuple[Round, ...]
    weights: Float  # (K,)


class _Choice(NamedTuple):
    """The best threshold of each feature, and its error."""

    thresholds: Float  # (K,)
    errors: Float  # (K,)


def boost_at(
    threshold: float, similarities: Float, known: Bits, labels: Labels, initial: Float, rounds: int
) -> Boosted:
    """Learn weights with one threshold for all features and rounds: Th1, as the paper has it (eq. 11-14).

    Parameters
    ----------
    threshold : float
        From which similarity on two things count as the same.
    similarities : (N, K) array
        In [0, 1].
    known : (N, K) bool
        Where a similarity says anything.
    labels : (N,) array
        +1 the same, -1 different.
    initial : (N,) array
        What each sample weighs at first, ≥ 0 and not all 0; brought to a sum of 1.
    rounds : int
        Z, at most so many; it ends sooner if no feature errs in less than half, or one never errs.

    Examples
    --------
    >>> similarities = np.array([[0.9, 0.9], [0.9, 0.1], [0.1, 0.1], [0.8, 0.1]])
    >>> found = boost_at(0.5, similarities, similarities > 0, np.array([1, 1, -1, -1]), np.ones(4), 1)
    >>> found.rounds[0].feature, found.rounds[0].error, found.weights.tolist()
    (0, 0.25, [1.0, 0.0])
    """
    above = similarities >= threshold
    even = np.full(similarities.shape[1], threshold)

    def choose(weights: Float) -> _Choice:
        return _Choice(even, _errors(above, known, labels, weights))

    return _boost(choose, similarities, known, labels, initial, rounds)


def boost_stumps(similarities: Float, known: Bits, labels: Labels, initial: Float, rounds: int) -> Boosted:
    """Learn weights with a threshold for each feature and round, that of least error; parameters as of `boost_at`.

    A threshold lies midway between two similarities that are there: one that tells nothing apart is none.
    """
    stumps = _Stumps.of(similarities, known, labels)
    return _boost(stumps.choose, similarities, known, labels, initial, rounds)


def best_thresholds(similarities: Float, known: Bits, labels: Labels, initial: Float) -> tuple[Float, Float]:
    """Return for each feature alone its best threshold and the error there (K,), (K,); 1 and ½ where there is none."""
    choice = _Stumps.of(similarities, known, labels).choose(initial / initial.sum())
    return choice.thresholds, choice.errors


def errors_at(threshold: float, similarities: Float, known: Bits, labels: Labels, initial: Float) -> Float:
    """Return the error (K,) of each feature alone at a threshold (eq. 12)."""
    return _errors(similarities >= threshold, known, labels, initial / initial.sum())


def separation(similarities: Float, known: Bits, labels: Labels) -> Float:
    """Return for each feature (K,) how often a same pair is more alike than a different one: the area under its curve.

    Half where two are equally alike, or where there are no pairs of both kinds of which it is known.

    >>> separation(np.array([[0.9], [0.5], [0.5]]), np.ones((3, 1), bool), np.array([1, 1, -1])).tolist()
    [0.75]
    """
    found = np.full(similarities.shape[1], 0.5)
    for k in range(similarities.shape[1]):
        there = known[:, k]
        values, same = similarities[there, k], labels[there] > 0
        count = int(same.sum()), int((~same).sum())
        if min(count):
            different = np.sort(values[~same])
            below = np.searchsorted(different, values[same], "left").sum()
            upto = np.searchsorted(different, values[same], "right").sum()
            found[k] = (below + upto) / (2.0 * count[0] * count[1])
    return found


def _boost(
    choose: Callable[[Float], _Choice],
    similarities: Float,
    known: Bits,
    labels: Labels,
    initial: Float,
    rounds: int,
) -> Boosted:
    """Choose, weigh and weigh anew, until nothing is left to choose (eq. 12-14)."""
    weights = initial / initial.sum()  # (N,)
    chosen: list[Round] = []
    total = np.zeros(similarities.shape[1])
    for _ in range(rounds):
        thresholds, errors = choose(weights)
        k = int(np.argmin(errors))
        error = float(errors[k])
        if error >= _EVEN:
            break
        alpha = min(LARGEST, 0.5 * float(np.log((1.0 - error) / max(error, 1e-12))))  # eq. 13
        chosen.append(Round(k, float(thresholds[k]), alpha, error))
        total[k] += alpha
        if error <= 1e-12:
            break
        said = np.where(similarities[:, k] >= thresholds[k], 1.0, -1.0) * known[:, k]
        weights = weights * np.exp(-alpha * labels * said)  # eq. 14
        weights /= weights.sum()
    return Boosted(tuple(chosen), total / total.sum() if chosen else total)


def _errors(above: Bits, known: Bits, labels: Labels, weights: Float) -> Float:
    """The weighted errors (K,) (eq. 12); what is not known is half wrong."""
    wrong = np.where(known, above != (labels > 0)[:, None], 0.5)  # (N, K)
    return np.asarray(weights @ wrong)


class _Stumps(NamedTuple):
    """Samples in the order of each similarity, sorted once for all rounds."""

    order: NDArray[np.intp]  # (N, K)
    middles: Float  # (N - 1, K) between neighbours in that order
    usable: Bits  # (N - 1, K) where the two are known and differ
    known: Bits
    signs: Float  # (N,)

    @staticmethod
    def of(similarities: Float, known: Bits, labels: Labels) -> _Stumps:
        """Sort; what is not known comes last."""
        values = np.where(known, similarities, np.inf)
        order = np.argsort(values, axis=0, kind="stable")
        values = np.take_along_axis(values, order, axis=0)
        low, high = values[:-1], values[1:]
        usable = np.isfinite(high) & (low < high)
        middles = np.where(usable, low + (np.where(usable, high, 0.0) - np.where(usable, low, 0.0)) / 2, 1.0)
        usable &= (low < middles) & (middles <= high)
        return _Stumps(order, middles, usable, known, np.where(labels > 0, 1.0, -1.0))

    def choose(self, weights: Float) -> _Choice:
        """Return the threshold of least error of each feature; ties go to the lowest."""
        count = self.known.shape[1]
        if not len(self.middles):
            return _Choice(np.ones(count), np.full(count, 0.5))
        signed = np.where(self.known, (weights * self.signs)[:, None], 0.0)  # (N, K)
        below = np.cumsum(np.take_along_axis(signed, self.order, axis=0), axis=0)[:-1]  # same less different
        different = np.maximum(-signed, 0.0).sum(axis=0)  # those wrong if all were called the same
        unknown = np.where(self.known, 0.0, weights[:, None]).sum(axis=0)
        errors = np.where(self.usable, below + different + 0.5 * unknown, np.inf)  # (N - 1, K)
        best = np.argmin(errors, axis=0)  # (K,)
        columns = np.arange(count)
        least = np.where(self.usable.any(axis=0), np.maximum(errors[best, columns], 0.0), 0.5)
        return _Choice(self.middles[best, columns], least)

"""Scores of association from `motrics` (equal to TrackEval's): HOTA (Luiten et al. 2021), IDF1 (Ristani et al. 2016)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perdure.metrics.compared import Compared

Float = NDArray[np.float64]
ALPHAS = tuple(round(0.05 * step, 2) for step in range(1, 20))  # thresholds of overlap, .05 to .95


@dataclass(frozen=True, eq=False)
class Hota:
    """Counts at each threshold of overlap, (19,) each; of several sequences they add up."""

    found: Float  # TP
    missed: Float  # FN
    wrong: Float  # FP
    association: Float  # association accuracy, summed over the found
    association_recall: Float  # the same of association recall
    association_precision: Float  # the same of association precision
    overlap: Float  # summed over the found

    @property
    def deta(self) -> Float:
        """Detection accuracy (19,)."""
        return self.found / np.maximum(1, self.found + self.missed + self.wrong)

    @property
    def detection_recall(self) -> Float:
        """DetRe (19,)."""
        return self.found / np.maximum(1, self.found + self.missed)

    @property
    def detection_precision(self) -> Float:
        """DetPr (19,)."""
        return self.found / np.maximum(1, self.found + self.wrong)

    @property
    def assa(self) -> Float:
        """Association accuracy (19,)."""
        return self.association / np.maximum(1, self.found)

    @property
    def loca(self) -> Float:
        """Mean overlap of the found (19,); 1 where nothing is found."""
        return np.maximum(1e-10, self.overlap) / np.maximum(1e-10, self.found)

    @property
    def hota(self) -> Float:
        """sqrt(DetA · AssA) (19,); the score is their mean."""
        return np.sqrt(self.deta * self.assa)

    @staticmethod
    def together(parts: Sequence[Hota]) -> Hota:
        """Return the counts of several sequences as of one."""
        return Hota(
            *(np.sum(values, axis=0) for values in zip(*(vars(one).values() for one in parts), strict=True))
        )


@dataclass(frozen=True)
class Identity:
    """Rows with the right identity, each object being allowed one said id and each said id one object."""

    found: int = 0  # IDTP
    missed: int = 0  # IDFN
    wrong: int = 0  # IDFP

    @property
    def precision(self) -> float:
        """IDP."""
        return self.found / max(1, self.found + self.wrong)

    @property
    def recall(self) -> float:
        """IDR."""
        return self.found / max(1, self.found + self.missed)

    @property
    def f1(self) -> float:
        """IDF1."""
        return self.found / max(1.0, self.found + 0.5 * (self.wrong + self.missed))

    @staticmethod
    def together(parts: Sequence[Identity]) -> Identity:
        """Return the counts of several sequences as of one."""
        return Identity(*(sum(values) for values in zip(*(vars(one).values() for one in parts), strict=True)))


def hota(compared: Compared) -> Hota:
    """Return the HOTA counts; an empty side finds nothing."""
    from motrics import compute_hota, compute_hota_from_similarity

    none = np.zeros(len(ALPHAS))
    if not (len(compared.truth) and len(compared.said)):
        return Hota(none, none + len(compared.truth), none + len(compared.said), none, none, none, none)
    if compared.masks:
        result = compute_hota_from_similarity(*_ids(compared), _overlaps(compared))
    else:
        result = compute_hota(*_ids_and_boxes(compared))
    found = np.array(result.hota_tp_alphas, np.float64)
    means = (result.assa_alphas, result.ass_re_alphas, result.ass_pr_alphas, result.loca_alphas)
    return Hota(
        found,
        np.array(result.hota_fn_alphas, np.float64),
        np.array(result.hota_fp_alphas, np.float64),
        *(np.array(mean, np.float64) * found for mean in means),
    )


def identity(compared: Compared, least_overlap: float = 0.5) -> Identity:
    """Return the identity counts at one threshold of overlap; an empty side finds nothing."""
    from motrics import compute_identity, compute_identity_from_similarity

    if not (len(compared.truth) and len(compared.said)):
        return Identity(0, len(compared.truth), len(compared.said))
    if compared.masks:
        result = compute_identity_from_similarity(*_ids(compared), _overlaps(compared), threshold=least_overlap)
    else:
        result = compute_identity(*_ids_and_boxes(compared), iou_threshold=least_overlap)
    return Identity(result.idtp, result.idfn, result.idfp)


def _ids(compared: Compared) -> tuple[list[list[int]], list[list[int]]]:
    """The identities of both sides, frame by frame."""
    return (
        [compared.truth.ids[moment.truth].tolist() for moment in compared.moments],
        [compared.said.ids[moment.said].tolist() for moment in compared.moments],
    )


def _overlaps(compared: Compared) -> list[list[list[float]]]:
    return [moment.overlap.tolist() for moment in compared.moments]


def _ids_and_boxes(compared: Compared) -> tuple[list[list[int]], list[Float], list[list[int]], list[Float]]:
    """What motrics wants of boxes, whose overlaps it finds without making lists of them."""
    truth, said = _ids(compared)
    return (
        truth,
        [compared.truth.boxes[moment.truth] for moment in compared.moments],
        said,
        [compared.said.boxes[moment.said] for moment in compared.moments],
    )

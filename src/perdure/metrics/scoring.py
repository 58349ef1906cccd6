"""All scores of one sequence, and of several together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perdure.metrics.clear import Clear, Pairs, count, pair
from perdure.metrics.compared import Compared, compare
from perdure.metrics.etiseo import Etiseo, etiseo
from perdure.metrics.identity import Hota, Identity, hota, identity
from perdure.types import Rows, Tracks

LEAST_OVERLAP = 0.5  # of CLEAR and identity
LEAST_DICE = 0.5  # of ETISEO


@dataclass(frozen=True, eq=False)
class Score:
    """Counts of one sequence, or of several together.

    Parameters
    ----------
    hota, clear, identity, etiseo
        The counts of each family.
    said : int
        Rows of the result that were scored.
    said_ids, true_ids : int
        Identities among them, and in the truth.
    excused : int
        Rows of the result taken away because they lie on what is not asked for.
    masks : bool
        True where silhouettes were compared, not boxes.
    """

    hota: Hota
    clear: Clear
    identity: Identity
    etiseo: Etiseo
    said: int
    said_ids: int
    true_ids: int
    excused: int
    masks: bool = False

    @property
    def figures(self) -> dict[str, float]:
        """Every figure by its usual name; ratios as such, not in percent, and never NaN."""
        tail = "S" if self.masks else ""
        ratios = {
            "HOTA": self.hota.hota.mean(),
            "DetA": self.hota.deta.mean(),
            "AssA": self.hota.assa.mean(),
            "LocA": self.hota.loca.mean(),
            f"MOT{tail}A": self.clear.mota,
            **({"sMOTSA": self.clear.soft_mota} if self.masks else {}),
            f"MOT{tail}P": self.clear.motp,
            "Recall": self.clear.recall,
            "Precision": self.clear.precision,
            "DetRe": self.hota.detection_recall.mean(),
            "DetPr": self.hota.detection_precision.mean(),
            "AssRe": (self.hota.association_recall / np.maximum(1, self.hota.found)).mean(),
            "AssPr": (self.hota.association_precision / np.maximum(1, self.hota.found)).mean(),
            "IDF1": self.identity.f1,
            "IDP": self.identity.precision,
            "IDR": self.identity.recall,
            "M1": self.etiseo.m1,
            "M2": self.etiseo.m2,
            "M3": self.etiseo.m3,
            "M": self.etiseo.mean,
        }
        return {name: float(value) for name, value in ratios.items()} | self._counts()

    def _counts(self) -> dict[str, float]:
        return {
            "TP": self.clear.found,
            "FP": self.clear.wrong,
            "FN": self.clear.missed,
            "IDSW": self.clear.switches,
            "Frag": self.clear.breaks,
            "MT": self.clear.mostly_tracked,
            "PT": self.clear.partly_tracked,
            "ML": self.clear.mostly_lost,
            "tracks_TP": self.etiseo.tracked,
            "tracks_FN": self.etiseo.lost,
            "tracks_FP": self.etiseo.noisy,
            "truth_rows": self.clear.truth,
            "truth_ids": self.true_ids,
            "rows": self.said,
            "ids": self.said_ids,
            "excused": self.excused,
        }

    @staticmethod
    def together(parts: Sequence[Score]) -> Score:
        """Return several sequences as one: counts add up, objects follow one another, as TrackEval combines."""
        if not parts:
            raise ValueError("no scores to put together")
        return Score(
            Hota.together([one.hota for one in parts]),
            Clear.together([one.clear for one in parts]),
            Identity.together([one.identity for one in parts]),
            Etiseo.together([one.etiseo for one in parts]),
            sum(one.said for one in parts),
            sum(one.said_ids for one in parts),
            sum(one.true_ids for one in parts),
            sum(one.excused for one in parts),
            parts[0].masks,
        )


def score(
    said: Tracks | Rows, truth: Tracks | Rows, *, masks: bool = False, report_confidence: float = 0.5
) -> Score:
    """Score what was said against what is true.

    HOTA and IDF1 with `motrics`, CLEAR and ETISEO with ours; boxes match from IoU 0.5, in ETISEO from Dice 0.5.

    Parameters
    ----------
    said : Tracks or Rows
        Of `Tracks` the rows that count: `Tracks.counted(report_confidence)`; of `Rows` all.
    truth : Tracks or Rows
        `Rows` may say which of them are to be ignored (`Use`); of `Tracks` all count.
    masks : bool
        Compare silhouettes instead of boxes.
    report_confidence : float
        Hidden targets count from this confidence on.

    Raises
    ------
    ValueError
        If masks are asked for and a side that has rows has none, or one id stands twice in a frame.

    Examples
    --------
    >>> truth = Tracks.of(frames=[0, 1], times=[0, 1], ids=[1, 1], boxes=[[0, 0, 9, 9], [1, 0, 10, 9]])
    >>> figures = score(truth.replace(ids=np.array([7, 8])), truth).figures
    >>> figures["MOTA"], figures["IDSW"], round(figures["HOTA"], 3)
    (0.5, 1, 0.707)
    """
    counted = said.counted(report_confidence) if isinstance(said, Tracks) else said
    return score_compared(compare(as_rows(counted), as_rows(truth), masks=masks), masks=masks)


def score_compared(compared: Compared, pairs: Pairs | None = None, *, masks: bool = False) -> Score:
    """Score two sides that were laid beside each other; `pairs` where CLEAR's matching is there already."""
    pairs = pair(compared, LEAST_OVERLAP) if pairs is None else pairs
    return Score(
        hota=hota(compared),
        clear=count(compared, pairs),
        identity=identity(compared, LEAST_OVERLAP),
        etiseo=etiseo(compared, LEAST_DICE),
        said=len(compared.said),
        said_ids=len(compared.said_ids),
        true_ids=len(compared.true_ids),
        excused=compared.excused,
        masks=masks,
    )


def as_rows(side: Tracks | Rows) -> Rows:
    """Return one side as rows; ValueError where one id stands twice in a frame."""
    rows = Rows.of_tracks(side) if isinstance(side, Tracks) else side
    order = np.lexsort((rows.ids, rows.frames))
    twice = (np.diff(rows.frames[order]) == 0) & (np.diff(rows.ids[order]) == 0) & (rows.use[order][1:] < 3)
    if twice.any():
        place = order[1:][twice][0]
        raise ValueError(f"id {rows.ids[place]} stands twice in frame {rows.frames[place]}")
    return rows

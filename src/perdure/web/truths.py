"""A truth beside a run: its rows, how the run scores against it, and where the two part."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np

from perdure.comparison import Comparison, Wanted, compare_files
from perdure.errors import PerdureError
from perdure.files.scored import Match, name_of, read_scored_truth
from perdure.metrics.mistakes import Mistake
from perdure.types import Rows
from perdure.web.settled import Settled

Json = Any
FIGURES = ("HOTA", "DetA", "AssA", "MOTA", "IDF1", "IDP", "IDR", "IDSW", "Frag", "FP", "FN")
_SHOWN = 400  # mistakes, worst first


class OpenTruth:
    """The truth of one run; every method may be called from any thread.

    Parameters
    ----------
    path : Path
        MOT or MOTS text, or a folder with gt/gt.txt.

    Raises
    ------
    FormatError
        If it is not what it should be.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.name = path, name_of(path)
        read = read_scored_truth(path, masks=False)
        rows = read.boxes if read.boxes is not None else read.masks
        self.settled = Settled.of_truth(rows if rows is not None else Rows.of(frames=(), ids=(), boxes=()))
        self._lock = threading.Lock()
        self._score: tuple[object, dict[str, Json]] | None = None

    def tracks(self) -> dict[str, Json]:
        """Return where each object is, stretch by stretch."""
        return {"spans": self.settled.spans(), "groups": [], "classes": {}}

    def rows(self, begin: int, end: int) -> bytes:
        """Return the rows of some frames, packed."""
        return self.settled.between(begin, end).packed()

    def score(self, run: Path, edition: object) -> dict[str, Json]:
        """Return the figures of a run against this, and its mistakes; `edition` tells one state of the run from another.

        Raises
        ------
        PerdureError
            If the two cannot be compared.
        """
        with self._lock:
            if self._score is None or self._score[0] != edition:
                try:
                    compared = compare_files(Match(self.name, run, self.path), Wanted(mistakes=True))
                except ValueError as error:
                    raise PerdureError(f"{run} against {self.path}: {error}") from error
                self._score = edition, _value(compared)
            return self._score[1]


def _value(one: Comparison) -> dict[str, Json]:
    score = one.boxes or one.masks
    figures = {} if score is None else score.figures
    kinds = [fault.kind for fault in one.mistakes]
    return {
        "figures": {name: _plain(figures[name]) for name in FIGURES if name in figures},
        "counts": {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)},
        "mistakes": [_mistake(fault) for fault in one.mistakes[:_SHOWN]],
        "protocol": one.protocol,
    }


def _plain(value: Any) -> float | int:
    return int(value) if isinstance(value, (int, np.integer)) else round(float(value), 6)


def _mistake(fault: Mistake) -> dict[str, Json]:
    return {
        "kind": fault.kind,
        "begin": fault.begin,
        "end": fault.end,
        "true_ids": list(fault.true_ids),
        "ids": list(fault.said_ids),
        "box": [round(side, 1) for side in fault.box],
        "cost": fault.cost,
        "text": fault.text,
    }

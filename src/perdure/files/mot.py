"""MOTChallenge text: `frame, id, left, top, width, height, confidence, …`; frames and pixels count from 1."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError
from perdure.files.lines import four_digits
from perdure.files.mot_table import MotTable, read_table
from perdure.types import Regions, Rows, Tracks, Use

CLASSES = (  # of MOT16 and later, from 1
    *("pedestrian", "person on vehicle", "car", "bicycle", "motorbike", "non-motorized vehicle", "static person"),
    *("distractor", "occluder", "occluder on the ground", "occluder full", "reflection", "crowd"),
)
PROTOCOLS = ("mot15", "mot17", "mot20")
_PEDESTRIAN = 1
_DISTRACTORS = {"mot15": (), "mot17": (2, 7, 8, 12), "mot20": (2, 6, 7, 8, 12)}
_LAST_CLASS = len(CLASSES)
_LARGEST = 2**53  # id: beyond it floats are not exact


def write_rows(file: IO[str], rows: Tracks) -> None:
    """Write rows as MOTChallenge lines: frame and corner counted from 1, two decimals."""
    for frame, identity, box, confidence in zip(rows.frames, rows.ids, rows.boxes, rows.confidence, strict=True):
        left, top, right, bottom = (float(one) for one in box)
        file.write(
            f"{frame + 1},{identity},{left + 1:.2f},{top + 1:.2f},{right - left:.2f},{bottom - top:.2f},"
            f"{four_digits(confidence)},-1,-1,-1\n"
        )


def read_tracks(path: Path, fps: float = 25.0) -> Tracks:
    """Return the rows of a MOTChallenge result file; times from `fps`.

    Raises
    ------
    FormatError
        Naming file and line.
    """
    table = read_table(path)
    frames = table.values[:, 0] - 1
    return Tracks.of(
        frames=frames,
        times=frames / fps,
        ids=table.values[:, 1],
        boxes=table.boxes,
        confidence=table.column(6, 1.0),
    )


def read_said(path: str | Path) -> Rows:
    """Return the rows of a MOTChallenge result file for scoring; whatever their confidence, all count.

    Raises
    ------
    FormatError
        Naming file and line; also for an id below 1, as detections have, and one that stands twice in a frame.
    """
    table = read_table(path)
    return _rows(table, np.zeros(len(table.values), np.int8))


def read_truth(path: str | Path, protocol: str = "auto") -> Rows:
    """Return the rows of a MOTChallenge truth, each marked as the benchmark uses it.

    Parameters
    ----------
    path : str or Path
        Of the text.
    protocol : 'auto', 'mot15', 'mot17' or 'mot20'
        'mot15': rows whose 7th column (the flag) is 0 are not asked for. 'mot17': the 8th column is a class; only
        pedestrians (1) are asked for, and rows said on a person on a vehicle (2), a static person (7), a
        distractor (8) or a reflection (12) are excused. 'mot20': on other vehicles (6) as well. 'auto': 'mot17'
        for nine columns of which the 8th is always a class from 1 to 13, and 1 at least once, else 'mot15'.

    Raises
    ------
    FormatError
        Naming file and line; also where a protocol wants a class and there is none.
    """
    table = read_table(path)
    return _rows(table, _use(table, protocol_of(table) if protocol == "auto" else protocol))


def protocol_of(table: MotTable) -> str:
    """Return the protocol that a truth's columns speak of: 'mot17' or 'mot15'."""
    kinds = table.column(7, -1.0)
    classes = table.values.shape[1] == 9 and np.isin(kinds, np.arange(1, _LAST_CLASS + 1)).all()
    return "mot17" if classes and (kinds == _PEDESTRIAN).any() else "mot15"


def read_detections(path: Path) -> Mapping[int, Regions]:
    """Return the regions of a MOTChallenge detection file by frame, counted from 0.

    Scores outside [0, 1] are brought into it by one linear scale for the whole file.

    Raises
    ------
    FormatError
        Naming file and line.
    """
    table = read_table(path)
    scores = table.column(6, 1.0)
    if len(scores) and (scores.min() < 0 or scores.max() > 1):
        span = scores.max() - scores.min()
        scores = (scores - scores.min()) / span if span > 0 else np.ones(len(scores))
    boxes, numbers = table.boxes.astype(np.float32), table.values[:, 0]
    order = np.argsort(numbers, kind="stable")
    frames, starts = np.unique(numbers[order], return_index=True)
    groups = np.split(order, starts[1:]) if len(frames) else []
    return {
        int(frame) - 1: Regions.of(boxes[rows], scores=scores[rows])
        for frame, rows in zip(frames, groups, strict=True)
    }


def _use(table: MotTable, protocol: str) -> NDArray[np.int8]:
    flagged = np.trunc(table.column(6, 1.0)) == 0
    if protocol == "mot15":
        return np.where(flagged, Use.IGNORED, Use.SCORED).astype(np.int8)
    if table.values.shape[1] < 8 and len(table.values):
        raise FormatError(f"{table.path} has no class in an 8th column, which {protocol} wants; score it as mot15")
    kind = table.column(7, -1.0)
    use = np.where(flagged | (kind != _PEDESTRIAN), Use.IGNORED, Use.SCORED)
    return np.where(np.isin(kind, _DISTRACTORS[protocol]), Use.DISTRACTOR, use).astype(np.int8)


def _rows(table: MotTable, use: NDArray[np.int8]) -> Rows:
    frames, ids = table.values[:, 0].astype(np.int64) - 1, table.values[:, 1]
    wrong = (ids < 1) | (ids != np.floor(ids)) | (ids > _LARGEST)
    if wrong.any():
        place = int(np.argmax(wrong))
        hint = "; these are detections, not tracks" if ids[place] == -1 else ""
        raise FormatError(
            f"{table.path}, line {table.lines[place]}: id {ids[place]:g} is not a whole number ≥ 1{hint}"
        )
    order = np.lexsort((ids, frames))
    twice = (np.diff(frames[order]) == 0) & (np.diff(ids[order]) == 0)
    if twice.any():
        first, second = order[:-1][twice][0], order[1:][twice][0]
        raise FormatError(
            f"{table.path}, line {table.lines[second]}: id {ids[second]:.0f} stands twice in frame"
            f" {frames[second] + 1}, first in line {table.lines[first]}"
        )
    return Rows.of(frames=frames, ids=ids, boxes=table.boxes, use=use)

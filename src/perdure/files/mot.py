"""MOTChallenge text: `frame, id, left, top, width, height, confidence, …`; frames and pixels count from 1."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError
from perdure.files.span import shown
from perdure.types import Regions, Tracks
from perdure.types.regions import FARTHEST


def write_rows(file: IO[str], rows: Tracks) -> None:
    """Write rows as MOTChallenge lines: frame and corner counted from 1, two decimals."""
    for frame, identity, box, confidence in zip(rows.frames, rows.ids, rows.boxes, rows.confidence, strict=True):
        left, top, right, bottom = (float(one) for one in box)
        file.write(
            f"{frame + 1},{identity},{left + 1:.2f},{top + 1:.2f},{right - left:.2f},{bottom - top:.2f},"
            f"{confidence:.4g},-1,-1,-1\n"
        )


def read_tracks(path: Path, fps: float = 25.0) -> Tracks:
    """Return the rows of a MOTChallenge result file; times from `fps`.

    Raises
    ------
    FormatError
        Naming file and line.
    """
    table = read_table(path)
    return Tracks.of(
        frames=table[:, 0] - 1,
        times=(table[:, 0] - 1) / fps,
        ids=table[:, 1],
        boxes=_boxes(table),
        confidence=table[:, 6] if table.shape[1] > 6 else None,
    )


def read_detections(path: Path) -> Mapping[int, Regions]:
    """Return the regions of a MOTChallenge detection file by frame, counted from 0.

    Scores outside [0, 1] are brought into it by one linear scale for the whole file.

    Raises
    ------
    FormatError
        Naming file and line.
    """
    table = read_table(path)
    scores = table[:, 6] if table.shape[1] > 6 else np.ones(len(table))
    if len(scores) and (scores.min() < 0 or scores.max() > 1):
        span = scores.max() - scores.min()
        scores = (scores - scores.min()) / span if span > 0 else np.ones(len(scores))
    boxes = _boxes(table)
    order = np.argsort(table[:, 0], kind="stable")
    frames, starts = np.unique(table[order, 0], return_index=True)
    groups = np.split(order, starts[1:]) if len(frames) else []
    return {
        int(frame) - 1: Regions.of(boxes[rows], scores=scores[rows])
        for frame, rows in zip(frames, groups, strict=True)
    }


def read_table(path: Path) -> NDArray[np.float64]:
    """Return the numbers of a MOTChallenge file, (N, 6 or more); commas or blanks between them.

    Raises
    ------
    FormatError
        Naming file and line, for a line that is no such row.
    """
    rows: list[list[float]] = []
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"cannot read {path}: {getattr(error, 'strerror', None) or 'it is not text'}") from error
    for number, line in enumerate(lines, 1):
        if line.strip():
            rows.append(_row(path, number, line))
            if len(rows[-1]) != len(rows[0]):
                raise FormatError(
                    f"{path}, line {number}: {len(rows[-1])} columns where line 1 has {len(rows[0])}"
                )
    return np.array(rows, np.float64) if rows else np.zeros((0, 7))


def _row(path: Path, number: int, line: str) -> list[float]:
    row = [_number(path, number, word) for word in _cells(path, number, line)]
    if len(row) < 6 or not np.isfinite(row).all():
        raise FormatError(
            f"{path}, line {number}: {shown(line.strip())} is not frame, id, left, top, width, height"
        )
    if not 1 <= row[0] <= _LAST or row[0] != int(row[0]):
        raise FormatError(f"{path}, line {number}: frame {row[0]:g} is not a whole number from 1 to {_LAST}")
    left, top, width, height = row[2:6]
    reach = max(abs(one - 1) for one in (left, top, left + width, top + height))
    if min(width, height) < 0 or reach > FARTHEST:
        raise FormatError(f"{path}, line {number}: a box of {width:g}x{height:g} at ({left:g}, {top:g}) cannot be")
    if max(abs(one) for one in row[6:7] or [0]) > _SUREST:
        raise FormatError(f"{path}, line {number}: a confidence of {row[6]:g} cannot be")
    return row


def _cells(path: Path, number: int, line: str) -> list[str]:
    """The words of a line: between commas, one of which may end it, or else between blanks."""
    if "," not in line:
        return line.split()
    cells = [cell.strip() for cell in line.strip().removesuffix(",").split(",")]
    if "" in cells:
        raise FormatError(
            f"{path}, line {number}: cell {cells.index('') + 1} is empty; give a number, -1 for none"
        )
    return cells


def _number(path: Path, number: int, word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise FormatError(
            f"{path}, line {number}: {shown(word)} is no number; wanted are frame, id, left, top, …"
        ) from None


def _boxes(table: NDArray[np.float64]) -> NDArray[np.float32]:
    corner = table[:, 2:4] - 1.0
    return np.concatenate([corner, corner + table[:, 4:6]], axis=1).astype(np.float32)


_LAST = 10**9  # frame
_SUREST = 1e30  # beyond which a span of scores might not be a number

"""The numbers of a MOTChallenge file: `frame, id, left, top, width, height, …`, each with its line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError
from perdure.files.lines import number_of
from perdure.files.span import shown
from perdure.types.regions import FARTHEST


class MotTable(NamedTuple):
    """The rows of a file, as it counts them: frames and pixels from 1."""

    path: Path
    values: NDArray[np.float64]  # (N, 6 or more)
    lines: NDArray[np.int64]  # (N,) the line that each row stands in, from 1

    @property
    def boxes(self) -> NDArray[np.float64]:
        """(N, 4) x1 y1 x2 y2, half-open, pixels from 0."""
        corner = self.values[:, 2:4] - 1.0
        return np.concatenate([corner, corner + self.values[:, 4:6]], axis=1)

    def column(self, place: int, default: float) -> NDArray[np.float64]:
        """A column, counted from 0; the default where the file has not so many."""
        if self.values.shape[1] > place:
            return np.asarray(self.values[:, place], np.float64)
        return np.full(len(self.values), default)


def read_table(path: str | Path) -> MotTable:
    """Return the numbers of a MOTChallenge file; commas or blanks between them.

    Raises
    ------
    FormatError
        Naming file and line, for a line that is no such row.
    """
    path = Path(path)
    lines = read_lines(path)
    values = _quickly(lines)
    if values is not None and len(values) == len(lines):
        return MotTable(path, values, np.arange(1, len(lines) + 1))
    filled = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    numbers = np.array([number for number, _ in filled], np.int64)
    return MotTable(path, _carefully(path, filled), numbers)


def read_lines(path: Path) -> list[str]:
    """Return the lines of a text.

    Raises
    ------
    FormatError
        If it cannot be read or is not text, or was cut off within its last number, as far as that can be seen.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"cannot read {path}: {getattr(error, 'strerror', None) or 'it is not text'}") from error
    lines = text.splitlines()
    if text[-1:] not in ("", "\n", "\r"):
        _refuse_cut(path, lines)
    return lines


def _refuse_cut(path: Path, lines: list[str]) -> None:
    """Refuse a last line without an end whose last number has fewer decimals than that of all the others, who have as many."""
    words = [line.replace(",", " ").split() for line in lines]
    decimals = [_DECIMALS.fullmatch(several[-1]) for several in words if several]
    *others, last = [len(one[1] or "") if one else -1 for one in decimals] or [-1]
    if len(others) >= _MANY and len(set(others)) == 1 and 0 <= last < others[0]:
        raise FormatError(
            f"{path}, line {len(lines)}: its last number has fewer decimals than those above it, and the line has no end:"
            " the file was cut off; take it anew, or end the line if it is whole"
        )


def _quickly(lines: list[str]) -> NDArray[np.float64] | None:
    """All rows at once; None where any of them needs a closer look; fewer than the lines where some are blank."""
    if not lines or not lines[0].strip():
        return None if lines else np.zeros((0, 7))
    try:
        values = np.loadtxt(lines, np.float64, delimiter="," if "," in lines[0] else None, comments=None, ndmin=2)
    except ValueError:
        return None
    if values.shape[1] < 6 or not np.isfinite(values).all():
        return None
    if np.abs(values[:, 2:6]).max() > 4 * FARTHEST:
        return None
    frame, corner, size = values[:, 0], values[:, 2:4] - 1.0, values[:, 4:6]
    good = (frame >= 1) & (frame <= _LAST) & (frame == np.floor(frame)) & (size >= 0).all(axis=1)
    good &= (np.abs(corner) <= FARTHEST).all(axis=1) & (np.abs(corner + size) <= FARTHEST).all(axis=1)
    good &= (np.abs(values[:, 6:7]) <= _SUREST).all(axis=1)
    return values if good.all() else None


def _carefully(path: Path, lines: list[tuple[int, str]]) -> NDArray[np.float64]:
    rows: list[list[float]] = []
    for number, line in lines:
        rows.append(_row(path, number, line))
        if len(rows[-1]) != len(rows[0]):
            raise FormatError(
                f"{path}, line {number}: {len(rows[-1])} columns where line {lines[0][0]} has {len(rows[0])}"
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
        return number_of(word)
    except ValueError:
        raise FormatError(
            f"{path}, line {number}: {shown(word)} is no number; wanted are frame, id, left, top, …"
        ) from None


_DECIMALS = re.compile(r"[-+]?[0-9]+(?:\.([0-9]*))?")
_MANY = 10  # lines that say how many decimals there are
_LAST = 10**9  # frame
_SUREST = 1e30  # beyond which a span of scores might not be a number

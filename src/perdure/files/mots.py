"""MOTS text: `frame id class height width rle`, a silhouette a line; frames count from 1.

The rle is COCO's compressed form of the picture's run lengths: numbers of 5 bits a letter, every one from the
fourth on written as the difference to the one before the last. pycocotools reads it in C and takes the string on
trust, so here it is decoded and checked in NumPy; what we made ourselves pycocotools compresses.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import IO, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError
from perdure.features.masks import of_picture_runs, picture_runs
from perdure.files import mot_table
from perdure.files.room import Room
from perdure.files.span import shown
from perdure.types import Mask, Rows, Tracks, Use

CAR, PERSON = 1, 2  # classes of MOTS
IGNORED_CLASS = 10  # the class of areas that are no object


class MotsRow(NamedTuple):
    """What a line says; the frame from 0."""

    frame: int
    id: int
    kind: int
    use: Use
    size: tuple[int, int]  # height, width
    mask: Mask


def read_masks(path: Path) -> Rows:
    """Return the silhouettes of a MOTS file, truth or result; those of class 10 as areas (`Use.REGION`).

    Silhouettes of a frame may overlap: those of a truth that shows whole objects do.

    Raises
    ------
    FormatError
        Naming file and line, for a line that is no such row, a size other than the first line's, and an
        object that a frame has twice.
    """
    rows = read_lines(path)
    return Rows.of(
        frames=[row.frame for row in rows],
        ids=[row.id for row in rows],
        use=[row.use for row in rows],
        masks=[row.mask for row in rows],
        size=rows[0].size if rows else None,
    )


def is_mots(path: Path) -> bool:
    """Return whether a text holds silhouettes: six words between blanks, of which the last is no number."""
    first = next((line for line in mot_table.read_lines(path) if line.strip()), "")
    words = first.split()
    return "," not in first.partition(" ")[0] and len(words) == 6 and not _is_number(words[5])


def read_lines(path: Path) -> list[MotsRow]:
    """Return what the lines of a MOTS file say, in their order; refused is what `read_masks` refuses."""
    rows: list[MotsRow] = []
    seen: dict[tuple[int, int], int] = {}
    room = Room(path.stat().st_size if path.is_file() else 0)
    for number, line in enumerate(mot_table.read_lines(path), 1):
        if not line.strip():
            continue
        try:
            row = _row(line)
            room.keep(row.mask)
            if rows and row.size != rows[0].size:
                raise ValueError(f"its picture is {_by(row.size)}, the first line's {_by(rows[0].size)}")
            if row.use is Use.SCORED:
                earlier = seen.setdefault((row.frame, row.id), number)
                if earlier != number:
                    raise ValueError(f"frame {row.frame + 1} has id {row.id} in line {earlier} already")
        except ValueError as error:
            raise FormatError(f"{path}, line {number}: {error}") from None
        rows.append(row)
    return rows


def write_masks(file: IO[str], rows: Tracks, height: int, width: int) -> int:
    """Write the silhouettes of rows as MOTS lines, and return their number; rows without one are left out.

    Rows of class 'car' have class 1, all others class 2. What lies outside the (height, width) picture is cut.
    """
    count = 0
    for frame, identity, kind, mask in zip(rows.frames, rows.ids, rows.classes, rows.masks, strict=True):
        runs = picture_runs(mask, height, width)
        if len(runs) > 1:
            number = CAR if kind == "car" else PERSON
            file.write(f"{frame + 1} {identity} {number} {height} {width} {packed_runs(runs, height, width)}\n")
            count += 1
    return count


def packed_runs(runs: NDArray[np.int64], height: int, width: int) -> str:
    """Return the compressed rle of a picture's run lengths."""
    from pycocotools import mask as coco

    packed = coco.frPyObjects({"size": [height, width], "counts": runs.tolist()}, height, width)
    return cast("str", packed["counts"].decode("ascii"))


def unpacked_runs(text: str) -> NDArray[np.int64]:
    """Return the run lengths (K,) that a compressed rle holds, whatever they are.

    Raises
    ------
    ValueError
        If it holds other letters than those from '0' to 'o', ends in the midst of a number, or holds a number
        of more than 35 bits.
    """
    digits = np.frombuffer(text.encode("utf-8"), np.uint8).astype(np.int64) - ord("0")  # (N,) of 6 bits
    if not digits.size or digits.min() < 0 or digits.max() >= 64:
        raise ValueError(f"the rle holds a letter that none may hold: {shown(text)}")
    if digits[-1] & _MORE:
        raise ValueError("the rle ends in the midst of a number")
    ends = np.flatnonzero(~digits & _MORE)  # (K,) the last letter of each number
    begins = np.concatenate([[0], ends[:-1] + 1])  # (K,)
    lengths = ends - begins + 1
    if lengths.max() > _MOST_LETTERS:
        raise ValueError("the rle holds a number that is too large")
    place = np.arange(len(digits)) - np.repeat(begins, lengths)  # of each letter in its number
    runs = np.add.reduceat((digits & _FIVE_BITS) << 5 * place, begins)  # (K,)
    runs -= ((digits[ends] & _SIGN) != 0) * (np.int64(1) << 5 * lengths)
    for parity in (1, 2):  # from the fourth on they are differences
        runs[parity::2] = np.cumsum(runs[parity::2])
    return runs


def _row(line: str) -> MotsRow:
    """Read a line; ValueError says what is wrong with it."""
    words = line.split()
    if len(words) != 6:
        raise ValueError(f"{len(words)} words; wanted are frame, id, class, height, width, rle")
    names = ("frame", "id", "class", "height", "width")
    frame, identity, kind, height, width = (_number(word, name) for word, name in zip(words, names, strict=False))
    use = Use.REGION if kind == IGNORED_CLASS else Use.SCORED
    if not 1 <= frame <= _LAST:
        raise ValueError(f"frame {frame} is not a whole number from 1 to {_LAST}")
    if identity < 1 and use is Use.SCORED:
        raise ValueError(f"id {identity} is below 1")
    if not (1 <= height <= _LONGEST_SIDE and 1 <= width <= _LONGEST_SIDE and height * width <= _LARGEST_AREA):
        raise ValueError(f"a picture of {width}x{height} cannot be")
    return MotsRow(
        frame - 1, identity, kind, use, (height, width), of_picture_runs(unpacked_runs(words[5]), height, width)
    )


def _number(word: str, name: str) -> int:
    if not re.fullmatch(r"[+-]?[0-9]{1,18}", word):
        raise ValueError(f"the {name} {shown(word)} is not a whole number")
    return int(word)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _by(size: tuple[int, int]) -> str:
    height, width = size
    return f"{width}x{height}"


_LAST = 10**9  # frame
_LONGEST_SIDE, _LARGEST_AREA = 1 << 16, 1 << 28  # px, of a picture
_FIVE_BITS, _SIGN, _MORE = 0x1F, 0x10, 0x20  # of a letter of the rle
_MOST_LETTERS = 7  # of a number

"""JSON lines: one value a line behind a header; a file cut off at any byte is still a valid one."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError
from perdure.files.span import shown
from perdure.types import PER_PIXEL, Mask, Outline
from perdure.types.frame import of_run_lengths, run_lengths

Json = Any
_LONGEST_SIDE, _LARGEST_AREA = 1 << 15, 1 << 28  # px, of a silhouette
_FAR = 10**6  # px


class NotANumber(ValueError):
    """NaN or an infinity, which JSON has not."""


class HalfALetter(ValueError):
    """One half of a surrogate pair, which is no letter."""


class Line(NamedTuple):
    """A whole line of a file: its number from 1, its place in bytes, its value."""

    number: int
    offset: int
    value: Mapping[str, Json]


def to_line(value: Json) -> str:
    """Return a value as one line of JSON, with its line end."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False, ensure_ascii=False) + "\n"


def read_lines(path: Path, kind: str, version: int) -> Iterator[Line]:
    """Yield every whole line after the header; a last line cut off is left out.

    Raises
    ------
    FormatError
        Naming file and line, if the file is not of this kind and version, or a whole line is damaged.
    """
    try:
        with path.open("rb") as file:
            header: Json = None
            offset = 0
            for number, raw in enumerate(file, 1):
                if not raw.endswith(b"\n"):
                    break  # cut off while it was written
                value = _parse(path, number, raw)
                if header is None:
                    header = value
                    check_header(path, header, kind, version)
                else:
                    yield Line(number, offset, value)
                offset += len(raw)
    except OSError as error:
        raise FormatError(f"cannot read {path}: {error.strerror or error}") from error


def line_at(path: Path, number: int, offset: int) -> Line:
    """Return the line that begins at a byte that `read_lines` gave; FormatError if it is there no more."""
    try:
        with path.open("rb") as file:
            file.seek(offset)
            return Line(number, offset, _parse(path, number, file.readline()))
    except OSError as error:
        raise FormatError(f"cannot read {path}: {error.strerror or error}") from error


def check_header(path: Path, header: Mapping[str, Json], kind: str, version: int) -> None:
    """Refuse a file of another kind or version."""
    if header.get("format") != kind:
        raise FormatError(f"{path} is not a {kind} file (its first line does not say so)")
    if header.get("version") != version:
        raise FormatError(
            f"{path} has version {shown(header.get('version'))}; this Perdure reads version {version}"
        )


def mask_to_json(mask: Mask) -> Json:
    """Return a silhouette as its corner, crop size and run lengths by columns."""
    return {"x": mask.x, "y": mask.y, "size": list(mask.bits.shape), "runs": run_lengths(mask)}


def mask_of_json(value: Json) -> Mask:
    """Return the silhouette that `mask_to_json` wrote; ValueError if it is damaged, before it takes room."""
    if not isinstance(value, Mapping) or not {"x", "y", "size", "runs"} <= value.keys():
        raise ValueError("a mask must have x, y, size and runs")
    size, runs, corner = value["size"], value["runs"], (value["y"], value["x"])
    if not _are_whole(size) or len(size) != 2 or not all(0 <= side <= _LONGEST_SIDE for side in size):
        raise ValueError(f"a mask's size must be [height, width], each a whole number up to {_LONGEST_SIDE}")
    if not _are_whole(list(corner)) or max(map(abs, corner)) > _FAR:
        raise ValueError(f"a mask's x and y must be whole numbers up to {_FAR}")
    if not _are_whole(runs) or min(runs, default=0) < 0:
        raise ValueError("a mask's runs must be whole numbers from 0 on")
    height, width = size
    if height * width > _LARGEST_AREA:
        raise ValueError(f"a mask may have {_LARGEST_AREA} pixels at most, not {width}x{height}")
    if sum(runs) != height * width:
        raise ValueError(f"the mask's runs do not fill its size of {width}x{height}")
    return of_run_lengths(runs, *corner, height, width)


def outline_to_json(outline: Outline) -> Json:
    """Return a contour as its lines: a place in whole parts of a pixel, and the steps from each point to the next."""
    rings = [np.rint(ring * PER_PIXEL).astype(np.int64) for ring in outline.rings]  # each (n, 2)
    steps = [np.diff(ring, axis=0, prepend=0).ravel().tolist() for ring in rings]
    return {"per_pixel": PER_PIXEL, "rings": steps}


def outline_of_json(value: Json) -> Outline:
    """Return the contour that `outline_to_json` wrote; ValueError if it is damaged."""
    if not isinstance(value, Mapping) or not {"per_pixel", "rings"} <= value.keys():
        raise ValueError("an outline must have per_pixel and rings")
    parts, rings = value["per_pixel"], value["rings"]
    if type(parts) is not int or not 1 <= parts <= PER_PIXEL or PER_PIXEL % parts:
        raise ValueError(f"an outline's per_pixel must be a whole number that divides {PER_PIXEL}")
    if not isinstance(rings, list) or not all(_are_whole(ring) for ring in rings):
        raise ValueError("an outline's rings must be lists of whole numbers")
    if any(len(ring) % 2 or len(ring) < 6 for ring in rings):
        raise ValueError("an outline's ring must have two numbers a point, and three points or more")
    if any(max(map(abs, ring)) > _FAR * parts for ring in rings):
        raise ValueError(f"an outline's steps must be whole numbers up to {_FAR} pixels")
    places = [np.cumsum(np.array(ring, np.int64).reshape(-1, 2), axis=0) for ring in rings]  # each (n, 2)
    return Outline(tuple(place / parts for place in places))


def _are_whole(values: Json) -> bool:
    """Whether this is a list of whole numbers and of nothing else, not even of yes and no."""
    return isinstance(values, list) and set(map(type, values)) <= {int}


def number_of(word: str) -> float:
    """Return the number that a word says; ValueError for what is none, also where Python would pass over `_`."""
    if "_" in word or not word.isascii():
        raise ValueError("not a number")
    return float(word)


def short(value: np.float32 | float) -> float:
    """Return the shortest number that reads back as the same float32."""
    return float(str(np.float32(value)))


def four_digits(value: np.float32 | float) -> str:
    """Return a confidence of four digits, and with four decimals where another program counts beyond 1.

    >>> four_digits(0.123456), four_digits(1.0), four_digits(98.7654)
    ('0.1235', '1', '98.7654')
    """
    number = float(value)
    return f"{number:.4g}" if abs(number) <= 1 else f"{number:.4f}".rstrip("0").rstrip(".")


def short_row(values: NDArray[np.float32]) -> list[float]:
    """Return a row of float32 as the shortest numbers."""
    return [short(value) for value in values]


def json_of(text: str | bytes) -> Json:
    """Return the value of a text; ValueError or RecursionError where it is not JSON, also for NaN and infinities."""
    return _whole_letters(text, json.loads(text, parse_constant=_no_number))


def json_with_nan(text: str | bytes) -> Json:
    """Return the value of a text as `json_of` does, with NaN and infinities, for who says himself which number it is."""
    return _whole_letters(text, json.loads(text))


def why_not_json(error: ValueError | RecursionError) -> str:
    """Return in a few words why a text is not JSON that can be read."""
    if isinstance(error, json.JSONDecodeError):
        return error.msg
    if isinstance(error, UnicodeDecodeError):
        return "it is not text"
    if isinstance(error, HalfALetter):
        return str(error)
    if isinstance(error, NotANumber):
        return f"{error} is not a number that JSON has; give null or leave it out"
    return "it is nested too deep" if isinstance(error, RecursionError) else "a number in it has too many digits"


def _parse(path: Path, number: int, raw: bytes) -> Mapping[str, Json]:
    try:
        value = json_of(raw)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}, line {number}: not JSON ({why_not_json(error)})") from error
    if not isinstance(value, Mapping):
        raise FormatError(f"{path}, line {number}: not a JSON object")
    return value


def _whole_letters(text: str | bytes, value: Json) -> Json:
    """A text's value; HalfALetter where a text in it cannot be written again, as escapes can say."""
    if (_HALF if isinstance(text, str) else _HALF_BYTES).search(text):  # type: ignore[arg-type]
        try:
            json.dumps(value, ensure_ascii=False).encode("utf-8")
        except UnicodeEncodeError:
            raise HalfALetter("half of a surrogate pair stands alone") from None
    return value


_HALF, _HALF_BYTES = re.compile(r"\\u[dD][89a-fA-F]"), re.compile(rb"\\u[dD][89a-fA-F]")


def _no_number(word: str) -> NoReturn:
    raise NotANumber(word)

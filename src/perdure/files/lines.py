"""JSON lines: one value a line behind a header; a file cut off at any byte is still a valid one."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError
from perdure.features.masks import of_run_lengths, run_lengths
from perdure.types import Mask

Json = Any


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
    """Return the line that begins at a byte that `read_lines` gave."""
    with path.open("rb") as file:
        file.seek(offset)
        return Line(number, offset, _parse(path, number, file.readline()))


def check_header(path: Path, header: Mapping[str, Json], kind: str, version: int) -> None:
    """Refuse a file of another kind or version."""
    if header.get("format") != kind:
        raise FormatError(f"{path} is not a {kind} file (its first line does not say so)")
    if header.get("version") != version:
        raise FormatError(f"{path} has version {header.get('version')}; this Perdure reads version {version}")


def mask_to_json(mask: Mask) -> Json:
    """Return a silhouette as its corner, crop size and run lengths by columns."""
    return {"x": mask.x, "y": mask.y, "size": list(mask.bits.shape), "runs": run_lengths(mask)}


def mask_of_json(value: Json) -> Mask:
    """Return the silhouette that `mask_to_json` wrote; ValueError, KeyError or TypeError if it is damaged."""
    height, width = (int(one) for one in value["size"])
    if height < 0 or width < 0:
        raise ValueError("a mask of negative size")
    return of_run_lengths(value["runs"], int(value["y"]), int(value["x"]), height, width)


def short(value: np.float32 | float) -> float:
    """Return the shortest number that reads back as the same float32."""
    return float(str(np.float32(value)))


def short_row(values: NDArray[np.float32]) -> list[float]:
    """Return a row of float32 as the shortest numbers."""
    return [short(value) for value in values]


def _parse(path: Path, number: int, raw: bytes) -> Mapping[str, Json]:
    try:
        value = json.loads(raw)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}, line {number}: not JSON ({error})") from error
    if not isinstance(value, Mapping):
        raise FormatError(f"{path}, line {number}: not a JSON object")
    return value

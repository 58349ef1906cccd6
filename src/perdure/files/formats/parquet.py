"""Parquet: every column of rows, silhouettes as run lengths; nothing is lost. Needs pyarrow."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from perdure.errors import FormatError
from perdure.files.formats.checked import checked
from perdure.files.formats.content import LAST, Content, Format, Reading
from perdure.files.formats.jsons import LARGEST_AREA, size_of
from perdure.files.formats.traits import ALL
from perdure.files.lines import json_of
from perdure.files.room import Room
from perdure.files.span import shown
from perdure.files.whole import cannot_write, refuse_existing
from perdure.types.arrow import arrow, of_arrow, to_arrow

_KEY = b"perdure"


def read(path: Path, reading: Reading) -> Content:
    """Return the rows of a file; columns of other names than ours are passed over.

    Raises
    ------
    FormatError
        Naming file, column and row.
    PerdureError
        Where pyarrow is not installed.
    """
    pa = arrow()
    import pyarrow.parquet

    try:
        table = pyarrow.parquet.read_table(path)
        _check_room(path, table)
        tracks = of_arrow(table)
        told = json_of((table.schema.metadata or {}).get(_KEY, b"{}"))
        content = _described(path, Content(tracks, timed="time" in table.column_names), told)
    except OSError as error:
        raise FormatError(f"cannot read {path}: {error.strerror or _first_line(error)}") from error
    except (
        ValueError,
        TypeError,
        KeyError,
        IndexError,
        AttributeError,
        RecursionError,
        pa.ArrowException,
    ) as error:
        raise FormatError(f"{path}: {_first_line(error)}") from error
    return checked(path, content)


def write(path: Path, content: Content, *, overwrite: bool) -> int:
    """Write all columns; size, frames and name of the film are in the file's own description."""
    arrow()
    import pyarrow.parquet

    refuse_existing(path, overwrite=overwrite)
    told: dict[str, Any] = {
        "size": content.size,
        "frames": content.frames,
        "fps": content.fps,
        "name": content.name,
    }
    told = {name: value for name, value in told.items() if value}
    table = to_arrow(content.tracks).replace_schema_metadata({_KEY: json.dumps(told)})
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        pyarrow.parquet.write_table(table, part, compression="zstd")
        os.replace(part, path)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
    return len(content.tracks)


def _check_room(path: Path, table: Any) -> None:
    """Refuse silhouettes that are too large together, before they are unfolded; what is none is refused later."""
    import pyarrow.compute as pc

    room = Room(path.stat().st_size)
    for name in ("mask", "believed"):
        kind = table.schema.field(name).type if name in table.column_names else None
        if kind is not None and {"height", "width"} <= {one.name for one in getattr(kind, "fields", ())}:
            sides = [pc.struct_field(table.column(name), side).to_pylist() for side in ("height", "width")]
            areas = [high * wide for high, wide in zip(*sides, strict=True) if type(high) is type(wide) is int]
            room.take(area for area in areas if 0 <= area <= LARGEST_AREA)  # others are refused each by itself


def _described(path: Path, content: Content, told: Any) -> Content:
    """The content with what a file's description tells of its film; ValueError where that cannot be."""
    if not isinstance(told, Mapping):
        raise ValueError("its description is no JSON object")
    frames, fps = told.get("frames"), told.get("fps")
    if frames is not None and not (
        isinstance(frames, list)
        and {type(one) for one in frames} <= {int}
        and all(0 <= one <= LAST for one in frames)
    ):
        raise ValueError("the frames of its description are no list of frames")
    if fps is not None and not (type(fps) in (int, float) and 0 < fps <= _FASTEST):
        raise ValueError(f"the fps of its description, {shown(fps)}, cannot be")
    size = told.get("size")
    if size is not None and not (isinstance(size, list) and len(size) == 2):
        raise ValueError("the size of its description is not [height, width]")
    return content.replace(
        size=None if size is None else size_of(f"{path}, its description", {"height": size[0], "width": size[1]}),
        frames=None if frames is None else tuple(sorted(set(frames))),
        fps=fps,
        name=str(told.get("name", "")),
    )


_FASTEST = 1e6  # frames a second


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__


FORMAT = Format(
    "parquet",
    "Parquet, every column, silhouettes as run lengths; needs pyarrow",
    read,
    write,
    suffixes=(".parquet", ".pq"),
    holds=ALL,
)

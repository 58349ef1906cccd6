"""Parquet: every column of rows, silhouettes as run lengths; nothing is lost. Needs pyarrow."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any

from perdure.errors import FormatError
from perdure.files.formats.checked import checked
from perdure.files.formats.content import Content, Format, Reading
from perdure.files.formats.traits import ALL
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
        tracks = of_arrow(table)
        told = json.loads((table.schema.metadata or {}).get(_KEY, b"{}"))
        size, frames = told.get("size"), told.get("frames")
        content = Content(
            tracks,
            size=None if size is None else (int(size[0]), int(size[1])),
            frames=None if frames is None else tuple(map(int, frames)),
            fps=told.get("fps"),
            timed="time" in table.column_names,
            name=str(told.get("name", "")),
        )
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

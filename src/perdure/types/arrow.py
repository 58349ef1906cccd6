"""Tracks as an Arrow table and back: every column, silhouettes as run lengths, contours in parts of a pixel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from perdure.errors import PerdureError
from perdure.types.frame import PER_PIXEL, Mask, Outline, of_run_lengths, run_lengths
from perdure.types.tracks import Ground, Status, Tracks

if TYPE_CHECKING:
    import pyarrow

NEEDED = ("frame", "id", "x1", "y1", "x2", "y2")


def arrow() -> Any:
    """Return the library; PerdureError says how to install it where it is missing."""
    try:
        import pyarrow
    except ModuleNotFoundError:
        raise PerdureError("Arrow and Parquet need pyarrow: pip install 'perdure[parquet]'") from None
    return pyarrow


def to_arrow(tracks: Tracks) -> pyarrow.Table:
    """Return all columns of tracks; what is not known of a row is null."""
    schema = _schema()
    places = [(None,) * 3 if one is None else tuple(one) for one in tracks.ground]
    columns: dict[str, Any] = {
        "frame": tracks.frames,
        "time": tracks.times,
        "id": tracks.ids,
        **dict(zip(("x1", "y1", "x2", "y2"), np.ascontiguousarray(tracks.boxes.T), strict=True)),
        "status": [Status(one).word for one in tracks.status],
        "confidence": tracks.confidence,
        "classes": tracks.classes.tolist(),
        "groups": tracks.groups,
        "inferred": tracks.inferred,
        "hidden_side": tracks.hidden_side.tolist(),
        **{name: [one[k] for one in places] for k, name in enumerate(_METRES)},
        "links": [list(one) for one in tracks.links],
        "mask": [_of_mask(one) if one.bits.size else None for one in tracks.masks],
        "believed": [None if one is None else _of_mask(one) for one in tracks.believed],
        "outline": [None if one is None else _of_outline(one) for one in tracks.outlines],
    }
    pa = arrow()
    return pa.table([pa.array(columns[one.name], one.type) for one in schema], schema=schema)


def of_arrow(table: pyarrow.Table) -> Tracks:
    """Return the tracks of a table; ValueError names the column, and the row, that cannot be read."""
    missing = [name for name in NEEDED if name not in table.column_names]
    if missing:
        raise ValueError(f"it has no column {missing[0]!r}; wanted are {', '.join(NEEDED)} at least")
    boxes = np.stack([_numbers(table, name, np.float32) for name in ("x1", "y1", "x2", "y2")], axis=1)
    columns: dict[str, Any] = {
        "frames": _numbers(table, "frame", np.int64),
        "ids": _numbers(table, "id", np.int64),
        "times": _numbers(table, "time", np.float64) if "time" in table.column_names else 0.0,
        "boxes": boxes,
    }
    for name, kind in (("confidence", np.float32), ("groups", np.int64), ("inferred", np.bool_)):
        if name in table.column_names:
            columns[name] = _numbers(table, name, kind)
    for name in ("classes", "hidden_side"):
        if name in table.column_names:
            columns[name] = [one or "" for one in _values(table, name, str)]
    readers = {"status": _status, "links": _links, "mask": _mask, "believed": _believed, "outline": _outline}
    plural = {"mask": "masks", "outline": "outlines"}
    for name, reader in readers.items():
        if name in table.column_names:
            columns[plural.get(name, name)] = _each(table, name, reader)
    if _METRES[0] in table.column_names and _METRES[1] in table.column_names:
        columns["ground"] = _ground(table)
    return Tracks.of(**columns)


def _schema() -> Any:
    pa = arrow()
    mask = pa.struct(
        [
            ("x", pa.int32()),
            ("y", pa.int32()),
            ("height", pa.int32()),
            ("width", pa.int32()),
            ("runs", pa.list_(pa.int32())),
        ]
    )
    outline = pa.struct([("per_pixel", pa.int32()), ("rings", pa.list_(pa.list_(pa.int32())))])
    plain = {
        "frame": pa.int64(),
        "time": pa.float64(),
        "id": pa.int64(),
        **dict.fromkeys(("x1", "y1", "x2", "y2"), pa.float32()),
        "status": pa.string(),
        "confidence": pa.float32(),
        "classes": pa.string(),
        "groups": pa.int64(),
        "inferred": pa.bool_(),
        "hidden_side": pa.string(),
        **dict.fromkeys(_METRES, pa.float64()),
    }
    return pa.schema(
        [*plain.items(), ("links", pa.list_(pa.int32())), ("mask", mask), ("believed", mask), ("outline", outline)]
    )


def _of_mask(mask: Mask) -> dict[str, Any]:
    height, width = mask.bits.shape
    return {"x": mask.x, "y": mask.y, "height": height, "width": width, "runs": run_lengths(mask)}


def _of_outline(outline: Outline) -> dict[str, Any]:
    rings = [np.rint(ring * PER_PIXEL).astype(np.int64).ravel().tolist() for ring in outline.rings]
    return {"per_pixel": PER_PIXEL, "rings": rings}


def _numbers(table: pyarrow.Table, name: str, kind: Any) -> NDArray[Any]:
    """A column as numbers (N,); ValueError where it holds others, or none."""
    pa = arrow()
    column = table.column(name)
    wanted = {np.int64: pa.types.is_integer, np.bool_: pa.types.is_boolean}.get(kind, _is_real)
    if not wanted(column.type) and len(column):
        raise ValueError(f"column {name!r} holds {column.type}")
    if column.null_count:
        row = next(k for k, one in enumerate(column) if not one.is_valid)
        raise ValueError(f"row {row}: column {name!r} is empty")
    values: NDArray[Any] = column.to_numpy(zero_copy_only=False).astype(kind)
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        raise ValueError(f"row {int(np.argmin(np.isfinite(values)))}: column {name!r} is not a finite number")
    return values


def _is_real(kind: Any) -> bool:
    pa = arrow()
    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind))


def _values(table: pyarrow.Table, name: str, kind: type) -> list[Any]:
    values: list[Any] = table.column(name).to_pylist()
    for row, one in enumerate(values):
        if one is not None and not isinstance(one, kind):
            raise ValueError(f"row {row}: column {name!r} holds {type(one).__name__}")
    return values


def _each(table: pyarrow.Table, name: str, reader: Any) -> list[Any]:
    found = []
    for row, value in enumerate(table.column(name).to_pylist()):
        try:
            found.append(reader(value))
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
            raise ValueError(f"row {row}: column {name!r} cannot be read ({error})") from None
    return found


def _status(value: str | None) -> int:
    words = {one.word: int(one) for one in Status}
    if value is not None and value not in words:
        raise ValueError(f"{value!r} is none of {', '.join(words)}")
    return 0 if value is None else words[value]


def _links(value: Sequence[int] | None) -> tuple[int, ...]:
    return tuple(int(one) for one in value or ())


def _mask(value: Mapping[str, Any] | None) -> Mask:
    return Mask.empty() if value is None else _some_mask(value)


def _believed(value: Mapping[str, Any] | None) -> Mask | None:
    return None if value is None else _some_mask(value)


def _some_mask(value: Mapping[str, Any]) -> Mask:
    height, width, x, y = (int(value[name]) for name in ("height", "width", "x", "y"))
    if not (0 <= height <= _LONGEST and 0 <= width <= _LONGEST and height * width <= _LARGEST):
        raise ValueError(f"a mask of {width}x{height} cannot be")
    if max(abs(x), abs(y)) > _FAR:
        raise ValueError(f"a mask at ({x}, {y}) is too far out")
    return of_run_lengths(value["runs"], y, x, height, width)


def _outline(value: Mapping[str, Any] | None) -> Outline | None:
    if value is None:
        return None
    parts = int(value["per_pixel"])
    if parts < 1 or PER_PIXEL % parts:
        raise ValueError(f"per_pixel must divide {PER_PIXEL}, not be {parts}")
    return Outline(tuple(np.array(ring, np.float64).reshape(-1, 2) / parts for ring in value["rings"]))


def _ground(table: pyarrow.Table) -> list[Ground | None]:
    columns = [table.column(name).to_pylist() for name in _METRES if name in table.column_names]
    columns += [[None] * table.num_rows] * (3 - len(columns))
    return [None if x is None or y is None else Ground(x, y, speed) for x, y, speed in zip(*columns, strict=True)]


_METRES = ("ground_x", "ground_y", "ground_speed")  # m, m/s
_LONGEST, _LARGEST, _FAR = 1 << 15, 1 << 28, 10**6  # px

"""What every table shares: array types, read-only views, columns of equal length."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Image = NDArray[np.uint8]
Bits = NDArray[np.bool_]
Boxes = NDArray[np.float32]


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """A read-only view; the owner's own array stays as it is."""
    view = array.view()
    view.setflags(write=False)
    return view


def as_boxes(values: ArrayLike) -> Boxes:
    """Return boxes as read-only (N, 4) float32; ValueError if they are none or not finite."""
    boxes = np.asarray(values, np.float32)
    boxes = boxes.reshape(0, 4) if boxes.size == 0 else boxes
    if boxes.ndim != 2 or boxes.shape[1] != 4:
        raise ValueError(f"boxes must be (N, 4) x1 y1 x2 y2, not {boxes.shape}")
    if not np.isfinite(boxes).all():
        raise ValueError("boxes must be finite numbers")
    return frozen(boxes)


def row_index(rows: ArrayLike, count: int) -> NDArray[np.intp]:
    """Return a choice of rows, by number or as (count,) bool, as numbers."""
    index = np.asarray(rows)
    if index.dtype == np.bool_:
        if index.shape != (count,):
            raise ValueError(f"a bool choice of rows must be ({count},), not {index.shape}")
        return np.flatnonzero(index)
    return index.astype(np.intp).reshape(-1)


def check_lengths(count: int, columns: Mapping[str, Any]) -> None:
    """Refuse a table whose columns are not all `count` long."""
    for name, column in columns.items():
        if len(column) != count:
            raise ValueError(f"{name} has {len(column)} rows, boxes has {count}")


def same_columns(one: object, other: object, names: Iterable[str]) -> bool:
    """Return whether two tables are of one kind and agree in every named column."""

    def pairs() -> Iterator[bool]:
        for name in names:
            left, right = getattr(one, name), getattr(other, name)
            yield left == right if isinstance(left, tuple) else np.array_equal(left, right)

    return type(one) is type(other) and all(pairs())

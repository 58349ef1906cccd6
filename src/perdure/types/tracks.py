"""What is said: one row per (frame, id)."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.errors import PerdureError
from perdure.types.arrays import Boxes, as_boxes, check_lengths, frozen, row_index, same_columns
from perdure.types.frame import Mask, Outline

if TYPE_CHECKING:
    import pandas
    import pyarrow


class Status(enum.IntEnum):
    """How much of a target is seen in a frame."""

    VISIBLE = 0
    PARTLY_OCCLUDED = 1
    OCCLUDED = 2
    AMBIGUOUS = 3
    LOST = 4

    @property
    def word(self) -> str:
        """The status as it is written in logs and drawn on films."""
        return self.name.lower()


class Ground(NamedTuple):
    """A place on the ground plane in metres and the speed there in metres per second; None where not known yet."""

    x: float
    y: float
    speed: float | None = None


@dataclass(frozen=True, eq=False)
class Tracks:
    """What is said: one row per (frame, id).

    Parameters
    ----------
    frames, times, ids : (N,) int64, float64, int64
        Source frame counted from 0, its time in seconds, identity ≥ 1.
    boxes : (N, 4) float32
        The whole object as believed; may leave the frame.
    status : (N,) int8
        Values of `Status`.
    confidence : (N,) float32
        In [0, 1].
    classes : (N,) str
        Empty where not known.
    groups : (N,) int64
        The id of the group that the row is a member of; 0 for none. The group has a row of its own.
    inferred : (N,) bool
        True where the row was filled in and rests on no region.
    masks : N of Mask
        The pixels seen: disjoint within a frame; empty where nothing is seen.
    believed : N of Mask or None
        The whole silhouette, hidden parts included, where the tracker has one.
    outlines : N of Outline or None
        The contour of that silhouette between pixels, where the tracker has one.
    hidden_side : (N,) str
        'left', 'top', 'right', 'bottom', several joined by '+', or empty.
    ground : N of Ground or None
        Metres, where the ground plane is known.
    links : N of tuple of int
        The rows of the frame's `Regions` that this row rests on.
    """

    frames: NDArray[np.int64]
    times: NDArray[np.float64]
    ids: NDArray[np.int64]
    boxes: Boxes
    status: NDArray[np.int8]
    confidence: NDArray[np.float32]
    classes: NDArray[np.str_]
    groups: NDArray[np.int64]
    inferred: NDArray[np.bool_]
    masks: tuple[Mask, ...]
    believed: tuple[Mask | None, ...]
    outlines: tuple[Outline | None, ...]
    hidden_side: NDArray[np.str_]
    ground: tuple[Ground | None, ...]
    links: tuple[tuple[int, ...], ...]

    def __post_init__(self) -> None:
        columns = vars(self)  # set here, and never again
        columns["boxes"] = as_boxes(self.boxes)
        for name, dtype in _TRACK_DTYPES.items():
            columns[name] = frozen(np.asarray(columns[name], dtype))
        for name in ("masks", "believed", "outlines", "ground", "links"):
            columns[name] = tuple(columns[name])
        check_lengths(len(self.boxes), columns)

    @staticmethod
    def of(
        *,
        frames: ArrayLike,
        times: ArrayLike,
        ids: ArrayLike,
        boxes: ArrayLike,
        status: ArrayLike | None = None,
        confidence: ArrayLike | None = None,
        classes: ArrayLike | None = None,
        groups: ArrayLike | None = None,
        inferred: ArrayLike | None = None,
        masks: Sequence[Mask] | None = None,
        believed: Sequence[Mask | None] | None = None,
        outlines: Sequence[Outline | None] | None = None,
        hidden_side: ArrayLike | None = None,
        ground: Sequence[Ground | None] | None = None,
        links: Sequence[tuple[int, ...]] | None = None,
    ) -> Tracks:
        """Make tracks from the columns that are known; a frame or time may be one number for all rows.

        >>> Tracks.of(frames=0, times=0.0, ids=[1, 2], boxes=[[0, 0, 9, 9], [5, 5, 9, 9]]).ids.tolist()
        [1, 2]
        """
        boxes = np.asarray(boxes, np.float32)
        count = boxes.size // 4

        def column(given: ArrayLike | None, default: object, dtype: Any) -> NDArray[Any]:
            values = np.asarray(default if given is None else given, dtype)
            return values.repeat(count) if values.ndim == 0 else values

        return Tracks(
            frames=column(frames, 0, np.int64),
            times=column(times, 0.0, np.float64),
            ids=column(ids, 0, np.int64),
            boxes=boxes,
            status=column(status, Status.VISIBLE, np.int8),
            confidence=column(confidence, 1.0, np.float32),
            classes=column(classes, "", np.str_),
            groups=column(groups, 0, np.int64),
            inferred=column(inferred, False, np.bool_),
            masks=(Mask.empty(),) * count if masks is None else tuple(masks),
            believed=(None,) * count if believed is None else tuple(believed),
            outlines=(None,) * count if outlines is None else tuple(outlines),
            hidden_side=column(hidden_side, "", np.str_),
            ground=(None,) * count if ground is None else tuple(ground),
            links=((),) * count if links is None else tuple(links),
        )

    @staticmethod
    def empty() -> Tracks:
        """Return tracks without a row."""
        return _NO_TRACKS

    @staticmethod
    def join(parts: Iterable[Tracks]) -> Tracks:
        """Return the rows of all parts, one after the other."""
        tables = [part for part in parts if len(part)]
        if not tables:
            return Tracks.empty()
        if len(tables) == 1:
            return tables[0]
        columns: dict[str, Any] = {}
        for name in TRACK_COLUMNS:
            pieces = [getattr(table, name) for table in tables]
            columns[name] = _chain(pieces)
        return Tracks(**columns)

    def __len__(self) -> int:
        return len(self.ids)

    def take(self, rows: ArrayLike) -> Tracks:
        """Return the named rows (indices or a bool array), in that order."""
        index = row_index(rows, len(self))
        if np.array_equal(index, np.arange(len(self))):
            return self  # all of them, as they are
        columns: dict[str, Any] = {}
        numbers = index.tolist()
        for name in TRACK_COLUMNS:
            values = getattr(self, name)
            columns[name] = tuple(values[i] for i in numbers) if isinstance(values, tuple) else values[index]
        return Tracks(**columns)

    def replace(self, **columns: Any) -> Tracks:
        """Return the same rows with some columns changed."""
        return dataclasses.replace(self, **columns)

    def in_frame(self, index: int) -> Tracks:
        """Return the rows of one frame."""
        return self.take(self.frames == index)

    def of_id(self, identity: int) -> Tracks:
        """Return the rows of one identity."""
        return self.take(self.ids == identity)

    @property
    def is_group(self) -> NDArray[np.bool_]:
        """True for a group's own row: its id is named in `groups` of some row."""
        return np.isin(self.ids, self.groups[self.groups > 0])

    @property
    def visible_boxes(self) -> Boxes:
        """The tight boxes of `masks`, (N, 4); zeros where nothing is seen."""
        return frozen(np.array([mask.box for mask in self.masks], np.float32).reshape(-1, 4))

    @property
    def visibility(self) -> NDArray[np.float32]:
        """Seen pixels / believed pixels in [0, 1], (N,); 1 where no silhouette is believed."""
        shares = [
            1.0 if whole is None or whole.area == 0 else min(1.0, seen.area / whole.area)
            for seen, whole in zip(self.masks, self.believed, strict=True)
        ]
        return np.array(shares, np.float32)

    def counted(self, report_confidence: float = 0.5) -> Tracks:
        """Return the rows that count for `tracks.txt`, scores and exports.

        VISIBLE, PARTLY_OCCLUDED and AMBIGUOUS rows, and OCCLUDED ones whose confidence is at least
        `report_confidence`; never LOST ones, never groups.
        """
        hidden = (self.status == Status.OCCLUDED) & (self.confidence < report_confidence)
        return self.take(~hidden & (self.status != Status.LOST) & ~self.is_group)

    def to_pandas(self) -> pandas.DataFrame:
        """Return the plain columns as a pandas DataFrame (the extra `perdure[pandas]`); metres where any are known."""
        try:
            import pandas
        except ModuleNotFoundError:
            raise PerdureError("a table needs pandas: pip install 'perdure[pandas]'") from None

        boxes = dict(zip(("x1", "y1", "x2", "y2"), self.boxes.T, strict=True))
        plain = {
            name: getattr(self, name)
            for name in ("status", "confidence", "classes", "groups", "inferred", "hidden_side")
        }
        plain["status"] = [Status(value).word for value in self.status]
        places = [tuple(one) if one else (None,) * 3 for one in self.ground] if any(self.ground) else []
        metres = {
            name: np.array([np.nan if place[i] is None else place[i] for place in places])
            for i, name in enumerate(("ground_x", "ground_y", "ground_speed"))
            if places
        }
        return pandas.DataFrame(
            {
                "frame": self.frames,
                "time": self.times,
                "id": self.ids,
                **boxes,
                **plain,
                **metres,
                "links": list(self.links),
            }
        )

    def to_arrow(self) -> pyarrow.Table:
        """Return all columns, silhouettes and contours too, as an Arrow table (the extra `perdure[parquet]`).

        The plain columns are those of `to_pandas`; `mask`, `believed` and `outline` are structs as in the run log.
        """
        from perdure.types.arrow import to_arrow

        return to_arrow(self)

    @staticmethod
    def of_arrow(table: pyarrow.Table) -> Tracks:
        """Return the tracks of an Arrow table with the columns of `to_arrow`; frame, id, x1, y1, x2 and y2 at least.

        Raises
        ------
        ValueError
            Naming the column, and the row from 0 where there is one, that cannot be read.
        """
        from perdure.types.arrow import of_arrow

        return of_arrow(table)

    def equals(self, other: Tracks) -> bool:
        """Return whether both say the same, row by row."""
        return same_columns(self, other, TRACK_COLUMNS)

    def __repr__(self) -> str:
        if not len(self):
            return "Tracks(no rows)"
        first, last = int(self.frames.min()), int(self.frames.max())
        return f"Tracks({len(self)} rows, {len(np.unique(self.ids))} ids, frames {first}..{last})"


TRACK_COLUMNS = tuple(one.name for one in dataclasses.fields(Tracks))
_TRACK_DTYPES: Mapping[str, Any] = {
    "frames": np.int64,
    "times": np.float64,
    "ids": np.int64,
    "status": np.int8,
    "confidence": np.float32,
    "classes": np.str_,
    "groups": np.int64,
    "inferred": np.bool_,
    "hidden_side": np.str_,
}


def _chain(pieces: Sequence[Any]) -> Any:
    if isinstance(pieces[0], tuple):
        return tuple(chain.from_iterable(pieces))
    return np.concatenate(pieces)


_NO_TRACKS = Tracks.of(frames=[], times=[], ids=[], boxes=np.zeros((0, 4), np.float32))

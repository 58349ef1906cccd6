"""The nouns: Frame, Mask, Regions, Tracks, Event, Report, Scene, Status.

*Seen* is `Regions`, *believed* is a tracker's own state, *said* is `Tracks`: three words, three types.
All are frozen, their arrays read-only. Boxes are (N, 4) float32 `x1 y1 x2 y2`, half-open, in pixels.
"""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import pandas

Image = NDArray[np.uint8]
Bits = NDArray[np.bool_]
Boxes = NDArray[np.float32]


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


@dataclass(frozen=True)
class Frame:
    """One picture of a source.

    Parameters
    ----------
    index : int
        Number in the source, counted from 0.
    time : float
        Seconds, by the source's own timestamps.
    image : (H, W, 3) uint8 array or None
        RGB; None where only detections exist.
    """

    index: int
    time: float
    image: Image | None = None

    def __post_init__(self) -> None:
        if self.image is not None:
            if self.image.ndim != 3 or self.image.shape[2] != 3 or self.image.dtype != np.uint8:
                raise ValueError(
                    f"a frame's image must be (H, W, 3) uint8, not {self.image.shape} {self.image.dtype}"
                )
            object.__setattr__(self, "image", _frozen(self.image))


@dataclass(frozen=True, eq=False)
class Mask:
    """A silhouette: a crop of bits and its upper left corner (x, y) in the frame.

    >>> Mask(y=2, x=5, bits=np.ones((3, 4), bool)).box
    (5, 2, 9, 5)
    """

    y: int
    x: int
    bits: Bits  # (h, w)

    def __post_init__(self) -> None:
        object.__setattr__(self, "bits", _frozen(np.asarray(self.bits, dtype=np.bool_)))

    @staticmethod
    def empty() -> Mask:
        """Return the mask of nothing."""
        return Mask(0, 0, np.zeros((0, 0), np.bool_))

    @staticmethod
    def of_image(bits: Bits, y: int = 0, x: int = 0) -> Mask:
        """Return the tight mask of the true pixels of a picture whose corner is (x, y)."""
        rows, columns = np.flatnonzero(bits.any(axis=1)), np.flatnonzero(bits.any(axis=0))
        if not rows.size:
            return Mask.empty()
        top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
        return Mask(int(y + top), int(x + left), bits[top:bottom, left:right].copy())

    @property
    def box(self) -> tuple[int, int, int, int]:
        """The crop's own box x1, y1, x2, y2; tight if the mask was made by `of_image`."""
        height, width = self.bits.shape
        return self.x, self.y, self.x + width, self.y + height

    @property
    def area(self) -> int:
        """The number of true pixels."""
        return int(np.count_nonzero(self.bits))

    def to_image(self, height: int, width: int) -> Bits:
        """Return the (height, width) bool picture with this mask in it; what lies outside is cut."""
        picture = np.zeros((height, width), np.bool_)
        x1, y1, x2, y2 = self.box
        left, top, right, bottom = max(x1, 0), max(y1, 0), min(x2, width), min(y2, height)
        if left < right and top < bottom:
            picture[top:bottom, left:right] = self.bits[top - y1 : bottom - y1, left - x1 : right - x1]
        return picture

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Mask)
            and (self.y, self.x) == (other.y, other.x)
            and np.array_equal(self.bits, other.bits)
        )

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, eq=False)
class Regions:
    """What is seen in one frame: N rows in the detector's own order.

    Parameters
    ----------
    boxes : (N, 4) float32
        Half-open pixels.
    scores : (N,) float32
        In [0, 1]; 1 where the detector gives none.
    classes : (N,) str
        Empty where not known.
    masks : N of Mask
        Empty masks where the detector gives none.
    data : mapping of str to (N, ...) arrays
        Whatever else the detector said; kept, never read.
    """

    boxes: Boxes
    scores: NDArray[np.float32]
    classes: NDArray[np.str_]
    masks: tuple[Mask, ...]
    data: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "boxes", _boxes(self.boxes))
        object.__setattr__(self, "scores", _frozen(np.asarray(self.scores, np.float32)))
        object.__setattr__(self, "classes", _frozen(np.asarray(self.classes, np.str_)))
        object.__setattr__(self, "masks", tuple(self.masks))
        _check_lengths(len(self.boxes), {"scores": self.scores, "classes": self.classes, "masks": self.masks})
        _check_lengths(len(self.boxes), self.data)

    @staticmethod
    def of(
        boxes: ArrayLike,
        scores: ArrayLike | None = None,
        classes: Sequence[str] | NDArray[np.str_] | None = None,
        masks: Sequence[Mask] | None = None,
        data: Mapping[str, NDArray[Any]] | None = None,
    ) -> Regions:
        """Make regions from boxes; what is not given is filled in.

        >>> len(Regions.of([[10, 20, 30, 60]], scores=[0.9]))
        1
        """
        boxes = _boxes(boxes)
        count = len(boxes)
        return Regions(
            boxes,
            np.ones(count, np.float32) if scores is None else np.asarray(scores, np.float32),
            np.full(count, "", dtype=np.str_) if classes is None else np.asarray(classes, np.str_),
            (Mask.empty(),) * count if masks is None else tuple(masks),
            {} if data is None else dict(data),
        )

    @staticmethod
    def empty() -> Regions:
        """Return the regions of a frame in which nothing is seen."""
        return Regions.of(np.zeros((0, 4), np.float32))

    def __len__(self) -> int:
        return len(self.boxes)

    def take(self, rows: ArrayLike) -> Regions:
        """Return the named rows (indices or a bool array), in that order."""
        index = _row_index(rows, len(self))
        return Regions(
            self.boxes[index],
            self.scores[index],
            self.classes[index],
            tuple(self.masks[i] for i in index),
            {key: np.asarray(values)[index] for key, values in self.data.items()},
        )

    def equals(self, other: Regions) -> bool:
        """Return whether both say the same, `data` apart."""
        return _same_columns(self, other, ("boxes", "scores", "classes", "masks"))


class Ground(NamedTuple):
    """A place on the ground plane in metres and the speed there in metres per second."""

    x: float
    y: float
    speed: float


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
    hidden_side: NDArray[np.str_]
    ground: tuple[Ground | None, ...]
    links: tuple[tuple[int, ...], ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "boxes", _boxes(self.boxes))
        for name, dtype in _TRACK_DTYPES.items():
            object.__setattr__(self, name, _frozen(np.asarray(getattr(self, name), dtype)))
        for name in ("masks", "believed", "ground", "links"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        _check_lengths(len(self.boxes), {name: getattr(self, name) for name in TRACK_COLUMNS})

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
        hidden_side: ArrayLike | None = None,
        ground: Sequence[Ground | None] | None = None,
        links: Sequence[tuple[int, ...]] | None = None,
    ) -> Tracks:
        """Make tracks from the columns that are known; a frame or time may be one number for all rows.

        >>> Tracks.of(frames=0, times=0.0, ids=[1, 2], boxes=[[0, 0, 9, 9], [5, 5, 9, 9]]).ids.tolist()
        [1, 2]
        """
        boxes = _boxes(boxes)
        count = len(boxes)

        def column(given: ArrayLike | None, default: object, dtype: Any) -> NDArray[Any]:
            values = np.asarray(default if given is None else given, dtype)
            return np.broadcast_to(values, (count,)) if values.ndim == 0 else values

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
        index = _row_index(rows, len(self))
        if np.array_equal(index, np.arange(len(self))):
            return self  # all of them, as they are
        columns: dict[str, Any] = {}
        for name in TRACK_COLUMNS:
            values = getattr(self, name)
            columns[name] = tuple(values[i] for i in index) if isinstance(values, tuple) else values[index]
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
        return _frozen(np.array([mask.box for mask in self.masks], np.float32).reshape(-1, 4))

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
        """Return the plain columns as a pandas DataFrame (pandas must be installed)."""
        import pandas

        boxes = dict(zip(("x1", "y1", "x2", "y2"), self.boxes.T, strict=True))
        plain = {
            name: getattr(self, name)
            for name in ("status", "confidence", "classes", "groups", "inferred", "hidden_side")
        }
        plain["status"] = [Status(value).word for value in self.status]
        return pandas.DataFrame(
            {"frame": self.frames, "time": self.times, "id": self.ids, **boxes, **plain, "links": list(self.links)}
        )

    def equals(self, other: Tracks) -> bool:
        """Return whether both say the same, row by row."""
        return _same_columns(self, other, TRACK_COLUMNS)

    def __repr__(self) -> str:
        if not len(self):
            return "Tracks(no rows)"
        first, last = int(self.frames.min()), int(self.frames.max())
        return f"Tracks({len(self)} rows, {len(np.unique(self.ids))} ids, frames {first}..{last})"


@dataclass(frozen=True)
class Event:
    """Something that happened: merge, split, occluded, reappeared, resolved, entered, left, …

    `begin` and `end` are frames (equal for a moment); `why` names the rule and its figures.
    """

    kind: str
    begin: int
    end: int
    ids: tuple[int, ...] = ()
    zone: str = ""
    confidence: float = 1.0
    why: str = ""


@dataclass(frozen=True)
class Renamed:
    """A correction: rows of `old` said before, in frames `begin` to `end` inclusive, belong to `new`."""

    old: int
    new: int
    begin: int
    end: int


@dataclass(frozen=True)
class Dropped:
    """A correction: rows of `id` said before, in frames `begin` to `end` inclusive, were wrong."""

    id: int
    begin: int
    end: int


@dataclass(frozen=True)
class Explanation:
    """Why a row or link of an identity was chosen, with the figures that decided."""

    id: int
    why: str
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Report:
    """What a step learned: rows of this frame (or of earlier ones, said late), corrections, events, reasons."""

    rows: Tracks = field(default_factory=Tracks.empty)
    renamed: tuple[Renamed, ...] = ()
    dropped: tuple[Dropped, ...] = ()
    events: tuple[Event, ...] = ()
    explanations: tuple[Explanation, ...] = ()

    @staticmethod
    def empty() -> Report:
        """Return the report of a step that learned nothing."""
        return Report()

    def equals(self, other: Report) -> bool:
        """Return whether both report the same."""
        return self.rows.equals(other.rows) and all(
            getattr(self, name) == getattr(other, name)
            for name in ("renamed", "dropped", "events", "explanations")
        )


@dataclass(frozen=True, eq=False)
class Scene:
    """What is known of the place before the first frame.

    Parameters
    ----------
    width, height : int
        Pixels.
    fps : float
        Nominal frames per second; times come with the frames.
    zones : tuple
        Polygons with a kind.
    ground : object or None
        The ground plane.
    roi : (H, W) bool array or None
        True where something may be seen; None for everywhere.
    """

    width: int
    height: int
    fps: float = 25.0
    zones: tuple[Any, ...] = ()
    ground: Any = None
    roi: Bits | None = None

    def __post_init__(self) -> None:
        if self.roi is not None:
            if self.roi.shape != (self.height, self.width):
                raise ValueError(
                    f"the roi is {self.roi.shape[1]}x{self.roi.shape[0]}, the scene {self.width}x{self.height}"
                )
            object.__setattr__(self, "roi", _frozen(np.asarray(self.roi, np.bool_)))


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


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    """A read-only view; the owner's own array stays as it is."""
    view = array.view()
    view.flags.writeable = False
    return view


def _boxes(values: ArrayLike) -> Boxes:
    boxes = np.asarray(values, np.float32)
    boxes = boxes.reshape(0, 4) if boxes.size == 0 else boxes
    if boxes.ndim != 2 or boxes.shape[1] != 4:
        raise ValueError(f"boxes must be (N, 4) x1 y1 x2 y2, not {boxes.shape}")
    if not np.isfinite(boxes).all():
        raise ValueError("boxes must be finite numbers")
    return _frozen(boxes)


def _row_index(rows: ArrayLike, count: int) -> NDArray[np.intp]:
    index = np.asarray(rows)
    if index.dtype == np.bool_:
        if index.shape != (count,):
            raise ValueError(f"a bool choice of rows must be ({count},), not {index.shape}")
        return np.flatnonzero(index)
    return index.astype(np.intp).reshape(-1)


def _check_lengths(count: int, columns: Mapping[str, Any]) -> None:
    for name, column in columns.items():
        if len(column) != count:
            raise ValueError(f"{name} has {len(column)} rows, boxes has {count}")


def _same_columns(one: object, other: object, names: Iterable[str]) -> bool:
    def pairs() -> Iterator[bool]:
        for name in names:
            left, right = getattr(one, name), getattr(other, name)
            yield left == right if isinstance(left, tuple) else np.array_equal(left, right)

    return type(one) is type(other) and all(pairs())


def _chain(pieces: Sequence[Any]) -> Any:
    if isinstance(pieces[0], tuple):
        return tuple(value for piece in pieces for value in piece)
    return np.concatenate(pieces)


_NO_TRACKS = Tracks.of(frames=[], times=[], ids=[], boxes=np.zeros((0, 4), np.float32))

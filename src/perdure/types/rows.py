"""One side of a comparison: rows of (frame, id) with box or silhouette, and what each counts for."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.types.arrays import check_lengths, frozen, row_index
from perdure.types.frame import Mask
from perdure.types.tracks import Tracks


class Use(enum.IntEnum):
    """What a row of a truth counts for."""

    SCORED = 0  # an object that must be followed
    IGNORED = 1  # not asked for, and no excuse: a row said on it is wrong (flag 0 of MOTChallenge)
    DISTRACTOR = 2  # not asked for; a row said on it is taken away first (MOT16 and later)
    REGION = 3  # an area, not an object: said rows that match nothing and lie in it are taken away (MOTS)


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows to be compared, in the order of their frames.

    Unlike `Tracks` the boxes are float64, as files give them: at a threshold of overlap the last digit counts.

    Parameters
    ----------
    frames, ids : (N,) int64
        Frame of the source counted from 0; identity.
    boxes : (N, 4) float64
        x1 y1 x2 y2, half-open pixels; tight on the masks where only those are known.
    use : (N,) int8
        Values of `Use`; all SCORED in what a tracker said.
    masks : N of Mask, or none at all
        Silhouettes, where they are known.
    size : (int, int) or None
        Height and width of the picture, where the file says.
    """

    frames: NDArray[np.int64]
    ids: NDArray[np.int64]
    boxes: NDArray[np.float64]
    use: NDArray[np.int8]
    masks: tuple[Mask, ...] = ()
    size: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        for name, dtype in _DTYPES.items():
            object.__setattr__(self, name, frozen(np.asarray(getattr(self, name), dtype)))
        object.__setattr__(self, "boxes", frozen(self.boxes.reshape(-1, 4)))
        object.__setattr__(self, "masks", tuple(self.masks))
        count = len(self.boxes)
        check_lengths(count, {"frames": self.frames, "ids": self.ids, "use": self.use})
        if self.masks:
            check_lengths(count, {"masks": self.masks})
        if (np.diff(self.frames) < 0).any():
            raise ValueError("rows must be in the order of their frames; Rows.of sorts them")

    @staticmethod
    def of(
        *,
        frames: ArrayLike,
        ids: ArrayLike,
        boxes: ArrayLike | None = None,
        use: ArrayLike | None = None,
        masks: Iterable[Mask] = (),
        size: tuple[int, int] | None = None,
    ) -> Rows:
        """Make rows from the columns that are known, sorted by frame; boxes are read off the masks without any.

        >>> Rows.of(frames=[3, 2], ids=[1, 1], boxes=[[0, 0, 1, 1], [5, 5, 9, 9]]).frames.tolist()
        [2, 3]
        """
        masks = tuple(masks)
        when = np.asarray(frames, np.int64).reshape(-1)
        order = np.argsort(when, kind="stable")
        corners = [mask.box for mask in masks] if boxes is None else boxes
        return Rows(
            frames=when[order],
            ids=np.asarray(ids, np.int64).reshape(-1)[order],
            boxes=np.asarray(corners, np.float64).reshape(-1, 4)[order],
            use=np.zeros(len(when), np.int8) if use is None else np.asarray(use, np.int8).reshape(-1)[order],
            masks=tuple(masks[i] for i in order) if masks else (),
            size=size,
        )

    @staticmethod
    def of_tracks(tracks: Tracks) -> Rows:
        """Return the rows of tracks, all of them; with masks where any row has one."""
        seen = any(mask.bits.size for mask in tracks.masks)
        return Rows.of(
            frames=tracks.frames, ids=tracks.ids, boxes=tracks.boxes, masks=tracks.masks if seen else ()
        )

    def __len__(self) -> int:
        return len(self.ids)

    def take(self, rows: ArrayLike) -> Rows:
        """Return the named rows (ascending indices or a bool array)."""
        index = row_index(rows, len(self))
        return Rows(
            self.frames[index],
            self.ids[index],
            self.boxes[index],
            self.use[index],
            tuple(self.masks[i] for i in index) if self.masks else (),
            self.size,
        )

    def between(self, first: int | None, last: int | None) -> Rows:
        """Return the rows of frames `first` to `last`, both included."""
        low = 0 if first is None else int(np.searchsorted(self.frames, first, "left"))
        high = len(self) if last is None else int(np.searchsorted(self.frames, last, "right"))
        return self.take(np.arange(low, max(low, high)))

    def replace(self, **columns: Any) -> Rows:
        """Return the same rows with some columns changed."""
        return dataclasses.replace(self, **columns)

    def __repr__(self) -> str:
        if not len(self):
            return "Rows(none)"
        first, last = int(self.frames[0]), int(self.frames[-1])
        return f"Rows({len(self)} rows, {len(np.unique(self.ids))} ids, frames {first}..{last})"


_DTYPES: Mapping[str, Any] = {"frames": np.int64, "ids": np.int64, "boxes": np.float64, "use": np.int8}

"""From one format to another: what is read is written, and what could not be kept is told."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from perdure.errors import FormatError, OutputError, ParameterError
from perdure.files.formats.content import Content, Format, Reading
from perdure.files.formats.known import FORMATS, read, recognised
from perdure.files.formats.losses import Loss, lost
from perdure.files.formats.traits import Trait
from perdure.files.images import natural_order
from perdure.types import Tracks


@dataclass(frozen=True)
class Wishes:
    """What the user says of the rows, beside what the file tells.

    Parameters
    ----------
    fps : float or None
        Times are frames / fps.
    size : (int, int) or None
        Height and width of the pictures.
    kind : str
        The class of rows that have none.
    video : str or None
        Which film of a file that holds several.
    """

    fps: float | None = None
    size: tuple[int, int] | None = None
    kind: str = ""
    video: str | None = None


@dataclass(frozen=True)
class Written:
    """What was written, and what was not."""

    path: Path
    source: str  # name of the format that was read
    target: str
    rows: int
    ids: int
    left_out: int  # rows that had not what the format is of
    losses: tuple[Loss, ...]
    notes: tuple[str, ...]


def gathered(path: Path, format_: Format | None, wishes: Wishes) -> tuple[Content, Format]:
    """Return what a file holds, with what the user says of it, and the format it was read as.

    Raises
    ------
    FormatError
        Naming file and place.
    ParameterError
        If the user says another size than the file.
    """
    source = format_ or recognised(path)
    content = read(path, source, reading=Reading(wishes.video), fps=wishes.fps)
    if wishes.size is not None:
        if content.size not in (None, wishes.size):
            (height, width), (high, wide) = content.size or wishes.size, wishes.size
            raise ParameterError(f"{path} says {width}x{height}, --size says {wide}x{high}; leave --size out")
        content = content.replace(size=wishes.size, notes=(*content.notes, *_outside(content.tracks, wishes.size)))
    if wishes.kind:
        tracks = content.tracks
        content = content.replace(
            tracks=tracks.replace(classes=np.where(tracks.classes == "", wishes.kind, tracks.classes))
        )
    return content, source


def _outside(tracks: Tracks, size: tuple[int, int]) -> tuple[str, ...]:
    """A note where boxes have their middle outside a picture (height, width): one may leave it, but not many."""
    boxes, (height, width) = tracks.boxes.astype(np.float64), size
    x, y = (boxes[:, 0] + boxes[:, 2]) / 2, (boxes[:, 1] + boxes[:, 3]) / 2
    out = np.flatnonzero((x < 0) | (x > width) | (y < 0) | (y > height))
    if not len(out):
        return ()
    first = out[0]
    sides = ", ".join(f"{side:g}" for side in boxes[first])
    return (
        f"{len(out)} of {len(boxes)} boxes lie more outside than inside the {width}x{height} of --size, the first "
        f"that of id {tracks.ids[first]} in frame {tracks.frames[first]} ({sides})",
    )


def write(path: Path, content: Content, source: str, target: Format, *, overwrite: bool) -> Written:
    """Write a content in a format.

    Raises
    ------
    OutputError, ParameterError
        If the place is taken or cannot be written, or the format cannot hold what is to be written.
    """
    if target.write is None:
        raise ParameterError(f"{target.name} is only read; perdure track writes it")
    tracks = content.tracks
    if is_of_masks(target) and len(tracks) and not any(mask.bits.size for mask in tracks.masks):
        boxes = ", ".join(name for name, one in FORMATS.items() if one.write and Trait.BOX in one.holds)
        raise ParameterError(
            f"there is no silhouette to write, and {target.name} holds nothing else; of boxes there are {boxes}"
        )
    rows = target.write(path, content, overwrite=overwrite)
    losses = tuple(lost(content, target))
    ids = len(np.unique(tracks.ids))
    return Written(path, source, target.name, rows, ids, len(tracks) - rows, losses, content.notes)


def is_of_masks(format_: Format) -> bool:
    """Return whether a format holds silhouettes and nothing else of where things are."""
    return Trait.MASK in format_.holds and Trait.BOX not in format_.holds


def sequences_in(folder: Path) -> list[Path]:
    """Return the files of several sequences in a folder, as label_02 of KITTI has them; those of no known format are passed over.

    Raises
    ------
    FormatError
        If there is none.
    """
    found = []
    for path in sorted(folder.iterdir(), key=natural_order):
        if path.is_file() and not path.name.startswith(".") and path.suffix.lower() in _SUFFIXES:
            found.append(path)
    if not found:
        raise FormatError(
            f"{folder} is none of the known formats, nor does it hold files of them ({', '.join(sorted(_SUFFIXES))})"
        )
    return found


def refuse_own_place(source: Path, target: Path) -> None:
    """Refuse to write over what is read.

    Raises
    ------
    OutputError
        If both are one place, or a file that is there in the folder that is read would be replaced.
    """
    if target.resolve() == source.resolve():
        raise OutputError(f"{target} is what is read; name another place")
    if target.exists() and source.is_dir() and target.resolve().is_relative_to(source.resolve()):
        raise OutputError(f"{target} is a part of {source}, which is read; name another place")


_SUFFIXES = {suffix for one in FORMATS.values() for suffix in one.suffixes}

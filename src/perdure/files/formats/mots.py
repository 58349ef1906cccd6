"""MOTS text as a format: silhouettes of cars and pedestrians; frames count from 1 there."""

from __future__ import annotations

from pathlib import Path

from perdure.files.formats.content import Content, Format, Reading, ordered
from perdure.files.formats.traits import Trait
from perdure.files.mots import CAR, read_lines, write_masks
from perdure.files.whole import refuse_existing, whole_file
from perdure.types import Tracks, Use

_CLASSES = ("car", "pedestrian")


def read(path: Path, reading: Reading) -> Content:
    """Return the silhouettes of a text; areas that are no object are left out, and a note says so."""
    lines = read_lines(path)
    rows = [one for one in lines if one.use is Use.SCORED]
    areas = len(lines) - len(rows)
    tracks = Tracks.of(
        frames=[one.frame for one in rows],
        times=0.0,
        ids=[one.id for one in rows],
        boxes=[one.mask.box for one in rows],
        masks=[one.mask for one in rows],
        classes=[_CLASSES[one.kind != CAR] for one in rows],
    )
    notes = (f"areas that are no object (class 10) left out: {areas}",) if areas else ()
    return Content(ordered(tracks), size=lines[0].size if lines else None, notes=notes)


def write(path: Path, content: Content, *, overwrite: bool) -> int:
    """Write the silhouettes as a text; rows without one are left out."""
    refuse_existing(path, overwrite=overwrite)
    height, width = content.sized("MOTS text")
    with whole_file(path) as file:
        return write_masks(file, content.tracks, height, width)


FORMAT = Format(
    "mots",
    "MOTS text, silhouettes, frames from 1",
    read,
    write,
    suffixes=(".txt",),
    needs_size=True,
    holds=frozenset({Trait.MASK, Trait.MASK_TOO, Trait.OVERLAP, Trait.CLASS, Trait.CHANGING_CLASS}),
    classes=_CLASSES,
    unnamed="pedestrian",
)

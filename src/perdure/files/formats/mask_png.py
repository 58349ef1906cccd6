"""A folder of index PNGs as a format: a picture a frame, the value of a pixel is the id of what is seen there."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from perdure.files import mask_pngs
from perdure.files.folders import refuse_existing_folder
from perdure.files.formats.content import Content, Format, Reading, ordered
from perdure.files.formats.traits import Trait
from perdure.types import Tracks, Use


def is_mask_folder(path: Path) -> bool:
    """Return whether a folder holds a PNG."""
    return path.is_dir() and any(path.glob(f"*{mask_pngs.SUFFIX}"))


def read(path: Path, reading: Reading) -> Content:
    """Return the silhouettes of a folder; 255 of 8 bits is no object where there are others, and a note says so."""
    rows = mask_pngs.read_masks(path, void=True)
    objects = rows.take(rows.use == Use.SCORED)
    tracks = Tracks.of(frames=objects.frames, times=0.0, ids=objects.ids, boxes=objects.boxes, masks=objects.masks)
    frames = tuple(frame for frame, _ in mask_pngs.pictures_in(path))
    areas = len(rows) - len(objects)
    notes = (f"void areas (255) left out: {areas}",) if areas else ()
    return Content(ordered(tracks), rows.size or _size(path), frames, name=path.resolve().name, notes=notes)


def write(path: Path, content: Content, *, overwrite: bool) -> int:
    """Write a picture for every frame that is known of; a pixel that several rows have goes to the lowest id."""
    refuse_existing_folder(path, mask_pngs.SUFFIX, overwrite=overwrite)
    height, width = content.sized("mask-png")
    tracks = content.tracks
    by_frame = ((frame, tracks.in_frame(frame)) for frame in np.unique(tracks.frames).tolist())
    largest = int(tracks.ids.max()) if len(tracks) else 0
    return mask_pngs.write_masks(
        path, by_frame, content.film, height, width, largest_id=largest, overwrite=overwrite
    )


def _size(folder: Path) -> tuple[int, int]:
    """Height and width of the first picture, where all are black."""
    _, first = mask_pngs.pictures_in(folder)[0]
    height, width = mask_pngs.read_indices(first).shape
    return height, width


FORMAT = Format(
    "mask-png",
    "a folder of PNGs, a picture a frame, pixel = id; frames from 0",
    read,
    write,
    is_folder=True,
    needs_size=True,
    holds=frozenset({Trait.MASK, Trait.MASK_TOO}),
)

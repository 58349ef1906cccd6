"""YouTube-VIS: COCO with an annotation a track, whose lists have a silhouette or null for each frame of the film.

Run lengths are lists of numbers, as in the benchmark's own files: its tools do not read packed ones in a truth.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from perdure.errors import FormatError, OutputError
from perdure.files.formats import coco
from perdure.files.formats.content import MOST_FRAMES, Content, Format, Gathering, Reading, counted_from_one
from perdure.files.formats.jsons import size_of
from perdure.files.formats.traits import Trait
from perdure.files.lines import short
from perdure.files.whole import refuse_existing, whole_file
from perdure.types import Tracks

_LISTS = ("segmentations", "bboxes")


def read(path: Path, reading: Reading) -> Content:
    """Return the tracks of one film; annotations of crowds are left out, and a note says so.

    Raises
    ------
    FormatError
        Naming file and annotation.
    ParameterError
        If it holds several films and none is chosen.
    """
    document = coco.read_document(path)
    video = coco.wanted_video(path, document["videos"], reading.video)
    size, length = size_of(f"{path}, video {coco.video_name(video)}", video), _length(path, video)
    kinds = coco.read_categories(path, document["categories"])
    rows, crowds = Gathering(path), 0
    for number, annotation in enumerate(document["annotations"], 1):
        if annotation.get("video_id") != video.get("id"):
            continue
        if annotation.get("iscrowd"):
            crowds += 1
            continue
        place = f"annotation {number}"
        try:
            _add(rows, place, annotation, kinds, size, length)
        except (KeyError, TypeError, ValueError) as error:
            raise rows.refuse(place, coco.why(error)) from None
    tracks, notes = counted_from_one(rows.tracks())
    return Content(
        tracks,
        size,
        range(length),
        fps=coco.rate_told(video),
        name=coco.video_name(video),
        images=dict(enumerate(video.get("file_names", ()))),
        notes=(*notes, f"annotations of crowds left out: {crowds}") if crowds else notes,
    )


def _length(path: Path, video: Mapping[str, Any]) -> int:
    names = video.get("file_names", [])
    length = video.get("length", len(names) if isinstance(names, list) else None)
    if type(length) is not int or not 0 <= length <= MOST_FRAMES or not isinstance(names, list):
        raise FormatError(
            f"{path}, video {coco.video_name(video)}: length must be a whole number up to {MOST_FRAMES}"
        )
    return length


def _add(
    rows: Gathering,
    place: str,
    annotation: Mapping[str, Any],
    kinds: Mapping[int, str],
    size: tuple[int, int],
    length: int,
) -> None:
    """Take up the rows of a track."""
    if not any(annotation.get(name) for name in _LISTS):
        return  # seen nowhere
    masks, boxes = (annotation.get(name) or [None] * length for name in _LISTS)
    for name, several in zip(_LISTS, (masks, boxes), strict=True):
        if not isinstance(several, list) or len(several) != length:
            raise ValueError(f"{name} must have an entry, or null, for each of the {length} frames")
    kind, identity = kinds[annotation["category_id"]], annotation["id"]
    for frame, (segmentation, box) in enumerate(zip(masks, boxes, strict=True)):
        if segmentation is None and box is None:
            continue
        here = f"{place}, frame {frame}"
        try:
            mask = None if segmentation is None else coco.mask_of(segmentation, size)
            corners = coco.box_of(box) if box is not None else mask.box if mask else ()
        except ValueError as error:
            raise rows.refuse(here, error) from None
        rows.add(
            here,
            frame=frame,
            identity=identity,
            box=corners,
            mask=mask,
            kind=kind,
            confidence=annotation.get("score", 1.0),
        )


def write(path: Path, content: Content, *, overwrite: bool) -> int:
    """Write a file of one film, with an annotation for each id."""
    refuse_existing(path, overwrite=overwrite)
    height, width = content.sized("coco-vis")
    tracks, film = content.tracks, content.film
    length = film[-1] + 1 if len(film) else 0
    ids = np.unique(tracks.ids).tolist()
    if length > MOST_FRAMES or length * len(ids) > _MOST_ENTRIES:
        raise OutputError(
            f"coco-vis lists each of {length} frames for each of {len(ids)} tracks, which is too much; take --to coco-video"
        )
    numbers = coco.categories_of(tracks)
    video = coco.written_video(content, height, width)
    video |= {"length": length, "file_names": [coco.image_name(content, frame) for frame in range(length)]}
    annotations = [_annotation(tracks.of_id(one), one, numbers, length, (height, width)) for one in ids]
    document = {
        "info": {"description": "written by Perdure"},
        "videos": [video],
        "annotations": annotations,
        "categories": coco.written_categories(numbers),
    }
    with whole_file(path) as file:
        json.dump(document, file, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
        file.write("\n")
    return len(tracks)


def _annotation(
    rows: Tracks, identity: int, numbers: Mapping[str, int], length: int, size: tuple[int, int]
) -> dict[str, Any]:
    """What is written of one id."""
    lists: dict[str, list[Any]] = {name: [None] * length for name in ("segmentations", "bboxes", "areas")}
    for frame, box, mask in zip(rows.frames.tolist(), rows.boxes, rows.masks, strict=True):
        lists["segmentations"][frame] = coco.written_mask(mask, *size, packed=False)
        lists["bboxes"][frame] = written = coco.written_box(box)
        lists["areas"][frame] = mask.area if mask.bits.size else written[2] * written[3]
    about: dict[str, Any] = {
        "id": identity,
        "video_id": 1,
        "category_id": numbers[coco.commonest(rows.classes)],
        "iscrowd": 0,
    }
    if (rows.confidence != 1).any():
        about["score"] = short(rows.confidence.mean() if np.ptp(rows.confidence) else rows.confidence[0])
    return {**about, "width": size[1], "height": size[0], "length": length, **lists}


FORMAT = Format(
    "coco-vis",
    "YouTube-VIS JSON, an annotation a track with silhouettes and boxes; frames from 0",
    read,
    write,
    suffixes=(".json",),
    needs_size=True,
    holds=frozenset(
        {Trait.BOX, Trait.MASK, Trait.MASK_TOO, Trait.OVERLAP, Trait.CLASS, Trait.CONFIDENCE, Trait.RATE}
    ),
)
_MOST_ENTRIES = 10**8  # of all lists together

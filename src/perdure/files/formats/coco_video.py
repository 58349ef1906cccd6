"""COCO for videos, as CocoVID and TAO have it: an annotation a row, with `image_id` and `track_id`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from perdure.errors import FormatError
from perdure.files.formats import coco
from perdure.files.formats.content import MOST_FRAMES, Content, Format, Gathering, Reading, counted_from_one
from perdure.files.formats.jsons import size_of
from perdure.files.formats.traits import Trait
from perdure.files.lines import short
from perdure.files.span import shown
from perdure.files.whole import refuse_existing, whole_file

_FRAME_KEYS = ("frame_id", "frame_index")
_ID_KEYS = ("track_id", "instance_id")


def read(path: Path, reading: Reading) -> Content:
    """Return the rows of one film; annotations of crowds are left out, and a note says so.

    A picture's frame is its `frame_id`, or its `frame_index`, from 0; where pictures have a `prev_image_id`, as those
    who made that key count, `frame_id` is from 1. Where they have none of these it is their place in the list.

    Raises
    ------
    FormatError
        Naming file and annotation, or picture.
    ParameterError
        If it holds several films and none is chosen.
    """
    document = coco.read_document(path)
    video = coco.wanted_video(path, document["videos"], reading.video) if document["videos"] else {}
    pictures = [one for one in document["images"] if not video or one.get("video_id") == video.get("id")]
    if not pictures and not video:
        raise FormatError(f"{path} holds neither images nor videos, so no frames")
    size, frames = _size(path, pictures or [video]), _frames(path, pictures)
    rows, crowds = _rows(path, document, size, frames)
    tracks, notes = counted_from_one(rows.tracks())
    return Content(
        tracks,
        size,
        tuple(sorted(frames.values())),
        fps=coco.rate_told(video),
        name=coco.video_name(video) if video else "",
        images={frames[one["id"]]: one["file_name"] for one in pictures if isinstance(one.get("file_name"), str)},
        notes=(*notes, f"annotations of crowds left out: {crowds}") if crowds else notes,
    )


def _rows(
    path: Path, document: Mapping[str, list[Mapping[str, Any]]], size: tuple[int, int], frames: Mapping[int, int]
) -> tuple[Gathering, int]:
    """The rows in these pictures, and the number of annotations of crowds."""
    kinds = coco.read_categories(path, document["categories"])
    rows, crowds, known = Gathering(path), 0, {one["id"] for one in document["images"] if _has_id(one)}
    for number, annotation in enumerate(document["annotations"], 1):
        place, image = f"annotation {number}", annotation.get("image_id")
        if type(image) is not int or image not in known:
            raise rows.refuse(place, f"there is no image of id {shown(image)}")
        if image not in frames:
            continue  # of another video
        if annotation.get("iscrowd"):
            crowds += 1
            continue
        try:
            _add(rows, place, annotation, kinds, size, frames[image])
        except (KeyError, TypeError, ValueError) as error:
            raise rows.refuse(place, coco.why(error)) from None
    return rows, crowds


def _has_id(picture: Mapping[str, Any]) -> bool:
    return type(picture.get("id")) is int


def _size(path: Path, pictures: Sequence[Mapping[str, Any]]) -> tuple[int, int]:
    sizes = {size_of(f"{path}, image {shown(one.get('id'))}", one) for one in pictures}
    if len(sizes) > 1:
        raise FormatError(f"{path}: pictures of one video have several sizes: {sorted(sizes)[:3]} (height, width)")
    return sizes.pop()


def _frames(path: Path, pictures: Sequence[Mapping[str, Any]]) -> dict[int, int]:
    """The frame of each picture, by its id."""
    key = next((one for one in _FRAME_KEYS if all(one in picture for picture in pictures)), None)
    first = 1 if key == "frame_id" and any("prev_image_id" in picture for picture in pictures) else 0
    frames: dict[int, int] = {}
    taken: dict[int, Any] = {}
    for place, picture in enumerate(pictures):
        frame = place if key is None else picture[key]
        if not _has_id(picture) or picture["id"] in frames:
            raise FormatError(f"{path}: image id {shown(picture.get('id'))} is not whole, or stands twice")
        if type(frame) is not int or not 0 <= frame - first <= MOST_FRAMES:
            raise FormatError(
                f"{path}, image {picture['id']}: {key} {shown(frame)} is not a whole number from {first} on"
            )
        if taken.setdefault(frame, picture["id"]) != picture["id"]:
            raise FormatError(f"{path}: images {taken[frame]} and {picture['id']} are both frame {frame}")
        frames[picture["id"]] = frame - first
    return frames


def _add(
    rows: Gathering,
    place: str,
    annotation: Mapping[str, Any],
    kinds: Mapping[int, str],
    size: tuple[int, int],
    frame: int,
) -> None:
    """Take up a row."""
    key = next((one for one in _ID_KEYS if annotation.get(one) is not None), None)
    if key is None:
        raise ValueError("it has no track_id: these are detections, not tracks")
    segmentation, box = annotation.get("segmentation"), annotation.get("bbox")
    mask = coco.mask_of(segmentation, size) if segmentation else None
    if box is None and mask is None:
        raise ValueError("it has neither bbox nor segmentation")
    rows.add(
        place,
        frame=frame,
        identity=annotation[key],
        box=mask.box if box is None and mask is not None else coco.box_of(box),
        mask=mask,
        kind=kinds[annotation["category_id"]],
        confidence=annotation.get("score", 1.0),
    )


def write(path: Path, content: Content, *, overwrite: bool) -> int:
    """Write a file of one film, with a picture for every frame that is known of and an annotation a row."""
    refuse_existing(path, overwrite=overwrite)
    height, width = content.sized("coco-video")
    tracks, numbers = content.tracks, coco.categories_of(content.tracks)
    film = content.film
    images = {frame: number for number, frame in enumerate(film, 1)}
    pictures = [
        {
            "id": number,
            "video_id": 1,
            "frame_id": frame,
            "frame_index": frame,
            "file_name": coco.image_name(content, frame),
            "width": width,
            "height": height,
        }
        for frame, number in images.items()
    ]
    said = [numbers[coco.commonest(tracks.of_id(one).classes)] for one in np.unique(tracks.ids).tolist()]
    document = {
        "info": {"description": "written by Perdure"},
        "videos": [coco.written_video(content, height, width)],
        "images": pictures,
        "tracks": [
            {"id": one, "category_id": kind, "video_id": 1}
            for one, kind in zip(np.unique(tracks.ids).tolist(), said, strict=True)
        ],
        "annotations": [_annotation(content, row, images, numbers) for row in range(len(tracks))],
        "categories": coco.written_categories(numbers),
    }
    with whole_file(path) as file:
        json.dump(document, file, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
        file.write("\n")
    return len(tracks)


def _annotation(
    content: Content, row: int, images: Mapping[int, int], numbers: Mapping[str, int]
) -> dict[str, Any]:
    """What is written of one row."""
    tracks, size = content.tracks, content.sized("coco-video")
    box, mask = coco.written_box(tracks.boxes[row]), coco.written_mask(tracks.masks[row], *size, packed=True)
    identity = int(tracks.ids[row])
    return {
        "id": row + 1,
        "image_id": images[int(tracks.frames[row])],
        "video_id": 1,
        "category_id": numbers[str(tracks.classes[row])],
        "track_id": identity,
        "instance_id": identity,
        "bbox": box,
        "area": tracks.masks[row].area if mask else box[2] * box[3],
        "iscrowd": 0,
        "score": short(tracks.confidence[row]),
        **({"segmentation": mask} if mask else {}),
    }


FORMAT = Format(
    "coco-video",
    "COCO JSON with videos, an annotation a row (CocoVID, TAO); frames from 0",
    read,
    write,
    suffixes=(".json",),
    needs_size=True,
    holds=frozenset(
        {
            *(Trait.BOX, Trait.MASK, Trait.MASK_TOO, Trait.OVERLAP, Trait.CLASS, Trait.CHANGING_CLASS),
            *(Trait.CONFIDENCE, Trait.CHANGING_CONFIDENCE, Trait.RATE),
        }
    ),
)

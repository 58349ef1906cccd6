"""What the two kinds of COCO for videos share: films, categories, boxes and segmentations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.errors import FormatError, ParameterError
from perdure.features.masks import of_picture_runs, picture_runs
from perdure.files.formats.content import Content, rate_of
from perdure.files.formats.jsons import read_json
from perdure.files.lines import short
from perdure.files.mots import packed_runs, unpacked_runs
from perdure.files.span import shown
from perdure.types import Mask, Tracks

FILM = "film"  # the name of one that has none
UNNAMED = "object"  # the category of rows without a class; read as none
Json = Any


def read_document(path: Path) -> Mapping[str, list[Mapping[str, Json]]]:
    """Return the lists of a document, `annotations` and `categories` at least; FormatError where they are none."""
    value = read_json(path)
    if not isinstance(value, Mapping):
        raise FormatError(
            f"{path}: wanted is a JSON object with 'annotations' and 'categories', not {shown(value)}"
        )
    found: dict[str, list[Mapping[str, Json]]] = {}
    for name in ("videos", "images", "annotations", "categories"):
        several = value.get(name, None if name in ("annotations", "categories") else [])
        if not isinstance(several, list):
            raise FormatError(f"{path}: {name!r} must be a list, not {shown(several)}")
        for number, one in enumerate(several, 1):
            if not isinstance(one, Mapping):
                raise FormatError(f"{path}, {name} {number}: wanted is an object, not {shown(one)}")
        found[name] = several
    return found


def wanted_video(path: Path, videos: Sequence[Mapping[str, Json]], named: str | None) -> Mapping[str, Json]:
    """Return the film that is wanted, by name or id; the only one where none is named.

    Raises
    ------
    ParameterError
        If there are several and none is named, or none is of that name.
    """
    names = [video_name(one) for one in videos]
    if named is not None:
        fitting = [one for one, name in zip(videos, names, strict=True) if named in (name, str(one.get("id")))]
        if fitting:
            return fitting[0]
    elif len(videos) == 1:
        return videos[0]
    listed = ", ".join(names[:8]) + (", …" if len(names) > 8 else "")
    if named is not None:
        raise ParameterError(f"{path} holds no video {named!r}; it holds {listed or 'none'}")
    raise ParameterError(f"{path} holds {len(videos)} videos; choose one by --video: {listed}")


def video_name(video: Mapping[str, Json]) -> str:
    """Return the name of a film: its own, that of its pictures' folder, or its id."""
    name = video.get("name") or video.get("file_name")
    files = video.get("file_names")
    if not name and isinstance(files, list) and files and isinstance(files[0], str) and "/" in files[0]:
        name = files[0].rpartition("/")[0]
    return str(name or video.get("id"))


def read_categories(path: Path, several: Sequence[Mapping[str, Json]]) -> dict[int, str]:
    """Return the classes by number; empty for `object`."""
    found = {}
    for number, one in enumerate(several, 1):
        if type(one.get("id")) is not int or not isinstance(one.get("name"), str):
            raise FormatError(f"{path}, categories {number}: wanted are a whole 'id' and a 'name'")
        found[one["id"]] = "" if one["name"] == UNNAMED else one["name"]
    return found


def categories_of(tracks: Tracks) -> dict[str, int]:
    """Return a number for every class that rows have, from 1."""
    return {name: number for number, name in enumerate(np.unique(tracks.classes).tolist(), 1)}


def written_categories(numbers: Mapping[str, int]) -> list[Json]:
    """Return the categories as they are written."""
    return [
        {"id": number, "name": name or UNNAMED, "supercategory": name or UNNAMED}
        for name, number in numbers.items()
    ]


def written_video(content: Content, height: int, width: int) -> dict[str, Json]:
    """Return what is written of a film, without its pictures."""
    rate = content.fps or (rate_of(content.tracks) if content.timed else None)
    about = {"id": 1, "name": content.name or FILM, "width": width, "height": height}
    return about | ({"fps": rate} if rate else {})


def rate_told(video: Mapping[str, Json]) -> float | None:
    """Return the frames a second that a film's entry tells, if any."""
    rate: Json = video.get("fps")
    return float(rate) if type(rate) in (int, float) and 0 < rate <= 1e6 else None


def image_name(content: Content, frame: int) -> str:
    """Return the name of a frame's picture: the film's own, or one made of the film's name and the frame's number."""
    return content.images.get(frame, f"{content.name or FILM}/{frame:06d}.jpg")


def commonest(column: NDArray[Any]) -> Any:
    """Return the value that stands most often, the least of several."""
    counts = Counter(column.tolist())
    return min(counts, key=lambda value: (-counts[value], value))


def why(error: Exception) -> str:
    """Return in words what is wrong with an annotation."""
    if isinstance(error, KeyError):
        return f"{error.args[0]!r} is missing, or a category that there is not"
    return str(error)


# Boxes ----------------------------------------------------------------------------------------------------------


def box_of(value: Json) -> list[float]:
    """Return x1 y1 x2 y2 of a box x, y, width, height; ValueError for what is none."""
    if not isinstance(value, list) or len(value) != 4 or not {type(one) for one in value} <= {int, float}:
        raise ValueError("a bbox must be four numbers: x, y, width, height")
    x, y, width, height = value
    if min(width, height) < 0:
        raise ValueError(f"a bbox of {width:g}x{height:g} cannot be")
    return [x, y, x + width, y + height]


def written_box(box: NDArray[np.float32]) -> list[float]:
    """Return x, y, width, height that read back as the same box."""
    x1, y1, x2, y2 = box
    return [short(x1), short(y1), _side(x1, x2), _side(y1, y2)]


def _side(low: np.float32, high: np.float32) -> float:
    """The shortest difference that brings one back to the other."""
    near = round(short(high) - short(low), 6)
    return near if np.float32(short(low) + near) == high else float(high) - short(low)


# Segmentations --------------------------------------------------------------------------------------------------


def mask_of(value: Json, size: tuple[int, int]) -> Mask:
    """Return the silhouette of a segmentation in a picture of this height and width: run lengths, packed or not, or polygons.

    Raises
    ------
    ValueError
        For what is none, and for one of another size.
    """
    height, width = size
    if isinstance(value, list):
        return _of_polygons(value, height, width)
    if not isinstance(value, Mapping) or not {"size", "counts"} <= value.keys():
        raise ValueError("a segmentation must have size and counts, or be a list of polygons")
    if value["size"] != [height, width]:
        raise ValueError(f"a segmentation of size {value['size']} in a picture of [{height}, {width}]")
    counts = value["counts"]
    if isinstance(counts, str):
        return of_picture_runs(unpacked_runs(counts), height, width)
    if not isinstance(counts, list) or not {type(one) for one in counts} <= {int}:
        raise ValueError("counts must be a text or a list of whole numbers")
    return of_picture_runs(np.array(counts, np.int64), height, width)


def written_mask(mask: Mask, height: int, width: int, *, packed: bool) -> dict[str, Json] | None:
    """Return a silhouette as run lengths, packed into a text or as a list; None where nothing of it is in the picture."""
    runs = picture_runs(mask, height, width)
    if len(runs) < 2:
        return None
    return {"size": [height, width], "counts": packed_runs(runs, height, width) if packed else runs.tolist()}


def _of_polygons(value: list[Json], height: int, width: int) -> Mask:
    from pycocotools import mask as packed

    for ring in value:
        if not isinstance(ring, list) or len(ring) < 6 or len(ring) % 2:
            raise ValueError("a polygon must be a list of x, y, x, y, … of three points or more")
        if not all(type(one) in (int, float) and abs(one) <= _FAR for one in ring):
            raise ValueError("a polygon must hold numbers that can be")
    if not value:
        return Mask.empty()
    whole = packed.merge(packed.frPyObjects(value, height, width))
    return of_picture_runs(unpacked_runs(whole["counts"].decode("ascii")), height, width)


_FAR = 1 << 16  # px

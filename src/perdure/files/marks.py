"""What the user marks in a frame: `WHAT[@FRAME]`, an index PNG, a box or a polygon; from Python also an index array.

In an index picture the value of a pixel is the id of the thing seen there, 0 for nothing; in 8 bits 255 is void
where there are other ids. A picture of one value, its largest (black and white), shows one thing of no id.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perdure.detect.marked import Mark, in_order
from perdure.errors import FormatError, ParameterError
from perdure.files.mask_pngs import LARGEST_ID, VOID, Indices, read_indices, silhouettes
from perdure.files.shapes import is_box, is_file, read_ring, read_shape
from perdure.files.span import cut, shown
from perdure.types import Mask, Scene

What = str | Path | NDArray[Any]
AnyMark = What | tuple[What, int]

_WHOLE = 0.995  # of the picture: what covers more leaves no ground
_FORMS = "an index PNG, a box 'x,y,w,h' or a polygon 'x,y x,y x,y', and @FRAME where it is not frame 0"


def read_marks(given: AnyMark | Sequence[AnyMark], scene: Scene, frames: range | None) -> tuple[Mark, ...]:
    """Read what the user marked.

    Parameters
    ----------
    given : str, Path, array, or several of them in a list
        Each an index PNG, a box 'x,y,w,h' or a polygon 'x,y x,y x,y …', with '@FRAME' behind it for another frame
        than 0; or an (H, W) array of whole numbers, 0 for nothing; or a pair of one of these and its frame.
    scene : Scene
        Its size, and its roi, in which every mark must have a pixel.
    frames : range or None
        Those that will come; None for a source that passes once and begins with frame 0.

    Returns
    -------
    tuple of Mark
        In the order given, those of one picture by their ids. What has no id of its own gets the next free one.

    Raises
    ------
    ParameterError, FormatError
        Naming what was given, what is wrong with it and what would do.
    """
    marks: list[Mark] = []
    texts: list[str] = []
    for what, frame, text in _each(given):
        try:
            _check_frame(frame, frames)
            read = [dataclasses.replace(mark, frame=frame) for mark in _read(what, scene)]
        except (FormatError, ParameterError) as error:
            raise type(error)(f"{_option(text)}: {error}") from None
        marks += read
        texts += [text] * len(read)
    _check_together(marks, texts, scene)
    return _with_ids(marks)


def words_of(given: AnyMark | Sequence[AnyMark]) -> tuple[str, ...]:
    """Return what was given in words, for the record of a run."""
    return tuple(text for _, _, text in _each(given))


def files_of(given: AnyMark | Sequence[AnyMark]) -> tuple[Path, ...]:
    """Return the files among what was given, each once."""
    places = [Path(what) for what, _, _ in _each(given) if isinstance(what, (str, Path)) and is_file(what)]
    return tuple(dict.fromkeys(places))


def _each(given: Any) -> Iterator[tuple[Any, int, str]]:
    """What is marked, its frame, and how the user said it."""
    several = isinstance(given, (list, tuple)) and not _is_pair(given)
    for one in given if several else [given]:
        pair = _is_pair(one)
        what, frame = one if pair else (one, 0)
        text = _text_of(what)
        if isinstance(what, str) and not pair:
            what, frame = _parted(what)
        if isinstance(frame, bool) or not isinstance(frame, Integral) or frame < 0:
            raise ParameterError(f"{_option(text)}: {shown(frame)} is no frame: it must be a whole number ≥ 0")
        yield what, int(frame), f"{text}@{frame}" if pair and frame else text


def _is_pair(given: object) -> bool:
    """Whether this is what is marked and its frame."""
    return isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], Real)


def _parted(text: str) -> tuple[str, Any]:
    """WHAT and its frame; the frame as its text where it is no whole number."""
    what, at, frame = text.rpartition("@")
    if not at or is_file(text):
        return text, 0
    if re.fullmatch(r"[0-9]{1,9}", frame.strip()):
        return what.strip(), int(frame.strip())
    return (what, frame) if is_file(what) or "," in what else (text, 0)


def _text_of(what: object) -> str:
    """How a message names what was given."""
    if isinstance(what, (str, Path)):
        return str(what)
    if isinstance(what, np.ndarray):
        return f"an array of {'x'.join(map(str, what.shape[::-1]))}"
    return shown(what)


def _option(text: str) -> str:
    """How a message begins that is about this mark."""
    return f"init = '{cut(text, _LONGEST)}'"


def _check_frame(frame: int, frames: range | None) -> None:
    """Refuse a frame that will not come."""
    if frames is None:
        if frame:
            raise ParameterError(
                "this source passes only once, and only its frame 0 can be marked: leave out @FRAME"
            )
    elif not frames:
        raise ParameterError("there is no frame to mark: the source is empty")
    elif frame not in frames:
        step = f" in steps of {frames.step}" if len(frames) > 1 and frames.step > 1 else ""
        raise ParameterError(
            f"frame {frame} is not among those that are tracked, {frames[0]} to {frames[-1]}{step}: "
            "name one of these after @, or change --start, --end or --stride"
        )


def _read(what: Any, scene: Scene) -> list[Mark]:
    """The marks of one thing given, of frame 0."""
    if isinstance(what, np.ndarray):
        return _of_indices(_whole_numbers(what), scene)
    if not isinstance(what, (str, Path)):
        raise ParameterError(f"{shown(what)} marks nothing: give {_FORMS}")
    text = str(what)
    try:
        drawn = read_shape(text, scene.width, scene.height)
    except ValueError as error:
        raise ParameterError(str(error)) from None
    if drawn is None:
        if not is_file(text):
            raise ParameterError(_no_file(text))
        return _of_indices(read_indices(Path(text)), scene)
    if not drawn.any():
        raise ParameterError(
            f"it has no pixel inside the picture of {scene.width}x{scene.height}: "
            "draw it inside, with a width and a height"
        )
    return [Mark(0, 0, Mask.of_image(drawn), rough=_is_rough(text))]


def _is_rough(text: str) -> bool:
    """Whether a shape is drawn around a thing, not along it: a box, or a polygon of so few corners."""
    return is_box(text) or len(read_ring(text)) <= _CORNERS


def _no_file(text: str) -> str:
    if Path(text).suffix.lower() in (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".gif", ".webp"):
        return f"there is no such file; give {_FORMS}"
    return f"it is no file, no box and no polygon; give {_FORMS}"


def _whole_numbers(array: NDArray[Any]) -> Indices:
    """An index array as an index picture."""
    if array.dtype == np.bool_:
        array = np.where(array, np.uint8(VOID), np.uint8(0))
    if array.ndim != 2 or not np.issubdtype(array.dtype, np.integer):
        raise ParameterError(f"an array of marks must be (H, W) whole numbers, not {array.shape} {array.dtype}")
    if array.size and not 0 <= int(array.min()) <= int(array.max()) <= LARGEST_ID:
        raise ParameterError(
            f"an array of marks may hold 0 to {LARGEST_ID}, not {int(array.min())} to {int(array.max())}"
        )
    return array if array.dtype in (np.uint8, np.uint16) else array.astype(np.uint16)


def _of_indices(picture: Indices, scene: Scene) -> list[Mark]:
    """The things of an index picture of the scene's size."""
    height, width = picture.shape
    if (height, width) != (scene.height, scene.width):
        raise FormatError(
            f"the mask is {width}x{height}, the video {scene.width}x{scene.height}: "
            "draw it on a picture of the video, or scale it without smoothing"
        )
    found = dict(silhouettes(picture))
    largest = int(np.iinfo(picture.dtype).max)
    if found.keys() == {largest}:
        return [Mark(0, 0, found[largest])]
    if picture.dtype == np.uint8:
        found.pop(VOID, None)
    if not found:
        raise FormatError("the mask is empty, every pixel is 0: give each thing's pixels its id, 1 or more")
    if _is_smoothed(picture, len(found)):
        raise FormatError(
            f"most of its {len(found)} values are single pixels, as in a photograph or a mask with soft edges: "
            "draw it without smoothing, or make it black and white"
        )
    return [Mark(0, value, mask) for value, mask in found.items()]


def _is_smoothed(picture: Indices, count: int) -> bool:
    """Whether most of the values nowhere fill two by two pixels."""
    corner = picture[:-1, :-1]  # (H - 1, W - 1)
    same = (corner == picture[1:, :-1]) & (corner == picture[:-1, 1:]) & (corner == picture[1:, 1:])
    filled = int(np.count_nonzero(np.unique(corner[same])))
    return count > _FEW and filled < count / 2


def _check_together(marks: Sequence[Mark], texts: Sequence[str], scene: Scene) -> None:
    """Refuse marks that leave no ground, lie outside the roi, share an id, or hide one another."""
    for frame in sorted({mark.frame for mark in marks}):
        here = [number for number, mark in enumerate(marks) if mark.frame == frame]
        free = np.ones((scene.height, scene.width), np.bool_) if scene.roi is None else scene.roi.copy()
        taken = np.zeros_like(free)
        said: dict[int, str] = {}
        for place in in_order(marks[number] for number in here):
            mark, name = marks[here[place]], _option(texts[here[place]])
            area = mark.area.to_image(scene.height, scene.width)
            taken |= area
            if np.count_nonzero(taken) >= _WHOLE * taken.size:
                raise ParameterError(
                    f"{name}: what is marked in frame {frame} covers {100 * taken.mean():.1f} % of the picture: "
                    "leave the ground unmarked, 0"
                )
            if scene.roi is not None and not (area & scene.roi).any():
                raise ParameterError(
                    f"{name}: {_named(mark)} lies outside the roi: mark what is inside, or leave out --roi"
                )
            if mark.id and mark.id in said:
                raise ParameterError(
                    f"{name}: id {mark.id} is marked twice in frame {frame}, also by '{cut(said[mark.id], _LONGEST)}': "
                    "give every thing an id of its own"
                )
            if not (area & free).any():
                raise ParameterError(
                    f"{name}: {_named(mark)} lies wholly under what else is marked in frame {frame}"
                )
            free &= ~area
            said[mark.id] = texts[here[place]]


def _named(mark: Mark) -> str:
    return f"id {mark.id}" if mark.id else "it"


def _with_ids(marks: Sequence[Mark]) -> tuple[Mark, ...]:
    """The marks, each with an id: what has none gets the lowest that nobody has."""
    taken = {mark.id for mark in marks}
    free = (number for number in range(1, len(marks) + len(taken) + 1) if number not in taken)
    return tuple(mark if mark.id else dataclasses.replace(mark, id=next(free)) for mark in marks)


_LONGEST = 160  # letters of what was given, in a message
_CORNERS = 4
_FEW = 2  # ids: so many may be as thin as they like

"""Reading CVAT for video 1.1, element by element: no entities, no document type, boxes between keyframes filled in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn
from xml.parsers import expat

import numpy as np

from perdure.errors import FormatError
from perdure.features.outlines import mask_of
from perdure.files.formats.coco import UNNAMED
from perdure.files.formats.content import LAST, MOST_FRAMES, Content, Gathering, Reading, counted_from_one, cut_to
from perdure.files.formats.jsons import LARGEST_AREA, LONGEST_SIDE
from perdure.files.lines import number_of
from perdure.files.span import shown
from perdure.types import Mask, Outline, Status

_SHAPES = ("box", "polygon", "mask")
_OTHERS = ("polyline", "points", "ellipse", "cuboid", "skeleton")
_TOLD = {
    ("original_size", "width"),
    ("original_size", "height"),
    ("task", "name"),
    ("task", "size"),
    ("job", "size"),
}


def read(path: Path, reading: Reading) -> Content:
    """Return the rows of a file; shapes of other kinds than boxes, polygons and masks are left out, and a note says so.

    Between two boxes of a track, or polygons of as many points, the frames that are not listed are filled in on a
    straight line, unless the first is `outside`; a mask stays as it is. Such rows, and those that are no keyframes,
    are `inferred`. A track ends with its last shape.

    Raises
    ------
    FormatError
        Naming file, line and what is wrong; also for a document type or entity, which are never read.
    """
    reader = _Reader(path)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = reader.begin
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.text
    parser.StartDoctypeDeclHandler = reader.refuse_doctype
    parser.EntityDeclHandler = reader.refuse_doctype
    reader.parser = parser
    try:
        with path.open("rb") as file:
            parser.ParseFile(file)
    except OSError as error:
        raise FormatError(f"cannot read {path}: {error.strerror or error}") from error
    except expat.ExpatError as error:
        why = expat.errors.messages[error.code]
        raise FormatError(f"{path}, line {error.lineno}: not XML ({why}); is the file whole?") from None
    except (LookupError, ValueError) as error:
        raise FormatError(f"{path}, line 1: its encoding cannot be read ({error}); save it as UTF-8") from None
    return reader.content()


@dataclass
class _Shape:
    """A shape of a track, as it is listed."""

    line: int
    frame: int
    outside: bool
    occluded: bool
    inferred: bool
    points: np.ndarray[Any, Any]  # (2, 2) corners of a box, (n, 2) of a polygon, none of a mask
    mask: Mask | None = None
    is_polygon: bool = False
    attributes: dict[str, str] = field(default_factory=dict)


class _Reader:
    """What has been read so far of a file."""

    parser: expat.XMLParserType

    def __init__(self, path: Path) -> None:
        self._path = path
        self._rows = Gathering(path)
        self._open: list[str] = []
        self._words: list[str] = []
        self._told: dict[tuple[str, str], str] = {}
        self._track: tuple[float, str] | None = None
        self._shapes: list[_Shape] = []
        self._attribute = ""
        self._others = self._filled = 0
        self._tasks: set[str] = set()

    def begin(self, tag: str, attributes: dict[str, str]) -> None:
        self._words.clear()
        depth = len(self._open)
        if depth == 0 and tag != "annotations":
            self._refuse(f"its first element is <{tag}>; wanted is <annotations> of CVAT for video 1.1")
        if depth > _DEEPEST:
            self._refuse("elements are nested too deep")
        self._open.append(tag)
        if depth == 1 and tag == "image":
            self._refuse("this is CVAT for images, which has no tracks; export it as 'CVAT for video 1.1'")
        if depth == 1 and tag == "track":
            self._tasks.add(attributes.get("task_id", ""))
            if len(self._tasks) > 1:
                self._refuse(
                    "this is a project with several tasks, whose frames all count from 0; export one task"
                )
            label = attributes.get("label", "")
            self._track = self._number(attributes, "id"), "" if label == UNNAMED else label
            self._shapes = []
        elif depth == 2 and self._track is not None:
            if tag in _SHAPES:
                self._shapes.append(self._shape(tag, attributes))
            elif tag in _OTHERS:
                self._others += 1
        elif depth == 3 and tag == "attribute":
            self._attribute = attributes.get("name", "")

    def end(self, tag: str) -> None:
        self._open.pop()
        words = "".join(self._words)
        self._words.clear()
        if tag == "attribute" and len(self._open) == 3 and self._open[2] in _SHAPES and self._shapes:
            self._shapes[-1].attributes[self._attribute] = words
        elif tag == "track" and len(self._open) == 1:
            self._settle()
            self._track = None
        elif self._open and (self._open[-1], tag) in _TOLD and "meta" in self._open:
            self._told.setdefault((self._open[-1], tag), words.strip())

    def text(self, words: str) -> None:
        self._words.append(words)

    def refuse_doctype(self, *_: object) -> NoReturn:
        self._refuse("it has a document type or entities, which are not read; take them out")

    def content(self) -> Content:
        """Return what the whole file says."""
        size, told = self._size(), self._told
        count = told.get(("task", "size"), told.get(("job", "size"), ""))
        frames = range(int(count)) if count.isdecimal() and int(count) <= MOST_FRAMES else None
        tracks, notes = counted_from_one(self._rows.tracks())
        if self._others:
            notes = (*notes, f"shapes that are no boxes, polygons or masks left out: {self._others}")
        return Content(cut_to(tracks, size), size, frames, name=told.get(("task", "name"), ""), notes=notes)

    # Shapes ---

    def _shape(self, tag: str, attributes: Mapping[str, str]) -> _Shape:
        frame = self._number(attributes, "frame")
        if not 0 <= frame <= LAST or frame % 1:
            self._refuse(f"frame {frame:g} is not a whole number from 0 to {LAST}")
        flags = (attributes.get(name, default) == "1" for name, default in _FLAGS.items())
        outside, occluded, is_key = flags
        points, mask = np.zeros((0, 2)), None
        if tag == "box":
            points = self._corners(attributes)
        elif tag == "polygon":
            points = self._points(attributes.get("points", ""))
        else:
            mask = self._mask(attributes)
        return _Shape(self._line, int(frame), outside, occluded, not is_key, points, mask, tag == "polygon")

    def _corners(self, attributes: Mapping[str, str]) -> np.ndarray[Any, Any]:
        """The corners (2, 2) of a box; of one that is turned, of the box around it."""
        corners = np.array([self._number(attributes, name) for name in ("xtl", "ytl", "xbr", "ybr")]).reshape(2, 2)
        turned = math.radians(self._number(attributes, "rotation") if "rotation" in attributes else 0.0)
        if turned:
            middle, (width, height) = corners.mean(axis=0), corners[1] - corners[0]
            cosine, sine = abs(math.cos(turned)), abs(math.sin(turned))
            half = np.array([width * cosine + height * sine, width * sine + height * cosine]) / 2
            corners = np.stack([middle - half, middle + half])
        return corners

    def _points(self, text: str) -> np.ndarray[Any, Any]:
        try:
            points = np.array([[number_of(one) for one in pair.split(",")] for pair in text.split(";")])
        except ValueError:
            points = np.zeros(0)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3 or not (np.abs(points) <= _FAR).all():
            self._refuse(f"points {shown(text)} are not 'x,y;x,y;x,y' or more of numbers that can be")
        return points

    def _mask(self, attributes: Mapping[str, str]) -> Mask:
        left, top, width, height = (self._number(attributes, name) for name in ("left", "top", "width", "height"))
        sides_are_good = (
            1 <= width <= LONGEST_SIDE and 1 <= height <= LONGEST_SIDE and width * height <= LARGEST_AREA
        )
        if (
            not sides_are_good
            or max(abs(left), abs(top)) > _FAR
            or any(one % 1 for one in (left, top, width, height))
        ):
            self._refuse(f"a mask of {width:g}x{height:g} at ({left:g}, {top:g}) cannot be")
        try:
            runs = np.array([int(one) for one in attributes.get("rle", "").split(",")], np.int64)
        except (ValueError, OverflowError):
            self._refuse("rle must be whole numbers with commas between them")
        area = int(width) * int(height)
        if (runs < 0).any() or (runs > area).any() or int(runs.sum()) != area:
            self._refuse(f"the rle does not fill the mask's {width:g}x{height:g} pixels")
        flat = np.repeat(np.arange(len(runs)) % 2 == 1, runs)
        return Mask.of_image(flat.reshape(int(height), int(width)), int(top), int(left))

    # Rows ---

    def _settle(self) -> None:
        """Make rows of the shapes of a track, and fill in what lies between them."""
        shapes = sorted(self._shapes, key=lambda one: one.frame)
        for k, shape in enumerate(shapes):
            following = shapes[k + 1] if k + 1 < len(shapes) else None
            if following is not None and following.frame == shape.frame:
                self._refuse(
                    f"frame {shape.frame} has two shapes of track {self._name}, as line {shape.line} says"
                )
            if shape.outside:
                continue
            self._add(shape, shape.frame, shape.points, inferred=shape.inferred)
            if following is not None:
                self._fill(shape, following)

    def _fill(self, shape: _Shape, following: _Shape) -> None:
        gap = following.frame - shape.frame
        self._filled += gap
        if self._filled > _FILLED + _FILLED_EACH * len(self._rows):
            self._refuse(
                f"frames {shape.frame} to {following.frame} of track {self._name} are too many to be filled in;"
                " list the track in some of them"
            )
        goes_on = following.points.shape == shape.points.shape and following.is_polygon == shape.is_polygon
        target = following.points if goes_on else shape.points
        for step in range(1, gap):
            share = step / gap
            self._add(shape, shape.frame + step, (1 - share) * shape.points + share * target, inferred=True)

    def _add(self, shape: _Shape, frame: int, points: np.ndarray[Any, Any], *, inferred: bool) -> None:
        place = f"line {shape.line}, frame {frame}"
        identity, label = self._track or (0, "")
        mask, outline = shape.mask, None
        if shape.is_polygon:
            outline = _outline_of(points)
            try:
                mask = mask_of(outline)
            except ValueError as error:
                raise self._rows.refuse(place, error) from None
            points = np.stack([points.min(axis=0), points.max(axis=0)])
        box = points.ravel().tolist() if shape.mask is None else shape.mask.box
        status, confidence = self._status(place, shape), self._confidence(place, shape)
        self._rows.add(
            place,
            frame=frame,
            identity=identity,
            box=box,
            status=status,
            confidence=confidence,
            kind=label,
            inferred=inferred,
            mask=mask,
            outline=outline,
        )

    def _status(self, place: str, shape: _Shape) -> Status:
        word = shape.attributes.get("status", "")
        known = {one.word: one for one in Status}
        return known.get(word, Status.PARTLY_OCCLUDED if shape.occluded else Status.VISIBLE)

    def _confidence(self, place: str, shape: _Shape) -> float:
        text = shape.attributes.get("confidence", "1")
        try:
            return number_of(text)
        except ValueError:
            raise self._rows.refuse(place, f"confidence {shown(text)} is no number") from None

    # Numbers ---

    @property
    def _line(self) -> int:
        return self.parser.CurrentLineNumber

    @property
    def _name(self) -> str:
        return f"{self._track[0]:g}" if self._track else "?"

    def _number(self, attributes: Mapping[str, str], name: str) -> float:
        text = attributes.get(name)
        try:
            value = number_of(text) if text is not None else math.nan
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self._refuse(f"{name} {'is missing' if text is None else f'{shown(text)} is no number'}")
        return value

    def _size(self) -> tuple[int, int] | None:
        """Height and width of the pictures, where the file says."""
        if not self._told.get(("original_size", "width")):
            return None
        height, width = (self._side(self._told.get(("original_size", side), "")) for side in ("height", "width"))
        if height * width > LARGEST_AREA:
            raise FormatError(f"{self._path}: a picture of {width}x{height} is too large")
        return height, width

    def _side(self, text: str) -> int:
        if not text.isdecimal() or not 1 <= int(text) <= LONGEST_SIDE:
            raise FormatError(
                f"{self._path}: original_size must be whole numbers from 1 to {LONGEST_SIDE}, not {shown(text)}"
            )
        return int(text)

    def _refuse(self, what: str) -> NoReturn:
        raise self._rows.refuse(f"line {self._line}", what)


def _outline_of(points: np.ndarray[Any, Any]) -> Outline:
    """The outline of a polygon's points, round it with the clock."""
    outline = Outline.of([points])
    return outline if outline.area >= 0 else Outline.of([points[::-1]])


_FLAGS = {"outside": "0", "occluded": "0", "keyframe": "1"}
_DEEPEST = 16
_FILLED, _FILLED_EACH = 300_000, 100  # rows between those that are listed: of a file, and more for each row
_FAR = 1 << 17  # px

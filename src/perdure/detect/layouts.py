"""What the outputs of a detection network mean, told by their names, shapes and first answer.

Networks are exported in a handful of layouts, which documents of their makers describe: YOLOX's raw grid (Ge and others
2021, section 2.1: a cell predicts the shift of the centre in cells, and the logarithm of the size), the decoded rows of
YOLOv5 and the decoded columns of YOLOv8, rows after suppression, the `DetectionOutput` of SSD (Caffe, OpenVINO), and boxes,
labels and scores apart (torchvision, TensorFlow, the ONNX model zoo). Each says what the network wants to be given, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.detect.letterbox import CORNER, STRETCHED, Fit
from perdure.errors import FormatError

Float = NDArray[np.float32]
Answer = Sequence[NDArray[np.generic]]  # the outputs of one run, in order


class Port(NamedTuple):
    """An input or output of a network."""

    name: str
    shape: tuple[int | None, ...]  # None where any size goes
    kind: str  # of its numbers: float32, float16, uint8, int64, …

    def __str__(self) -> str:
        """Name and shape, as the user may have seen them."""
        return f"{self.name!r} ({', '.join('any' if one is None else str(one) for one in self.shape)})"


class Found(NamedTuple):
    """What a network said of one picture: pixels of its input."""

    boxes: Float  # (N, 4)
    scores: Float  # (N,)
    kinds: NDArray[np.int64]  # (N,) number of the class


@dataclass(frozen=True)
class Layout:
    """How one network is given pictures, and what its outputs mean."""

    name: str
    fit: Fit
    decode: Callable[[Answer], Found]
    classes: int | None = None  # how many; None where the outputs do not tell
    suppressed: bool = False  # of several boxes of one thing the network itself has kept one


KNOWN = (
    "YOLOX (1, cells, 5 + C), YOLOv5 and v7 (1, 3 cells, 5 + C), YOLOv8, v9 and 11 (1, 4 + C, cells), rows after "
    "suppression (1, N, 6) of x1 y1 x2 y2 score class, SSD (1, 1, N, 7), and outputs boxes, scores and labels"
)


def recognised(
    outputs: Sequence[Port], answer: Answer, size: tuple[int, int], metadata: Mapping[str, str], kind: str
) -> Layout:
    """Return the layout of a network's outputs.

    Parameters
    ----------
    outputs : sequence of Port
        As the model declares them.
    answer : sequence of arrays
        What it said of a plain grey picture: of an output whose size is not declared, this is it.
    size : (height, width)
        Of the input.
    metadata : mapping
        What the model's file says of itself; Ultralytics tells the task there.
    kind : str
        Of the input's numbers; pictures go into whole numbers as they are.

    Raises
    ------
    FormatError
        For outputs of no known layout, naming them and the known ones.
    """
    task = metadata.get("task", "detect")
    if task != "detect":
        raise FormatError(f"it is made for the task {task!r:.40}, not to detect; export a detection model")
    shapes = [
        tuple(np.shape(said)) if None in port.shape else tuple(one or 0 for one in port.shape)
        for port, said in zip(outputs, answer, strict=True)
    ]
    layout = (
        _of_one(shapes[0], answer[0], size) if len(shapes) == 1 else _of_several(outputs, shapes, answer, size)
    )
    if layout is None:
        there = ", ".join(map(str, outputs)) or "none"
        raise FormatError(
            f"its outputs are of no known layout: {there}; known are {KNOWN}. "
            "For another one, give a function from Python: perdure.track(source, detector=function)"
        )
    if kind == "uint8":
        fit = Fit(layout.fit.height, layout.fit.width, layout.fit.place, layout.fit.bgr, 255.0)
        return Layout(layout.name, fit, layout.decode, layout.classes, layout.suppressed)
    return layout


def _of_one(shape: tuple[int, ...], said: NDArray[np.generic], size: tuple[int, int]) -> Layout | None:
    """The layout of a network with one output."""
    if len(shape) == 4 and shape[:2] == (1, 1) and shape[3] == 7:
        fit = Fit(*size, STRETCHED, bgr=True, most=255.0)
        return Layout("SSD", fit, partial(_ssd, size=size), suppressed=True)
    if len(shape) != 3 or shape[0] < 1:
        return None
    rows, columns = shape[1:]
    for strides in _STRIDES:
        cells = sum(len(one) for one, _ in _cells(size, strides))
        if rows == cells and columns > 5:
            return _grid(said, size, strides, columns - 5)
        if rows == 3 * cells and columns > 5:
            return Layout("YOLOv5", Fit(*size), _rows, columns - 5)
        if columns == cells and rows > 4:
            return Layout("YOLOv8", Fit(*size), _columns, rows - 4)
    if columns == 6:
        return Layout("rows after suppression", Fit(*size), partial(_done, size=size), suppressed=True)
    return None


def _grid(said: NDArray[np.generic], size: tuple[int, int], strides: Sequence[int], classes: int) -> Layout:
    """YOLOX: the centres are shifts within cells, or, of a model that decodes them itself, pixels of the input."""
    fit = Fit(*size, CORNER, bgr=True, most=255.0)
    centres = np.asarray(said, np.float32)[0, :, :2]
    if np.median(np.abs(centres)) > _SHIFT:
        return Layout("YOLOX, decoded", fit, _rows, classes)
    places = _cells(size, strides)
    cells = np.concatenate([one for one, _ in places])  # (N, 2)
    steps = np.concatenate([np.full((len(one), 1), stride, np.float32) for one, stride in places])  # (N, 1)
    return Layout("YOLOX", fit, partial(_raw, cells=cells, steps=steps), classes)


def _of_several(
    outputs: Sequence[Port], shapes: Sequence[tuple[int, ...]], answer: Answer, size: tuple[int, int]
) -> Layout | None:
    """The layout of boxes, labels and scores apart: told by names, else by shapes and kinds of numbers."""
    plain = [port.name.partition(":")[0].lower() for port in outputs]
    places = [next((k for k, name in enumerate(plain) if name in names), -1) for names in _NAMES]
    if -1 in places:
        places = _by_shape(shapes, [np.asarray(one).dtype for one in answer])
    if -1 in places or shapes[places[0]][-1:] != (4,):
        return None
    boxes, scores, labels = places
    rows_first = plain[boxes].startswith("detection_")  # TensorFlow's
    decode = partial(_apart, places=(boxes, scores, labels), size=size, rows_first=rows_first)
    if plain[boxes] == "bboxes":  # of the ONNX model zoo
        fit = Fit(*size, STRETCHED, mean=(0.485, 0.456, 0.406), spread=(0.229, 0.224, 0.225))
    else:
        fit = Fit(*size, STRETCHED if rows_first else CORNER)
    return Layout("boxes, scores and labels", fit, decode, suppressed=True)


def _by_shape(shapes: Sequence[tuple[int, ...]], kinds: Sequence[np.dtype[np.generic]]) -> list[int]:
    """The places of boxes, scores and labels among three outputs that are named otherwise; -1 where not told."""
    if len(shapes) != 3:
        return [-1]
    boxes = [k for k, one in enumerate(shapes) if len(one) > 1 and one[-1] == 4 and kinds[k].kind == "f"]
    labels = [k for k, kind in enumerate(kinds) if kind.kind in "iu"]
    if len(boxes) != 1 or len(labels) != 1:
        return [-1]
    scores = ({0, 1, 2} - {boxes[0], labels[0]}).pop()
    same = shapes[scores] == shapes[labels[0]] == shapes[boxes[0]][:-1]
    return [boxes[0], scores, labels[0]] if same else [-1]


# What the outputs say.


def _raw(answer: Answer, cells: Float, steps: Float) -> Found:
    """YOLOX: centre = (shift + cell) * stride, size = exp(said) * stride."""
    said = np.asarray(answer[0], np.float32)[0]  # (N, 5 + C)
    with np.errstate(over="ignore", invalid="ignore"):
        centres, extents = (said[:, :2] + cells) * steps, np.exp(said[:, 2:4]) * steps
    return _scored(centres, extents, said[:, 5:], said[:, 4])


def _rows(answer: Answer) -> Found:
    """Rows of centre, size, how sure it is that there is a thing, and how sure of each class."""
    said = np.asarray(answer[0], np.float32)[0]  # (N, 5 + C)
    return _scored(said[:, :2], said[:, 2:4], said[:, 5:], said[:, 4])


def _columns(answer: Answer) -> Found:
    """Columns of centre, size, and how sure of each class."""
    said = np.asarray(answer[0], np.float32)[0].T  # (N, 4 + C)
    return _scored(said[:, :2], said[:, 2:4], said[:, 4:], np.ones(len(said), np.float32))


def _done(answer: Answer, size: tuple[int, int]) -> Found:
    """Rows of corners, score and class; unused rows have the score 0."""
    said = np.asarray(answer[0], np.float32)[0]  # (N, 6)
    said = said[~(said[:, 4] <= 0)]
    return Found(_in_pixels(said[:, :4], size), said[:, 4], _numbers(said[:, 5]))


def _ssd(answer: Answer, size: tuple[int, int]) -> Found:
    """Rows of picture, class, score and corners as shares of the picture; the first picture below 0 ends them."""
    said = np.asarray(answer[0], np.float32)[0, 0]  # (N, 7)
    ends = np.flatnonzero(said[:, 0] < 0)
    said = said[: ends[0]] if len(ends) else said
    said = said[(said[:, 0] == 0) & ~(said[:, 2] <= 0)]
    return Found(said[:, 3:] * _extent(size), said[:, 2], _numbers(said[:, 1]))


def _apart(answer: Answer, places: tuple[int, int, int], size: tuple[int, int], rows_first: bool) -> Found:
    """Boxes (…, N, 4), scores (…, N) and labels (…, N) of one picture; `rows_first`: y1 x1 y2 x2."""
    boxes, scores, labels = (np.asarray(answer[place], np.float32) for place in places)
    boxes, scores, labels = boxes.reshape(-1, 4), scores.reshape(-1), labels.reshape(-1)
    boxes = boxes[:, [1, 0, 3, 2]] if rows_first else boxes
    there = ~(scores <= 0)
    return Found(_in_pixels(boxes[there], size), scores[there], _numbers(labels[there]))


def _scored(centres: Float, extents: Float, classes: Float, sure: Float) -> Found:
    """Boxes by centre and size, each of its likeliest class; its score is how sure it is of both."""
    kinds = classes.argmax(axis=1)  # a number that is not one is the largest: it stays one that is not
    with np.errstate(invalid="ignore", over="ignore"):
        scores = sure * np.take_along_axis(classes, kinds[:, None], axis=1)[:, 0]
        boxes = np.concatenate([centres - extents / 2, centres + extents / 2], axis=1)
    return Found(boxes, scores, kinds.astype(np.int64))


def _in_pixels(boxes: Float, size: tuple[int, int]) -> Float:
    """Boxes in pixels of the input; where no side lies beyond `_SHARE` they were shares of it."""
    with np.errstate(invalid="ignore"):
        shares = len(boxes) and not (np.abs(boxes[np.isfinite(boxes)]) > _SHARE).any()
    return np.asarray(boxes * _extent(size), np.float32) if shares else boxes


def _extent(size: tuple[int, int]) -> Float:
    return np.array([size[1], size[0]] * 2, np.float32)


def _numbers(values: NDArray[np.floating]) -> NDArray[np.int64]:
    """Numbers of classes; -1 for what is none."""
    good = np.isfinite(values) & (np.abs(values) < 1e6)
    return np.where(good, np.rint(np.where(good, values, 0)), -1).astype(np.int64)


def _cells(size: tuple[int, int], strides: Sequence[int]) -> list[tuple[Float, int]]:
    """For each stride the cells' x, y (N, 2), row by row, and the stride."""
    found = []
    for stride in strides:
        down, across = -(-size[0] // stride), -(-size[1] // stride)
        y, x = np.mgrid[:down, :across]
        found.append((np.stack([x, y], axis=2).reshape(-1, 2).astype(np.float32), stride))
    return found


_STRIDES = ((8, 16, 32), (8, 16, 32, 64), (16, 32))
_SHIFT = 8.0  # cells: raw centres lie nearer to their cell, decoded ones are pixels of all of the input
_SHARE = 2.0  # sides of boxes that are told as shares of the picture; no box in pixels is so small
_NAMES = (  # of boxes, of scores, of labels
    ("boxes", "bboxes", "detection_boxes"),
    ("scores", "detection_scores"),
    ("labels", "classes", "detection_classes"),
)

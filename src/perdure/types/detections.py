"""Detections as others keep them: arrays and `supervision.Detections` to regions, and tracks back to the latter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.errors import ParameterError, PerdureError
from perdure.types.frame import Mask
from perdure.types.regions import Regions
from perdure.types.tracks import Tracks

if TYPE_CHECKING:
    import supervision


class Given(NamedTuple):
    """What somebody's detector said of a frame, as it was said: nothing is checked but the shapes."""

    boxes: NDArray[np.float32]  # (N, 4)
    scores: NDArray[np.float32]  # (N,)
    classes: NDArray[np.str_]  # (N,)
    masks: tuple[Mask, ...]  # N
    data: dict[str, NDArray[Any]]  # (N, ...) each

    def regions(self, rows: NDArray[np.intp] | None = None) -> Regions:
        """Return it, or some of its rows, as regions; ValueError for a box or score that cannot be."""
        index = np.arange(len(self.boxes)) if rows is None else rows
        masks = [self.masks[k] for k in index.tolist()]
        data = {name: values[index] for name, values in self.data.items()}
        return Regions.of(self.boxes[index], self.scores[index], self.classes[index], masks, data)


def to_regions(detections: Any) -> Regions:
    """Return detections of any known kind as regions; order, classes, masks and data kept.

    Parameters
    ----------
    detections : supervision.Detections, Regions, or (N, 4 to 6) array
        Array columns: x1, y1, x2, y2, score, class number. Of `supervision`, ids go into `data["tracker_id"]`, numbers
        of classes into `data["class_id"]`.

    Raises
    ------
    ParameterError
        For another kind, a shape that cannot be, or a box or score that cannot be.
    """
    if isinstance(detections, Regions):
        return detections
    given = given_of(detections)
    if not (np.isfinite(given.boxes).all() and np.isfinite(given.scores).all()):
        raise ParameterError("detections hold a number that is not finite")
    try:
        return given.regions()
    except ValueError as error:
        raise ParameterError(f"these detections cannot be: {error}") from error


def given_of(detections: Any) -> Given:
    """Return detections of any known kind, as `to_regions` takes them, with their boxes and scores as they are."""
    if isinstance(detections, Regions):
        columns = (detections.boxes, detections.scores, detections.classes, detections.masks)
        return Given(*columns, {name: np.asarray(values) for name, values in detections.data.items()})
    try:
        if hasattr(detections, "xyxy") and hasattr(detections, "tracker_id"):
            return _of_supervision(detections)
        return _of_array(detections)
    except ValueError as error:
        raise ParameterError(f"these detections cannot be: {error}") from error


def to_supervision(
    said: Tracks | Regions, size: tuple[int, int] | None = None, names: Sequence[str] = ()
) -> supervision.Detections:
    """Return the rows of a frame as `supervision.Detections`, in their order.

    Parameters
    ----------
    said : Tracks or Regions
        Rows of one frame. Of tracks the ids are `tracker_id`.
    size : (height, width) or None
        Of the picture; None: no masks. Masks are (N, height, width); None where no row has any.
    names : sequence of str
        Names of all classes: `class_id` is the place of a row's class there, -1 for another. Where it is empty,
        `class_id` is what the detections had brought, or the class itself where all are numbers.

    Raises
    ------
    PerdureError
        If `supervision` is not installed.
    """
    try:
        import supervision
    except ImportError:
        raise PerdureError("this needs supervision: pip install 'perdure[supervision]'") from None
    tracks = said if isinstance(said, Tracks) else None
    data = {} if isinstance(said, Tracks) else dict(said.data)
    brought = data.pop("class_id", None)
    masks = None
    if size is not None and any(mask.area for mask in said.masks):
        masks = np.stack([mask.to_image(*size) for mask in said.masks])
    return supervision.Detections(
        xyxy=np.array(said.boxes),
        confidence=np.array(said.scores if isinstance(said, Regions) else said.confidence),
        mask=masks,
        class_id=_class_numbers(said.classes, names, brought),
        tracker_id=np.array(tracks.ids) if tracks is not None else data.pop("tracker_id", None),
        data={"class_name": np.array(said.classes), **{name: np.array(values) for name, values in data.items()}},
    )


def _class_numbers(
    classes: NDArray[np.str_], names: Sequence[str], brought: NDArray[Any] | None
) -> NDArray[np.int64] | None:
    """The numbers of classes (N,); None where nothing tells them."""
    if names:
        numbers = {name: number for number, name in enumerate(names)}
        return np.array([numbers.get(str(name), -1) for name in classes], np.int64)
    if brought is not None:
        return np.asarray(brought, np.int64)
    if len(classes) and all(str(name).isdecimal() for name in classes):
        return np.array([int(name) for name in classes], np.int64)
    return None


def _of_array(values: ArrayLike) -> Given:
    try:
        table = np.asarray(values, np.float32)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"detections of {type(values).__name__} are not known; give {_KINDS}") from error
    table = table.reshape(0, 4) if table.size == 0 else table
    if table.ndim != 2 or not 4 <= table.shape[1] <= 6:
        raise ParameterError(f"detections of shape {table.shape} are not known; give {_KINDS}")
    count = len(table)
    classes = [f"{number:g}" for number in table[:, 5]] if table.shape[1] > 5 else [""] * count
    scores = table[:, 4] if table.shape[1] > 4 else np.ones(count, np.float32)
    return Given(table[:, :4], scores, np.array(classes, np.str_), (Mask.empty(),) * count, {})


def _of_supervision(detections: supervision.Detections) -> Given:
    count = len(detections)
    data = {name: np.asarray(values) for name, values in detections.data.items() if name != "class_name"}
    data = {name: values for name, values in data.items() if values.ndim and len(values) == count}
    for name in ("class_id", "tracker_id"):
        if getattr(detections, name) is not None:
            data[name] = np.asarray(getattr(detections, name))
    classes: Any = detections.data.get("class_name")
    if classes is None:
        numbers = detections.class_id
        classes = [""] * count if numbers is None else [str(number) for number in numbers]
    masks = (Mask.empty(),) * count
    if detections.mask is not None:
        masks = tuple(Mask.of_image(np.asarray(bits, np.bool_)) for bits in detections.mask)
    scores = np.ones(count) if detections.confidence is None else detections.confidence
    boxes = np.asarray(detections.xyxy, np.float32).reshape(count, 4)
    return Given(boxes, np.asarray(scores, np.float32), np.asarray(classes, np.str_).reshape(count), masks, data)


_KINDS = "supervision.Detections, perdure.Regions or an array (N, 4 to 6) of x1, y1, x2, y2, score, class"

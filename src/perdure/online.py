"""One tracker fed by hand, frame after frame, in the ecosystem's habit: `tracker.update(detections)`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure import params
from perdure.errors import ParameterError
from perdure.trackers import TRACKERS
from perdure.types import Frame, Mask, Regions, Report, Scene, Tracks

if TYPE_CHECKING:
    import supervision


class Online:
    """A tracker with its state, for a loop of one's own.

    Parameters
    ----------
    tracker : str
        A name of `perdure.trackers.TRACKERS`.
    fps : float
        Frames per second where `update` is given no timestamp.
    width, height : int
        The picture's size; masks and boxes are cut to it. 0: taken from the first frame, else unknown.
    parameters
        The tracker's parameters by name.

    Examples
    --------
    >>> tracker = Online("overlap", fps=10, confirm=0.0)
    >>> tracker.update([[10, 10, 30, 60]]).ids.tolist()
    [1]
    >>> tracker.update([[12, 10, 32, 60]]).ids.tolist()
    [1]
    """

    def __init__(
        self, tracker: str = "overlap", *, fps: float = 25.0, width: int = 0, height: int = 0, **parameters: object
    ) -> None:
        if tracker not in TRACKERS:
            raise ParameterError(params.unknown_name("tracker", tracker, TRACKERS))
        if not fps > 0:
            raise ParameterError(f"fps = {fps!r} is out of range: it must be above 0")
        self.tracker = params.build(TRACKERS[tracker], parameters)
        self._fps, self._size = fps, (width, height)
        self.reset()

    def reset(self) -> None:
        """Forget every target; ids begin at 1 again."""
        self._state: Any = None
        self._index = -1
        self._time = -np.inf
        self.report = Report.empty()  # of the last update: corrections and events are there

    def update(
        self, detections: Any, frame: NDArray[np.uint8] | None = None, timestamp: float | None = None
    ) -> Any:
        """Take in the detections of the next frame and return them with ids.

        Parameters
        ----------
        detections : supervision.Detections, Regions, or (N, 4 to 6) array
            Array columns: x1, y1, x2, y2, score, class number.
        frame : (H, W, 3) uint8 or None
            RGB, for trackers that look at pixels.
        timestamp : float or None
            Seconds; must rise. None: one more frame at `fps`.

        Returns
        -------
        supervision.Detections or Tracks
            For `supervision.Detections`: the same rows in the same order, `data` kept, `tracker_id` set
            (-1 for a detection without an identity). Otherwise the frame's rows as `Tracks`.

        Raises
        ------
        ParameterError
            If time does not rise or the detections are not of a known kind.
        """
        regions = to_regions(detections)
        self._index += 1
        time = self._index / self._fps if timestamp is None else float(timestamp)
        if not time > self._time:
            self._index -= 1
            raise ParameterError(f"timestamp {time:g} s does not come after {self._time:g} s; times must rise")
        self._time = time
        picture = Frame(self._index, time, frame)
        if self._state is None:
            self._state = self.tracker.start(self._scene(frame))
        self._state, self.report = self.tracker.step(self._state, picture, regions)
        rows = self.report.rows.in_frame(self._index)
        return rows if isinstance(detections, (Regions, list, tuple, np.ndarray)) else _with_ids(detections, rows)

    def _scene(self, frame: NDArray[np.uint8] | None) -> Scene:
        width, height = self._size
        if frame is not None and not (width and height):
            height, width = frame.shape[:2]
        return Scene(width or _UNBOUNDED, height or _UNBOUNDED, self._fps)


def to_regions(detections: Any) -> Regions:
    """Return detections of any known kind as regions, order and data kept."""
    if isinstance(detections, Regions):
        return detections
    if hasattr(detections, "xyxy") and hasattr(detections, "tracker_id"):
        return _of_supervision(detections)
    return _of_array(detections)


def _of_array(values: ArrayLike) -> Regions:
    try:
        table = np.asarray(values, np.float32)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"detections of {type(values).__name__} are not known; give {_KINDS}") from error
    table = table.reshape(0, 4) if table.size == 0 else table
    if table.ndim != 2 or not 4 <= table.shape[1] <= 6:
        raise ParameterError(f"detections of shape {table.shape} are not known; give {_KINDS}")
    if not np.isfinite(table).all():
        raise ParameterError("detections hold a number that is not finite")
    classes = [f"{number:g}" for number in table[:, 5]] if table.shape[1] > 5 else None
    return Regions.of(table[:, :4], table[:, 4] if table.shape[1] > 4 else None, classes)


def _of_supervision(detections: supervision.Detections) -> Regions:
    count = len(detections)
    named = detections.data.get("class_name")
    classes: Any = named
    if named is None and detections.class_id is not None:
        classes = [str(number) for number in detections.class_id]
    masks = None
    if detections.mask is not None:
        masks = [Mask.of_image(np.asarray(bits, np.bool_)) for bits in detections.mask]
    return Regions.of(
        np.asarray(detections.xyxy, np.float32).reshape(count, 4), detections.confidence, classes, masks
    )


def _with_ids(detections: supervision.Detections, rows: Tracks) -> Any:
    ids = np.full(len(detections), -1, dtype=int)
    for identity, links in zip(rows.ids, rows.links, strict=True):
        ids[list(links)] = identity
    named: Any = detections[np.arange(len(detections))]  # a copy: the caller's stays as it is
    named.tracker_id = ids
    return named


_KINDS = "supervision.Detections, perdure.Regions or an array (N, 4 to 6) of x1, y1, x2, y2, score, class"
_UNBOUNDED = 1 << 20  # px: a picture whose size nobody told

"""One tracker fed by hand, frame after frame, in the ecosystem's habit: `tracker.update(detections)`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from perdure import params
from perdure.equipment import AnyContext, equipped
from perdure.errors import ParameterError
from perdure.files.zones import read_zones
from perdure.scene.zones import Zones
from perdure.trackers import TRACKERS
from perdure.types import Frame, Regions, Report, Scene, Tracks
from perdure.types.detections import to_regions

if TYPE_CHECKING:
    import supervision


@dataclass(frozen=True)
class _Camera:
    """What `Online` must know of a camera."""

    fps: float = params.parameter(25.0, "frames per second without timestamps", low=0.001, high=1000.0)
    width: int = params.parameter(0, "width of the picture, 0 where not known", unit="px", low=0, high=1 << 20)
    height: int = params.parameter(0, "height of the picture, 0 where not known", unit="px", low=0, high=1 << 20)


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
    zones : str, Path, Zones or None
        Zones of the place and rules between them, in pixels of the picture: a file of GeoJSON.
    context, embedding
        For the multi-feature tracker, as for `perdure.plan`.
    parameters
        The tracker's parameters by name.

    Examples
    --------
    >>> tracker = Online(fps=10, confirm=0.0)
    >>> tracker.update([[10, 10, 30, 60]]).ids.tolist()
    [1]
    >>> tracker.update([[12, 10, 32, 60]]).ids.tolist()
    [1]
    """

    def __init__(
        self,
        tracker: str = "compound",
        *,
        fps: float = 25.0,
        width: int = 0,
        height: int = 0,
        zones: str | Path | Zones | None = None,
        context: AnyContext | Sequence[AnyContext] | None = None,
        embedding: str | Path | None = None,
        **parameters: object,
    ) -> None:
        if not isinstance(tracker, str) or tracker not in TRACKERS:
            raise ParameterError(params.unknown_name("tracker", tracker, TRACKERS))
        camera = params.build(_Camera, {"fps": fps, "width": width, "height": height})
        self.tracker = equipped(params.build(TRACKERS[tracker], parameters), tracker, context, embedding)
        self._fps, self._size = camera.fps, (camera.width, camera.height)
        self._zones = read_zones(zones, *self._size) if isinstance(zones, (str, Path)) else zones
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
        picture = self._next_frame(frame, timestamp)
        if self._state is None:
            self._state = self.tracker.start(self._scene(frame))
        self._state, self.report = self.tracker.step(self._state, picture, regions)
        self._index, self._time = picture.index, picture.time
        rows = self.report.rows.in_frame(self._index)
        return rows if isinstance(detections, (Regions, list, tuple, np.ndarray)) else _with_ids(detections, rows)

    def _next_frame(self, image: NDArray[np.uint8] | None, timestamp: float | None) -> Frame:
        """The next frame, checked; what is refused uses up neither its number nor its time."""
        index = self._index + 1
        try:
            time = index / self._fps if timestamp is None else float(timestamp)
        except (TypeError, ValueError) as error:
            raise ParameterError(f"timestamp {timestamp!r:.40} is not a number of seconds") from error
        if not math.isfinite(time):
            raise ParameterError(f"timestamp {time} is not a finite number of seconds")
        if not time > self._time:
            raise ParameterError(f"timestamp {time:g} s does not come after {self._time:g} s; times must rise")
        try:
            return Frame(index, time, None if image is None else np.asarray(image))
        except ValueError as error:
            raise ParameterError(str(error)) from error

    def _scene(self, frame: NDArray[np.uint8] | None) -> Scene:
        width, height = self._size
        if frame is not None and not (width and height):
            height, width = frame.shape[:2]
        scene = Scene(width or _UNBOUNDED, height or _UNBOUNDED, self._fps)
        return scene if self._zones is None else replace(scene, zones=self._zones.zones, rules=self._zones.rules)


def _with_ids(detections: supervision.Detections, rows: Tracks) -> Any:
    ids = np.full(len(detections), -1, dtype=int)
    for identity, links in zip(rows.ids, rows.links, strict=True):
        ids[list(links)] = identity
    named: Any = detections[np.arange(len(detections))]  # a copy: the caller's stays as it is
    named.tracker_id = ids
    return named


_UNBOUNDED = 1 << 20  # px: a picture whose size nobody told

"""A tracker of another library in the place of one of ours: the regions go out, identities come back.

The library runs in a process of its own, because some bring another build of OpenCV that breaks ours: in the environment
that is named, or in this one. It is told boxes and scores, and no pictures.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

from perdure.errors import ParameterError
from perdure.trackers.foreign import libraries
from perdure.types import Frame, Mask, Regions, Report, Scene, Status, Tracks

LIBRARIES = tuple(libraries.LIBRARIES)
_UNSEEN = 0.5  # confidence of who is said without a region: he counts for results


@dataclass(eq=False)
class ForeignState:
    """The process in which the other tracker lives. It cannot be saved."""

    process: subprocess.Popen[str]
    ask: IO[str]
    answers: IO[str]


@dataclass(frozen=True)
class Foreign:
    """One tracker of another library.

    Parameters
    ----------
    library, make : str
        One of `LIBRARIES`, and the name of the class there: 'trackers', 'ByteTrackTracker'.
    arguments : mapping
        Of its constructor, plain values; 'fps' stands for the source's frames per second.
    python : str
        The interpreter that has the library.
    """

    library: str
    make: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    python: str = sys.executable

    needs_pixels = False

    def start(self, scene: Scene) -> ForeignState:
        """Start the process and make the tracker.

        Raises
        ------
        ParameterError
            If the library is not there, or refuses its arguments, with its own words.
        """
        command = [self.python, str(Path(libraries.__file__))]
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                encoding="utf-8",
                start_new_session=True,  # Ctrl-C ends the frames, not this
            )
        except OSError as error:
            raise ParameterError(f"{self.python} does not run: {error.strerror or error}") from error
        job = {"library": self.library, "make": self.make, "arguments": dict(self.arguments), "fps": scene.fps}
        state = ForeignState(process, cast("IO[str]", process.stdin), cast("IO[str]", process.stdout))
        self._asked(state, job)
        return state

    def step(self, state: ForeignState, frame: Frame, regions: Regions) -> tuple[ForeignState, Report]:
        """Return what the other tracker says of one frame.

        A row that rests on a region has its silhouette and class; one that rests on none is `OCCLUDED` and inferred.
        """
        seen = {"boxes": regions.boxes.tolist(), "scores": regions.scores.tolist()}
        said = self._asked(state, seen)
        boxes = np.array(said["boxes"], np.float32).reshape(-1, 4)
        good = np.isfinite(boxes).all(axis=1) & (boxes[:, :2] <= boxes[:, 2:]).all(axis=1)
        kept = np.flatnonzero(good)
        ids = np.array(said["ids"], np.int64)[kept]
        if said["rows"] is None:
            return state, Report(Tracks.of(frames=frame.index, times=frame.time, ids=ids, boxes=boxes[kept]))
        rows = np.array(said["rows"], np.intp)[kept]
        return state, Report(_tracks(frame, regions, ids, boxes[kept], rows))

    def finish(self, state: ForeignState) -> Report:
        """End the process; it has said everything."""
        _end(state)
        return Report.empty()

    def _asked(self, state: ForeignState, message: Mapping[str, Any]) -> dict[str, Any]:
        """The answer to one message; where there is none, or a fault, the process is ended."""
        line = ""
        with contextlib.suppress(OSError):  # it has ended, which an empty answer says, too
            state.ask.write(json.dumps(message) + "\n")
            state.ask.flush()
            line = state.answers.readline()
        answer: dict[str, Any] = json.loads(line) if line else {"fault": "its process ended"}
        if "fault" in answer:
            _end(state)
            raise ParameterError(self._why(str(answer["fault"])))
        return answer

    def _why(self, fault: str) -> str:
        """What the other side found wrong, and what would do where it is the library that is missing."""
        if "ModuleNotFoundError" in fault:
            remedy = "name an environment that has it with --tracker-environment (docs/detectors.md tells how to make one)"
            return f"{self.library} is not installed for {self.python} ({fault}); {remedy}"
        return f"{self.library}:{self.make} says: {fault}"


def _tracks(
    frame: Frame, regions: Regions, ids: NDArray[np.int64], boxes: NDArray[np.float32], rows: NDArray[np.intp]
) -> Tracks:
    """The rows that are said, each with what is known of the region that it rests on."""
    seen = (rows >= 0) & (rows < len(regions))
    masks = [regions.masks[row] if there else Mask.empty() for row, there in zip(rows, seen, strict=True)]
    whole = boxes.copy()
    for k, mask in enumerate(masks):
        if mask.area:  # a box holds what is seen
            whole[k] = (*np.minimum(boxes[k, :2], mask.box[:2]), *np.maximum(boxes[k, 2:], mask.box[2:]))
    place = np.where(seen, rows, len(regions))
    return Tracks.of(
        frames=frame.index,
        times=frame.time,
        ids=ids,
        boxes=whole,
        status=np.where(seen, Status.VISIBLE, Status.OCCLUDED),
        confidence=np.append(regions.scores, np.float32(_UNSEEN))[place],
        classes=np.append(regions.classes, "")[place],
        inferred=~seen,
        masks=masks,
        links=[(int(row),) if there else () for row, there in zip(rows, seen, strict=True)],
    )


def _end(state: ForeignState) -> None:
    """End the process: it ends by itself when nothing comes any more."""
    for pipe in (state.ask, state.answers):
        with contextlib.suppress(OSError):  # what was not yet written has nobody to read it
            pipe.close()
    try:
        state.process.wait(timeout=5)
    except subprocess.TimeoutExpired:
        state.process.kill()
        state.process.wait()

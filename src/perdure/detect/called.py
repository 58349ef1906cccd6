"""A detector of one's own: any function of a picture."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from perdure.detect.own import failed, name_of
from perdure.detect.plausible import MOST, MOST_HELP, centred_in, plausible, told
from perdure.errors import ParameterError
from perdure.params import parameter
from perdure.types import Bits, Frame, Image, Regions, Scene
from perdure.types.detections import given_of


@dataclass(frozen=True, eq=False)
class CalledState:
    """Where something may be seen; what the function carries along is its own matter."""

    roi: Bits | None


@dataclass(frozen=True)
class Called:
    """What a function says of each picture, in its order: of regions inside the roi only.

    The function is given a picture (H, W, 3) RGB uint8, read-only, and returns `supervision.Detections`, `Regions`, an
    array (N, 4 to 6) of x1, y1, x2, y2, score, class, or None for nothing. Boxes that cannot be are left out, and an
    event tells how many.

    >>> detector = Called(function=lambda image: [[0, 0, 9, 9, 0.5], [9, 9, 0, 0, 0.5]])
    >>> picture = Frame(0, 0.0, np.zeros((48, 64, 3), np.uint8))
    >>> _, regions = detector.step(detector.start(Scene(64, 48)), picture)
    >>> regions.boxes.tolist(), regions.events[0].why
    ([[0.0, 0.0, 9.0, 9.0]], '1 boxes left out: 1 without an area')
    """

    most_objects: int = parameter(MOST, MOST_HELP, low=1, high=100_000)
    function: Callable[[Image], Any] | None = field(default=None, repr=False, compare=False)

    needs_pixels = True

    def start(self, scene: Scene) -> CalledState:
        """Return the state before the first frame."""
        if self.function is None:
            raise ParameterError(
                "a detector of one's own is given from Python: perdure.track(source, detector=function)"
            )
        return CalledState(scene.roi)

    def step(self, state: CalledState, frame: Frame) -> tuple[CalledState, Regions]:
        """Return what the function says of one picture, and an event for boxes that cannot be.

        Raises
        ------
        DetectorError
            If the function raises an exception, which is the cause.
        ParameterError
            For an answer of a kind that is not known, naming the function and the frame.
        """
        if frame.image is None or self.function is None:
            return state, Regions.empty()
        try:
            answer = self.function(frame.image)
        except Exception as error:  # whatever the caller's code raises
            raise failed(name_of(self.function), frame, error) from error
        if answer is None:
            return state, Regions.empty()
        try:
            given = given_of(answer)
            sifted = plausible(given.boxes, given.scores, self.most_objects)
            regions = given.regions(sifted.rows)
        except (ParameterError, ValueError) as error:
            raise ParameterError(
                f"what the detector {name_of(self.function)} said of frame {frame.index} cannot be taken: {error}"
            ) from error
        regions = regions.take(np.flatnonzero(centred_in(regions.boxes, state.roi)))
        before = answer.events if isinstance(answer, Regions) else ()
        return state, dataclasses.replace(regions, events=(*before, *told(frame.index, sifted.reasons)))

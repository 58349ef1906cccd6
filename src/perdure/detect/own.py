"""A detector of the caller's own: its code may fail in any frame, and may answer anything; both are told in a sentence."""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from perdure.errors import DetectorError, ParameterError, PerdureError
from perdure.states import kind_of
from perdure.types import Frame, Regions, Report, Scene


@dataclass(frozen=True)
class Own:
    """An object of the caller's with `start` and `step`, of which every exception and answer is looked at."""

    detector: Any

    @property
    def needs_pixels(self) -> bool:
        """What it says itself; pixels, where it does not say."""
        return bool(getattr(self.detector, "needs_pixels", True))

    @property
    def state_kind(self) -> Any:
        """What its state is, for `perdure.states.load`."""
        return kind_of(self.detector)

    def prepare(self, frames: Sequence[Frame]) -> Own:
        """Return this detector with its first look taken, where it takes one."""
        prepare = getattr(self.detector, "prepare", None)
        return self if prepare is None else Own(prepare(frames))

    def start(self, scene: Scene) -> Any:
        """Return the state before the first frame; DetectorError if it raises an exception."""
        try:
            return self.detector.start(scene)
        except PerdureError:
            raise
        except Exception as error:  # whatever the caller's code raises
            raise failed(name_of(self.detector), None, error) from error

    def step(self, state: Any, frame: Frame) -> tuple[Any, Regions]:
        """Return its state and what it sees.

        Raises
        ------
        DetectorError
            If it raises an exception, which is the cause.
        ParameterError
            If it returns something else than a state and regions.
        """
        try:
            answer = self.detector.step(state, frame)
        except PerdureError:
            raise
        except Exception as error:  # whatever the caller's code raises
            raise failed(name_of(self.detector), frame, error) from error
        if not isinstance(answer, tuple) or len(answer) != 2 or not isinstance(answer[1], Regions):
            raise ParameterError(
                f"the detector {name_of(self.detector)} answered {answer!r:.60} in frame {frame.index}; its step must "
                "return a pair, its state and perdure.Regions (perdure.to_regions makes them of boxes)"
            )
        return answer

    def heed(self, state: Any, report: Report) -> Any:
        """Tell it what the tracker said, where it heeds that."""
        heed = getattr(self.detector, "heed", None)
        return state if heed is None else heed(state, report)


def failed(name: str, frame: Frame | None, error: Exception) -> DetectorError:
    """Return the error that tells in which frame (None: before the first) a detector failed, and where in its code."""
    when = "before the first frame" if frame is None else f"in frame {frame.index} ({frame.time:.2f} s)"
    said = " ".join(f"{type(error).__name__}: {error}".split())
    return DetectorError(
        f"the detector {name} failed {when}{_place(error)}: {said:.200}; mend it, or let it see nothing where it cannot",
        0 if frame is None else frame.index,
    )


def name_of(detector: object) -> str:
    """Return what a function or an object is called, as a message may show it."""
    return repr(getattr(detector, "__qualname__", type(detector).__qualname__))


def _place(error: Exception) -> str:
    """The last line of the caller's own file that was at work."""
    below = traceback.extract_tb(error.__traceback__)[1:]  # the first is the call itself
    mine = [one for one in below if one.filename == below[0].filename]
    return f", in {Path(mine[-1].filename).name}, line {mine[-1].lineno}" if mine else ""

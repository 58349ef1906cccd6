"""An endless run over a live source: folders that roll, events as they happen, figures of how it is."""

from __future__ import annotations

import dataclasses
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from perdure.files.live_source import LiveSource
from perdure.files.memory import memory
from perdure.files.rolling import Rolling
from perdure.fold import Step
from perdure.pipeline import Plan
from perdure.types import Frame, Report

_OVER = 10.0  # s over which rates and latencies are told


@dataclass
class Vital:
    """How a live run is, for whoever asks while it goes on.

    Parameters
    ----------
    source : LiveSource
    clock : function
        Seconds of this machine.
    """

    source: LiveSource
    clock: Callable[[], float] = time.monotonic
    frames: int = 0
    events: int = 0
    targets: int = 0
    begun: float = field(default=0.0)
    _lately: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=4096))  # when, latency

    def __post_init__(self) -> None:
        self.begun = self.clock()

    def note(self, step: Step) -> None:
        """Note a step that has just been worked off."""
        now = self.clock()
        self.frames += 1
        self.events += len(step.report.events)
        self.targets = len(set(step.report.rows.ids.tolist()))
        self._lately.append((now, now - self.source.arrived))

    def figures(self) -> dict[str, Any]:
        """Return plain values by name."""
        now, counts = self.clock(), self.source.counts
        lately = [one for one in tuple(self._lately) if one[0] >= now - _OVER]
        span = min(_OVER, max(now - self.begun, 1e-3))
        latencies = sorted(latency for _, latency in lately)
        return {
            "source": self.source.origin,
            "state": "running" if counts.connected else "waiting for the source",
            "why": counts.why,
            "frames_a_second": round(len(lately) / span, 2),
            "latency_ms": round(1000 * latencies[len(latencies) // 2], 1) if latencies else None,
            "latency_worst_ms": round(1000 * latencies[-1], 1) if latencies else None,
            "frames": self.frames,
            "received": counts.received,
            "dropped": counts.dropped,
            "waiting": self.source.waiting,
            "connections": counts.connections,
            "failed_tries": counts.failures,
            "seconds_away": round(counts.away, 1),
            "targets_now": self.targets,
            "events": self.events,
            "memory_mb": memory(),
            "seconds": round(now - self.begun, 1),
        }


def warmed(made: Plan) -> None:
    """Load and compile what a run needs, on pictures of nothing, so that the first real frames do not wait for it."""
    blank = np.zeros((made.scene.height, made.scene.width, 3), np.uint8)
    frames = [Frame(k, k / made.scene.fps, blank) for k in range(2)]
    spot = blank.copy()
    spot[made.scene.height // 3 : made.scene.height // 2, made.scene.width // 3 : made.scene.width // 2] = 255
    frames += [Frame(k, k / made.scene.fps, spot) for k in range(2, 6)]
    for _ in made.steps(frames):
        pass


def followed(
    steps: Iterator[Step],
    source: LiveSource,
    rolling: Rolling,
    tell: Callable[[Step], None],
    vital: Vital,
) -> None:
    """Work off the steps of a live run: into folders, and to whom events are told.

    What happened to the source is an event of the next frame: a `gap` where it was away.
    """
    last = 0.0
    for step in steps:
        happened = source.happened()
        if happened:
            report = dataclasses.replace(step.report, events=(*happened, *step.report.events))
            step = step._replace(report=report)
        frame, last = (-1, last) if step.frame is None else (step.frame.index, step.frame.time)
        if step.frame is not None or not _is_empty(step.report):
            rolling.append(frame, last, step.report)
        tell(step)
        if step.frame is not None:
            vital.note(step)


def _is_empty(report: Report) -> bool:
    return report.equals(Report.empty())

"""Events as they happen: a JSON object a line, for a pipe."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import IO, Any

from perdure.files.checkpoints import Lasting
from perdure.fold import Step
from perdure.types import Event


class LiveEvents:
    """Hands out the events of a run while it goes on, as plain values.

    A scenario that lasts is told twice: `"state": "begins"` when it is recognised, `"ends"` when it is over; what happens
    in a moment, and what a tracker tells, once, as `"state": "happens"`. Ids are those of the moment: who turns out later
    to be another is told in the run folder's `events.csv` alone.
    """

    def __init__(self, out: Callable[[dict[str, Any]], None]) -> None:
        self._out = out
        self._lasting: set[Lasting] = set()
        self._time = 0.0

    @property
    def lasting(self) -> tuple[Lasting, ...]:
        """What was told as begun and not yet as over, sorted."""
        return tuple(sorted(self._lasting))

    def go_on(self, lasting: Iterable[Lasting], time: float) -> None:
        """Go on where an earlier run had told that this lasts, at this time in seconds."""
        self._lasting, self._time = set(lasting), time

    def tell(self, step: Step) -> None:
        """Write what a step tells."""
        self._time = self._time if step.frame is None else step.frame.time
        for event in step.report.events:
            key = (event.kind, event.ids, event.zone)
            state = "ends" if key in self._lasting else "happens"
            self._lasting.discard(key)
            self._write(event, state)
        for event in step.report.begun:
            self._lasting.add((event.kind, event.ids, event.zone))
            self._write(event, "begins")

    def _write(self, event: Event, state: str) -> None:
        value = {
            "time": round(self._time, 3),
            "state": state,
            "kind": event.kind,
            "begin": event.begin,
            "end": event.end,
            "ids": list(event.ids),
            "zone": event.zone,
            "confidence": event.confidence,
            "why": event.why,
        }
        self._out(value)


def lines_to(out: IO[str]) -> Callable[[dict[str, Any]], None]:
    """Return what writes values as lines of JSON, each at once."""

    def write(value: dict[str, Any]) -> None:
        out.write(json.dumps(value, ensure_ascii=False) + "\n")
        out.flush()

    return write

"""A run of a source that may never end, into run folders by the clock: every frame gets its turn."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer

from perdure.cli.running import asked
from perdure.cli.stopping import Ending
from perdure.errors import ParameterError
from perdure.files.live_events import LiveEvents
from perdure.files.rolling import Rolling, check_place
from perdure.files.runs import Reporting
from perdure.files.span import seconds_of
from perdure.pipeline import Plan


def run_rolled(
    made: Plan,
    place: Path,
    reporting: Reporting,
    roll: str,
    keep: int,
    *,
    window: Mapping[str, Any],
    inputs: Mapping[str, str],
    live: LiveEvents | None = None,
    as_json: bool = False,
) -> None:
    """Track into folders in `place` of which the clock begins a new one every `roll`, and end with the exit code.

    Raises
    ------
    ParameterError
        If the source is a file, whose run can be gone on with and has one folder.
    OutputError
        If the place cannot hold such folders.
    """
    try:
        seconds = seconds_of(roll, "roll")
        if made.source.rereadable:
            raise ParameterError(
                f"--roll is for what passes once, a camera or a URL; {made.source.name} ends, and its run is one folder, "
                "read piece by piece however long it is. Leave out --roll, or take parts of it by --start and --end"
            )
        check_place(place)
        rolling = Rolling(place, asked(made, reporting, window, inputs), reporting, seconds, keep)
    except BaseException:
        made.source.close()
        raise
    frames, last = 0, 0.0
    with Ending() as ending:
        try:
            for step in made.steps(ending.frames(made.source)):
                if step.frame is not None:
                    frames, last = frames + 1, step.frame.time
                rolling.append(-1 if step.frame is None else step.frame.index, last, step.report)
                if live is not None:
                    live.tell(step)
        finally:
            made.source.close()
            rolling.close(ending.status, str(ending.damage or ""))
    _close(rolling, made, ending, frames, as_json=as_json)


def _close(rolling: Rolling, made: Plan, ending: Ending, frames: int, *, as_json: bool) -> None:
    """Say how it ended."""
    for note in (*made.source.warnings, *made.notes(), *rolling.failed):
        print(f"perdure: note: {note}", file=sys.stderr)
    if ending.damage is not None:
        print(f"perdure: {ending.damage}", file=sys.stderr)
    if as_json:
        told = {"status": ending.status, "message": str(ending.damage or ""), "runs": str(rolling.place)}
        print(json.dumps({**told, "folders": rolling.begun, "frames": frames}))
    else:
        folders = f"{rolling.begun} run folder{'' if rolling.begun == 1 else 's'}"
        print(f"perdure: {frames} frames, {folders} in {rolling.place}", file=sys.stderr)
    code = {"done": 0, "damaged": 3, "interrupted": 130}[ending.status]
    if code:
        raise typer.Exit(code)

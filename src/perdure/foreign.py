"""A tracker of another library as the user names it: LIBRARY:CLASS, its settings, the environment that has it."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from perdure.errors import ParameterError
from perdure.files.settings import read_settings
from perdure.trackers.foreign import LIBRARIES, Foreign

ENVIRONMENT = "PERDURE_PEERS"  # variable that names one, where the user names none

AnySettings = str | Path | Mapping[str, Any]


def made_foreign(
    tracker: object, settings: AnySettings | None = None, environment: str | Path | None = None
) -> Foreign | None:
    """Return the tracker of another library that a word means; None for every other word.

    Parameters
    ----------
    tracker : str
        'trackers:ByteTrackTracker', 'norfair:Tracker', …
    settings : mapping, str, Path or None
        Arguments of its constructor: a JSON object, or a file of one.
    environment : str, Path or None
        The folder of a virtual environment that has the library; None: $PERDURE_PEERS, else this one.

    Raises
    ------
    ParameterError
        For settings that are none, an environment without an interpreter, or either beside a tracker of ours.
    """
    library, colon, make = tracker.partition(":") if isinstance(tracker, str) else ("", "", "")
    if library not in LIBRARIES:
        for option, value in (("--tracker-settings", settings), ("--tracker-environment", environment)):
            if value is not None:
                raise ParameterError(
                    f"{option} goes with --tracker LIBRARY:CLASS of {', '.join(LIBRARIES)}; leave it out"
                )
        return None
    if not colon or not make.isidentifier():
        raise ParameterError(f"name the class of {library}, too: --tracker {library}:CLASS")
    return Foreign(library, make, {} if settings is None else _settings(settings), _interpreter(environment))


def about(tracker: object) -> dict[str, Any]:
    """Return for `run.json` what a tracker of another library was given; nothing for one of ours."""
    return {"settings": dict(tracker.arguments), "python": tracker.python} if isinstance(tracker, Foreign) else {}


def _settings(given: AnySettings) -> dict[str, Any]:
    """The arguments by name."""
    return dict(given) if isinstance(given, Mapping) else read_settings(given, "--tracker-settings")


def _interpreter(environment: str | Path | None) -> str:
    """The interpreter of an environment."""
    folder = environment or os.environ.get(ENVIRONMENT)
    if not folder:
        return sys.executable
    python = Path(folder) / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        raise ParameterError(
            f"{folder} is no environment: it has no {python.relative_to(folder)}; python -m venv makes one"
        )
    return str(python)

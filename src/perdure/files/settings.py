"""Settings for somebody else's program: a JSON object, as text or in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from perdure.errors import ParameterError
from perdure.files.lines import json_with_nan


def read_settings(given: str | Path, option: str) -> dict[str, Any]:
    """Return the values by name of a JSON object, or of a file of one.

    Raises
    ------
    ParameterError
        Naming the file, or the option by which the text was given.
    """
    text, what = str(given), option
    if not text.lstrip().startswith("{"):
        what = str(given)
        try:
            text = Path(given).read_text(encoding="utf-8-sig")
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "it is no text"
            raise ParameterError(
                f"cannot read {what[:200]}: {reason}; {option} takes a JSON object or a file of one"
            ) from error
    try:
        value = json_with_nan(text)
    except (ValueError, RecursionError) as error:
        raise ParameterError(f"{what[:200]} is not JSON: {error}") from error
    if not isinstance(value, dict):
        raise ParameterError(f'{what[:200]}: wanted is a JSON object such as {{"lost_track_buffer": 60}}')
    return value

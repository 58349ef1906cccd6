"""JSON that strangers wrote: read whole, without NaN, and sizes of pictures in it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from perdure.errors import FormatError
from perdure.files.lines import json_of, why_not_json
from perdure.files.span import shown

LONGEST_SIDE, LARGEST_AREA = 1 << 16, 1 << 28  # px, of a picture


def read_json(path: Path) -> Any:
    """Return the value of a file; FormatError says where it is not JSON."""
    try:
        return json_of(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise FormatError(f"cannot read {path}: {error.strerror or error}") from error
    except json.JSONDecodeError as error:
        raise FormatError(f"{path}, line {error.lineno}: not JSON ({error.msg}); is the file whole?") from error
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: not JSON ({why_not_json(error)})") from error


def size_of(place: object, value: Mapping[str, Any]) -> tuple[int, int]:
    """Return the height and width that a value tells; FormatError where they cannot be."""
    height: Any = value.get("height")
    width: Any = value.get("width")
    for side in (height, width):
        if type(side) is not int or not 1 <= side <= LONGEST_SIDE:
            raise FormatError(
                f"{place}: height and width must be whole numbers from 1 to {LONGEST_SIDE}, not {shown(side)}"
            )
    if height * width > LARGEST_AREA:
        raise FormatError(f"{place}: a picture of {width}x{height} is too large")
    return height, width

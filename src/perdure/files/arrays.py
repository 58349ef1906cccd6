"""Arrays as a source: a list that can be read again, or an iterator that passes once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from perdure.errors import ParameterError, VideoError
from perdure.files.clock import Clock
from perdure.files.numbered import Numbered
from perdure.files.passing import Passing, Shot, passing
from perdure.files.span import Span, shown
from perdure.types import Image

_RATE = 25.0
_NO_RATE = "arrays say no frame rate: 25 per second are taken; give fps for the true one"


def open_arrays(arrays: Iterable[NDArray[np.uint8]], fps: float | None, span: Span) -> Numbered | Passing:
    """Open (H, W, 3) RGB or (H, W) grey uint8 arrays; a list, tuple or array can be read again.

    Raises
    ------
    ParameterError
        For what holds no pictures in an order, and for one picture by itself.
    VideoError
        If the first picture is none.
    """
    _refuse_other(arrays)
    warnings = [] if fps else [_NO_RATE]
    rate = fps or _RATE
    if not isinstance(arrays, (list, tuple, np.ndarray)):
        shots = (Shot(rgb_of(array).copy(), None) for array in arrays)  # its owner may fill it anew
        return passing("frames", "arrays", rate, span, shots, Clock(rate, warnings, fixed=rate), warnings)
    images: Sequence[NDArray[np.uint8]] = arrays  # type: ignore[assignment]
    height, width = rgb_of(images[0]).shape[:2] if len(images) else (0, 0)
    return Numbered(
        "frames",
        f"{len(images)} arrays",
        width,
        height,
        rate,
        len(images),
        span,
        lambda index: rgb_of(images[index]),
        warnings=tuple(warnings),
    )


def _refuse_other(arrays: object) -> None:
    """Refuse what is no film of arrays, and say what would do."""
    if isinstance(arrays, np.ndarray):
        if arrays.ndim == 2 or (arrays.ndim == 3 and arrays.shape[2] in (3, 4)):
            raise ParameterError("one picture is no film; give [picture] or an array (N, H, W, 3)")
        if arrays.ndim not in (3, 4) and arrays.shape != (0,):
            raise ParameterError(f"an array as a source must be (N, H, W, 3) or (N, H, W), not {arrays.shape}")
    elif not isinstance(arrays, Iterable) or isinstance(arrays, (Mapping, Set, bytes, bytearray, memoryview)):
        raise ParameterError(
            f"{shown(arrays)} is no source: give a file, a folder, a URL, a camera number, or a list or iterator"
            " of (H, W, 3) uint8 arrays"
        )


def rgb_of(array: NDArray[np.uint8]) -> Image:
    """Return the (H, W, 3) picture of a grey or RGB array; raises VideoError for any other."""
    if isinstance(array, (str, Path)):
        raise VideoError(f"{shown(array)} is no picture but a name: give the folder or a glob as the source")
    try:
        array = np.asarray(array)
    except (TypeError, ValueError):
        raise VideoError(f"an array must be (H, W, 3) or (H, W) uint8, not {shown(array)}") from None
    if array.dtype != np.uint8 or array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] not in (1, 3)):
        raise VideoError(f"an array must be (H, W, 3) or (H, W) uint8, not {array.shape} {array.dtype}")
    if not array.size:
        raise VideoError(f"a picture of {array.shape[1]}x{array.shape[0]} has no pixels")
    if array.ndim == 2:
        array = array[:, :, None]  # (H, W, 1)
    return np.ascontiguousarray(np.broadcast_to(array, (*array.shape[:2], 3)))  # (H, W, 3)

"""A picture beside what a command writes: both appear, or neither."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from perdure.files.whole import cannot_write
from perdure.types import Image


@contextlib.contextmanager
def new_picture(path: Path, picture: Image) -> Iterator[None]:
    """Write a PNG beside its place; it takes its name if nothing goes wrong in between."""
    import cv2

    part = path.with_name(f".{path.name}.part")
    try:
        encoded: NDArray[np.uint8] = cv2.imencode(".png", np.ascontiguousarray(picture[..., ::-1]))[1]
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(encoded.tobytes())
        yield
        os.replace(part, path)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)

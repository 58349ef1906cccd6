"""Make the pictures of the README: `python docs/pictures.py` writes docs/images/demo.png."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import av
import cv2
import numpy as np

from perdure.files.film import save_png

MOMENTS = (100, 160, 235, 300)  # frames of the demo film


def main() -> None:
    """Track the demo film and lay four of its frames side by side."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-c", "from perdure.cli import main; main()", "demo", "-o", folder], check=True
        )
        with av.open(str(Path(folder) / "run/tracked.mp4")) as film:
            frames = enumerate(film.decode(video=0))
            shown = [frame.to_ndarray(format="rgb24") for index, frame in frames if index in MOMENTS]
    rows = [np.hstack(shown[:2]), np.hstack(shown[2:])]
    picture = cv2.resize(np.vstack(rows), None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA)
    save_png(Path(__file__).parent / "images/demo.png", picture)


if __name__ == "__main__":
    main()

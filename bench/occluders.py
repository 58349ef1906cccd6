"""Static occluders found by the background model, beside those that were drawn into the composites.

    python bench/occluders.py [--data DIR] [--clips NAME ...] [--json] [--draw DIR]

Each clip is seen as `perdure track` sees it, with a first look over the file; then the detector is asked what stands
in front. `truth` is the share of the picture that occluder.png covers (composites; where nothing is drawn in front
there is none to find, and in pets09-s2l1 and cdnet-fall a post and a trunk that nobody has outlined); IoU is that of
all found ones together with it; precision is how much of what was found is an occluder. Parts behind which nothing
ever passes cannot be found, so IoU has a ceiling.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from regions import CLIPS, chosen, open_clip

from perdure.detect import Background
from perdure.detect.occluders import Occluder
from perdure.errors import PerdureError
from perdure.files.video import open_source
from perdure.pipeline import FIRST_LOOKS

ROOT = Path(__file__).parents[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--data", type=Path, default=root, help="where the clips are")
    parser.add_argument("--clips", nargs="+", metavar="NAME", default=CLIPS, help=", ".join(CLIPS))
    parser.add_argument("--draw", type=Path, metavar="DIR", help="a picture per clip goes here")
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    arguments = parser.parse_args()
    try:
        names = chosen(arguments.clips, {name: [name] for name in CLIPS}, "clip")
        rows = [row for name in names if (row := measure(arguments.data, name, arguments.draw))]
    except PerdureError as error:
        print(f"occluders.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    print(f"{'clip':14}{'truth':>8}{'found':>8}{'area':>8}{'IoU':>7}{'precision':>11}  confidence of each")
    for row in rows:
        shares = "".join(
            f"{'-' if one is None else format(one, '.2f'):>{w}}"
            for one, w in ((row["iou"], 7), (row["precision"], 11))
        )
        sure = ", ".join(f"{one:.2f}" for one in row["confidence"])
        print(
            f"{row['clip']:14}{row['truth']:>8.1%}{len(row['confidence']):>8}{row['area']:>8.1%}{shares}  {sure}"
        )
    if arguments.json:
        print(json.dumps({"clips": rows}))


def measure(data: Path, name: str, drawings: Path | None) -> dict[str, Any] | None:
    """Return what was found in one clip, None if it is not there."""
    clip = open_clip(data, name)
    if clip is None:
        print(f"note: {name} is not in {data}; it is left out", file=sys.stderr)
        return None
    source = open_source(clip.source)
    try:
        detector = Background().prepare(source.sample(FIRST_LOOKS))
        state, frame = detector.start(source.scene(None)), None
        for frame in source:
            state, _ = detector.step(state, frame)
    finally:
        source.close()
    found = detector.occluders(state)
    height, width = state.held.shape
    seen = np.zeros((height, width), np.bool_)
    for one in found:
        seen |= one.mask.to_image(height, width)
    if drawings and frame is not None:
        save(drawings / f"{name}.png", np.array(frame.image), found)
    there = truth(clip.source.parent / "occluder.png", height, width)
    both, either = np.count_nonzero(seen & there), np.count_nonzero(seen | there)
    return {
        "clip": name,
        "truth": float(there.mean()),
        "area": float(seen.mean()),
        "iou": both / either if there.any() else None,
        "precision": both / np.count_nonzero(seen) if there.any() and seen.any() else None,
        "confidence": [round(one.confidence, 3) for one in found],
    }


def truth(path: Path, height: int, width: int) -> np.ndarray:
    """Return what was drawn in front, (H, W) bool; nothing where there is no picture of it."""
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if path.is_file() else None
    if picture is None:
        return np.zeros((height, width), np.bool_)
    return np.asarray((picture if picture.ndim == 2 else picture[..., -1]) > 0)


def save(path: Path, image: np.ndarray, found: tuple[Occluder, ...]) -> None:
    """Draw the outlines over a frame."""
    for one in found:
        cv2.polylines(image, [one.polygon.round().astype(np.int32)], True, (255, 60, 60), 2)
        x, y = one.polygon.min(axis=0).astype(int).tolist()
        cv2.putText(
            image, f"{one.confidence:.2f}", (x, max(y - 4, 10)), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 60, 60), 1
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), cv2.cvtColor(image, cv2.COLOR_RGB2BGR))


if __name__ == "__main__":
    main()

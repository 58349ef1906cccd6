"""What was counted, in a folder: crossings.csv, occupancy.csv, dwell.csv, counts.json and counts.png."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from perdure.files.whole import whole_file
from perdure.scene.counting import Counts
from perdure.types import Image

CROSSINGS = ("frame", "time", "id", "class", "line", "direction", "x", "y", "speed")
OCCUPANCY = ("frame", "time", "zone", "count")
DWELL = ("id", "class", "zone", "enter", "leave", "seconds", "entered", "left", "speed")
NAMES = ("crossings.csv", "occupancy.csv", "dwell.csv", "counts.json", "counts.png")


def write_counts(
    folder: Path, counts: Counts, summary: Mapping[str, Any], plot: Image, *, on_ground: bool
) -> None:
    """Write all files into a folder that is there."""
    import cv2

    _write_table(
        folder / "crossings.csv",
        CROSSINGS,
        (
            [
                one.frame,
                f"{one.time:.3f}",
                one.id,
                one.label,
                one.line,
                one.direction,
                f"{one.x:.2f}",
                f"{one.y:.2f}",
                _speed(one.ground_speed if on_ground else one.speed),
            ]
            for one in counts.crossings
        ),
    )
    _write_table(
        folder / "occupancy.csv",
        OCCUPANCY,
        (
            [frame, f"{time:.3f}", zone, counts.occupancy[zone][i]]
            for i, (frame, time) in enumerate(zip(counts.frames.tolist(), counts.times.tolist(), strict=True))
            for zone in counts.zones
        ),
    )
    _write_table(
        folder / "dwell.csv",
        DWELL,
        (
            [
                one.id,
                one.label,
                one.zone,
                f"{one.enter:.3f}",
                f"{one.leave:.3f}",
                f"{one.seconds:.3f}",
                int(one.entered),
                int(one.left),
                _speed(one.ground_speed if on_ground else one.speed),
            ]
            for one in counts.visits
        ),
    )
    with whole_file(folder / "counts.json") as file:
        json.dump(summary, file, indent=1, ensure_ascii=False)
        file.write("\n")
    (folder / "counts.png").write_bytes(cv2.imencode(".png", plot[..., ::-1])[1].tobytes())


def _write_table(path: Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with whole_file(path) as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(head)
        table.writerows(rows)


def _speed(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"

"""Where something flickers and goes nowhere."""

from __future__ import annotations

import numpy as np

from perdure.scene.learning.paths import Paths, feet_of, linked
from perdure.scene.learning.proposals import AROUND, LEAST, Proposal, numbered, proposed, rectangle_in


def flickers_of(paths: Paths, walks: Paths, size: tuple[int, int]) -> tuple[list[Proposal], str]:
    """Where hardly anything but flickers begins, and why there is no such place."""
    brief = paths.take(paths.flickers & ~paths.parted)
    middle, most, found = (brief.first[:, :2] + brief.first[:, 2:]) / 2, 0, []
    for cluster in linked(middle, brief.side):
        most = max(most, len(cluster))
        if len(cluster) < LEAST:
            continue
        boxes = np.concatenate([brief.first[cluster], brief.last[cluster]])
        margin = AROUND * float(np.median(brief.side[cluster]))
        corners = np.concatenate([boxes[:, :2].min(axis=0) - margin, boxes[:, 2:].max(axis=0) + margin])
        x1, y1, x2, y2 = corners.tolist()
        feet = feet_of(walks.first)
        begun = int(((feet >= corners[:2]) & (feet <= corners[2:])).all(axis=1).sum())
        if begun < len(cluster):
            why = f"{len(cluster)} were seen here for a moment and went nowhere"
            place = rectangle_in(x1, y1, x2, y2, size)
            found.append(proposed("noise", "flicker", place, len(cluster), why))
    why = f"what flickered at one place: {most} at most, needed are {LEAST}"
    return numbered(found), why if most < LEAST else "where things flicker as many walks begin"

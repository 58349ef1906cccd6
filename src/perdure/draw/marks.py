"""Where a result departs from the truth, over a drawn picture.

=======  ===================================================================
missed   a dashed red box with the true id: an object that nobody follows
wrong    a red cross through the box of a row that is on nothing
changed  a thick red box, '3 → 7': the object has another id than before
=======  ===================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from perdure.draw.labels import Label
from perdure.draw.strokes import Stroke, Style, broken, whole

RED = (255, 64, 48)
LEGEND = "red: dashed = missed (true id), crossed = matches nothing, 3 → 7 = new id"


class Mark(NamedTuple):
    """One departure: 'missed', 'wrong' or 'changed', its text, and its box x1, y1, x2, y2 in pixels."""

    kind: str
    text: str
    box: tuple[float, float, float, float]


def mark_strokes(marks: Sequence[Mark], style: Style) -> list[Stroke]:
    """Return the lines of the marks of a frame."""
    strokes = []
    for mark in marks:
        x1, y1, x2, y2 = whole(np.array(mark.box, np.float32))
        ring = np.array([[x1, y1], [x2 - 1, y1], [x2 - 1, y2 - 1], [x1, y2 - 1], [x1, y1]], np.int32)
        if mark.kind == "missed":
            strokes.append(Stroke(broken(ring, 1.5 * style.dash, style.dash), RED, style.line))
        elif mark.kind == "wrong":
            strokes.append(Stroke([ring[[0, 2]], ring[[1, 3]]], RED, style.line))
        else:
            strokes.append(Stroke([ring], RED, 2 * style.line))
    return strokes


def mark_labels(marks: Sequence[Mark], style: Style, height: int, width: int) -> list[Label]:
    """Return the labels of the marks that have a text and lie in the picture."""
    return [
        Label(mark.text, RED, True, whole(np.array(mark.box, np.float32)), style.line)
        for mark in marks
        if mark.text and mark.box[0] < width and mark.box[1] < height and mark.box[2] > 0 and mark.box[3] > 0
    ]

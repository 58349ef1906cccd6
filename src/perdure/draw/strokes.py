"""Widths for a picture's height, and lines: dashed ones, brackets, whole pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.draw.colours import Colour
from perdure.draw.labels import Place

Lines = list[NDArray[np.int32]]  # each (n, 2): points x, y
SHIFT = 4  # of lines between pixels


class Style(NamedTuple):
    """Widths in pixels for a picture's height."""

    line: int
    thin: int
    halo: int  # what the dark band adds to a line's width
    letters: int  # height of the letters' box
    dash: float

    @property
    def gap(self) -> int:
        """How far a group's brackets stay away from its box."""
        return 2 * self.line + 2

    @staticmethod
    def of(height: int) -> Style:
        """Return the widths for a picture of this height."""
        # Two pixels at least where there is room: a film stores colour at half the resolution.
        line = max(1 if height < 200 else 2, round(height / 320))
        halo = 2 * max(1, round(height / 900))
        return Style(line, max(1, line - 1), halo, max(11, round(height / 38)), 3.0 + 2.5 * line)


class Stroke(NamedTuple):
    """Lines of one colour and width."""

    lines: Lines
    colour: Colour
    width: int
    shift: int = 0  # points are in parts of a pixel, of which there are 2 ** shift


def between_pixels(line: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return a line (n, 2), pixel (0, 0) reaching from 0 to 1, in the parts of a pixel that `SHIFT` says, as cv2 draws it."""
    near = np.clip(line - 0.5, -16000, 16000)  # cv2 counts pixels from their middles
    return np.rint(near * (1 << SHIFT)).astype(np.int32)


def whole(box: NDArray[np.float32]) -> Place:
    """Whole pixels; far corners are brought near, because cv2 counts lines in 16 bits."""
    x1, y1, x2, y2 = (round(value) for value in np.clip(box, -16000, 16000).tolist())
    return x1, y1, x2, y2


def brackets(x1: int, y1: int, x2: int, y2: int, style: Style) -> Lines:
    """Return four corners around a box, at the style's gap from it."""
    x1, y1, x2, y2 = x1 - style.gap, y1 - style.gap, x2 + style.gap, y2 + style.gap
    arm = max(3, min(x2 - x1, y2 - y1) // 4)
    corners = ((x1, y1, 1, 1), (x2, y1, -1, 1), (x2, y2, -1, -1), (x1, y2, 1, -1))
    return [
        np.array([[x + arm * right, y], [x, y], [x, y + arm * down]], np.int32) for x, y, right, down in corners
    ]


def broken(line: NDArray[np.int32], drawn: float, left_out: float) -> Lines:
    """Cut a line (n, 2) into dashes, counted from its first point."""
    steps = np.hypot(*np.diff(line, axis=0).T.astype(np.float64))
    along = np.concatenate([[0.0], np.cumsum(steps)])  # (n,)
    begin = np.arange(0.0, max(along[-1], 1.0), drawn + left_out)
    ends = np.stack([begin, np.minimum(begin + drawn - 1.0, along[-1])], axis=1)  # (dashes, 2)
    x, y = (np.interp(ends, along, line[:, axis]) for axis in (0, 1))
    return list(np.rint(np.stack([x, y], axis=2)).astype(np.int32))  # each (2, 2)

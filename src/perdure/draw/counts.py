"""Counts over time as a picture: crossings, summed up, above; how many are in each zone below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.draw.chart import COLOURS, GRID, INK, PAPER, ticks, width_of, write
from perdure.scene.counting import IN, OUT, Counts
from perdure.types import Image

WIDTH, PANEL = 1200, 360  # px
_LEFT, _RIGHT, _TOP, _BOTTOM = 80, 30, 52, 60  # px round a panel's axes


class _Curve(NamedTuple):
    """Steps over time."""

    name: str
    times: NDArray[np.float64]
    values: NDArray[np.int64]


def plot(counts: Counts) -> Image:
    """Return the picture of all lines and zones, RGB; a panel for lines and one for zones, where there are any."""
    end = float(counts.times[-1]) if len(counts.times) else 1.0
    begin = float(counts.times[0]) if len(counts.times) else 0.0
    panels = []
    if counts.lines:
        curves = [
            _cumulative(f"{line}: {way}", [one.time for one in counts.of_line(line, way)], begin, end)
            for line in counts.lines
            for way in (IN, OUT)
        ]
        panels.append(_panel("crossings so far", curves, begin, end))
    if counts.zones:
        curves = [_Curve(zone, counts.times, counts.occupancy[zone]) for zone in counts.zones]
        panels.append(_panel("in the zone", curves, begin, end))
    return np.vstack(panels)


def _cumulative(name: str, moments: Sequence[float], begin: float, end: float) -> _Curve:
    times = np.array([begin, *moments, end])
    return _Curve(name, times, np.array([0, *range(1, len(moments) + 1), len(moments)], np.int64))


def _panel(title: str, curves: Sequence[_Curve], begin: float, end: float) -> Image:
    picture = np.full((PANEL, WIDTH, 3), PAPER, np.uint8)
    highest = max([1, *(int(curve.values.max()) for curve in curves if len(curve.values))])
    span = max(end - begin, 1e-9)
    wide, high = WIDTH - _LEFT - _RIGHT, PANEL - _TOP - _BOTTOM

    def place(time: float, value: float) -> tuple[int, int]:
        return round(_LEFT + wide * (time - begin) / span), round(_TOP + high * (1 - value / highest))

    for value in ticks(0, highest, 5, least=1):
        cv2.line(picture, place(begin, value), place(end, value), GRID, 1)
        write(picture, f"{value:g}", (_LEFT - 10, place(begin, value)[1] + 6), right=True)
    for time in ticks(begin, end, 10):
        cv2.line(picture, place(time, 0), place(time, highest), GRID, 1)
        write(picture, f"{time:g}", (place(time, 0)[0], PANEL - _BOTTOM + 22), middle=True)
    cv2.line(picture, place(begin, 0), place(end, 0), INK, 1)
    cv2.line(picture, place(begin, 0), place(begin, highest), INK, 1)
    write(picture, "seconds", (WIDTH // 2, PANEL - 12), middle=True)
    write(picture, title, (_LEFT, 28))
    x, y = _LEFT + 220, 28
    for number, curve in enumerate(curves):
        colour = COLOURS[number % len(COLOURS)]
        if len(curve.times):
            corners = [place(time, value) for time, value in _steps(curve)]
            cv2.polylines(
                picture, [np.array(corners, np.int32)], False, colour, _width_of(number, len(curves)), cv2.LINE_AA
            )
        width = width_of(curve.name) + 60
        if x + width > WIDTH - _RIGHT:
            x, y = _LEFT + 220, y + 20
        if x + width <= WIDTH - _RIGHT and y < _TOP:  # a legend as far as there is room for it
            cv2.line(picture, (x, y - 6), (x + 26, y - 6), colour, 4)
            write(picture, curve.name, (x + 34, y))
            x += width
    return picture


def _width_of(number: int, count: int) -> int:
    """How wide a curve is drawn, px: the first ones wider, so that those drawn over them do not hide them."""
    return min(2 + 3 * (count - 1 - number), 11)


def _steps(curve: _Curve) -> list[tuple[float, int]]:
    """Corners of a curve that keeps its value until the next time."""
    values = curve.values.tolist()
    corners = [(float(curve.times[0]), values[0])]
    for k in range(1, len(values)):
        if values[k] != values[k - 1] or k == len(values) - 1:
            corners += [(float(curve.times[k]), values[k - 1]), (float(curve.times[k]), values[k])]
    return corners

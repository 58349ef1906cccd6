"""Pieces of charts: colours, letters, and round numbers along an axis."""

from __future__ import annotations

import math

import cv2

from perdure.draw.colours import Colour
from perdure.types import Image

PAPER: Colour = (255, 255, 255)
INK: Colour = (40, 42, 48)
GRID: Colour = (222, 224, 228)
COLOURS: tuple[Colour, ...] = (  # told apart by who sees colours badly, too (Okabe and Ito)
    (0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (86, 180, 233), (230, 159, 0),
)  # fmt: skip


def ticks(low: float, high: float, about: int, least: float = 0.0) -> list[float]:
    """Return round numbers from low to high, some `about` of them."""
    rough = max((high - low) / about, least, 1e-9)
    unit = 10.0 ** math.floor(math.log10(rough) + 1e-9)
    step = next(unit * times for times in (1, 2, 5, 10) if unit * times >= rough * (1 - 1e-9))
    return [round(k * step, 9) for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def write(picture: Image, text: str, place: tuple[int, int], *, right: bool = False, middle: bool = False) -> None:
    """Write a text that begins at a place (x, y of its base line), ends or has its middle there."""
    x, y = place
    x -= width_of(text) if right else width_of(text) // 2 if middle else 0
    cv2.putText(picture, _plain(text), (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.55, INK, 1, cv2.LINE_AA)


def width_of(text: str) -> int:
    """Return how wide a text is, in pixels."""
    return int(cv2.getTextSize(_plain(text), cv2.FONT_HERSHEY_SIMPLEX, 0.55, 1)[0][0])


def _plain(text: str) -> str:
    """Letters that are there to draw with."""
    return text.encode("ascii", "replace").decode()

"""Labels on small chips of colour, laid where they cover neither the picture's edge nor one another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np

from perdure.draw.colours import DARK, LIGHT, Colour, readable_on
from perdure.features.boxes import intersections
from perdure.types import Image

Place = tuple[int, int, int, int]  # x1, y1, x2, y2 in whole pixels


class Label(NamedTuple):
    """A text that belongs to a box; `gap` is how far from it, in pixels.

    A bold one is written on its colour, another in its colour on a dark chip.
    """

    text: str
    colour: Colour
    bold: bool
    box: Place
    gap: int


def lay_labels(
    picture: Image,
    clock: str,
    labels: Sequence[Label],
    size: int,
    *,
    title: str = "",
    beside: Sequence[Place] = (),
) -> None:
    """Write the clock into the lower left corner, a title into the upper, and each label at its box, in order.

    None covers the places `beside`, if there is room elsewhere. What is larger than the picture allows is left out. `size` is the height of the letters in pixels.
    """
    taken: list[Place] = list(beside)
    margin = size // 3
    for text, top in ((title, True), (clock, False)):
        chip = _chip(text or " ", DARK, LIGHT, max(10, round(size * 0.85)))
        room = (
            chip.shape[0] + 2 * margin <= picture.shape[0] // 3 and chip.shape[1] + 2 * margin <= picture.shape[1]
        )
        if text and room:
            y = margin if top else picture.shape[0] - margin - chip.shape[0]
            taken.append(lay_chip(picture, margin, y, chip, 0.75))
    for label in labels:
        found = free_chip(label, taken, picture, size)
        if found is not None:
            taken.append(lay_chip(picture, *found, 0.92))


def free_chip(label: Label, taken: Sequence[Place], picture: Image, size: int) -> tuple[int, int, Image] | None:
    """Return the corner x, y at which a label covers no other, and its chip; None where the picture is too small."""
    paper, letters = (label.colour, readable_on(label.colour)) if label.bold else (DARK, label.colour)
    chip = _chip(label.text, paper, letters, size)
    if chip.shape[0] > picture.shape[0] // 2 or chip.shape[1] > picture.shape[1]:
        return None
    return (*_free_place(label, chip, taken, picture), chip)


def lay_chip(picture: Image, x: int, y: int, chip: Image, share: float) -> Place:
    """Blend a chip into the picture at a corner; return the place it takes."""
    height, width = chip.shape[:2]
    under = picture[y : y + height, x : x + width]
    under[:] = cv2.addWeighted(under, 1.0 - share, chip, share, 0.0)
    return x, y, x + width, y + height


def _free_place(label: Label, chip: Image, taken: Sequence[Place], picture: Image) -> tuple[int, int]:
    """Return the corner of the first place at the box that covers no other label, else the least covering."""
    (tall, wide), (height, width) = chip.shape[:2], picture.shape[:2]
    wished = np.array(_places(label, tall, wide))  # (P, 2)
    corners = np.clip(wished, 0, (width - wide, height - tall))  # (P, 2)
    places = np.concatenate([corners, corners + np.array([wide, tall])], axis=1)  # (P, 4)
    covered = intersections(places, np.array(taken).reshape(-1, 4)).sum(axis=1)
    cost = 1000.0 * covered + 4.0 * np.abs(corners - wished).sum(axis=1) + np.arange(len(places))
    x, y = corners[int(cost.argmin())]
    return int(x), int(y)


def _places(label: Label, tall: int, wide: int) -> list[tuple[int, int]]:
    """Corners for the chip, the best first: above, below, higher, inside, beside."""
    (x1, y1, x2, y2), gap = label.box, label.gap
    return [
        (x1 - gap, y1 - tall - gap),
        (x2 + gap - wide, y1 - tall - gap),
        (x1 - gap, y2 + gap),
        (x2 + gap - wide, y2 + gap),
        (x1 - gap, y1 - 2 * tall - gap - 1),
        (x1 + gap + 2, y1 + gap + 2),
        (x2 + gap + 1, y1),
        (x1 - gap - wide - 1, y1),
    ]


def _chip(text: str, paper: Colour, letters: Colour, size: int) -> Image:
    """Return a line of text on its paper; TrueType letters where cv2 has them (5.x), Hershey's else."""
    write = _truetype if hasattr(cv2, "FontFace") else _hershey
    return write(text, paper, letters, size)


def _truetype(text: str, paper: Colour, letters: Colour, size: int) -> Image:
    toolbox: Any = cv2  # the stubs of 4.x know no FontFace
    face = toolbox.FontFace("sans")
    _, _, wide, _ = toolbox.getTextSize((0, 0), text, (0, 0), face, size, 400)
    pad = max(2, size // 4)
    chip = np.full((size + 2 * (pad // 2) + 2, wide + 2 * pad, 3), paper, np.uint8)
    toolbox.putText(chip, text, (pad, pad // 2 + 1 + round(0.82 * size)), letters, face, size, 400)
    return chip


def _hershey(text: str, paper: Colour, letters: Colour, size: int) -> Image:
    scale, weight = size / 30.0, max(1, round(size / 14))
    (wide, tall), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, weight)
    pad = max(2, size // 4)
    chip = np.full((tall + below // 2 + 2 * pad, wide + 2 * pad, 3), paper, np.uint8)
    cv2.putText(chip, text, (pad, pad + tall), cv2.FONT_HERSHEY_SIMPLEX, scale, letters, weight, cv2.LINE_AA)
    return chip

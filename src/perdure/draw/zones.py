"""Zones on a picture: thin outlines in the colour of the kind, dashed where they share a place with others, and names."""

from __future__ import annotations

import cv2
import numpy as np

from perdure.draw.colours import Colour
from perdure.draw.labels import Label, Place, free_chip, lay_chip
from perdure.draw.strokes import Lines, Style, broken
from perdure.types import Image, Scene

COLOURS: dict[str, Colour] = {
    "entry": (80, 220, 120),
    "exit": (255, 120, 90),
    "occlusion": (250, 210, 80),
    "low-contrast": (110, 190, 255),
    "noise": (215, 140, 255),
    "ignore": (170, 174, 182),
    "ground": (200, 165, 120),
}
_WHOLE = ("ground", "entry", "occlusion")  # outlines that are not dashed: an exit is often where an entry is
_SHARE = 0.75  # of a chip, against what is under it
_FAR = 16000  # cv2 counts lines in 16 bits


def draw_zones(picture: Image, scene: Scene, style: Style) -> list[Place]:
    """Draw the zones of a scene into a picture, whole outlines first; return where their names stand."""
    zones = sorted(scene.zones, key=lambda one: one.kind not in _WHOLE)
    band = np.zeros(picture.shape[:2], np.uint8)
    outlines = [_outlines(one.polygons) for one in zones]
    for lines in outlines:
        cv2.polylines(band, lines, False, 255, style.thin + style.halo)
    cv2.copyTo(cv2.convertScaleAbs(picture, alpha=0.6), band, picture)
    for zone, lines in zip(zones, outlines, strict=True):
        dash = style.dash if zone.kind not in _WHOLE else None
        drawn = (
            lines if dash is None else [part for line in lines for part in broken(line, 1.5 * dash, 1.5 * dash)]
        )
        cv2.polylines(picture, drawn, False, COLOURS[zone.kind], style.thin, cv2.LINE_AA)
    taken: list[Place] = []
    for zone, lines in zip(zones, outlines, strict=True):
        corner = np.concatenate(lines).min(axis=0).tolist()
        place = (corner[0], corner[1], corner[0], corner[1])
        text = zone.name if zone.kind in zone.name else f"{zone.kind}: {zone.name}"
        label = Label(text, COLOURS[zone.kind], False, place, -style.line)
        chip = free_chip(label, taken, picture, max(10, round(0.8 * style.letters)))
        if chip is not None:
            taken.append(lay_chip(picture, *chip, _SHARE))
    return taken


def _outlines(polygons: tuple[tuple[tuple[tuple[float, float], ...], ...], ...]) -> Lines:
    """Closed lines round a zone's polygons and holes."""
    rings = [np.array([*ring, ring[0]]) for polygon in polygons for ring in polygon]
    return [np.rint(np.clip(ring, -_FAR, _FAR)).astype(np.int32) for ring in rings]

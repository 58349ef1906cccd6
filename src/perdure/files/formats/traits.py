"""What rows may say beside frame and id, in words; a format holds some of it."""

from __future__ import annotations

import enum


class Trait(enum.Enum):
    """A thing that rows may say."""

    BOX = "boxes that differ from the silhouettes'"
    MASK = "silhouettes"
    MASK_TOO = "silhouettes beside contours"
    OVERLAP = "pixels of silhouettes that another one covers"
    BELIEVED = "whole silhouettes as believed"
    OUTLINE = "contours between pixels"
    CLASS = "classes"
    CHANGING_CLASS = "classes that change within a track (its commonest is kept)"
    CONFIDENCE = "confidence"
    CHANGING_CONFIDENCE = "confidence frame by frame (a track's mean is kept)"
    STATUS = "status"
    LOST = "which targets are lost (they become occluded)"
    GROUP = "groups"
    INFERRED = "which rows were filled in"
    SIDE = "hidden sides"
    GROUND = "places on the ground"
    LINKS = "links to regions"
    TIME = "times"
    RATE = "frames a second"


ALL = frozenset(Trait)

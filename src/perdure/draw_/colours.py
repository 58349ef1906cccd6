"""A colour for every id: far from its neighbours' colours, readable on light and dark."""

from __future__ import annotations

import math
from functools import lru_cache

Colour = tuple[int, int, int]  # red, green, blue, 0 to 255

DARK: Colour = (22, 24, 30)
LIGHT: Colour = (240, 242, 246)

_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
_LIGHTNESS = (0.74, 0.84, 0.66)  # OKLab; by id modulo 3, so that hues that come near each other differ here
_CHROMA = 0.17


@lru_cache(maxsize=4096)
def colour_of(identity: int) -> Colour:
    """Return the RGB colour of an id: the hue turns by the golden angle from each id to the next.

    >>> colour_of(1) == colour_of(1), colour_of(1) == colour_of(2)
    (True, False)
    """
    hue = identity * _GOLDEN_ANGLE
    lightness = _LIGHTNESS[identity % 3]
    chroma = _CHROMA
    while True:
        red, green, blue = _linear_rgb(lightness, chroma * math.cos(hue), chroma * math.sin(hue))
        if chroma < 0.02 or (min(red, green, blue) >= 0.0 and max(red, green, blue) <= 1.0):
            return _gamma(red), _gamma(green), _gamma(blue)
        chroma -= 0.01


def dimmer(colour: Colour) -> Colour:
    """Return the colour of what is not seen."""
    red, green, blue = (int(0.6 * value + 62) for value in colour)
    return red, green, blue


def readable_on(colour: Colour) -> Colour:
    """Return the colour of letters on paper of this colour."""
    red, green, blue = colour
    return DARK if 0.299 * red + 0.587 * green + 0.114 * blue > 110 else LIGHT


def _linear_rgb(lightness: float, a: float, b: float) -> tuple[float, float, float]:
    """OKLab to linear sRGB (Ottosson 2020)."""
    long = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3
    medium = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3
    short = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3
    return (
        4.0767416621 * long - 3.3077115913 * medium + 0.2309699292 * short,
        -1.2684380046 * long + 2.6097574011 * medium - 0.3413193965 * short,
        -0.0041960863 * long - 0.7034186147 * medium + 1.7076147010 * short,
    )


def _gamma(value: float) -> int:
    value = min(max(value, 0.0), 1.0)
    curved = 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055
    return round(255 * curved)

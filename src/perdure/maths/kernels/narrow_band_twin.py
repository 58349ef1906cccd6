"""The kernels of `narrow_band` once more, plainly: their oracles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates

from perdure.maths.kernels.narrow_band import CLOSE, CLOSEST, EVEN, FLAT, SHORT, SURE

Float = NDArray[np.float64]
Index = NDArray[np.int64]
Bits = NDArray[np.bool_]

_UP, _RIGHT, _DOWN, _LEFT = range(4)
_WAYS = {  # corners inside, with the clock from the upper left -> sides where pieces begin and end
    "1000": [(_UP, _LEFT)], "0100": [(_RIGHT, _UP)], "0010": [(_DOWN, _RIGHT)], "0001": [(_LEFT, _DOWN)],
    "1100": [(_RIGHT, _LEFT)], "0110": [(_DOWN, _UP)], "0011": [(_LEFT, _RIGHT)], "1001": [(_UP, _DOWN)],
    "1110": [(_DOWN, _LEFT)], "0111": [(_LEFT, _UP)], "1011": [(_UP, _RIGHT)], "1101": [(_RIGHT, _DOWN)],
}  # fmt: skip
_JOINED = {"1010": [(_UP, _RIGHT), (_DOWN, _LEFT)], "0101": [(_RIGHT, _DOWN), (_LEFT, _UP)]}
_APART = {"1010": [(_UP, _LEFT), (_DOWN, _RIGHT)], "0101": [(_RIGHT, _UP), (_LEFT, _DOWN)]}


def pieces_twin(phi: Float, pixels: Index, ends: Float, edges: Index) -> int:
    """Look every cell up in a table: the oracle of `pieces`; shapes, units and what changes are the same."""
    found, (height, width) = 0, phi.shape
    for y, x in zip(*np.unravel_index(pixels, phi.shape), strict=True):
        if y == height - 1 or x == width - 1:
            continue
        corners = phi[[y, y, y + 1, y + 1], [x, x + 1, x + 1, x]]
        case = "".join("1" if corner < 0 else "0" for corner in corners)
        table = _JOINED if corners.sum() < 0 else _APART
        for way in _WAYS.get(case, table.get(case, [])):
            for column, side in enumerate(way):
                (y0, x0), (y1, x1) = [(y, x), (y, x + 1), (y + 1, x), (y, x)][side], [
                    (y, x + 1), (y + 1, x + 1), (y + 1, x + 1), (y + 1, x)
                ][side]  # fmt: skip
                share = phi[y0, x0] / (phi[y0, x0] - phi[y1, x1])
                ends[found, 2 * column : 2 * column + 2] = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
                edges[found, column] = 2 * (y0 * width + x0) + (y1 - y0)
            found += 1
    return found


def measure_twin(phi: Float, held: Float, ends: Float, band: float, pixels: Index, count: int) -> int:
    """Take the least distance of every pixel from all pieces: the oracle of `measure`, but for the pixels' order."""
    y, x = (one.reshape(-1, 1) for one in np.indices(phi.shape))  # (H W, 1)
    x0, y0, x1, y1 = ends.T
    length = np.maximum((x1 - x0) ** 2 + (y1 - y0) ** 2, SHORT)
    share = np.clip(((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length, 0, 1)  # (H W, N)
    away = np.hypot(x0 + share * (x1 - x0) - x, y0 + share * (y1 - y0) - y)
    nearest = away.min(axis=1, initial=band)
    near = np.flatnonzero(nearest < band)
    signed = np.where(phi < 0, -1, 1) * nearest.reshape(phi.shape)
    around = np.pad(held, 1, mode="edge")
    north, south, west, east = around[:-2, 1:-1], around[2:, 1:-1], around[1:-1, :-2], around[1:-1, 2:]
    beside = np.logical_or.reduce([(one < 0) != (held < 0) for one in (north, south, west, east)])
    slope_y, slope_x = (
        np.gradient(held, axis=axis) if held.shape[axis] > 1 else np.zeros(held.shape) for axis in (0, 1)
    )
    slope = np.hypot(slope_x, slope_y)
    apart = np.divide(held, slope, out=np.full(phi.shape, np.inf), where=slope > 0)
    sloped = np.where(np.abs(apart - signed) <= SURE, apart, signed)
    settled = np.where(
        beside,
        np.where(np.abs(slope - 1) <= EVEN, held, sloped),
        np.where(np.abs(signed - held) <= CLOSE, held, signed),
    )
    settled = np.where((settled < 0) & (settled > -CLOSEST), -settled, settled)
    phi[:] = np.where((nearest < band).reshape(phi.shape), settled, signed)
    pixels[: len(near)] = near
    return len(near)


def borders_twin(mask: Bits, room: Float, out: Float) -> None:
    """Take the nearest pixel of the other kind from SciPy: the oracle of `borders`; what changes is the same, but for `room`."""
    out[:] = np.where(mask, 0.5 - distance_transform_edt(mask), distance_transform_edt(~mask) - 0.5)


def rates_twin(phi: Float, pixels: Index, force: Float, domain: Bits, curvature: float, out: Float) -> float:
    """Take differences of whole pictures: the oracle of `rates`; shapes, units and what changes are the same."""
    height, width = phi.shape
    padded = np.pad(phi, 2, mode="edge")

    def at(down: int, right: int) -> Float:
        return padded[2 + down : 2 + down + height, 2 + right : 2 + right + width]

    steep = np.zeros(phi.shape)
    for down, right in ((0, 1), (1, 0)):
        back, fore = phi - at(-down, -right), at(down, right) - phi
        middle = fore - back
        back = back + _lesser(phi - 2 * at(-down, -right) + at(-2 * down, -2 * right), middle) / 2
        fore = fore - _lesser(middle, at(2 * down, 2 * right) - 2 * at(down, right) + phi) / 2
        rising = np.maximum(np.minimum(back, 0) ** 2, np.maximum(fore, 0) ** 2)
        steep += np.where(force < 0, np.maximum(np.maximum(back, 0) ** 2, np.minimum(fore, 0) ** 2), rising)
    x, y = (at(0, 1) - at(0, -1)) / 2, (at(1, 0) - at(-1, 0)) / 2
    bent = (at(0, 1) - 2 * phi + at(0, -1)) * y * y + (at(1, 0) - 2 * phi + at(-1, 0)) * x * x
    bent -= 2 * x * y * (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / 4
    squared = x * x + y * y
    slope = np.sqrt(squared)
    curved = np.divide(bent, squared * slope, out=np.zeros(phi.shape), where=squared > FLAT)
    curved = curvature * np.clip(curved, -1, 1)
    change = np.where(domain, force * np.sqrt(steep) + curved * slope, 0)
    speed = np.where(domain, np.abs(force) + np.abs(curved), 0)
    out[:] = change.flat[pixels]
    return float(speed.flat[pixels].max(initial=0))


def sample_twin(field: Float, points: Float, out: Float) -> None:
    """Interpolate by SciPy: the oracle of `sample`; shapes, units and what changes are the same."""
    out[:] = map_coordinates(field, points[:, ::-1].T, order=1, mode="nearest")


def carry_twin(phi: Float, back: Float, scale: float, out: Float) -> None:
    """Interpolate by SciPy, and add the way to the border: the oracle of `carry`."""
    y, x = np.indices(out.shape)
    points = (np.stack([x, y, np.ones_like(x)], axis=-1) @ back[:2].T).reshape(-1, 2)  # (h w, 2)
    beyond = np.hypot(*(points - np.clip(points, 0, np.array(phi.shape[::-1]) - 1)).T)
    found = np.empty(out.size)
    sample_twin(phi, points, found)
    out[:] = scale * (found + beyond).reshape(out.shape)


def _lesser(one: Float, other: Float) -> Float:
    return np.where(one * other > 0, np.sign(one) * np.minimum(np.abs(one), np.abs(other)), 0)

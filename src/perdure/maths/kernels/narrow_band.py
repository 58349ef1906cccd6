"""Level sets near their contour: where it runs, how far away pixels are, and how fast they change.

A picture `phi` is below 0 inside. Pixels come as flat places y W + x, so that work grows with the contour's length and
not with the picture. Vertices of the contour lie on edges between neighbours: the edge from (x, y) to the right has
the key 2 (y W + x), the one downwards 2 (y W + x) + 1. The twins are in `narrow_band_twin`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel_for, part

Float = NDArray[np.float64]
Index = NDArray[np.int64]
Bits = NDArray[np.bool_]

PIECES = 2  # of a contour in one cell at most
CLOSE = 0.04  # pixels by which a distance may be off
CLOSEST = 1e-3  # pixels: what is inside by less is outside, so that specks do not dwindle for ever
SHORT = 1e-18  # squared length of a piece below which it is a point
EVEN = 0.05  # by which the slope of a distance beside the contour may differ from 1
SURE = 0.1  # pixels by which a distance found from the slope may differ from that of the polygon
FLAT = 1e-12  # squared slope below which nothing is curved


@kernel_for(
    given(np.float64, 2, "C"),
    given(np.int64, 1, "C"),
    changed(np.float64, 2),
    changed(np.int64, 2),
)
def pieces(phi: Float, pixels: Index, ends: Float, edges: Index) -> int:
    """Write the pieces of the contour in the cells of 2x2 pixels whose upper left ones are named; return their number.

    Marching squares (Lorensen & Cline, *Marching cubes*, 1987). Where two inside corners lie across (a saddle), they
    are joined if the mean of the four corners is below 0.

    Parameters
    ----------
    phi : (H, W) float64
        Finite, below 0 inside.
    pixels : (K,) int64
        Flat places, each once; those in the last row or column have no cell.
    ends : (≥ PIECES K, 4) float64, changed
        x, y, x, y of begin and end. The inside lies to the right of the way, as seen with y downwards.
    edges : (≥ PIECES K, 2) int64, changed
        Keys of the edges where a piece begins and ends.
    """
    height, width = phi.shape
    found = 0
    for n in range(len(pixels)):
        y = pixels[n] // width
        x = pixels[n] - y * width
        if y + 1 >= height or x + 1 >= width:
            continue
        a, b, c, d = phi[y, x] < 0, phi[y, x + 1] < 0, phi[y + 1, x + 1] < 0, phi[y + 1, x] < 0
        if a == b and b == c and c == d:
            continue
        apart = a == c and b == d and phi[y, x] + phi[y, x + 1] + phi[y + 1, x + 1] + phi[y + 1, x] >= 0
        for begin in range(4):  # the side on which one leaves the inside, going round with the clock
            if not _inside(phi, y, x, begin) or _inside(phi, y, x, begin + 1):
                continue
            end = begin + 3 if apart else begin + 1
            while not apart and not _inside(phi, y, x, end + 1):
                end += 1
            _place(phi, _key(y, x, begin, width), found, 0, ends, edges)
            _place(phi, _key(y, x, end, width), found, 1, ends, edges)
            found += 1
    return found


@part
def _inside(phi: Float, y: int, x: int, corner: int) -> bool:
    """Whether a corner of a cell is inside: 0 upper left, then with the clock."""
    corner &= 3
    return bool(phi[y + (corner >> 1), x + ((corner ^ (corner >> 1)) & 1)] < 0)


@part
def _key(y: int, x: int, side: int, width: int) -> int:
    """Key of a cell's side: 0 the upper one, then with the clock."""
    side &= 3
    here = y * width + x
    if side == 0:
        return 2 * here
    if side == 1:
        return 2 * here + 3
    return 2 * (here + width) if side == 2 else 2 * here + 1


@part
def _place(phi: Float, key: int, row: int, column: int, ends: Float, edges: Index) -> None:
    """Write where the contour crosses an edge."""
    y = (key >> 1) // phi.shape[1]
    x = (key >> 1) - y * phi.shape[1]
    down = key & 1
    one, other = phi[y, x], phi[y + down, x + 1 - down]
    share = one / (one - other)
    edges[row, column] = key
    ends[row, 2 * column] = x + share * (1 - down)
    ends[row, 2 * column + 1] = y + share * down


@kernel_for(
    changed(np.float64, 2),
    given(np.float64, 2, "C"),
    given(np.float64, 2, "C"),
    float,
    changed(np.int64),
    int,
)
def measure(phi: Float, held: Float, ends: Float, band: float, pixels: Index, count: int) -> int:
    """Write distances from the pieces of a contour in its band; return how many pixels that has.

    The polygon lies within the curve that it stands for, by 1 / 8 r or so where that is bent with a radius r, and
    every measuring would draw the contour in. So pixels beside it, one of whose four neighbours is on the other side,
    take held / |grad held|, where that differs by no more than SURE. None changes if its slope differs from 1 by no more
    than EVEN, or, farther away, if it is off by no more than CLOSE.

    Parameters
    ----------
    phi : (H, W) float64, changed
        Signs stay, but below CLOSEST; values become distances in pixels, or `band` where that is less. Beyond the
        pixels named, they must be `band` or -`band`.
    held : (H, W) float64
        What phi was.
    ends : (N, 4) float64
        x, y, x, y of the pieces.
    band : float
        > 0, pixels.
    pixels : (H W,) int64, changed
        Flat places of the band so far; of the new one then.
    count : int
        How many pixels the band had so far.
    """
    height, width = phi.shape
    for n in range(count):
        y = pixels[n] // width
        x = pixels[n] - y * width
        phi[y, x] = -band if phi[y, x] < 0 else band
    found = 0
    for n in range(len(ends)):
        x0, y0, x1, y1 = ends[n, 0], ends[n, 1], ends[n, 2], ends[n, 3]
        along, down = x1 - x0, y1 - y0
        length = max(along * along + down * down, SHORT)
        left, right = max(int(np.ceil(min(x0, x1) - band)), 0), min(int(max(x0, x1) + band), width - 1)
        top, bottom = max(int(np.ceil(min(y0, y1) - band)), 0), min(int(max(y0, y1) + band), height - 1)
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                share = min(max(((x - x0) * along + (y - y0) * down) / length, 0.0), 1.0)
                away_x, away_y = x0 + share * along - x, y0 + share * down - y
                squared, before = away_x * away_x + away_y * away_y, phi[y, x]
                if squared < before * before:
                    if abs(before) >= band:
                        pixels[found] = y * width + x
                        found += 1
                    phi[y, x] = -np.sqrt(squared) if before < 0 else np.sqrt(squared)
    for n in range(found):
        y = pixels[n] // width
        x = pixels[n] - y * width
        phi[y, x] = _settled(held, y, x, phi[y, x])
    return found


@part
def _settled(held: Float, y: int, x: int, distance: float) -> float:
    """What a pixel's distance from the polygon makes of what it was."""
    up, down, left, right = (
        max(y - 1, 0),
        min(y + 1, held.shape[0] - 1),
        max(x - 1, 0),
        min(x + 1, held.shape[1] - 1),
    )
    here, north, south, west, east = held[y, x], held[up, x], held[down, x], held[y, left], held[y, right]
    inside = here < 0
    if inside != (north < 0) or inside != (south < 0) or inside != (west < 0) or inside != (east < 0):
        slope_x, slope_y = (east - west) / max(right - left, 1), (south - north) / max(down - up, 1)
        slope = np.sqrt(slope_x * slope_x + slope_y * slope_y)
        if abs(slope - 1) <= EVEN:
            distance = here
        elif slope > 0 and abs(here / slope - distance) <= SURE:
            distance = here / slope
    elif abs(distance - here) <= CLOSE:
        distance = here
    return -distance if -CLOSEST < distance < 0 else distance


@kernel_for(given(np.bool_, 2, "C"), changed(np.float64, 2), changed(np.float64, 2))
def borders(mask: Bits, room: Float, out: Float) -> None:
    """Write distances of pixels from the border between a mask and the rest, half a pixel from both; below 0 inside.

    Columns, then rows, by the lower envelope of parabolas (Felzenszwalb & Huttenlocher, *Distance transforms of sampled
    functions*, 2012). In a row, pixels of one kind need no look beyond the next of the other kind, so that every pixel
    is in one envelope, and both kinds are found at once.

    Parameters
    ----------
    mask : (H, W) bool
        With a border.
    room : (3, ≥ W + 3) float64, changed
        For columns, heights and bounds of the envelope.
    out : (H, W) float64, changed
        Every element is written.
    """
    height, width = mask.shape
    none = float(height + 1)  # farther than any pixel of a column
    for x in range(width):
        out[0, x] = none
    for y in range(1, height):
        for x in range(width):
            out[y, x] = out[y - 1, x] + 1 if mask[y, x] == mask[y - 1, x] else 1.0
    for y in range(height - 2, -1, -1):
        for x in range(width):
            out[y, x] = min(out[y, x], out[y + 1, x] + 1 if mask[y, x] == mask[y + 1, x] else 1.0)
    for y in range(height):
        end = 0
        while end < width:
            begin = end
            while end < width and mask[y, end] == mask[y, begin]:
                end += 1
            count = 0
            for x in range(begin - 1, end + 1):
                if x < 0 or x >= width:
                    continue
                far = out[y, x] if begin <= x < end else 0.0
                if far >= none:
                    continue
                here, bound = far * far, -1.0
                while count > 0:
                    place = room[0, count - 1]
                    bound = ((here + x * x) - (room[1, count - 1] + place * place)) / (2 * (x - place))
                    if bound > room[2, count - 1]:
                        break
                    count -= 1
                room[0, count], room[1, count], room[2, count] = x, here, bound if count > 0 else -1.0
                count += 1
            room[2, count] = width
            near = 0
            for x in range(begin, end):
                while room[2, near + 1] < x:
                    near += 1
                away = x - room[0, near]
                distance = np.sqrt(away * away + room[1, near])
                out[y, x] = 0.5 - distance if mask[y, x] else distance - 0.5


@kernel_for(
    given(np.float64, 2, "C"),
    given(np.int64, 1, "C"),
    given(np.float64, 2, "C"),
    given(np.bool_, 2, "C"),
    float,
    changed(np.float64),
)
def rates(phi: Float, pixels: Index, force: Float, domain: Bits, curvature: float, out: Float) -> float:
    """Write by how much pixels change in a unit of time; return the greatest speed, px per unit.

    Godunov's upwind scheme for force · |grad phi| (Osher & Sethian, *Fronts propagating with curvature-dependent
    speed*, 1988) with slopes of second order (ENO; Osher & Shu, 1991), central differences for curvature · κ |grad phi|.

    Parameters
    ----------
    phi, force : (H, W) float64
        Finite; a force above 0 raises phi.
    pixels : (K,) int64
        Flat places.
    domain : (H, W) bool
        Pixels outside it do not change.
    curvature : float
        ≥ 0, pixels; no curve is taken as bent by more than 1 / px.
    out : (K,) float64, changed
        Every element is written.
    """
    height, width = phi.shape
    fastest = 0.0
    for n in range(len(pixels)):
        y = pixels[n] // width
        x = pixels[n] - y * width
        if not domain[y, x]:
            out[n] = 0.0
            continue
        up, down, left, right = max(y - 1, 0), min(y + 1, height - 1), max(x - 1, 0), min(x + 1, width - 1)
        here, pull = phi[y, x], force[y, x]
        north, south, west, east = phi[up, x], phi[down, x], phi[y, left], phi[y, right]
        steep = _upwind(phi[y, max(x - 2, 0)], west, here, east, phi[y, min(x + 2, width - 1)], pull)
        steep += _upwind(phi[max(y - 2, 0), x], north, here, south, phi[min(y + 2, height - 1), x], pull)
        change, speed = pull * np.sqrt(steep), abs(pull)
        if curvature > 0:
            slope_x, slope_y = (east - west) / 2, (south - north) / 2
            cross = (phi[down, right] - phi[down, left] - phi[up, right] + phi[up, left]) / 4
            squared = slope_x * slope_x + slope_y * slope_y
            if squared > FLAT:
                bent = (east - 2 * here + west) * slope_y * slope_y + (
                    south - 2 * here + north
                ) * slope_x * slope_x
                slope = np.sqrt(squared)
                bent = curvature * min(max((bent - 2 * slope_x * slope_y * cross) / squared / slope, -1.0), 1.0)
                change += bent * slope
                speed += abs(bent)
        out[n] = change
        fastest = max(fastest, speed)
    return fastest


@part
def _upwind(second: float, first: float, here: float, next_: float, last: float, force: float) -> float:
    """Squared slope along one axis, taken from where the contour comes."""
    middle = next_ - 2 * here + first
    back = here - first + _lesser(here - 2 * first + second, middle) / 2
    fore = next_ - here - _lesser(middle, last - 2 * next_ + here) / 2
    if force < 0:
        back, fore = -back, -fore
    back, fore = min(back, 0.0), max(fore, 0.0)
    return max(back * back, fore * fore)


@part
def _lesser(one: float, other: float) -> float:
    """The one nearer to 0; 0 where their signs differ (minmod)."""
    if one * other <= 0:
        return 0.0
    return one if abs(one) < abs(other) else other


@kernel_for(given(np.float64, 2, "C"), given(np.float64, 2, "C"), changed(np.float64))
def sample(field: Float, points: Float, out: Float) -> None:
    """Write the values (N,) of a picture (H, W) at points (N, 2) x, y between pixels; beyond it those of its border."""
    for n in range(len(points)):
        out[n] = value_at(field, points[n, 0], points[n, 1])


@kernel_for(given(np.float64, 2, "C"), given(np.float64, 2, "C"), float, changed(np.float64, 2))
def carry(phi: Float, back: Float, scale: float, out: Float) -> None:
    """Write the distances (h, w) of a shape that has moved.

    Parameters
    ----------
    phi : (H, W) float64
        Distances; beyond it, those of its border and the way to there.
    back : (2 or 3, 3) float64
        Takes x, y, 1 of a pixel to where it was in phi.
    scale : float
        By which distances have grown.
    out : (h, w) float64, changed
        Every element is written.
    """
    height, width = phi.shape
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            x = back[0, 0] * column + back[0, 1] * row + back[0, 2]
            y = back[1, 0] * column + back[1, 1] * row + back[1, 2]
            beyond_x, beyond_y = max(-x, x - (width - 1), 0.0), max(-y, y - (height - 1), 0.0)
            beyond = np.sqrt(beyond_x * beyond_x + beyond_y * beyond_y)
            out[row, column] = scale * (value_at(phi, x, y) + beyond)


@part
def value_at(field: NDArray[np.floating], x: float, y: float) -> float:
    """The bilinear value at a point, or at the point of the picture that is nearest to it."""
    height, width = field.shape
    x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
    left, top = int(x), int(y)
    right, bottom = min(left + 1, width - 1), min(top + 1, height - 1)
    across, down = x - left, y - top
    upper = field[top, left] * (1 - across) + field[top, right] * across
    lower = field[bottom, left] * (1 - across) + field[bottom, right] * across
    return float(upper * (1 - down) + lower * down)

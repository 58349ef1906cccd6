"""Where forms of known size and colours lie in a common silhouette: moved in turn until none gains by moving."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, given, kernel, kernel_for

OUTSIDE, WITHIN, UNKNOWN = 0, 1, 2  # of the silhouette; beyond the picture
SWEEPS = 4

Float = NDArray[np.float32]


def arrange(
    support: NDArray[np.uint8],
    picture: Float,
    forms: Float,
    extents: NDArray[np.int64],
    corners: NDArray[np.int64],
    reach: NDArray[np.int64],
    pull: float,
    colour: float,
    contrast: float,
    gains: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Return upper left corners (N, 2) row, column of the forms where they explain the silhouette best.

    A cell of a form gains 1 where the silhouette is and no other form, nothing where another form is too, and
    loses 1 where the silhouette is not. Where colours are known, alike ones gain up to `colour` more and unlike
    ones lose as much, but nothing is lost where another form may stand in front. Leaving the place expected costs
    `pull` times the squared way in form sizes.

    Parameters
    ----------
    support : (H, W) uint8
        OUTSIDE, WITHIN or UNKNOWN.
    picture : (H, W, 3) float32
        Colours 0 to 255; (0, 0, 3) for none.
    forms : (N, h, w, 4) float32
        Colour and share in [0, 1] of each cell; of form n the first `extents[n]` rows and columns count.
    extents, corners, reach : (N, 2) int64
        Rows and columns: sizes (≥ 1), places expected (also beyond the picture), and how far from them to search
        (≥ 0).
    pull, colour, contrast : float
        Cost of leaving the place expected, weight of colour, and the difference of colours (0 to 442) that is
        unlike.
    gains : (N,) float64, changed
        What every form gained when it last was moved, per cell, less what its way cost.
    """
    placed, covered = corners.copy(), np.zeros(support.shape, np.float32)
    _arrange(support, picture, forms, extents, corners, reach, pull, colour, contrast, gains, placed, covered)
    return placed


@kernel_for(
    given(np.uint8, 2, "C"),
    given(np.float32, 3, "C"),
    given(np.float32, 4, "C"),
    given(np.int64, 2),
    given(np.int64, 2),
    given(np.int64, 2),
    float,
    float,
    float,
    changed(np.float64),
    changed(np.int64, 2),
    changed(np.float32, 2),
)
def _arrange(
    support: NDArray[np.uint8],
    picture: Float,
    forms: Float,
    extents: NDArray[np.int64],
    corners: NDArray[np.int64],
    reach: NDArray[np.int64],
    pull: float,
    colour: float,
    contrast: float,
    gains: NDArray[np.float64],
    placed: NDArray[np.int64],
    covered: Float,
) -> None:
    """Move what is `placed`; `covered` (0 before) adds up the shares of the forms at each place."""
    for n in range(len(placed)):
        _stamp(covered, forms, extents, placed, n, 1.0)
    for _sweep in range(SWEEPS):
        moved = False
        for n in range(len(placed)):
            _stamp(covered, forms, extents, placed, n, -1.0)
            best, row, column = -np.inf, placed[n, 0], placed[n, 1]
            for y in range(corners[n, 0] - reach[n, 0], corners[n, 0] + reach[n, 0] + 1):
                for x in range(corners[n, 1] - reach[n, 1], corners[n, 1] + reach[n, 1] + 1):
                    away_y = (y - corners[n, 0]) / extents[n, 0]
                    away_x = (x - corners[n, 1]) / extents[n, 1]
                    gain = _gain(support, picture, covered, forms, extents, n, y, x, colour, contrast)
                    gain -= pull * (away_y * away_y + away_x * away_x)
                    if gain > best + 1e-9:
                        best, row, column = gain, y, x
            moved = moved or row != placed[n, 0] or column != placed[n, 1]
            placed[n, 0], placed[n, 1], gains[n] = row, column, best
            _stamp(covered, forms, extents, placed, n, 1.0)
        if not moved:
            break


def arrange_twin(
    support: NDArray[np.uint8],
    picture: Float,
    forms: Float,
    extents: NDArray[np.int64],
    corners: NDArray[np.int64],
    reach: NDArray[np.int64],
    pull: float,
    colour: float,
    contrast: float,
    gains: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Do the same on a picture with a border so wide that no form leaves it: the oracle of `arrange`.

    What the others cover is counted anew for every move. Shapes, units and what changes are those of `arrange`.
    """
    border = int(np.abs(corners).max(initial=0) + reach.max(initial=0) + extents.max(initial=0))
    ground = np.pad(support, border)  # OUTSIDE all around
    colours = np.pad(picture, ((border, border), (border, border), (0, 0))) if len(picture) else None
    cells = [form[:height, :width] for form, (height, width) in zip(forms, extents, strict=True)]
    placed = corners.copy()

    def window(n: int, corner: NDArray[np.int64]) -> tuple[slice, slice]:
        (y, x), (height, width) = (corner + border).tolist(), extents[n].tolist()
        return slice(y, y + height), slice(x, x + width)

    def gained(n: int, corner: NDArray[np.int64], covered: NDArray[np.float64]) -> float:
        here = window(n, corner)
        share = np.where(cells[n][..., 3] > 0.02, cells[n][..., 3], 0).astype(np.float64)  # (h, w)
        free = np.maximum(0.0, 1.0 - covered[here])
        worth = free
        if colours is not None:
            differing = ((colours[here] - cells[n][..., :3]) ** 2).sum(axis=2)
            match = 1 - 2 * np.minimum(1, differing / contrast**2)  # -1 unlike to 1 alike
            worth = free + colour * np.where(match > 0, match, match * free)
        value = np.select([ground[here] == WITHIN, ground[here] == UNKNOWN], [worth, np.zeros_like(worth)], -1.0)
        return float((share * value).sum() / share.sum()) if share.any() else 0.0

    for _sweep in range(SWEEPS):
        before = placed.copy()
        for n in range(len(placed)):
            covered = np.zeros(ground.shape)
            for other in range(len(placed)):
                if other != n:
                    covered[window(other, placed[other])] += cells[other][..., 3]
            best = -np.inf
            for way in np.ndindex(*(2 * reach[n] + 1)):
                corner = corners[n] - reach[n] + way
                gain = gained(n, corner, covered) - pull * float((((corner - corners[n]) / extents[n]) ** 2).sum())
                if gain > best + 1e-9:  # the first of equals
                    best, placed[n], gains[n] = gain, corner, gain
        if np.array_equal(placed, before):
            break
    return placed


@kernel
def _stamp(
    covered: Float, forms: Float, extents: NDArray[np.int64], placed: NDArray[np.int64], n: int, sign: float
) -> None:
    """Add (or take away) a form's shares where it lies."""
    height, width = covered.shape
    for a in range(extents[n, 0]):
        y = placed[n, 0] + a
        if 0 <= y < height:
            for b in range(extents[n, 1]):
                x = placed[n, 1] + b
                if 0 <= x < width:
                    covered[y, x] += sign * forms[n, a, b, 3]


@kernel
def _gain(
    support: NDArray[np.uint8],
    picture: Float,
    covered: Float,
    forms: Float,
    extents: NDArray[np.int64],
    n: int,
    top: int,
    left: int,
    colour: float,
    contrast: float,
) -> float:
    """What a form gains at a place, per cell."""
    height, width = support.shape
    total, gain = 0.0, 0.0
    coloured = picture.shape[0] > 0
    for a in range(extents[n, 0]):
        y = top + a
        for b in range(extents[n, 1]):
            share = forms[n, a, b, 3]
            if share <= 0.02:
                continue
            total += share
            x = left + b
            if y < 0 or y >= height or x < 0 or x >= width or support[y, x] == 0:
                gain -= share
                continue
            if support[y, x] == 2:
                continue
            free = 1.0 - covered[y, x] if covered[y, x] < 1.0 else 0.0
            worth = free
            if coloured:
                red = picture[y, x, 0] - forms[n, a, b, 0]
                green = picture[y, x, 1] - forms[n, a, b, 1]
                blue = picture[y, x, 2] - forms[n, a, b, 2]
                unlike = (red * red + green * green + blue * blue) / (contrast * contrast)
                match = 1.0 - 2.0 * (unlike if unlike < 1.0 else 1.0)
                worth += colour * (match if match > 0 else match * free)
            gain += share * worth
    return gain / total if total > 0 else 0.0

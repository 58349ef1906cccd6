"""Where the members of a compound are believed inside its regions, which of its pixels are theirs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import sizes
from perdure.types import Boxes, Image, Mask

Float = NDArray[np.float32]
_CELLS = 26  # of a member's height
_REACH = 0.3  # sizes that a member may be from where it is expected
_PULL = 1.5  # cost of leaving the place expected by its own size
_CONTRAST = 90.0  # difference of colours (0 to 442) that is unlike
_FITS = 0.8  # of its square: difference with which a pixel is still taken for one's own


class Inside(NamedTuple):
    """Members as they are believed in the regions of their compound."""

    boxes: Boxes  # (N, 4)
    share: Float  # (N,) of the member's form that is seen, in [0, 1]
    masks: tuple[Mask, ...]  # N; whose pixels of the regions are whose


class Canvas(NamedTuple):
    """The neighbourhood of a compound in cells."""

    support: NDArray[np.uint8]  # (H, W)
    picture: Float  # (H, W, 3) or (0, 0, 3)
    x: float  # px of the upper left corner
    y: float
    cell: float  # px


def believe(
    boxes: Boxes,
    looks: Float,
    region_boxes: Boxes,
    masks: Sequence[Mask],
    image: Image | None,
    frame: tuple[int, int],
) -> Inside:
    """Return members, expected at boxes (N, 4), where they explain the regions best.

    Parameters
    ----------
    boxes : (N, 4)
        Where they are expected, at their mean sizes.
    looks : (N, *GRID, 4)
        What they look like.
    region_boxes : (M, 4)
        The regions of the compound.
    masks : M of Mask
        Empty where the detector gives boxes alone.
    image : (H, W, 3) uint8 or None
        The picture, where there is one to look at.
    frame : (int, int)
        Height and width of the picture.
    """
    from perdure.maths.kernels.arrange import arrange  # numba: only where things meet

    cell = max(1.0, float(np.median(sizes(boxes)[:, 1])) / _CELLS)
    canvas = _canvas(boxes, region_boxes, masks, image, frame, cell)
    extents = np.maximum(np.round(sizes(boxes)[:, ::-1] / cell), 1).astype(np.int64)  # (N, 2) rows, columns
    forms = _forms(looks, extents)
    corners = np.round((boxes[:, [1, 0]] - [canvas.y, canvas.x]) / cell).astype(np.int64)
    reach = np.maximum(np.round(extents.min(axis=1, keepdims=True) * _REACH), 2).astype(np.int64).repeat(2, axis=1)
    gains = np.zeros(len(boxes))
    placed = arrange(canvas.support, canvas.picture, forms, extents, corners, reach, _PULL, 1.0, _CONTRAST, gains)
    moved = np.tile((placed - corners)[:, ::-1] * cell, 2)  # (N, 4)
    owner, share = _owners(canvas, forms, extents, placed)
    parts = [_pixels(owner == n, canvas, region_boxes, masks) for n in range(len(boxes))]
    return Inside((boxes + moved).astype(np.float32), share, tuple(parts))


def _canvas(
    boxes: Boxes,
    region_boxes: Boxes,
    masks: Sequence[Mask],
    image: Image | None,
    frame: tuple[int, int],
    cell: float,
) -> Canvas:
    from perdure.maths.kernels.arrange import OUTSIDE, UNKNOWN, WITHIN

    around = np.concatenate([boxes, region_boxes])
    x1, y1 = np.floor(around[:, :2].min(axis=0)) - 2 * cell
    x2, y2 = np.ceil(around[:, 2:].max(axis=0)) + 2 * cell
    xs = (x1 + (np.arange(max(1, int((x2 - x1) / cell))) + 0.5) * cell).astype(np.intp)
    ys = (y1 + (np.arange(max(1, int((y2 - y1) / cell))) + 0.5) * cell).astype(np.intp)
    support = np.full((len(ys), len(xs)), OUTSIDE, np.uint8)
    for box, mask in zip(region_boxes, masks, strict=True):
        if mask.bits.size:
            top, left, bits = mask.y, mask.x, mask.bits
            down, across = (ys >= top) & (ys < top + bits.shape[0]), (xs >= left) & (xs < left + bits.shape[1])
            support[np.ix_(down, across)] |= bits[np.ix_(ys[down] - top, xs[across] - left)]
        else:
            down, across = (ys >= box[1]) & (ys < box[3]), (xs >= box[0]) & (xs < box[2])
            support[np.ix_(down, across)] = WITHIN
    support[(ys < 0) | (ys >= frame[0])] = UNKNOWN
    support[:, (xs < 0) | (xs >= frame[1])] = UNKNOWN
    picture = np.zeros((0, 0, 3), np.float32)
    if image is not None:
        picture = image[np.ix_(np.clip(ys, 0, frame[0] - 1), np.clip(xs, 0, frame[1] - 1))].astype(
            np.float32, order="C"
        )
    return Canvas(support, picture, float(x1), float(y1), cell)


def _forms(looks: Float, extents: NDArray[np.int64]) -> Float:
    """Looks brought to the members' sizes in cells (N, h, w, 4); a form never seen is a full box without colour."""
    forms = np.zeros((len(looks), *extents.max(axis=0), 4), np.float32)
    for one, look, (rows, columns) in zip(forms, looks, extents, strict=True):
        if look[..., 3].any():
            down = ((np.arange(rows) + 0.5) * look.shape[0] / rows).astype(np.intp)
            across = ((np.arange(columns) + 0.5) * look.shape[1] / columns).astype(np.intp)
            one[:rows, :columns] = look[np.ix_(down, across)]
        else:
            one[:rows, :columns] = (128, 128, 128, 1)
    return forms


def _owners(
    canvas: Canvas, forms: Float, extents: NDArray[np.int64], placed: NDArray[np.int64]
) -> tuple[NDArray[np.int64], Float]:
    """Whose each cell of the silhouette is (H, W), -1 for nobody's; what share of each form is its own.

    Who explains most takes all that he explains, then who explains most of the rest, and so on: of two that are
    believed in one place one has the place, the other is hidden.
    """
    height, width = canvas.support.shape
    worth = np.zeros((len(forms), height, width), np.float32)
    fits = np.zeros((len(forms), height, width), np.bool_)
    for n, (form, (rows, columns), (top, left)) in enumerate(zip(forms, extents, placed, strict=True)):
        y1, x1, y2, x2 = max(top, 0), max(left, 0), min(top + rows, height), min(left + columns, width)
        if y1 >= y2 or x1 >= x2:
            continue
        part = form[y1 - top : y2 - top, x1 - left : x2 - left]
        mine = part[..., 3] * (canvas.support[y1:y2, x1:x2] == 1)
        if canvas.picture.size:
            difference = ((canvas.picture[y1:y2, x1:x2] - part[..., :3]) ** 2).sum(axis=2)
            mine = mine * (0.2 + 0.8 * np.exp(-difference / (2 * (_CONTRAST / 2) ** 2)))
        worth[n, y1:y2, x1:x2] = mine
        fits[n, y1:y2, x1:x2] = difference < _FITS * _CONTRAST**2 if canvas.picture.size else True
    whole = np.maximum(forms[..., 3].sum(axis=(1, 2)), 1.0)
    owner, share = np.full((height, width), -1), np.zeros(len(forms), np.float32)
    left_over, rest = np.ones((height, width), np.bool_), list(range(len(forms)))
    while rest:
        n = max(rest, key=lambda one: (worth[one][left_over].sum() / np.sqrt(whole[one]), -one))
        rest.remove(n)
        mine = left_over & (worth[n] > 0.1) & fits[n]
        share[n] = min(1.0, float(np.count_nonzero(mine)) / whole[n])
        owner[mine] = n
        left_over &= ~mine
    return owner, share


def _pixels(cells: NDArray[np.bool_], canvas: Canvas, region_boxes: Boxes, masks: Sequence[Mask]) -> Mask:
    """The regions' pixels in some cells; empty where the detector gives boxes alone."""
    known = [mask for mask in masks if mask.bits.size]
    if not known or not cells.any():
        return Mask.empty()
    x1, y1 = min(mask.x for mask in known), min(mask.y for mask in known)
    x2, y2 = max(mask.box[2] for mask in known), max(mask.box[3] for mask in known)
    whole = np.zeros((y2 - y1, x2 - x1), np.bool_)
    for mask in known:
        whole[mask.y - y1 : mask.box[3] - y1, mask.x - x1 : mask.box[2] - x1] |= mask.bits
    rows = np.clip(((np.arange(y1, y2) - canvas.y) / canvas.cell).astype(np.intp), 0, cells.shape[0] - 1)
    columns = np.clip(((np.arange(x1, x2) - canvas.x) / canvas.cell).astype(np.intp), 0, cells.shape[1] - 1)
    return Mask.of_image(whole & cells[np.ix_(rows, columns)], y1, x1)

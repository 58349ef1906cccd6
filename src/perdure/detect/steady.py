"""A camera that shakes: by how much a picture is displaced against the background model, and how it is put back.

Lucas & Kanade, *An iterative image registration technique* (1981): where the model has an edge, a small displacement
makes a difference of edge slope times displacement; least squares over the edges gives the displacement, and again
from there. Departures: only the steepest pixel of each cell of a coarse lattice is looked at, once for slopes across
and once for slopes down, so that a still picture costs next to nothing; moving things are outliers (Tukey's biweight);
a jump too wide for slopes is first searched for on a lattice; in a direction without edges nothing is claimed;
and a displacement is believed only if it is no trifle and most parts of the picture agree with it: a fixed camera
stays fixed, whatever moves before it.

The displacement is a translation. Rotation, zoom and parallax are not looked for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.types import Image, Mask, Regions

Single = NDArray[np.float32]
Vector = NDArray[np.float64]  # (2,) x, y in pixels


def shift(image: Image, mean: Single, exposure: Single) -> tuple[float, float]:
    """Return by how many pixels (dx, dy) a picture is displaced against the model; (0, 0) where not surely displaced.

    What the model has at (x, y) the picture has at (x + dx, y + dy). Only the green channel is read: it is most of
    the brightness.

    Parameters
    ----------
    image : (H, W, 3) uint8
        The picture, contiguous.
    mean : (H, W, 3) float32
        The model's.
    exposure : (3,) float32
        What brings the picture to the model's exposure.
    """
    reach = max(_LEAST_FARTHEST, round(_FARTHEST * image.shape[0]))
    margin = reach + 2  # a pixel for the slope, one for what lies between pixels
    if min(image.shape[:2]) < 2 * margin + _LEAST_CELL:
        return 0.0, 0.0
    edges = _edges(mean, margin)
    if np.count_nonzero(np.bincount(edges.tile)) < _LEAST_TILES:
        return 0.0, 0.0
    view = _View(image.reshape(-1), image.shape[1], float(exposure[1]), reach)
    still = np.zeros(2)
    unmoved = _differences(view, edges, still)
    resting = _at_rest(edges, unmoved)
    if resting >= _SURELY_AT_REST:
        return 0.0, 0.0
    found = _descend(view, edges, still if resting >= _PERHAPS_AT_REST else _search(view, edges))
    moved = _differences(view, edges, found)
    if math.hypot(*found) < _TRIFLE or not _believed(edges, unmoved, moved):
        return 0.0, 0.0
    return float(found[0]), float(found[1])


def steadied(image: NDArray[np.uint8], dx: float, dy: float) -> NDArray[np.uint8]:
    """Return the picture moved back onto the model, (H, W) or (H, W, 3): bilinear, the border repeated."""
    left, top = math.floor(dx), math.floor(dy)
    right, down = dx - left, dy - top
    if right or down:
        weights = np.outer([1.0 - down, down], [1.0 - right, right])  # (2, 2) of the four pixels around each place
        between = cv2.filter2D(image, -1, weights, anchor=(0, 0), borderType=cv2.BORDER_REPLICATE)
        image = np.asarray(between, np.uint8)
    height, width = image.shape[:2]
    part = image[max(top, 0) : height + min(top, 0), max(left, 0) : width + min(left, 0)]
    rim = max(-top, 0), max(top, 0), max(-left, 0), max(left, 0)
    return np.asarray(cv2.copyMakeBorder(part, *rim, cv2.BORDER_REPLICATE), np.uint8)


def blank(marks: NDArray[np.uint8], dx: float, dy: float) -> None:
    """Set to 0 what a displaced picture did not show, in place: (H, W), beside the model."""
    height, width = marks.shape
    marks[: math.ceil(max(-dy, 0.0))] = 0
    marks[height - math.ceil(max(dy, 0.0)) :] = 0
    marks[:, : math.ceil(max(-dx, 0.0))] = 0
    marks[:, width - math.ceil(max(dx, 0.0)) :] = 0


def moved(regions: Regions, dx: float, dy: float, height: int, width: int) -> Regions:
    """Return regions found in a steadied picture where they stand in the picture, by whole pixels, cut at its border.

    What lies outside altogether is left out.
    """
    right, down = round(dx), round(dy)
    if not (right or down):
        return regions
    masks = [_cut(Mask(mask.y + down, mask.x + right, mask.bits), height, width) for mask in regions.masks]
    inside = [number for number, mask in enumerate(masks) if mask.area]
    boxes = np.array([masks[number].box for number in inside], np.float32)
    kept = regions.take(inside)
    return Regions.of(boxes, kept.scores, kept.classes, [masks[number] for number in inside], kept.data)


def aligned(images: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return pictures (N, H, W, 3) of one exposure, each moved onto the one that stands in their middle.

    Pictures of a fixed camera are returned as they are.
    """
    places = _places(images, images[0])
    if not places.any():
        return images
    middle = int(np.hypot(*(places - np.median(places, axis=0)).T).argmin())
    places = _places(images, images[middle])
    return np.stack([steadied(image, *place) for image, place in zip(images, places.tolist(), strict=True)])


def _places(images: NDArray[np.uint8], known: Image) -> NDArray[np.float64]:
    """Where each picture stands against a known one, (N, 2)."""
    plain, mean = np.ones(3, np.float32), known.astype(np.float32)
    return np.array([shift(image, mean, plain) for image in images])


_FARTHEST = 0.015  # of the height: how far a camera shakes
_LEAST_FARTHEST = 4  # pixels, the same in a small picture
_ROWS, _COLUMNS = 32, 40  # cells of the lattice
_LEAST_CELL = 4  # pixels, the same in a small picture
_STEEP = 6.0  # grey levels a pixel: less is no edge
_TILES = 6  # of the picture's height and of its width, in which edges vote
_LEAST_TILES = 9  # with edges, fewer may all belong to one thing
_RESTING = 0.25  # pixels: an edge that differs by less than this displacement would make it differ is at rest
_SURELY_AT_REST = 0.5  # of the edges, when the camera is
_PERHAPS_AT_REST = 0.2  # of the edges, by chance 0.1
_TRIFLE = 0.3  # pixels: less does no harm at any but the steepest edges
_AGREEING = 0.7  # of the tiles
_BETTER = 0.9  # of the difference, at most, is left by a displacement worth believing
_ROUNDS = 8  # of least squares
_SETTLED = 0.05  # pixels of a step that is the last
_TUKEY = 4.685 * 1.4826  # times the median difference: beyond, an edge is covered
_SHARPNESS = 0.1  # pixels: standard error up to which a direction is known
_FLATTER = 0.02  # of the other direction's squared slopes, below which there are no edges in a direction
_SOUGHT = 150  # edges that a search looks at
_SIDE = 9  # places from the middle of its lattice to each side


class _Edges(NamedTuple):
    """The steepest pixels of a model."""

    at: NDArray[np.int64]  # (N,) pixels into the flat picture
    slope: Single  # (2, N) grey levels a pixel, across and down
    level: Single  # (N,) of the model's green
    across: int  # the first so many were taken for their slope across, the others for that down
    tile: NDArray[np.int64]  # (N,) of the picture


class _View(NamedTuple):
    """A picture to be compared."""

    flat: NDArray[np.uint8]  # (H W 3,)
    width: int
    exposure: float
    reach: int  # pixels that an edge may be displaced by


def _edges(mean: Single, margin: int) -> _Edges:
    """The steepest pixel of each cell, once across and once down, from one row of each row of cells."""
    height, width = mean.shape[:2]
    step, cell = max(2, (height - 2 * margin) // _ROWS), max(_LEAST_CELL, (width - 2 * margin) // _COLUMNS)
    rows = np.arange(margin + step // 2, height - margin, step)
    columns = (width - 2 * margin) // cell
    above, here, below = (  # (R, w)
        np.ascontiguousarray(mean[rows[0] + k : rows[-1] + k + 1 : step, :, 1]) for k in (-1, 0, 1)
    )
    part = slice(margin, margin + columns * cell)
    right, left = (here[:, margin + k : part.stop + k] for k in (1, -1))
    slopes = [right - left, below[:, part] - above[:, part]]  # over two pixels
    begins = np.arange(len(rows) * columns) * cell
    steepest = [begins + np.abs(slope).reshape(-1, cell).argmax(axis=1) for slope in slopes]
    chosen = [
        spots[np.abs(slope.take(spots)) >= 2 * _STEEP] for slope, spots in zip(slopes, steepest, strict=True)
    ]
    spots = np.concatenate(chosen)  # (N,) into the rows' parts
    row, column = np.divmod(spots, columns * cell)
    tile = row * _TILES // len(rows) * _TILES + column * _TILES // (columns * cell)
    slope = np.stack([one.take(spots) for one in slopes]) * np.float32(0.5)  # (2, N)
    return _Edges(rows[row] * width + column + margin, slope, here[row, column + margin], len(chosen[0]), tile)


def _differences(view: _View, edges: _Edges, place: Vector) -> Single:
    """Picture at a displacement less model (N,), in grey levels of the model; bilinear."""
    left, top = math.floor(place[0]), math.floor(place[1])
    right, down = place[0] - left, place[1] - top
    first = 3 * (edges.at + top * view.width + left) + 1
    seen = np.zeros(len(first), np.float32)
    for weight, ahead in (
        ((1.0 - down) * (1.0 - right), 0),
        ((1.0 - down) * right, 3),
        (down * (1.0 - right), 3 * view.width),
        (down * right, 3 * view.width + 3),
    ):
        if weight:
            seen += np.float32(weight * view.exposure) * view.flat.take(first + ahead)
    return seen - edges.level


def _at_rest(edges: _Edges, differences: Single) -> float:
    """The share of edges that differ hardly, the less of those across and those down."""
    across, down = np.abs(edges.slope[0, : edges.across]), np.abs(edges.slope[1, edges.across :])
    resting = np.abs(differences) <= np.float32(_RESTING) * np.concatenate([across, down])
    kinds = [kind for kind in (resting[: edges.across], resting[edges.across :]) if len(kind) >= _LEAST_TILES]
    return min((float(kind.mean()) for kind in kinds), default=1.0)


def _descend(view: _View, edges: _Edges, place: Vector) -> Vector:
    """Iterate weighted least squares from a place; in a direction without edges, 0."""
    known = np.eye(2)
    for _ in range(_ROUNDS):
        differences = _differences(view, edges, place)
        middle = max(float(_median(np.abs(differences))), 1.0)
        weight = np.maximum(1.0 - np.square(differences / np.float32(_TUKEY * middle)), np.float32(0.0)) ** 2
        weighted = edges.slope * weight  # (2, N)
        squares, ways = np.linalg.eigh((weighted @ edges.slope.T).astype(np.float64))  # (2,), (2, 2)
        least = max(_FLATTER * squares[1], 1.0)
        gain = np.where(squares >= least, 1.0 / np.maximum(squares, least), 0.0)
        known = (ways * (squares >= max(least, (1.4826 * middle / _SHARPNESS) ** 2))) @ ways.T
        step = -(ways * gain) @ ways.T @ (weighted @ differences)
        step /= max(1.0, float(np.hypot(*step)))  # slopes say nothing of what is farther
        place = np.clip(place + step, -view.reach, view.reach)
        if np.hypot(*step) < _SETTLED:
            break
    return known @ place


def _search(view: _View, edges: _Edges) -> Vector:
    """The nearest place of a coarse lattice at which the edges differ about as little as anywhere on it."""
    every = max(1, len(edges.at) // _SOUGHT)
    at, slope, level = edges.at[::every], edges.slope[:, ::every], edges.level[::every]
    step = max(1, round(view.reach / _SIDE))
    ticks = np.arange(-(view.reach // step), view.reach // step + 1) * step
    places = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)  # (P, 2)
    distance = np.square(places).sum(axis=1)
    places = places[np.argsort(distance, kind="stable")[: np.count_nonzero(distance <= view.reach**2)]]
    first = 3 * (at + (places[:, 1:] * view.width + places[:, :1])) + 1  # (P, n)
    differences = np.abs(view.flat.take(first) * np.float32(view.exposure) - level)
    most = np.float32(2.0) * np.abs(slope).max(axis=0)  # (n,): what is covered costs the same anywhere
    costs = np.minimum(differences, most).mean(axis=1)  # (P,)
    least = costs.min()
    nearest = int((costs <= least + _ALIKE * (np.median(costs) - least)).argmax())
    return np.asarray(places[nearest], np.float64)


_ALIKE = 0.1  # of the way from the least to the usual cost: a repeated texture fits at several places


def _believed(edges: _Edges, unmoved: Single, moved: Single) -> bool:
    """Whether most tiles that say anything, and the edges altogether, differ less at a displacement than without.

    No edge counts for more than a pixel: of what is covered by moving things it is all one where it would be.
    """
    if _at_rest(edges, moved) < _PERHAPS_AT_REST:
        return False
    before, after = np.abs(unmoved), np.abs(moved)
    pixel = np.abs(edges.slope).max(axis=0)  # (N,)
    gained = np.bincount(edges.tile, np.minimum(before, pixel) - np.minimum(after, pixel))
    said = _SAYING * np.bincount(edges.tile, pixel)
    told = np.bincount(edges.tile) >= _VOTERS
    agreeing, against = (np.count_nonzero(told & (gain > said)) for gain in (gained, -gained))
    enough = agreeing >= max(_LEAST_TILES, _AGREEING * (agreeing + against))
    return bool(enough and _median(after) <= _BETTER * _median(before))


_VOTERS = 3  # edges of a tile that votes
_SAYING = 0.05  # pixels gained or lost on average by the edges of a tile that does not abstain


def _median(values: Single) -> np.float32:
    return np.float32(np.partition(values, len(values) // 2)[len(values) // 2])


def _cut(mask: Mask, height: int, width: int) -> Mask:
    """A mask cut to the picture, tight."""
    top, left = max(-mask.y, 0), max(-mask.x, 0)
    bits = mask.bits[top : max(height - mask.y, 0), left : max(width - mask.x, 0)]
    return mask if bits.shape == mask.bits.shape else Mask.of_image(bits, mask.y + top, mask.x + left)

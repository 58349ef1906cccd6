"""How much more each pixel looks like an object than like what is behind it: ln p_in / p_out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from perdure.maths import levelset, lie
from perdure.maths.flow import dense, global_motion
from perdure.maths.mixture import Mixture, fit, log_density, subsample
from perdure.trackers.contour.targets import Layer, Looks, Place
from perdure.types import Bits, Image, Mask

Single = NDArray[np.float32]
Float = NDArray[np.float64]
_ROWS = 300  # rows of the picture, about, in which the camera's motion is looked for
_SAMPLE, _STEPS, _FLOOR = 2000, 4, 4.0  # pixels a mixture is fitted to, steps of EM, least variance
_FEWEST = 40  # pixels whose flow tells of a motion
_OWN_SPREAD, _STILL_SPREAD = 8.0, 4.0  # by which colours differ at least from those remembered at their places


class Window(NamedTuple):
    """Cells of `step` x `step` pixels from x, y on, (h, w) of them; they may lie outside the picture."""

    x: int
    y: int
    step: int
    height: int
    width: int

    def cut(self, picture: NDArray[Any]) -> NDArray[Any]:
        """Return the cells (h, w, …) of a picture: means of their pixels, its border repeated outside."""
        x2, y2 = self.x + self.width * self.step, self.y + self.height * self.step
        rows, columns = picture.shape[:2]
        if self.x >= 0 and self.y >= 0 and x2 <= columns and y2 <= rows:
            part = picture[self.y : y2, self.x : x2]
        else:
            down = np.clip(np.arange(self.y, y2), 0, rows - 1)
            part = picture[down[:, None], np.clip(np.arange(self.x, x2), 0, columns - 1)]
        if self.step == 1:
            return np.ascontiguousarray(part)
        return cv2.resize(part, (self.width, self.height), interpolation=cv2.INTER_AREA)

    def inside(self, size: tuple[int, int]) -> Bits:
        """Return which cells (h, w) lie in a picture (height, width)."""
        rows, columns = self.y + np.arange(self.height) * self.step, self.x + np.arange(self.width) * self.step
        within = (rows >= 0) & (rows + self.step <= size[0])
        return np.asarray(within[:, None] & ((columns >= 0) & (columns + self.step <= size[1])))

    def to_cells(self) -> Float:
        """Return the motion (3, 3) from pixels to columns and rows of cells."""
        half = (self.step - 1) / 2
        one = 1 / self.step
        return np.array([[one, 0, -(self.x + half) * one], [0, one, -(self.y + half) * one], [0.0, 0, 1]])

    def drawn(self, shape: Float, pose: Float) -> Float:
        """Return the distances (h, w), in cells, of μ (…) at a pose."""
        about = np.eye(3)
        about[:2, 2] = -(shape.shape[1] - 1) / 2, -(shape.shape[0] - 1) / 2
        return levelset.carried(shape, self.to_cells() @ pose @ about, (self.height, self.width))


def window_round(shape: Float, pose: Float, ring: float, cells: int) -> Window:
    """Return the window that holds μ at a pose and a ring of pixels round it, in `cells` cells at most."""
    rows, columns = np.nonzero(shape < 0)
    corners = np.array(
        [[x, y] for x in (columns.min(), columns.max()) for y in (rows.min(), rows.max())], np.float64
    )
    there = lie.act(pose, corners - ((shape.shape[1] - 1) / 2, (shape.shape[0] - 1) / 2))
    x1, y1 = np.floor(there.min(axis=0) - ring).astype(int).tolist()
    x2, y2 = np.ceil(there.max(axis=0) + ring).astype(int).tolist()
    step = 1
    while (x2 - x1 + 1) * (y2 - y1 + 1) > cells * step * step:
        step *= 2
    return Window(x1, y1, step, -(-(y2 - y1 + 1) // step), -(-(x2 - x1 + 1) // step))


@dataclass(frozen=True)
class Weights:
    """What colours at their places count beside colours anywhere, what the first looks count, and the bound in nats."""

    place: float
    trust: float
    bound: float


def evidence(
    window: Window,
    colours: Single,
    looks: Looks,
    place: Place,
    outside: Bits,
    pose: Float | None,
    weights: Weights,
) -> Single:
    """Return ln p_in / p_out (h, w) of colours (h, w, 3), within ± bound.

    p_in is a mixture of colours anywhere in the object, and the colour that was seen at this place of it (if a pose is
    given); p_out one of colours round it, and the colour that was seen at this place of the picture when no object was
    there. `outside` (h, w) tells where the object surely is not.
    """
    own = np.logaddexp(
        log_density(looks.first_own, colours) + np.log(weights.trust + 1e-9),
        log_density(looks.last_own, colours) + np.log(1 - weights.trust + 1e-9),
    )
    other = np.logaddexp(
        log_density(looks.first_other, colours) + np.log(weights.trust * 0.5 + 1e-9),
        log_density(looks.last_other, colours) + np.log(1 - weights.trust * 0.5 + 1e-9),
    )
    known = window.cut(place.known.view(np.uint8)).astype(np.float32)
    away = np.square(colours - window.cut(place.colours).astype(np.float32)).sum(axis=2)
    other = _with_place(other, away, known * np.float32(weights.place), outside & (known > 0.5), _STILL_SPREAD)
    if pose is not None:
        there, held = _carried(looks.layer, window, pose)
        away = np.square(colours - there).sum(axis=2)
        own = _with_place(own, away, held * np.float32(weights.place), held > 0.7, _OWN_SPREAD)
    return np.asarray(np.clip(own - other, -weights.bound, weights.bound), np.float32)


def _with_place(anywhere: Single, away: Single, share: Single, sure: Bits, least: float) -> Single:
    """Logarithm of (1 - share) p + share N, N being a Gaussian about what was seen there, as wide as it is where that is sure."""
    squares = away[sure]
    spread = max(least**2, 1.5 * float(np.median(squares)) if squares.size else 0.0)
    there = -away / (2 * spread / 3) - 1.5 * np.log(2 * np.pi * spread / 3)
    with np.errstate(divide="ignore"):
        return np.asarray(
            np.logaddexp(anywhere + np.log(np.maximum(1 - share, 1e-3)), there + np.log(share)), np.float32
        )


def _carried(layer: Layer, window: Window, pose: Float) -> tuple[Single, Single]:
    """The object as it was seen, (h, w, 3), where it is now, and how well (h, w) that is known."""
    was = Window(layer.x, layer.y, layer.step, *layer.known.shape)
    there = window.to_cells() @ pose @ lie.inverse(layer.pose) @ lie.inverse(was.to_cells())
    size = (window.width, window.height)
    colours = cv2.warpAffine(layer.colours, there[:2], size, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(colours, np.float32), np.asarray(cv2.warpAffine(layer.known, there[:2], size), np.float32)


def learnt_layer(
    layer: Layer | None, window: Window, colours: Single, sure: Bits, pose: Float, rate: float
) -> Layer:
    """Return the object's picture with what is surely seen of it (h, w) taken up."""
    if layer is None:
        return Layer(window.x, window.y, window.step, colours, sure.astype(np.float32), pose)
    there, known = _carried(layer, window, pose)
    share = np.where(sure, np.where(known > 0.5, np.float32(rate), np.float32(1)), np.float32(0))
    mixed = there + share[..., None] * (colours - there)
    return Layer(window.x, window.y, window.step, mixed, np.maximum(known, share > 0).astype(np.float32), pose)


def fitted(points: Single, components: int, start: Mixture | None) -> Mixture:
    """Return a mixture of colours (N, 3)."""
    if not len(points):
        return start if start is not None else Mixture.empty(3)
    return fit(subsample(points, _SAMPLE), components, start=start, iterations=_STEPS, floor=_FLOOR)


# The place ------------------------------------------------------------------------------------------------------


def lab_of(image: Image) -> NDArray[np.uint8]:
    """Return the colours (H, W, 3) in Lab: distances are as seen, and light is one channel."""
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2LAB), np.uint8)


def small_grey(image: Image) -> tuple[NDArray[np.uint8], int]:
    """Return a small grey picture (h, w), and by how much it is smaller."""
    step = max(1, round(min(image.shape[:2]) / _ROWS))
    grey = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    if step > 1:
        grey = cv2.resize(grey, (grey.shape[1] // step, grey.shape[0] // step), interpolation=cv2.INTER_AREA)
    return np.asarray(grey, np.uint8), step


def moved_on(place: Place, grey: NDArray[np.uint8], step: int, things: Bits) -> tuple[Place, Float]:
    """Return the place as the camera now sees it, and its motion (2, 3), pixels; things (H, W) do not tell of it."""
    small = things[::step, ::step][: grey.shape[0], : grey.shape[1]]
    camera = global_motion(place.grey, grey, small if not small.all() else None)
    camera = camera.copy()
    camera[:, 2] *= step
    if np.array_equal(camera, np.eye(2, 3)):
        return Place(place.colours, place.known, place.covered, grey, step), camera
    size = (place.known.shape[1], place.known.shape[0])
    colours = cv2.warpAffine(place.colours, camera, size)
    known = cv2.warpAffine(place.known.view(np.uint8), camera, size, flags=cv2.INTER_NEAREST).astype(np.bool_)
    covered = cv2.warpAffine(place.covered.view(np.uint8), camera, size, flags=cv2.INTER_NEAREST).astype(np.bool_)
    return Place(np.asarray(colours, np.uint8), known, covered, grey, step), camera


def learnt_place(place: Place, colours: NDArray[np.uint8], things: Bits, covered: Bits, rate: float) -> Place:
    """Return the place with what is seen of it now, things (H, W) being before the rest; some are seen at `covered`."""
    free = ~things
    mixed = cv2.addWeighted(place.colours, 1 - rate, colours, rate, 0)
    fresh = free & ~place.known
    out = place.colours.copy()
    out[free] = mixed[free]
    out[fresh] = colours[fresh]
    return Place(out, place.known | free, place.covered | covered, place.grey, place.step)


def velocity_by_flow(
    before: NDArray[np.uint8],
    now: NDArray[np.uint8],
    seen: Mask,
    pose: Float,
    expected: Float,
    group: lie.Group,
    *,
    whole: bool,
) -> Float | None:
    """Return the velocity (D,) about the object's origin that its pixels have had between two grey pictures (H, W).

    By Tukey's biweight over what was seen of it; None where too little of that has a valid flow. Of a part alone (not `whole`) only a shift is believed.
    """
    grown = 24 + int(2 * np.abs(expected[:2]).max())
    x1, y1, x2, y2 = seen.box
    height, width = now.shape
    left, top, right, bottom = (
        max(x1 - grown, 0),
        max(y1 - grown, 0),
        min(x2 + grown, width),
        min(y2 + grown, height),
    )
    own = seen.to_image(height, width)[top:bottom, left:right].astype(np.uint8)
    inner = cv2.erode(own, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    one, other = now[top:bottom, left:right], before[top:bottom, left:right]
    back = dense(
        np.ascontiguousarray(one), np.ascontiguousarray(other), preset="medium", astray=1.5
    )  # on the frame before
    rows, columns = np.nonzero((np.asarray(inner) > 0) & back.valid)
    if len(rows) < _FEWEST:
        return None
    keep = slice(None, None, max(1, len(rows) // 1500))
    rows, columns = rows[keep], columns[keep]
    points = np.stack([columns + left, rows + top], axis=1) - pose[:2, 2]  # (N, 2) about the origin
    moved = -back.vectors[rows, columns].astype(np.float64)
    slopes = group.jacobian(points)  # (N, 2, D)
    velocity = np.zeros(group.dimension)
    velocity[:2] = np.median(moved, axis=0)
    ridge = np.diag([1e-9, 1e-9, *[0.2 * float((points**2).sum())] * (group.dimension - 2)])
    for _ in range(5):
        off = moved - slopes @ velocity
        size = np.hypot(*off.T)
        scale = max(4.685 * 1.4826 * float(np.median(size)) / np.sqrt(2), 0.5)
        weights = np.maximum(1 - (size / scale) ** 2, 0) ** 2
        normal = np.einsum("n,nid,nie->de", weights, slopes, slopes) + ridge
        right = np.einsum("n,nid,ni->d", weights, slopes, moved)
        free = group.dimension if whole else 2
        velocity[:free] = np.linalg.solve(normal[:free, :free], right[:free])
    return velocity

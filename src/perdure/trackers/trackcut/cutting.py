"""The energy of one object in its window, and its minimum (eq. 4, 5, 10-13)."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.maths.maxflow import Nodes, cut, nodes_of

Float = NDArray[np.float32]
_RING = 2  # cells along the window's sides that are background for certain
_NEVER = 1000.0  # what it costs to take them


class Observed(NamedTuple):
    """An observation as one object sees it."""

    cells: NDArray[np.bool_]  # (h, w) of the window
    ratio: float  # ln p / q of its mean (eq. 9)
    mean: Float  # (3,) its mean colour (eq. 1)


class Found(NamedTuple):
    """The minimum."""

    cells: NDArray[np.bool_]  # (h, w)
    matched: tuple[bool, ...]  # of the observations
    touches: bool  # whether the object comes up to the window's ring


def contrast(colours: Float, weight: float) -> tuple[Float, float]:
    """Return the costs (4, h, w) of neighbours that differ, and σ² (eq. 10, with σ² = 4 <|z_s - z_r|²>)."""
    from perdure.maths.kernels.differences import squared_differences

    height, width = colours.shape[:2]
    costs = np.empty((4, height, width), np.float32)
    total = squared_differences(np.ascontiguousarray(colours, np.float32), costs)  # of squares, so far
    count = 4 * height * width - 3 * (height + width) + 2
    sigma = max(4.0 * total / max(count, 1), 1e-3)
    np.exp(np.divide(costs, -np.float32(sigma), out=costs), out=costs)
    costs[:2] *= np.float32(weight)
    costs[2:] *= np.float32(weight / np.sqrt(2.0))
    return costs, sigma


def cut_out(
    unary: Float, costs: Float, sigma: float, colours: Float, observed: list[Observed], link: float, bound: float
) -> Found:
    """Return the object of least energy (eq. 12, 13).

    Parameters
    ----------
    unary : (h, w)
        Cost of being the object's less that of not being.
    costs, sigma
        As `contrast` returns them.
    colours : (h, w, 3)
        Colours.
    observed : list of Observed
        Each becomes a node, linked to its pixels (eq. 11).
    link : float
        λ2.
    bound : float
        Largest evidence of an observation for each of its pixels, nats.
    """
    data = unary.astype(np.float64)
    ringed = min(data.shape) > 2 * _RING
    if ringed:
        data[:_RING], data[-_RING:], data[:, :_RING], data[:, -_RING:] = (_NEVER,) * 4
    nodes: Nodes | None = None
    if observed:
        links: list[tuple[ArrayLike, ArrayLike]] = []
        for one in observed:
            places = np.flatnonzero(one.cells)
            off = colours.reshape(-1, 3)[places] - one.mean
            links.append((places, link * np.exp(-np.einsum("nc,nc->n", off, off) / sigma)))
        sizes = np.array([one.cells.sum() for one in observed], np.float64)
        ratios = np.clip([one.ratio for one in observed], -bound, bound)
        nodes = nodes_of(-ratios * sizes, links)
    best = cut(data, costs.astype(np.float64), nodes)
    near = _RING + 1
    sides = (best.labels[:near], best.labels[-near:], best.labels[:, :near], best.labels[:, -near:])
    touches = ringed and any(bool(side.any()) for side in sides)
    return Found(best.labels, tuple(bool(one) for one in best.node_labels), touches)


def touching(cells: NDArray[np.bool_], anchors: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the connected parts (h, w) of an object that meet its prediction or a matched observation."""
    count, part = cv2.connectedComponents(cells.view(np.uint8), connectivity=8)
    kept = np.zeros(count, np.bool_)
    kept[part[anchors]] = True
    kept[0] = False
    return np.asarray(kept[part], np.bool_)

"""The labelling of a picture by 0 and 1 that costs least, exactly: a minimum cut.

The energy of labels x is sum(unary * x) + sum over neighbours and links of weight * [labels differ], with weights ≥ 0. Its
minimum is the minimum cut of a graph (Greig, Porteous & Seheult 1989). Costs become whole numbers, `scale` to a unit; of
all labellings that cost least in these the one with the fewest 1s is returned, so that the result is unique.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise as pairs
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.errors import ParameterError

Float = NDArray[np.floating[Any]]
Bits = NDArray[np.bool_]

SCALE = 64.0
DIRECTIONS = ("E", "S", "SE", "SW")  # of an edge, in the order of pairwise weights
STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))  # rows, columns


class Nodes(NamedTuple):
    """Nodes besides the pixels, each linked to pixels of its choice: K nodes, L links in the order of the nodes."""

    unary: Float  # (K,), cost of label 1 less that of label 0
    ends: NDArray[np.integer[Any]]  # (K,), how many links the nodes up to each one have together
    pixels: NDArray[np.integer[Any]]  # (L,), flat places y * W + x
    weights: Float  # (L,), ≥ 0


class Cut(NamedTuple):
    """The labelling that costs least."""

    labels: Bits  # (H, W)
    node_labels: Bits  # (K,)
    energy: float  # of these labels, as rounded by the scale


def nodes_of(unary: ArrayLike, links: list[tuple[ArrayLike, ArrayLike]]) -> Nodes:
    """Return nodes from a pair (flat places, weights) for each.

    Examples
    --------
    >>> nodes_of([-1.0, 2.0], [([0, 1], [0.5, 0.5]), ([3], [1.0])]).ends.tolist()
    [2, 3]
    """
    pixels = [np.asarray(one, np.int64).reshape(-1) for one, _ in links]
    weights = [
        np.broadcast_to(np.asarray(one, np.float64), np.shape(places))
        for places, (_, one) in zip(pixels, links, strict=True)
    ]
    empty = [np.zeros(0)]
    return Nodes(
        np.asarray(unary, np.float64).reshape(-1),
        np.cumsum([len(one) for one in pixels]).astype(np.int64),
        np.concatenate([*pixels, np.zeros(0, np.int64)]),
        np.concatenate([*weights, *empty]),
    )


def cut(
    unary: Float,
    pairwise: Float,
    nodes: Nodes | None = None,
    *,
    domain: Bits | None = None,
    scale: float = SCALE,
    workspace: Workspace | None = None,
) -> Cut:
    """Return the labels of least energy; of several such labellings the one with the fewest 1s.

    Parameters
    ----------
    unary : (H, W) float
        Cost of label 1 less that of label 0. What must not be is a large cost, not an infinite one.
    pairwise : (4, H, W) or (2, H, W) float
        ≥ 0: what it costs if a pixel and its neighbour to the E, S, SE, SW (or E, S: four neighbours) differ. Weights
        of edges that leave the picture do not count.
    nodes : Nodes, optional
        Further nodes, linked to pixels.
    domain : (H, W) bool, optional
        The pixels that take part; the others get label 0 and cost nothing.
    scale : float
        Costs are rounded to 1 / scale.
    workspace : Workspace, optional
        Memory to be used again by cuts of the same size, and by `recut`. It never changes a result.

    Raises
    ------
    ParameterError
        If a weight is negative, not finite or too large for 32 bits at this scale, by name and place.

    Examples
    --------
    >>> unary = np.array([[-3.0, 1.0, 1.0, 4.0]])
    >>> cut(unary, np.full((2, 1, 4), 2.0)).labels.astype(int).tolist()
    [[1, 0, 0, 0]]
    """
    costs, weights = _float(unary), _float(pairwise)
    nodes = NO_NODES if nodes is None else nodes
    _check_shapes(costs, weights, nodes, domain, scale)
    workspace = Workspace() if workspace is None else workspace
    workspace.pose(costs, weights, nodes, domain, scale)
    return workspace.solved()


def recut(workspace: Workspace, change: Float | float, node_change: Float | float = 0.0) -> Cut:
    """Return the labels of least energy after a change of unaries; what flows already goes on flowing.

    Parameters
    ----------
    workspace : Workspace
        That of the cut before.
    change : (H, W) float, or float
        Added to the unaries of the cut before; rounded as they were.
    node_change : (K,) float, or float
        Added to the unaries of the nodes.
    """
    workspace.change(change, node_change)
    return workspace.solved()


def energy(
    labels: NDArray[Any],
    unary: Float,
    pairwise: Float,
    nodes: Nodes | None = None,
    node_labels: NDArray[Any] | None = None,
    *,
    domain: Bits | None = None,
) -> float:
    """Return what any labelling by 0 and 1 costs, in the caller's own numbers: the oracle of `cut`.

    Examples
    --------
    >>> energy(np.array([[1, 0]]), np.array([[-3.0, 1.0]]), np.full((2, 1, 2), 2.0))
    -1.0
    """
    inside = np.ones(np.shape(labels), np.bool_) if domain is None else domain
    ones = np.asarray(labels, np.bool_) & inside
    total = float(np.asarray(unary, np.float64)[ones].sum())
    for weights, step in zip(pairwise, STEPS, strict=False):
        here, there = neighbours(ones.shape, step)
        differ = (ones[here] != ones[there]) & inside[here] & inside[there]
        total += float(np.asarray(weights, np.float64)[here][differ].sum())
    if nodes is None or node_labels is None:
        return total
    chosen = np.asarray(node_labels, np.bool_)
    total += float(nodes.unary[chosen].sum())
    of = np.repeat(np.arange(len(nodes.ends)), np.diff(nodes.ends, prepend=0))
    differ = (chosen[of] != ones.reshape(-1)[nodes.pixels]) & inside.reshape(-1)[nodes.pixels]
    return total + float(nodes.weights[differ].sum())


def margins(
    unary: Float,
    pairwise: Float,
    nodes: Nodes | None = None,
    *,
    steps: Sequence[float] = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0),
    domain: Bits | None = None,
    scale: float = SCALE,
    workspace: Workspace | None = None,
) -> Float:
    """Return how sure each pixel's label is: the largest bias of all unaries at once under which it keeps it.

    A pixel whose own unary alone changes keeps its label at least as long. The labels of a rising bias are nested, so
    that each pixel changes once; every step is an in-place re-solve.

    Parameters
    ----------
    unary, pairwise, nodes, domain, scale, workspace
        As for `cut`.
    steps : sequence of float
        The biases that are tried, in the unit of the costs, rising from above 0.

    Returns
    -------
    (H, W) float64
        0 or one of `steps`; 0 outside the domain.

    Examples
    --------
    >>> margins(np.array([[-3.0, 1.0, 1.0, 4.0]]), np.zeros((2, 1, 4)), steps=(0.5, 2.0)).tolist()
    [[2.0, 0.5, 0.5, 2.0]]
    """
    if not all(low < high < np.inf for low, high in pairs((0.0, *steps))):
        raise ParameterError(f"steps = {tuple(steps)!r} must be finite and rise from above 0")
    workspace = Workspace() if workspace is None else workspace
    first = cut(unary, pairwise, nodes, domain=domain, scale=scale, workspace=workspace).labels
    sure = np.zeros(first.shape)
    bias = 0.0
    for sign, sought in ((1.0, first), (-1.0, ~first)):
        kept = sought if domain is None else sought & domain
        for step in steps:
            if not kept.any():
                break
            labels = recut(workspace, sign * step - bias).labels
            bias = sign * step
            kept = kept & (labels == first)
            sure[kept] = step
    return sure


def neighbours(shape: tuple[int, ...], step: tuple[int, int]) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return where the pixels are that have a neighbour a step away, and where these neighbours are."""
    (height, width), (down, across) = shape, step
    rows = slice(0, max(height - down, 0)), slice(down, height)
    if across >= 0:
        columns = slice(0, max(width - across, 0)), slice(across, width)
    else:
        columns = slice(-across, width), slice(0, max(width + across, 0))
    return (rows[0], columns[0]), (rows[1], columns[1])


NO_NODES = Nodes(np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))


class Workspace:
    """The memory of a cut: 58 bytes a pixel, used again by the next cut of the same size.

    What it holds after a cut is that cut's flow, from which `recut` goes on. One thread at a time may use it.
    """

    def __init__(self) -> None:
        self._graph: Any = None
        self._size = (0, 0, 0)  # height, width, directions
        self._room = (-1, -1)  # for nodes, for links
        self._tables: list[NDArray[np.int32]] = []  # of the links, as `ibfs.Graph` has them
        self._domain: Bits | None = None
        self._scale = SCALE
        self._nodes = 0
        self._ready = False  # whether it holds a cut that is solved
        self._constant = 0  # of the energy, in whole numbers
        self._marked = False  # whether the last cut had links

    @property
    def nbytes(self) -> int:
        """Return how many bytes are held."""
        return 0 if self._graph is None else sum(array.nbytes for array in self._graph)

    def pose(
        self,
        unary: NDArray[np.float64],
        pairwise: NDArray[np.float64],
        nodes: Nodes,
        domain: Bits | None,
        scale: float,
    ) -> None:
        """Make ready for a cut: write capacities and excesses."""
        from perdure.maths.kernels import capacities  # Numba, loaded where it is needed

        self._ready = False
        height, width = unary.shape
        self._reserve((height, width, 2 * len(pairwise)), len(nodes.unary), len(nodes.pixels))
        graph = self._graph
        below, good = capacities.fill(unary, pairwise, scale, graph.residual, graph.excess, width + 1)
        if not good:
            _refuse(unary, pairwise, domain, scale)
        self._scale, self._nodes = scale, len(nodes.unary)
        self._domain = None if domain is None else np.array(domain, order="C")
        self._join(nodes, width)
        if self._domain is not None:
            below -= capacities.forbid(self._domain, graph.residual, graph.excess, width + 1)
            self._forbid_links(nodes, self._domain)
        wholes = _wholes(nodes.unary, scale, "nodes.unary", signed=True)
        places = self._pixels + np.arange(len(wholes))
        graph.excess[self._pixels :] = 0
        graph.excess[places] = -wholes
        self._constant = int(below) + int(np.minimum(wholes, 0).sum())

    def change(self, change: Float | float, node_change: Float | float) -> None:
        """Change the unaries of the cut before."""
        from perdure.maths.kernels import capacities

        if not self._ready:
            raise ParameterError("workspace holds no cut that could be changed: it must be that of a cut before")
        height, width, _ = self._size
        added = _float(np.atleast_2d(np.asarray(change, np.float64)))
        if added.shape not in ((1, 1), (height, width)):
            raise ParameterError(f"change has the shape {added.shape}: it must be a number or ({height}, {width})")
        domain = np.zeros((0, 0), np.bool_) if self._domain is None else self._domain
        grown, good = capacities.shift(added, domain, self._scale, self._graph.excess, height, width)
        if not good:
            raise ParameterError(
                f"change has a value that is not finite or too large for 32 bits at scale {self._scale:g}"
            )
        wholes = _wholes(np.broadcast_to(node_change, (self._nodes,)), self._scale, "node_change", signed=True)
        mine = self._graph.excess[self._pixels : self._pixels + self._nodes]
        after = mine - wholes
        grown += int(np.maximum(mine, 0).sum() - np.maximum(after, 0).sum())
        mine[:] = after
        self._constant += grown

    def solved(self) -> Cut:
        """Push what flow there is, and read the labels."""
        from perdure.maths.kernels.ibfs import solve

        self._constant += int(solve(self._graph, self._pixels))
        self._ready = True
        height, width, _ = self._size
        row = width + 1
        key = self._graph.key
        labels = key[row + 1 : row + 1 + height * row].reshape(height, row)[:, :width] > 0
        return Cut(labels, key[self._pixels : self._pixels + self._nodes] > 0, self._constant / self._scale)

    @property
    def _pixels(self) -> int:
        height, width, _ = self._size
        return (height + 2) * (width + 1) + 2

    def _reserve(self, size: tuple[int, int, int], nodes: int, links: int) -> None:
        """Have arrays for a cut of this size, those there are if they are large enough."""
        if self._size == size and self._room[0] >= nodes and self._room[1] >= links:
            return
        from perdure.maths.kernels import ibfs

        self._size, self._room, self._marked = size, (nodes, links), False
        pixels, row = self._pixels, size[1] + 1
        every, words = pixels + nodes, pixels // 32 + 1 if links else 1
        whole = np.int32
        lists = np.cumsum([0, every, every // 2 + 1, every, ibfs.BUCKETS])
        tables = np.cumsum([0, links, links, nodes + 1, nodes, nodes, words, words, links + 1, links, links])
        turn = np.zeros(ibfs.PLACES, np.int64)
        turn[ibfs.QUEUE : ibfs.QUEUE + 2], turn[ibfs.SLOTS : ibfs.SLOTS + 2] = lists[:2], np.diff(lists)[:2]
        turn[ibfs.WORK], turn[ibfs.HEADS], turn[ibfs.LAST] = lists[2], lists[3], ibfs.BUCKETS - 1
        turn[ibfs.PIXEL : ibfs.VIA + 1] = tables[:-1]
        turn[ibfs.OFFSETS :] = 1, -1, row, -row, row + 1, -row - 1, row - 1, -row + 1
        self._graph = ibfs.Graph(
            residual=np.zeros(pixels * 8 + 2 * links, whole),
            excess=np.zeros(every, whole),
            key=np.zeros(every, whole),
            mark=np.zeros(every, np.uint8),
            open=np.zeros(pixels, np.uint16),
            chain=np.empty(every, whole),
            lists=np.empty(lists[-1], whole),
            turn=turn,
            links=np.zeros(tables[-1], whole),
        )
        self._graph.lists[lists[3] :] = -1
        self._tables = [self._graph.links[begin:end] for begin, end in pairs(tables)]

    def _join(self, nodes: Nodes, width: int) -> None:
        """Write the links, and which pixels have any."""
        from perdure.maths.kernels import capacities

        graph, count = self._graph, len(nodes.pixels)
        pixel, node, first, _, _, bits, ranks, begins, ways, _ = self._tables
        if self._marked:
            graph.mark[:] = 0
            self._marked = False
        first[0] = 0
        first[1 : len(nodes.ends) + 1] = nodes.ends
        first[len(nodes.ends) + 1 :] = count
        if not count:
            return
        places, ends = np.asarray(nodes.pixels, np.int64), np.asarray(nodes.ends, np.int64)
        weights, tables = np.asarray(nodes.weights, np.float64), (bits.view(np.uint32), ranks, begins, ways)
        self._marked = True
        if capacities.join(
            places,
            ends,
            weights,
            self._scale,
            self._pixels,
            width + 1,
            width,
            graph.residual,
            graph.mark,
            pixel,
            node,
            *tables,
        ):
            _wholes(weights, self._scale, "nodes.weights", signed=False)

    def _forbid_links(self, nodes: Nodes, domain: Bits) -> None:
        """Close the links to pixels outside the domain."""
        closed = np.flatnonzero(~domain.reshape(-1)[nodes.pixels])
        places = self._pixels * 8 + 2 * closed
        self._graph.residual[places] = self._graph.residual[places + 1] = 0


# What is refused --------------------------------------------------------------------------------------------


def _float(values: Any) -> NDArray[np.float64]:
    """Floats side by side in memory, of the one type for which kernels are compiled."""
    return np.ascontiguousarray(values, np.float64)


def _check_shapes(unary: Float, pairwise: Float, nodes: Nodes, domain: Bits | None, scale: float) -> None:
    if unary.ndim != 2 or pairwise.ndim != 3 or pairwise.shape[1:] != unary.shape or len(pairwise) not in (2, 4):
        raise ParameterError(
            f"pairwise has the shape {pairwise.shape} beside unary's {unary.shape}: they must be (2 or 4, H, W) and (H, W)"
        )
    if domain is not None and (domain.shape != unary.shape or domain.dtype != np.bool_):
        raise ParameterError(f"domain is {domain.dtype} {domain.shape}: it must be bool {unary.shape}")
    if not (np.isfinite(scale) and scale > 0):
        raise ParameterError(f"scale = {scale!r} is out of range: it must be a finite number above 0")
    count, ends = len(nodes.pixels), np.asarray(nodes.ends)
    if len(ends) != len(nodes.unary) or len(nodes.weights) != count or (ends[-1] if len(ends) else 0) != count:
        raise ParameterError(
            f"nodes has {len(nodes.unary)} unaries, {len(ends)} ends, {count} pixels and {len(nodes.weights)} weights: "
            "a unary and an end for each node, the last end the number of pixels and of weights"
        )
    if count and not (nodes.pixels.min() >= 0 and nodes.pixels.max() < unary.size):
        raise ParameterError(f"nodes.pixels must be flat places from 0 to {unary.size - 1}")
    if (np.diff(ends, prepend=0) < 0).any():
        raise ParameterError("nodes.ends must not fall")


def _refuse(unary: Float, pairwise: Float, domain: Bits | None, scale: float) -> None:
    """Say which weight cannot be; one outside the domain may be anything."""
    inside = np.ones(unary.shape, np.bool_) if domain is None else domain
    _wholes(np.where(inside, unary, 0.0), scale, "unary", signed=True)
    for weights, step, name in zip(pairwise, STEPS, DIRECTIONS, strict=False):
        here, there = neighbours(unary.shape, step)
        counted = np.zeros(unary.shape)
        counted[here] = np.where(inside[here] & inside[there], weights[here], 0.0)
        _wholes(counted, scale, f"pairwise ({name})", signed=False)


def _wholes(weights: Float, scale: float, name: str, *, signed: bool) -> NDArray[np.int64]:
    """Round weights to whole numbers; refuse one that cannot be, by name and place."""
    from perdure.maths.kernels.capacities import MOST

    weights = np.asarray(weights, np.float64)
    if not weights.size:
        return np.zeros(0, np.int64)
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = weights * scale
        wrong = ~(np.abs(scaled) <= MOST) if signed else ~((scaled >= 0) & (scaled <= MOST))
    if not wrong.any():
        return np.asarray(np.floor(scaled + 0.5), np.int64)
    place = tuple(int(one[0]) for one in np.nonzero(wrong))
    value = float(weights[place])
    where = f"{name}[{', '.join(map(str, place))}] = {value!r}"
    if not np.isfinite(value):
        raise ParameterError(f"{where}: it must be finite")
    if value < 0 and not signed:
        raise ParameterError(f"{where}: it must be ≥ 0")
    largest = MOST / np.abs(weights[np.isfinite(weights)]).max()
    raise ParameterError(
        f"{where} does not fit into 32 bits at scale {scale:g}: a scale up to {largest:.3g} would do"
    )

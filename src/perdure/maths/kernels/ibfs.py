"""Maximum flow on a grid with a few extra nodes, by incremental breadth-first search.

Goldberg, Hed, Kaplan, Tarjan & Werneck, "Maximum flows by incremental breadth-first search" (ESA 2011): two forests of
shortest paths, S from the nodes with an excess and T from those with a deficit, grow level by level in turn; where they
touch, flow is pushed from root to root, and nodes whose way to the root is full find another parent or a farther level.

Departures. (1) Orphans wait until a level is done: in between, a path that meets one looks for another parent of the
same level, as in Dinic's blocking flow, and what finds none is dead until then; then all of them are brought to their
new levels at once, each once, in the order of these. One by one they are most of the work where trees are deep. (2) A
root of S gives no more than its way bears, but T takes what comes and passes it on at the end of a level, all paths
together (compare EIBFS, ESA 2015); what finds no way on becomes a root of S. S alone decides when all is done; T
shortens ways and may be incomplete. (3) No arc is stored. A pixel's residual capacities to its neighbours lie side by
side, E W S N SE NW SW NE, so that the arc back from the neighbour in direction j is its j ^ 1; pixels beyond the border
are there, with no capacity. Which arcs are open, there and back, are 16 bits: most questions are about the neighbours'
levels and these. (4) Terminals are one number a node, its excess (> 0: from the source, < 0: to the sink). Pushing
along a path changes the excess of its ends, and what is left is an equivalent problem, so that excesses may be changed
between two solutions. (5) Before any search two passes over the pixels push what neighbours take: most of the flow.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from perdure.maths.kernels.compile import changed, kernel_for, lowest, part

Ints = NDArray[np.int32]
Int = Any  # a Python int or one of NumPy's: to Numba they are the same

int64 = np.int64
S, T = int64(0), int64(1)  # the sides
ROOT, LINK, NONE, DEAD = 8, 9, 10, 11  # how a node hangs; below 8: by its arc in that direction
CODE, FOREST, LINKED, LISTED = 15, 16, 64, 128  # bits of a mark; FOREST << side: is in that side's queue
FAR = 1 << 29  # added to a level that is not yet final
NEVER = 1 << 40
BUCKETS = 1024
MOST = 2**29 - 1  # that is gathered at a pixel
WEIGHT = 2  # of a node out of the forest beside one to be scanned
# Places in `turn`. First what changes, for both sides: + side.
LEVEL, HEAD, TAIL, NEXT, ORPHANS, EFFORT, HIGHEST, FILLED = 0, 2, 4, 6, 8, 10, 12, 13
# Where each side's queue begins in `lists` and how long it is; where the work list and the buckets begin; last bucket.
QUEUE, SLOTS, WORK, HEADS, LAST = 16, 18, 20, 21, 22
# Where the tables of the links begin in `links`; see `Graph`.
PIXEL, NODE, FIRST, CURRENT, HANGS, BITS, RANKS, BEGINS, WAYS, VIA = 24, 25, 26, 27, 28, 29, 30, 31, 32, 33
OFFSETS, PLACES = 40, 48  # from a pixel to its eight neighbours


class Graph(NamedTuple):
    """A flow problem and the forests: P pixels of the padded grid, K nodes, L links.

    Few arrays, because each of them is compiled into every part of the kernel.
    """

    residual: Ints  # (P * 8 + 2 * L,); then of each link: node to pixel, pixel to node
    excess: Ints  # (P + K,)
    key: Ints  # (P + K,): level in S, minus the level in T, 0 for neither
    mark: NDArray[np.uint8]  # (P + K,)
    open: NDArray[np.uint16]  # (P,): bit j: the arc in direction j has capacity left; bit 8 + j: the one back
    chain: Ints  # (P + K,): the next one in a list of orphans, or in a bucket
    # For each side nodes of the level to be scanned, from the left, and of the next level, from the right; nodes of a
    # path or of a level; the first node of each bucket, -1.
    lists: Ints
    turn: NDArray[np.int64]  # (PLACES,)
    # PIXEL, NODE of each link; FIRST link of each node, CURRENT arc before which no arc leads to a parent at the node's
    # level, the link by which it HANGS; BITS: which pixels have links, RANKS: how many of them come before each word;
    # of these pixels, where their links begin in WAYS, which has the links in their order; the link VIA which they hang.
    links: Ints


_KINDS = (np.int32, np.int32, np.int32, np.uint8, np.uint16, np.int32, np.int32, np.int64, np.int32)
_GRAPH = types.NamedTuple([changed(kind) for kind in _KINDS], Graph)


@kernel_for(_GRAPH, int)
def solve(graph: Graph, pixels: Int) -> Int:
    """Push all the flow there is; return how much. After it the S forest, key > 0, is the minimal source set.

    Changed: residuals, excesses, and all that describes the forests.
    """
    turn = graph.turn
    total = _swept(graph, pixels)
    sinks = _plant(graph, pixels)
    planted = False
    while turn[HEAD] < turn[TAIL]:
        there = turn[TAIL + 1] if planted else min(sinks, graph.key.shape[0] - sinks)
        side = 1 if there > 0 and turn[EFFORT + 1] + there < turn[EFFORT] + turn[TAIL] else 0
        if side == 1 and not planted:
            planted = True
            _gather(graph, sinks, pixels)
        while turn[HEAD + side] < turn[TAIL + side]:
            _scan(graph, side, pixels)
            total += _drained(graph, pixels)
            root = turn[LEVEL] + (1 if side == 0 else 0)
            for tree in range(2):
                top = turn[LEVEL + tree] + (1 if tree == side else 0)
                _settle(graph, tree, top, _detached(graph, tree, root, pixels), pixels)
        _advance(graph, side)
    return total


@part
def _swept(graph: Graph, pixels: Int) -> Int:
    """Push the excess of each pixel in turn to E, S, SE and SW, then from the last to the first to W, N, NW and NE.

    Most of the flow finds its way so; return how much arrives. An excess that finds no way may be anywhere.
    """
    residual, excess, turn = graph.residual, graph.excess, graph.turn
    total: Int = int64(0)
    for back in range(2):
        for place in range(pixels):
            v = pixels - 1 - place if back else place
            left = int64(excess[v])
            j = back
            while left > 0 and j < 8:
                u = v + turn[OFFSETS + j]
                before = int64(excess[u])
                flow = min(left, int64(residual[v * 8 + j]), MOST - before)
                if flow > 0:
                    residual[v * 8 + j] -= flow
                    residual[u * 8 + (j ^ 1)] += flow
                    excess[u] = before + flow
                    excess[v] = left - flow
                    left -= flow
                    total += min(flow, max(-before, 0))
                j += 2
    return total


@part
def _plant(graph: Graph, pixels: Int) -> Int:
    """Make every node with an excess or a deficit a root; list those of S, return how many T has. Note open arcs."""
    key, mark, turn = graph.key, graph.mark, graph.turn
    residual, low, row = graph.residual, graph.chain, turn[OFFSETS + 2]
    for v in range(pixels):
        way: Int = int64(0)
        for j in range(8):
            way |= int64(residual[v * 8 + j] > 0) << j
        low[v] = way
    for v in range(row + 1, pixels - row - 1):
        graph.open[v] = (
            low[v]
            | ((low[v + 1] >> 1 & 1) << 8)
            | ((low[v - 1] & 1) << 9)
            | ((low[v + row] >> 3 & 1) << 10)
            | ((low[v - row] >> 2 & 1) << 11)
            | ((low[v + row + 1] >> 5 & 1) << 12)
            | ((low[v - row - 1] >> 4 & 1) << 13)
            | ((low[v + row - 1] >> 7 & 1) << 14)
            | ((low[v - row + 1] >> 6 & 1) << 15)
        )
    sinks = 0
    for v in range(key.shape[0]):
        excess = graph.excess[v]
        key[v] = (1 if excess > 0 else 0) - (1 if excess < 0 else 0)
        mark[v] = (mark[v] & LINKED) | (ROOT if excess != 0 else NONE)
        sinks += 1 if excess < 0 else 0
    sources = 0
    for v in range(key.shape[0]):
        if key[v] > 0:
            mark[v] |= FOREST
            graph.lists[turn[QUEUE] + sources] = v
            sources += 1
    for side in range(2):
        turn[LEVEL + side], turn[HEAD + side], turn[TAIL + side], turn[NEXT + side] = 1, 0, 0, 0
        turn[ORPHANS + side], turn[EFFORT + side] = -1, 0
    turn[TAIL], turn[HIGHEST], turn[FILLED] = sources, 0, 0
    return sinks


@part
def _gather(graph: Graph, sinks: Int, pixels: Int) -> None:
    """List the roots of T; where S ends first nobody needs the list. If they are many, list their children instead.

    A node of S beside a root of T is left to S, which alone decides when all is done.
    """
    key, mark, turn = graph.key, graph.mark, graph.turn
    if 2 * sinks < key.shape[0]:
        for v in range(key.shape[0]):
            if key[v] == -1:
                mark[v] |= FOREST << 1
                graph.lists[turn[QUEUE + 1] + turn[TAIL + 1]] = v
                turn[TAIL + 1] += 1
        return
    for v in range(key.shape[0]):
        if key[v] == 0 and _nearest(graph, v, T, T, pixels) == 1:
            key[v] = -2
            _enqueue(graph, v, T, int64(2))
    _advance(graph, T)


@part
def _advance(graph: Graph, side: Int) -> None:
    """Turn to the next level of a side: what was listed from the right is now listed from the left."""
    lists, turn = graph.lists, graph.turn
    count = turn[NEXT + side]
    left, right = turn[QUEUE + side], turn[QUEUE + side] + turn[SLOTS + side] - 1
    for place in range(count):
        if left + place < right - place:
            lists[left + place], lists[right - place] = lists[right - place], lists[left + place]
    turn[LEVEL + side] += 1
    turn[HEAD + side], turn[TAIL + side], turn[NEXT + side] = 0, count, 0


@part
def _enqueue(graph: Graph, v: Int, side: Int, level: Int) -> None:
    """List a node of the level to be scanned, or of the next one; nodes of earlier levels are not listed.

    There is room for every node of S, and for half as many of T: one that is left out is not scanned by T.
    """
    turn, lists = graph.turn, graph.lists
    if level < turn[LEVEL + side] or graph.mark[v] & (FOREST << side):
        return
    begin, slots = turn[QUEUE + side], turn[SLOTS + side]
    if turn[TAIL + side] + turn[NEXT + side] == slots:
        if turn[HEAD + side] == 0:
            return
        for place in range(begin + turn[HEAD + side], begin + turn[TAIL + side]):
            lists[place - turn[HEAD + side]] = lists[place]
        turn[TAIL + side] -= turn[HEAD + side]
        turn[HEAD + side] = 0
    graph.mark[v] |= FOREST << side
    if level == turn[LEVEL + side]:
        lists[begin + turn[TAIL + side]] = v
        turn[TAIL + side] += 1
    else:
        turn[NEXT + side] += 1
        lists[begin + slots - turn[NEXT + side]] = v


# Growth -----------------------------------------------------------------------------------------------------


@part
def _scan(graph: Graph, side: Int, pixels: Int) -> None:
    """Scan all listed nodes of a side's level.

    A node of T that meets a dead one of S leaves it to S, which alone decides when all is done.
    """
    key, mark, turn = graph.key, graph.mark, graph.turn
    sign, top = 1 - 2 * side, turn[LEVEL + side]
    turn[EFFORT + side] += turn[TAIL + side]
    while turn[HEAD + side] < turn[TAIL + side]:
        v = int64(graph.lists[turn[QUEUE + side] + turn[HEAD + side]])
        turn[HEAD + side] += 1
        mark[v] &= 255 - (FOREST << side)
        if key[v] != sign * top:
            if key[v] == sign * (top + 1):
                _enqueue(graph, v, side, top + 1)
            continue
        met = _grown(graph, v, side, top + 1, pixels)
        link, end = int64(8), _end(graph, v, pixels)
        while True:
            if met != 0:
                j = lowest(met)
                met &= met - 1
            elif link < end:
                j = link
                link += 1
            else:
                break
            u, there, back = _arc(graph, v, j, pixels)
            if j >= 8 and (key[u] * sign > 0 or graph.residual[there if side == 0 else back] <= 0):
                continue
            if j >= 8 and key[u] == 0:
                key[u] = sign * (top + 1)
                _hang(graph, u, v, j, pixels)
                _enqueue(graph, u, side, top + 1)
                continue
            if not _augment(graph, v, j, u, side, pixels) and side == 0:
                break
    turn[HEAD + side], turn[TAIL + side] = 0, 0


@part
def _grown(graph: Graph, v: Int, side: Int, level: Int, pixels: Int) -> Int:
    """Let the free neighbours of a pixel hang by it; return the arcs to the other forest, as bits."""
    key, sign = graph.key, 1 - 2 * side
    if v >= pixels:
        return int64(0)
    free, other = int64(0), int64(0)
    for j in range(8):
        found = key[v + graph.turn[OFFSETS + j]] * sign
        free |= int64(found == 0) << j
        other |= int64(found < 0) << j
    way = int64(graph.open[v]) >> (8 * side)
    free &= way
    while free != 0:
        j = lowest(free)
        free &= free - 1
        u = v + graph.turn[OFFSETS + j]
        key[u] = sign * level
        graph.mark[u] = (graph.mark[u] & (255 - CODE)) | (j ^ 1)
        _enqueue(graph, u, side, level)
    return other & way & 255


@part
def _augment(graph: Graph, v: Int, j: Int, u: Int, side: Int, pixels: Int) -> Int:
    """Fill an arc between the forests, as far as roots of S can; tell whether it is full. T gets what comes later."""
    _, there, back = _arc(graph, v, j, pixels)
    ahead, behind = (there, back) if side == 0 else (back, there)
    giver, taker = (v, u) if side == 0 else (u, v)
    whole = int64(graph.residual[ahead])
    while whole > 0:
        flow = _borne(graph, giver, S, whole, pixels)
        if flow == 0:
            return False
        _push(graph, giver, S, flow, pixels)
        whole -= flow
        graph.residual[ahead] = whole
        turned = int64(graph.residual[behind])
        graph.residual[behind] = turned + flow
        if v < pixels and j < 8:
            if whole == 0:
                _shut(graph, v, u, j, side)
            if turned == 0:
                _opened(graph, v, u, j, 1 - side)
        graph.turn[FILLED] += _receive(graph, taker, flow)
    return True


@part
def _receive(graph: Graph, v: Int, flow: Int) -> Int:
    """Let flow arrive at a node of T, to be passed on by `_drained`; return how much of its deficit that fills."""
    excess = int64(graph.excess[v])
    graph.excess[v] = excess + flow
    if excess + flow >= 0 and (excess < 0 or (excess == 0 and (graph.mark[v] & CODE) != ROOT)):
        level = min(int64(-graph.key[v]), graph.turn[LAST])
        graph.chain[v] = graph.lists[graph.turn[HEADS] + level]
        graph.lists[graph.turn[HEADS] + level] = v
        graph.turn[HIGHEST] = max(graph.turn[HIGHEST], level)
    return min(flow, -excess) if excess < 0 else int64(0)


@part
def _drained(graph: Graph, pixels: Int) -> Int:
    """Pass on what arrived in T, from the farthest level to the roots; return how much of deficits it fills.

    What finds no way on stays where it is: a node that is dead, to be a root of S.
    """
    mark, residual, turn = graph.mark, graph.residual, graph.turn
    total = graph.turn[FILLED]
    graph.turn[FILLED] = 0
    level = turn[HIGHEST]
    turn[HIGHEST] = 0
    while level > 0:
        if graph.lists[turn[HEADS] + level] < 0:
            level -= 1
            continue
        v = _farthest(graph, level)
        left = int64(graph.excess[v])
        if (mark[v] & CODE) == ROOT:
            _detach(graph, v, T)
        while left > 0:
            code = int64(mark[v] & CODE)
            if code >= NONE:
                if _adopted(graph, v, T, pixels):
                    continue
                _detach(graph, v, T)
                mark[v] = (mark[v] & (255 - CODE)) | DEAD
                break
            up, back, there = _parent(graph, v, pixels)
            room, turned = int64(residual[there]), int64(residual[back])
            flow = min(left, room)
            residual[there], residual[back] = room - flow, turned + flow
            left -= flow
            total += _receive(graph, up, flow)
            if code < ROOT and turned == 0:
                _opened(graph, v, up, code, T)
            if flow == room:
                if code < ROOT:
                    _shut(graph, v, up, code, S)
                _detach(graph, v, T)
        graph.excess[v] = left
    return total


@part
def _farthest(graph: Graph, bucket: Int) -> Int:
    """Take a node out of a bucket; in the last one, which holds all that is farther, one of the farthest level."""
    lists, chain, key, head = graph.lists, graph.chain, graph.key, graph.turn[HEADS] + bucket
    v, before = int64(lists[head]), int64(-1)
    if bucket == graph.turn[LAST]:
        last, u = v, int64(chain[v])
        while u >= 0:
            if key[u] < key[v]:
                v, before = u, last
            last, u = u, int64(chain[u])
    if before < 0:
        lists[head] = chain[v]
    else:
        chain[before] = chain[v]
    return v


@part
def _borne(graph: Graph, end: Int, side: Int, most: Int, pixels: Int) -> Int:
    """Return how much of a flow the way from a node to its root bears; 0 if there is none, and the node is dead.

    Orphans on the way get another parent of the same level, or are dead: then the one before is an orphan.
    """
    mark, lists, path = graph.mark, graph.lists, graph.turn[WORK]
    v, least, depth = int64(end), int64(most), int64(0)
    whole = False
    while not whole:
        whole = True
        v, least, depth = int64(end), int64(most), int64(0)
        code = mark[v] & CODE
        while code != ROOT:
            if code < NONE:
                up, down, rise = _parent(graph, v, pixels)
                code = mark[up] & CODE
                if code != DEAD:
                    least = min(least, int64(graph.residual[down if side == 0 else rise]))
                    lists[path + depth] = v
                    depth += 1
                    v = up
                    continue
                _detach(graph, v, side)
            whole = False  # what was seen of the way is no longer all of it: once more from its end
            if _adopted(graph, v, side, pixels):
                code = mark[v] & CODE
                continue
            mark[v] = (mark[v] & (255 - CODE)) | DEAD
            if depth == 0:
                return int64(0)
            depth -= 1
            v = int64(lists[path + depth])
            _detach(graph, v, side)
            code = NONE
    excess = int64(graph.excess[v])
    return min(least, excess if side == 0 else -excess)


@part
def _push(graph: Graph, end: Int, side: Int, flow: Int, pixels: Int) -> None:
    """Push flow along the way to the root; where an arc is full now, or the root empty, there is an orphan."""
    residual = graph.residual
    v = int64(end)
    code = int64(graph.mark[v] & CODE)
    while code != ROOT:
        up, down, rise = _parent(graph, v, pixels)
        full, other = (down, rise) if side == 0 else (rise, down)
        left, turned = int64(residual[full]) - flow, int64(residual[other])
        residual[full] = left
        residual[other] = turned + flow
        if left == 0:
            if code < ROOT:
                _shut(graph, v, up, code, 1 - side)
            _detach(graph, v, side)
        if turned == 0 and code < ROOT:
            _opened(graph, v, up, code, side)
        v = up
        code = int64(graph.mark[v] & CODE)
    left = int64(graph.excess[v]) - (flow if side == 0 else -flow)
    graph.excess[v] = left
    if left == 0:
        _detach(graph, v, side)


@part
def _shut(graph: Graph, v: Int, u: Int, j: Int, way: Int) -> None:
    """Note that v's arc j to its neighbour u is full: there (0) or back (1)."""
    graph.open[v] &= 65535 - (1 << (j + 8 * way))
    graph.open[u] &= 65535 - (1 << ((j ^ 1) + 8 * (1 - way)))


@part
def _opened(graph: Graph, v: Int, u: Int, j: Int, way: Int) -> None:
    """Note that v's arc j to its neighbour u has capacity: there (0) or back (1)."""
    graph.open[v] |= 1 << (j + 8 * way)
    graph.open[u] |= 1 << ((j ^ 1) + 8 * (1 - way))


@part
def _adopted(graph: Graph, v: Int, side: Int, pixels: Int) -> Int:
    """Find an orphan another parent at the level before its own."""
    key, mark = graph.key, graph.mark
    wanted = key[v] - (1 - 2 * side)
    if wanted == 0:
        return False
    if v < pixels:
        some = int64(0)
        for j in range(8):
            some |= int64(key[v + graph.turn[OFFSETS + j]] == wanted) << j
        some &= int64(graph.open[v]) >> (8 * (1 - side))
        while some != 0:
            j = lowest(some)
            some &= some - 1
            if (mark[v + graph.turn[OFFSETS + j]] & CODE) != DEAD:
                mark[v] = (mark[v] & (255 - CODE)) | j
                return True
    for j in range(
        8 if v < pixels else int64(graph.links[graph.turn[CURRENT] + v - pixels]), _end(graph, v, pixels)
    ):
        u, there, back = _arc(graph, v, j, pixels)
        if key[u] == wanted and (mark[u] & CODE) != DEAD and graph.residual[back if side == 0 else there] > 0:
            _hang_by(graph, v, j, pixels)
            return True
    return False


@part
def _detach(graph: Graph, v: Int, side: Int) -> None:
    """Make a node an orphan."""
    mark = graph.mark[v]
    graph.mark[v] = (mark & (255 - CODE)) | NONE | LISTED
    if not mark & LISTED:
        graph.chain[v] = graph.turn[ORPHANS + side]
        graph.turn[ORPHANS + side] = v


# Adoption ---------------------------------------------------------------------------------------------------


@part
def _detached(graph: Graph, side: Int, root: Int, pixels: Int) -> Int:
    """Find parents at the same level for all orphans; return a list of those without, out of the forest, or -1.

    Those of T that hold an excess become roots of S at the level `root`, which is that of its border.
    """
    key, mark, turn = graph.key, graph.mark, graph.turn
    sign, lost = 1 - 2 * side, int64(-1)
    while turn[ORPHANS + side] >= 0:
        v = turn[ORPHANS + side]
        turn[ORPHANS + side] = graph.chain[v]
        mark[v] &= 255 - LISTED
        code = mark[v] & CODE
        if code < NONE or (code == NONE and _adopted(graph, v, side, pixels)):
            continue
        after = key[v] + sign
        graph.lists[turn[WORK] + v] = key[v] * sign
        if graph.excess[v] > 0:
            key[v] = root
            mark[v] = (mark[v] & (255 - CODE)) | ROOT
            if v >= pixels:
                graph.links[graph.turn[CURRENT] + v - pixels] = 8
            _enqueue(graph, v, S, root)
        else:
            key[v] = 0
            mark[v] = (mark[v] & (255 - CODE)) | NONE
            graph.chain[v], lost = lost, v
        turn[EFFORT + side] += WEIGHT
        if v < pixels:
            some = int64(0)
            for j in range(8):
                some |= int64(key[v + graph.turn[OFFSETS + j]] == after) << j
            while some != 0:
                j = lowest(some)
                some &= some - 1
                if (mark[v + graph.turn[OFFSETS + j]] & CODE) == (j ^ 1):
                    _detach(graph, v + graph.turn[OFFSETS + j], side)
        for j in range(8, _end(graph, v, pixels)):
            u, _, _ = _arc(graph, v, j, pixels)
            if key[u] == after and _hangs_by(graph, u, v, j, pixels):
                _detach(graph, u, side)
    return lost


@part
def _settle(graph: Graph, side: Int, top: Int, lost: Int, pixels: Int) -> None:
    """Bring the lost ones to their new levels, if these are not above `top`; lower levels first."""
    key, lists, chain, turn = graph.key, graph.lists, graph.chain, graph.turn
    sign, work, heads, far = 1 - 2 * side, turn[WORK], turn[HEADS], turn[LAST]
    if top == 1:
        return
    base, waiting = int64(2), 0
    v = int64(lost)
    while v >= 0:
        after = int64(chain[v])
        level = _nearest(graph, v, side, int64(lists[work + v]), pixels) + 1 if lists[work + v] < top else NEVER
        if level <= top:
            key[v] = sign * (FAR + level)
            place = min(level - base, far)
            chain[v] = lists[heads + place]
            lists[heads + place] = v
            waiting += 1
        v = after
    level, begin, end = base, int64(0), int64(0)
    while waiting > 0 or begin < end:
        if level - base == far:  # the last bucket holds all that is farther
            v = int64(lists[heads + far])
            lists[heads + far] = -1
            base = level
            while v >= 0:
                after = int64(chain[v])
                place = min(max(key[v] * sign - FAR - base, 0), far)
                chain[v] = lists[heads + place]
                lists[heads + place] = v
                v = after
        stop = end
        v = int64(lists[heads + level - base])
        lists[heads + level - base] = -1
        while v >= 0 or begin < stop:
            if v >= 0:
                settled = v
                v = int64(chain[v])
                waiting -= 1
                if key[settled] * sign != FAR + level:
                    continue
            else:
                settled = int64(lists[work + begin])
                begin += 1
            key[settled] = sign * level
            _enqueue(graph, settled, side, level)
            if level < top:
                end = _offered(graph, settled, side, level + 1, end, pixels)
        level += 1


@part
def _offered(graph: Graph, v: Int, side: Int, level: Int, end: Int, pixels: Int) -> Int:
    """Offer a level to all who could hang by a node and have none as low; append who takes it to `work`."""
    key, lists, work = graph.key, graph.lists, graph.turn[WORK]
    sign = 1 - 2 * side
    if v < pixels:
        some = int64(0)
        for j in range(8):
            found = key[v + graph.turn[OFFSETS + j]] * sign
            some |= int64((found == 0) | (found > FAR + level)) << j
        some &= (int64(graph.open[v]) >> (8 * side)) & 255
        while some != 0:
            j = lowest(some)
            some &= some - 1
            u = v + graph.turn[OFFSETS + j]
            key[u] = sign * (FAR + level)
            graph.mark[u] = (graph.mark[u] & (255 - CODE)) | (j ^ 1)
            lists[work + end] = u
            end += 1
    for j in range(8, _end(graph, v, pixels)):
        u, there, back = _arc(graph, v, j, pixels)
        found = key[u] * sign
        if (found == 0 or found > FAR + level) and graph.residual[there if side == 0 else back] > 0:
            key[u] = sign * (FAR + level)
            _hang(graph, u, v, j, pixels)
            lists[work + end] = u
            end += 1
    return end


@part
def _nearest(graph: Graph, v: Int, side: Int, least: Int, pixels: Int) -> Int:
    """Hang a free node by its neighbour of the lowest level; return that level, NEVER if there is none.

    None is below `least`.
    """
    key, sign = graph.key, 1 - 2 * side
    best = int64(NEVER)
    if v < pixels:
        way = int64(graph.open[v]) >> (8 * (1 - side))
        for j in range(8):
            level = int64(key[v + graph.turn[OFFSETS + j]] * sign)
            good = ((way >> j) & 1) != 0 and level > 0 and level < FAR
            best = min(best, level * 8 + j if good else int64(NEVER))
        if best < NEVER:
            graph.mark[v] = (graph.mark[v] & (255 - CODE)) | (best & 7)
            best >>= 3
    if best > least:
        end = _end(graph, v, pixels)
        by = end
        for j in range(8, end):
            u, there, back = _arc(graph, v, j, pixels)
            level = int64(key[u]) * sign
            if level > 0 and level < min(best, FAR) and graph.residual[back if side == 0 else there] > 0:
                best, by = level, j
        if by < end:
            _hang_by(graph, v, by, pixels)
            if v >= pixels:
                graph.links[graph.turn[CURRENT] + v - pixels] = 8
    return best


# Arcs -------------------------------------------------------------------------------------------------------


@part
def _rank(graph: Graph, pixel: Int) -> Int:
    """Return how many linked pixels come before a linked one."""
    left = np.uint64(np.uint32(graph.links[graph.turn[BITS] + (pixel >> 5)])) & (
        (np.uint64(1) << np.uint64(pixel & 31)) - np.uint64(1)
    )
    left = left - ((left >> np.uint64(1)) & np.uint64(0x55555555))
    left = (left & np.uint64(0x33333333)) + ((left >> np.uint64(2)) & np.uint64(0x33333333))
    left = (left + (left >> np.uint64(4))) & np.uint64(0x0F0F0F0F)
    left = ((left * np.uint64(0x01010101)) >> np.uint64(24)) & np.uint64(255)
    return int64(graph.links[graph.turn[RANKS] + (pixel >> 5)]) + int64(left)


@part
def _end(graph: Graph, v: Int, pixels: Int) -> Int:
    """Return the number after a node's last arc: 0 to 7 are those of the grid, then come its links."""
    if v >= pixels:
        return (
            8
            + int64(graph.links[graph.turn[FIRST] + v - pixels + 1])
            - int64(graph.links[graph.turn[FIRST] + v - pixels])
        )
    if not graph.mark[v] & LINKED:
        return int64(8)
    place = _rank(graph, v)
    return 8 + int64(graph.links[graph.turn[BEGINS] + place + 1]) - int64(graph.links[graph.turn[BEGINS] + place])


@part
def _link(graph: Graph, v: Int, j: Int, pixels: Int) -> Int:
    """Return the link that is a node's arc j."""
    if v >= pixels:
        return int64(graph.links[graph.turn[FIRST] + v - pixels]) + j - 8
    return int64(graph.links[graph.turn[WAYS] + graph.links[graph.turn[BEGINS] + _rank(graph, v)] + j - 8])


@part
def _arc(graph: Graph, v: Int, j: Int, pixels: Int) -> tuple[Int, Int, Int]:
    """Return the other end of an arc, and where its residual capacities stand: there and back."""
    if j < 8:
        u = v + graph.turn[OFFSETS + j]
        return u, v * 8 + j, u * 8 + (j ^ 1)
    link = _link(graph, v, j, pixels)
    place = pixels * 8 + 2 * link
    if v < pixels:
        return int64(graph.links[graph.turn[NODE] + link]), place + 1, place
    return int64(graph.links[graph.turn[PIXEL] + link]), place, place + 1


@part
def _parent(graph: Graph, v: Int, pixels: Int) -> tuple[Int, Int, Int]:
    """Return a node's parent, and where the capacities from it and to it stand."""
    code = int64(graph.mark[v] & CODE)
    if code < ROOT:
        u = v + graph.turn[OFFSETS + code]
        return u, u * 8 + (code ^ 1), v * 8 + code
    if v < pixels:
        link = int64(graph.links[graph.turn[VIA] + _rank(graph, v)])
        return int64(graph.links[graph.turn[NODE] + link]), pixels * 8 + 2 * link, pixels * 8 + 2 * link + 1
    link = int64(graph.links[graph.turn[HANGS] + v - pixels])
    return int64(graph.links[graph.turn[PIXEL] + link]), pixels * 8 + 2 * link + 1, pixels * 8 + 2 * link


@part
def _hang_by(graph: Graph, v: Int, j: Int, pixels: Int) -> None:
    """Make the other end of a node's link, its arc j, its parent."""
    graph.mark[v] = (graph.mark[v] & (255 - CODE)) | LINK
    if v < pixels:
        graph.links[graph.turn[VIA] + _rank(graph, v)] = _link(graph, v, j, pixels)
    else:
        graph.links[graph.turn[HANGS] + v - pixels] = _link(graph, v, j, pixels)
        graph.links[graph.turn[CURRENT] + v - pixels] = j


@part
def _hang(graph: Graph, u: Int, v: Int, j: Int, pixels: Int) -> None:
    """Make v the parent of u, the other end of its link, its arc j."""
    graph.mark[u] = (graph.mark[u] & (255 - CODE)) | LINK
    if v < pixels:
        graph.links[graph.turn[HANGS] + u - pixels] = _link(graph, v, j, pixels)
        graph.links[graph.turn[CURRENT] + u - pixels] = 8
    else:
        graph.links[graph.turn[VIA] + _rank(graph, u)] = _link(graph, v, j, pixels)


@part
def _hangs_by(graph: Graph, u: Int, v: Int, j: Int, pixels: Int) -> Int:
    """Tell whether u, the other end of v's link, its arc j, hangs by it."""
    if (graph.mark[u] & CODE) != LINK:
        return False
    link = (
        graph.links[graph.turn[HANGS] + u - pixels]
        if v < pixels
        else graph.links[graph.turn[VIA] + _rank(graph, u)]
    )
    return link == _link(graph, v, j, pixels)

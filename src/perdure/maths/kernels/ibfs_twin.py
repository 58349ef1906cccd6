"""The oracle of `ibfs.solve`: SciPy's maximum flow on the same graph, with arcs of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from perdure.maths.kernels.ibfs import Graph


def solve_twin(graph: Graph, pixels: int) -> int:
    """Return the flow of `ibfs.solve`, and write 1 into `key` where it has its S forest, 0 elsewhere; no more."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import breadth_first_order, maximum_flow

    from perdure.maths.kernels.ibfs import NODE, OFFSETS, PIXEL

    nodes, links = len(graph.excess), len(graph.residual) // 2 - pixels * 4
    grid = graph.residual[: pixels * 8].reshape(pixels, 8)
    tails, ways = np.nonzero(grid)
    there, back = graph.residual[pixels * 8 :].reshape(links, 2).T
    sources, sinks = np.flatnonzero(graph.excess > 0), np.flatnonzero(graph.excess < 0)
    source, sink = nodes, nodes + 1
    pixel, node = (graph.links[graph.turn[one] : graph.turn[one] + links] for one in (PIXEL, NODE))
    begin = np.concatenate([tails, node, pixel, np.full(len(sources), source), sinks])
    end = np.concatenate([tails + graph.turn[OFFSETS + ways], pixel, node, sources, np.full(len(sinks), sink)])
    capacity = np.concatenate([grid[tails, ways], there, back, graph.excess[sources], -graph.excess[sinks]])
    capacities = csr_array((capacity.astype(np.int32), (begin, end)), shape=(nodes + 2, nodes + 2))
    flow = maximum_flow(capacities, source, sink)
    left = csr_array(capacities - flow.flow)
    left.eliminate_zeros()
    reached = breadth_first_order(left, source, return_predecessors=False)
    graph.key[:] = 0
    graph.key[reached[reached < nodes]] = 1
    return int(flow.flow_value)

"""Minimum cuts by PyMaxflow; executed by the peers' own interpreter, which has no perdure.

    python cuts.py INSTANCE.npz

Reads a line for every turn from its standard input, solves the cut once and writes one JSON object: the milliseconds
of CPU time from arrays of weights to labels, the milliseconds of that for building, and the flow of the whole
capacities. A turn is the fastest of four: whole and floating capacities, in a new graph and in the memory of the turn
before. Edges are added in bulk, which is faster than `add_grid_edges`.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import maxflow
import numpy as np

EVERY = ((slice(None), slice(None, -1)), (slice(None, -1), slice(None)), (slice(None, -1), slice(None, -1)))
OTHER = ((slice(None), slice(1, None)), (slice(1, None), slice(None)), (slice(1, None), slice(1, None)))
SIDES = (*zip(EVERY, OTHER, strict=True), ((slice(None, -1), slice(1, None)), (slice(1, None), slice(None, -1))))


def main() -> None:
    with np.load(sys.argv[1]) as file:
        given = {name: file[name] for name in file.files}
    size = given["unary"].size + len(given["node_unary"]), 4 * given["unary"].size + len(given["weights"])
    graphs = maxflow.GraphInt(*size), maxflow.GraphFloat(*size)
    for _ in sys.stdin:
        told = [solved(given, graph, graph is graphs[0]) for graph in graphs]
        told += [solved(given, kind, kind is maxflow.GraphInt) for kind in (maxflow.GraphInt, maxflow.GraphFloat)]
        best = min(told, key=lambda one: one["ms"])
        print(json.dumps({"ms": best["ms"], "build": best["build"], "flow": int(told[0]["flow"])}), flush=True)


def solved(given: dict[str, Any], graph: Any, whole: bool) -> dict[str, float]:
    """Solve once, with whole capacities or with the costs as they are, in a graph or, by its type, in a new one."""
    begun = time.process_time()
    if isinstance(graph, type):
        size = given["unary"].size + len(given["node_unary"]), 4 * given["unary"].size + len(given["weights"])
        graph = graph(*size)
    else:
        graph.reset()
    unary, pairwise, node_unary, weights = (
        np.floor(given[name] * given["scale"] + 0.5).astype(np.int64) if whole else given[name]
        for name in ("unary", "pairwise", "node_unary", "weights")
    )
    height, width = unary.shape
    ids = graph.add_grid_nodes((height, width))
    for weight, (here, there) in zip(pairwise, SIDES, strict=False):
        flat = weight[here].ravel()
        graph.add_edges(ids[here].ravel(), ids[there].ravel(), flat, flat)
    graph.add_grid_tedges(ids, np.maximum(-unary, 0), np.maximum(unary, 0))
    if len(node_unary):
        graph.add_nodes(len(node_unary))
        for node, cost in enumerate(node_unary):
            graph.add_tedge(unary.size + node, max(-cost, 0), max(cost, 0))
        nodes = unary.size + np.repeat(np.arange(len(node_unary)), np.diff(given["ends"], prepend=0))
        graph.add_edges(nodes, given["pixels"], weights, weights)
    built = time.process_time()
    flow = graph.maxflow()
    graph.get_grid_segments(ids)
    ended = time.process_time()
    return {"ms": 1e3 * (ended - begun), "build": 1e3 * (built - begun), "flow": flow}


main()

"""Minimum cuts: the kernel against SciPy's maximum flow, cuts against every labelling, and small scenes."""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perdure.errors import ParameterError
from perdure.maths.kernels import capacities, ibfs
from perdure.maths.kernels.ibfs import Graph, solve
from perdure.maths.kernels.ibfs_twin import solve_twin
from perdure.maths.maxflow import Nodes, Workspace, cut, energy, margins, nodes_of, recut

SCALE_1 = 1.0  # whole weights are exact then


def problem(seed: int, *, largest: int = 8) -> tuple[np.ndarray, np.ndarray, Nodes, np.ndarray | None]:
    """A random cut: sparse or full terminals, weak or strong edges, 0 to 3 nodes, sometimes a domain; whole numbers."""
    rng = np.random.default_rng(seed)
    height, width = rng.integers(1, largest + 1, 2)
    if rng.random() < 0.2:
        height, width = 1, int(rng.integers(1, 40))  # a line: the longest paths there are
    some = rng.random((height, width)) < rng.choice([0.0, 0.1, 0.5, 1.0])
    unary = rng.integers(-9, 10, (height, width)) * some.astype(float)
    pairwise = rng.integers(0, rng.choice([1, 2, 5, 12]), (rng.choice([2, 4]), height, width)).astype(float)
    count = int(rng.integers(0, 4))
    linked = [np.flatnonzero(rng.random(height * width) < 0.4) for _ in range(count)]
    weights = [rng.integers(0, 6, len(one)).astype(float) for one in linked]
    nodes = nodes_of(rng.integers(-30, 31, count).astype(float), list(zip(linked, weights, strict=True)))
    domain = None if rng.random() < 0.6 else rng.random((height, width)) < 0.8
    return unary, pairwise, nodes, domain


def posed(seed: int, **options: int) -> tuple[Workspace, Graph, int]:
    """A workspace with a random cut before it is solved, its graph, and how many pixels that has."""
    unary, pairwise, nodes, domain = problem(seed, **options)
    workspace = Workspace()
    workspace.pose(unary, pairwise, nodes, domain, SCALE_1)
    return workspace, workspace._graph, workspace._pixels


def copied(graph: Graph) -> Graph:
    return Graph(*(array.copy() for array in graph))


def assert_same_flow_and_source_set(graph: Graph, pixels: int) -> None:
    theirs = copied(graph)
    before = copied(graph)
    flow = solve(graph, pixels)
    assert flow == solve_twin(theirs, pixels)
    np.testing.assert_array_equal(graph.key > 0, theirs.key > 0)
    assert_is_a_flow(before, graph, pixels, flow)


def assert_is_a_flow(before: Graph, after: Graph, pixels: int, flow: int) -> None:
    """No capacity is below 0, and what leaves a node that had an excess arrives at one that had a deficit, or stays on the way."""
    assert (after.residual >= 0).all()
    assert np.minimum(after.excess, 0).sum() - np.minimum(before.excess, 0).sum() == flow
    grid = (before.residual - after.residual)[: pixels * 8].reshape(pixels, 8).sum(axis=1)
    links = (before.residual - after.residual)[pixels * 8 :].reshape(-1, 2)
    net = np.concatenate([grid, np.zeros(len(after.excess) - pixels, grid.dtype)])
    for place, sent in ((ibfs.PIXEL, links[:, 1]), (ibfs.NODE, links[:, 0])):
        np.add.at(net, after.links[after.turn[place] :][: len(sent)], sent)
    np.testing.assert_array_equal(net, before.excess - after.excess)


# The kernel against its twin --------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1))
def test_the_kernel_finds_the_flow_and_the_source_set_that_scipy_finds(seed: int):
    _, graph, pixels = posed(seed)
    assert_same_flow_and_source_set(graph, pixels)


def test_it_does_so_on_two_thousand_small_graphs():
    for seed in range(2000):
        _, graph, pixels = posed(seed)
        assert_same_flow_and_source_set(graph, pixels)


@pytest.mark.slow
def test_it_does_so_on_many_larger_graphs():
    for seed in range(20_000):
        _, graph, pixels = posed(seed + 10_000, largest=24)
        assert_same_flow_and_source_set(graph, pixels)


def test_levels_beyond_the_buckets_are_sorted_in_rounds():
    """With three buckets instead of a thousand, nearly every level is beyond them."""
    for seed in range(300):
        _, graph, pixels = posed(seed)
        graph.turn[ibfs.LAST] = 2
        assert_same_flow_and_source_set(graph, pixels)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (3, 3)])
def test_nothing_flows_where_there_is_no_source_no_sink_or_no_edge(shape: tuple[int, int]):
    nothing, free = np.zeros(shape), np.zeros((4, *shape))
    for unary, pairwise in ((nothing, free + 3), (nothing - 5, free + 3), (nothing + 5, free + 3)):
        found = cut(unary, pairwise)
        assert (found.labels == (unary < 0)).all()
        assert found.energy == np.minimum(unary, 0).sum()
    rng = np.random.default_rng(0)
    apart = rng.integers(-3, 4, shape).astype(float)
    assert (cut(apart, free).labels == (apart < 0)).all()


def test_the_largest_costs_there_may_be_gather_nowhere_beyond_32_bits():
    largest = float(capacities.MOST)
    costs = np.full((6, 6), -largest)
    costs[2:4, 2:4] = largest
    found = cut(costs, np.full((4, 6, 6), largest), scale=SCALE_1)
    assert found.energy == (4 - 32) * largest
    assert found.labels.all()


def test_an_edge_is_filled_to_the_last_unit():
    row = np.array([[-7.0, 0.0, 0.0, 9.0]])
    weights = np.zeros((2, 1, 4))
    weights[0, 0, :3] = 5, 3, 4
    found = cut(row, weights, scale=SCALE_1)
    assert found.energy == -7 + 3
    assert found.labels.tolist() == [[True, True, False, False]]
    tie = cut(np.array([[-3.0, 0.0, 0.0, 9.0]]), weights, scale=SCALE_1)
    assert not tie.labels.any()  # 1s at the ends of the full edge cost the same; the fewest are none


# Cuts against every labelling ------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_a_cut_is_the_least_of_all_labellings_and_of_these_the_one_with_the_fewest_ones(seed: int):
    unary, pairwise, nodes, domain = problem(seed, largest=3)
    unary, pairwise = unary[:, :9], pairwise[:, :, :9]
    nodes = nodes if unary.size == problem(seed, largest=3)[0].size else nodes_of([], [])
    found = cut(unary, pairwise, nodes, domain=None if domain is None else domain[:, :9], scale=SCALE_1)
    inside = None if domain is None else domain[:, :9]
    count, more = unary.size, len(nodes.unary)
    least, fewest = np.inf, count + more
    for choice in itertools.product([0, 1], repeat=count + more):
        labels = np.array(choice[:count], bool).reshape(unary.shape)
        if inside is not None and (labels & ~inside).any():
            continue
        cost = energy(labels, unary, pairwise, nodes, choice[count:], domain=inside)
        if (cost, sum(choice)) < (least, fewest):
            least, fewest = cost, sum(choice)
    assert found.energy == least == energy(found.labels, unary, pairwise, nodes, found.node_labels, domain=inside)
    assert found.labels.sum() + found.node_labels.sum() == fewest


def test_a_node_carries_far_pixels_along():
    """Two pixels far apart, one sure of its label, both linked to a node as an observation links its pixels."""
    unary = np.array([[-9.0, 2.0, 2.0, 2.0, 1.0]])
    alone = cut(unary, np.zeros((2, 1, 5)))
    linked = cut(unary, np.zeros((2, 1, 5)), nodes_of([0.5], [([0, 4], 3.0)]))
    assert alone.labels.astype(int).tolist() == [[1, 0, 0, 0, 0]]
    assert linked.labels.astype(int).tolist() == [[1, 0, 0, 0, 1]]
    assert linked.node_labels.tolist() == [True]


def test_costs_are_rounded_to_the_scale():
    found = cut(np.array([[-1.26, 0.9]]), np.full((2, 1, 2), 0.24), scale=4)
    assert found.energy == -1.25 + 0.25
    assert found.labels.tolist() == [[True, False]]


def test_pixels_outside_the_domain_part_those_inside():
    unary = np.array([[-5.0, 1.0, 1.0]])
    strong = np.full((2, 1, 3), 50.0)
    assert cut(unary, strong).labels.all()
    domain = np.array([[True, False, True]])
    assert cut(unary, strong, domain=domain).labels.tolist() == [[True, False, False]]


# Once more -------------------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1))
def test_a_solution_after_a_change_is_that_of_the_changed_problem(seed: int):
    unary, pairwise, nodes, domain = problem(seed)
    rng = np.random.default_rng(seed)
    workspace = Workspace()
    cut(unary, pairwise, nodes, domain=domain, scale=SCALE_1, workspace=workspace)
    for change in (rng.integers(-5, 6, unary.shape).astype(float), float(rng.integers(-3, 4))):
        node_change = rng.integers(-5, 6, len(nodes.unary)).astype(float)
        unary, nodes = unary + change, nodes._replace(unary=nodes.unary + node_change)
        again = recut(workspace, change, node_change)
        fresh = cut(unary, pairwise, nodes, domain=domain, scale=SCALE_1)
        np.testing.assert_array_equal(again.labels, fresh.labels)
        np.testing.assert_array_equal(again.node_labels, fresh.node_labels)
        assert again.energy == fresh.energy


def test_a_workspace_never_changes_a_result():
    workspace = Workspace()
    for seed in range(300):
        unary, pairwise, nodes, domain = problem(seed % 150, largest=3)  # few sizes: memory is used again
        fresh = cut(unary, pairwise, nodes, domain=domain)
        again = cut(unary, pairwise, nodes, domain=domain, workspace=workspace)
        np.testing.assert_array_equal(fresh.labels, again.labels)
        np.testing.assert_array_equal(fresh.node_labels, again.node_labels)
        assert fresh.energy == again.energy


def test_two_threads_find_what_one_finds():
    rng = np.random.default_rng(1)
    problems = [(rng.normal(0, 4, (60, 80)), rng.random((4, 60, 80)) * 3) for _ in range(8)]
    alone = [cut(*one) for one in problems]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda one: cut(*one), problems))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.labels, other.labels)
        assert one.energy == other.energy


def test_the_memory_is_at_most_sixty_bytes_a_pixel():
    workspace = Workspace()
    shape = (240, 320)
    pixels = np.arange(5000)
    cut(np.ones(shape), np.ones((4, *shape)), workspace=workspace)
    assert workspace.nbytes <= 60 * 240 * 320
    assert ibfs.BUCKETS * 4 < 60 * 100  # what does not grow with the picture
    cut(np.ones(shape), np.ones((4, *shape)), nodes_of([1.0], [(pixels, 1.0)]), workspace=workspace)
    assert workspace.nbytes <= 60 * 240 * 320 + 32 * len(pixels)


# How sure --------------------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_a_pixel_keeps_its_label_under_a_bias_up_to_its_margin_and_not_beyond(seed: int):
    unary, pairwise, nodes, domain = problem(seed, largest=5)
    steps = (1.0, 2.0, 4.0, 8.0)
    sure = margins(unary, pairwise, nodes, steps=steps, domain=domain, scale=SCALE_1)
    first = cut(unary, pairwise, nodes, domain=domain, scale=SCALE_1).labels
    expected = np.zeros(unary.shape)
    kept = np.ones(unary.shape, bool) if domain is None else domain
    for step in steps:
        more, less = (
            cut(unary + bias, pairwise, nodes, domain=domain, scale=SCALE_1).labels for bias in (step, -step)
        )
        kept = kept & np.where(first, more, ~less)
        expected[kept] = step
    np.testing.assert_array_equal(sure, expected)


def test_a_margin_is_at_most_what_the_pixel_alone_bears():
    rng = np.random.default_rng(4)
    unary, pairwise = rng.integers(-6, 7, (4, 5)).astype(float), rng.integers(0, 4, (4, 4, 5)).astype(float)
    sure = margins(unary, pairwise, steps=(1.0, 2.0, 4.0), scale=SCALE_1)
    first = cut(unary, pairwise, scale=SCALE_1).labels
    for place in np.ndindex(unary.shape):
        alone = unary.copy()
        alone[place] += sure[place] if first[place] else -sure[place]
        assert cut(alone, pairwise, scale=SCALE_1).labels[place] == first[place]


# What is refused -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unary", "weight", "message"),
    [
        (np.nan, 1.0, r"unary\[1, 2\] = nan: it must be finite"),
        (-np.inf, 1.0, r"unary\[1, 2\] = -inf: it must be finite"),
        (1e9, 1.0, r"unary\[1, 2\] = 1000000000.0 does not fit into 32 bits at scale 64: a scale up to 0.537"),
        (0.0, -0.5, r"pairwise \(SW\)\[1, 2\] = -0.5: it must be ≥ 0"),
        (0.0, np.nan, r"pairwise \(SW\)\[1, 2\] = nan: it must be finite"),
    ],
)
def test_a_weight_that_cannot_be_is_refused_by_name_and_place(unary: float, weight: float, message: str):
    costs, weights = np.zeros((3, 4)), np.ones((4, 3, 4))
    costs[1, 2], weights[3, 1, 2] = unary, weight
    with pytest.raises(ParameterError, match=message):
        cut(costs, weights)
    domain = np.ones((3, 4), bool)
    domain[1, 2] = False
    assert not cut(costs, weights, domain=domain).labels.any()  # outside the domain it may be anything


def test_a_weight_of_an_edge_that_leaves_the_picture_does_not_count():
    weights = np.zeros((4, 2, 2))
    weights[0, :, 1] = weights[1, 1] = weights[2, 1] = weights[3, :, 0] = np.nan
    assert cut(np.array([[-1.0, 1.0], [1.0, 1.0]]), weights).labels.sum() == 1


def test_other_mistakes_are_named():
    costs, weights = np.zeros((3, 4)), np.ones((4, 3, 4))
    with pytest.raises(ParameterError, match=r"they must be \(2 or 4, H, W\)"):
        cut(costs, weights[:3])
    with pytest.raises(ParameterError, match=r"domain is float64 \(3, 4\): it must be bool"):
        cut(costs, weights, domain=np.ones((3, 4)))
    with pytest.raises(ParameterError, match="scale = 0 is out of range"):
        cut(costs, weights, scale=0)
    with pytest.raises(ParameterError, match=r"nodes.weights\[1\] = -1.0: it must be ≥ 0"):
        cut(costs, weights, nodes_of([0.0], [([0, 1], [1.0, -1.0])]))
    with pytest.raises(ParameterError, match=r"nodes.unary\[0\] = nan: it must be finite"):
        cut(costs, weights, nodes_of([np.nan], [([0], 1.0)]))
    with pytest.raises(ParameterError, match="flat places from 0 to 11"):
        cut(costs, weights, nodes_of([0.0], [([12], 1.0)]))
    with pytest.raises(ParameterError, match="nodes has 1 unaries, 1 ends, 1 pixels and 1 weights"):
        cut(costs, weights, nodes_of([0.0], [([2], 1.0)])._replace(ends=np.array([3])))
    with pytest.raises(ParameterError, match=r"steps = .* rise from above 0"):
        margins(costs, weights, steps=(2.0, 1.0))
    with pytest.raises(ParameterError, match="workspace holds no cut"):
        recut(Workspace(), 1.0)
    workspace = Workspace()
    cut(costs, weights, workspace=workspace)
    with pytest.raises(ParameterError, match=r"change has the shape \(2, 4\)"):
        recut(workspace, np.zeros((2, 4)))
    with pytest.raises(ParameterError, match="change has a value that is not finite or too large"):
        recut(workspace, np.inf)
    assert not recut(workspace, 0.0).labels.any()  # nothing was written
    with pytest.raises(ParameterError, match="it must be finite"):
        cut(costs + np.nan, weights, workspace=workspace)
    with pytest.raises(ParameterError, match="workspace holds no cut"):
        recut(workspace, 0.0)  # what the refused one had begun to write is no cut

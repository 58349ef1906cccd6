"""The bench of minimum cuts: the cuts it poses, what it tells of them, the section it writes."""

from __future__ import annotations

import cut_instances
import maxflow as bench
import numpy as np
import peers
import pytest

from perdure.errors import ParameterError
from perdure.maths.maxflow import Workspace, nodes_of

PYTHON = peers.ENVIRONMENT / "bin" / "python"


def world(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A picture with a reddish block on green ground, and the block."""
    rng = np.random.default_rng(seed)
    mask = np.zeros((40, 60), np.bool_)
    mask[12:30, 20:38] = True
    colours = np.where(mask[..., None], (60.0, 80.0, 190.0), (70.0, 150.0, 90.0))
    return colours + rng.normal(0, 12, (40, 60, 3)), mask


def posed(kind: str, nodes: int = 1) -> cut_instances.Instance:
    size = (30, 30) if kind == "region" else (0, 0)
    before, mask = world(1)
    return cut_instances.posed(cut_instances.Case("drawn", 3, kind, *size, nodes), before, world(2)[0], mask)


@pytest.mark.parametrize("kind", bench.KINDS)
def test_the_cut_that_is_posed_finds_the_object(kind: str):
    given = posed(kind)
    workspace = Workspace()
    bench.solve_here(given, nodes_of(given.node_unary, list(given.node_links)), workspace)
    found = workspace.solved()
    block = world(1)[1]
    if kind == "region":
        block = block[cut_instances.window(cut_instances.Case("drawn", 3, kind, 30, 30, 1), block)]
    assert (found.labels == block).mean() > 0.99
    assert found.node_labels.all()
    assert given.size == ("30x30" if kind == "region" else "60x40")


def test_every_case_is_there_and_has_at_most_seven_nodes():
    assert len(cut_instances.CASES) >= 20
    assert {one.nodes for one in cut_instances.CASES} >= {0, 1, 7}
    assert {one.kind for one in cut_instances.CASES} == set(bench.KINDS)


def test_films_that_are_not_there_are_left_out(tmp_path):
    assert list(cut_instances.instances(tmp_path)) == []


@pytest.mark.skipif(not PYTHON.exists(), reason="no environment of the peers; python bench/peers.py makes it")
@pytest.mark.parametrize("nodes", [0, 1])
def test_both_sides_find_the_same_flow(nodes: int):
    if peers.library_versions(PYTHON).get("PyMaxflow") is None:
        pytest.skip("the peers' environment has no PyMaxflow yet; remove it and run bench/peers.py")
    line = bench.race(posed("region", nodes), PYTHON, rounds=1)
    assert line.equal
    assert line.ratio > 0
    assert line.nodes == nodes


def a_line(kind: str, ours: float, peer: float) -> bench.Line:
    return bench.Line("film 3", kind, "60x40", 2, 0.1, ours, 0.2, peer, True, 58.25, 0.012)


def test_tables_tell_every_instance_and_the_median_of_each_kind():
    lines = [a_line("region", 1.0, 4.0), a_line("region", 1.0, 6.0), a_line("border", 2.0, 3.0)]
    assert bench.table_of(lines).rows[0][3:] == [
        "2", "0.10", "1.00", "0.20", "4.00", "4.00", "yes", "58.2", "1.2%",
    ]  # fmt: skip
    assert bench.summary(lines).rows == [
        ["regions", "2", "5.00", "4.00", "6.00"],
        ["whole frames anchored at their border", "1", "1.50", "1.50", "1.50"],
    ]


def test_the_section_is_put_at_the_end_and_then_replaced_in_place():
    first = bench.replaced("# Benchmarks\n\nText.\n", "old")
    assert first == f"# Benchmarks\n\nText.\n\n{bench.HEADING}\n\n{bench.BEGIN}\nold\n{bench.END}\n"
    assert bench.replaced(first + "\n## After\n", "new") == first.replace("old", "new") + "\n## After\n"
    with pytest.raises(ParameterError, match="without the other"):
        bench.replaced(f"{bench.BEGIN}\n", "new")

"""Minimum cuts, ours and PyMaxflow's, on cuts of real frames: from arrays of weights to labels.

    python bench/maxflow.py [--kinds region frame border] [--data DIR] [--environment DIR] [--rounds N] [--scipy]
                            [--json] [--write]

The instances are those of bench/cut_instances.py: regions around an object, whole frames, and whole frames where only
the object's prediction and the frame's border have unaries, each with 0 to 7 extra nodes. Both sides are given the same
float arrays and timed from there to labels, build and solve, in CPU time of one thread; they take turns, `--rounds`
times after a warm-up, and the best counts. PyMaxflow runs in the peers' environment as bench/peers.py has it
($PERDURE_PEERS; it is GPL and no dependency of ours), each time with whole and with floating capacities, in a new graph
and in that of the turn before, of which the fastest counts; ours uses its workspace again. `pass` is the time of one
pass over our workspace's memory as a share of our solve. --scipy adds SciPy's maximum flow on the smallest instance, for orientation.

The data is read from $PERDURE_DATA or ../shared/data beside the repository; a film that is not there is left out.
--write puts the tables into docs/benchmarks.md, --json prints everything as one object in the last line.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import peers
from cut_instances import CASES, Instance, instances
from regions import Table, chosen, markdown, plain

from perdure.errors import ParameterError, PerdureError
from perdure.files.whole import whole_file
from perdure.maths.kernels.ibfs_twin import solve_twin
from perdure.maths.maxflow import SCALE, Nodes, Workspace, nodes_of

KINDS = {"region": "regions", "frame": "whole frames", "border": "whole frames anchored at their border"}
ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "benchmarks.md"
HEADING = "## Minimum cuts"
BEGIN, END = "<!-- bench/maxflow.py begin -->", "<!-- bench/maxflow.py end -->"


@dataclass(frozen=True)
class Line:
    """What was measured on one instance; milliseconds."""

    name: str
    kind: str
    size: str
    nodes: int
    build: float
    ours: float  # build and solve
    peer_build: float
    peer: float
    equal: bool  # the flows, to the last unit
    bytes: float  # a pixel
    share: float  # one pass over the memory / the solve

    @property
    def ratio(self) -> float:
        return self.peer / self.ours


def main() -> None:
    arguments = _arguments()
    try:
        lines, orientation, versions = measure(arguments)
        tables = [table_of(lines), summary(lines), *orientation]
        print("\n\n".join(plain(one) for one in tables))
        if arguments.write:
            page = replaced(PAGE.read_text(encoding="utf-8"), section(tables, versions))
            with whole_file(PAGE) as file:
                file.write(page)
        if arguments.json:
            told = {"versions": versions, "instances": [asdict(one) | {"ratio": one.ratio} for one in lines]}
            print(json.dumps(told))
    except (PerdureError, peers.PeersError) as error:
        print(f"maxflow.py: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(os.environ.get("PERDURE_DATA") or ROOT.parent / "shared" / "data")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--data", type=Path, default=root, help="where the films are")
    parser.add_argument("--environment", type=Path, default=peers.ENVIRONMENT, metavar="DIR", help="of the peers")
    parser.add_argument("--rounds", type=int, default=5, help="turns of both on each instance")
    parser.add_argument("--scipy", action="store_true", help="SciPy's maximum flow on the smallest instance")
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line")
    parser.add_argument("--write", action="store_true", help="replace the section in docs/benchmarks.md")
    return parser.parse_args()


def measure(arguments: argparse.Namespace) -> tuple[list[Line], list[Table], dict[str, Any]]:
    """Run all instances of the kinds that the arguments name."""
    kinds = chosen(arguments.kinds, {kind: [kind] for kind in KINDS}, "kind")
    python = peers.environment(arguments.environment)
    posed = list(instances(arguments.data, tuple(one for one in CASES if one.kind in kinds)))
    if not posed:
        raise ParameterError(f"no film in {arguments.data}: name the data's folder with --data or PERDURE_DATA")
    lines = []
    for number, one in enumerate(posed, 1):
        print(f"{number}/{len(posed)}  {one.name}, {one.kind}", file=sys.stderr, flush=True)
        lines.append(race(one, python, arguments.rounds))
    theirs = peers.library_versions(python)
    versions = {"cpu": peers.cpu(), "python": platform.python_version(), "perdure": metadata.version("perdure")}
    versions |= {name: theirs.get(name) for name in ("PyMaxflow", "numpy")} | {"numba": metadata.version("numba")}
    return lines, [by_scipy(posed[0], lines[0])] if arguments.scipy else [], versions


def race(given: Instance, python: Path, rounds: int) -> Line:
    """Solve an instance here and there in turn; the best of each counts."""
    nodes = nodes_of(given.node_unary, list(given.node_links))
    with peer(given, nodes, python) as turn:
        ours, theirs, workspace = [], [], Workspace()
        for number in range(rounds + 1):
            mine, other = solve_here(given, nodes, workspace), turn()
            if number:
                ours.append(mine)
                theirs.append(other)
    best = min(ours, key=lambda one: one.ms)
    fastest = min(theirs, key=lambda one: float(one["ms"]))
    return Line(
        given.name,
        given.kind,
        given.size,
        len(given.node_unary),
        best.build,
        best.ms,
        fastest["build"],
        fastest["ms"],
        best.flow == fastest["flow"],
        best.bytes / given.unary.size,
        one_pass(best.bytes) / (best.ms - best.build),
    )


@dataclass(frozen=True)
class Solved:
    """Our side of a turn."""

    ms: float
    build: float
    flow: int
    bytes: int


def solve_here(given: Instance, nodes: Nodes, workspace: Workspace) -> Solved:
    """Do what `maxflow.cut` does, in its two halves."""
    begun = time.process_time()
    workspace.pose(given.unary, given.pairwise, nodes, None, SCALE)
    built = time.process_time()
    found = workspace.solved()
    ended = time.process_time()
    below = sum(int(np.minimum(np.floor(one * SCALE + 0.5), 0).sum()) for one in (given.unary, nodes.unary))
    flow = round(found.energy * SCALE) - below
    return Solved(1e3 * (ended - begun), 1e3 * (built - begun), flow, workspace.nbytes)


@contextmanager
def peer(given: Instance, nodes: Nodes, python: Path) -> Iterator[Callable[[], dict[str, Any]]]:
    """Start PyMaxflow on an instance; what is called solves it once."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "instance.npz"
        np.savez(
            path,
            unary=given.unary,
            pairwise=given.pairwise,
            node_unary=nodes.unary,
            ends=nodes.ends,
            pixels=nodes.pixels,
            weights=nodes.weights,
            scale=SCALE,
        )
        command = [str(python), str(peers.HERE / "cuts.py"), str(path)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:

            def turn() -> dict[str, Any]:
                process.stdin.write("\n")
                process.stdin.flush()
                told = process.stdout.readline()
                if not told:
                    raise peers.PeersError(
                        "PyMaxflow's process ended early; remove the environment and run this again"
                    )
                return json.loads(told)

            yield turn
            process.stdin.close()


def one_pass(size: int) -> float:
    """Return the milliseconds of reading so many bytes once, the best of several."""
    memory = np.ones(size // 8, np.int64)
    times = []
    for _ in range(5):
        begun = time.process_time()
        memory.sum()
        times.append(time.process_time() - begun)
    return 1e3 * min(times)


def by_scipy(given: Instance, line: Line) -> Table:
    """Return what SciPy needs for an instance, from our arrays of capacities on."""
    workspace = Workspace()
    workspace.pose(given.unary, given.pairwise, nodes_of(given.node_unary, list(given.node_links)), None, SCALE)
    begun = time.process_time()
    solve_twin(workspace._graph, workspace._pixels)
    taken = 1e3 * (time.process_time() - begun)
    rows = [[line.name, line.size, f"{line.ours:.2f}", f"{line.peer:.2f}", f"{taken:.0f}"]]
    return Table("for orientation", ["instance", "size", "ours, ms", "PyMaxflow, ms", "SciPy, ms"], rows)


# The tables -------------------------------------------------------------------------------------------------


def table_of(lines: Iterable[Line]) -> Table:
    """A row per instance."""
    rows = [
        [
            one.name,
            one.kind,
            one.size,
            str(one.nodes),
            f"{one.build:.2f}",
            f"{one.ours:.2f}",
            f"{one.peer_build:.2f}",
            f"{one.peer:.2f}",
            f"{one.ratio:.2f}",
            "yes" if one.equal else "NO",
            f"{one.bytes:.1f}",
            f"{100 * one.share:.1f}%",
        ]
        for one in lines
    ]
    head = ["instance", "kind", "size", "nodes", "build", "ours, ms", "its build", "PyMaxflow, ms", "ratio"]
    return Table("a cut, build and solve", [*head, "equal", "bytes a pixel", "pass"], rows)


def summary(lines: Sequence[Line]) -> Table:
    """A row per kind: how much faster than PyMaxflow."""
    rows = []
    for kind, name in KINDS.items():
        ratios = [one.ratio for one in lines if one.kind == kind]
        if ratios:
            rows.append(
                [name, str(len(ratios)), f"{median(ratios):.2f}", f"{min(ratios):.2f}", f"{max(ratios):.2f}"]
            )
    return Table("times as fast as PyMaxflow", ["instances", "number", "median", "least", "most"], rows)


def section(tables: Iterable[Table], versions: dict[str, Any]) -> str:
    """Return what stands between the marks in docs/benchmarks.md."""
    words = ", ".join(f"{name} {version}" for name, version in versions.items())
    return "\n\n".join(
        ["`python bench/maxflow.py --scipy --write`", *(markdown(one) for one in tables), f"Versions: {words}."]
    )


def replaced(page: str, inside: str) -> str:
    """Return a page with the section between our marks replaced, or put at the end with its heading."""
    if (BEGIN in page) != (END in page):
        raise ParameterError(f"{PAGE.name} has one of the lines {BEGIN} and {END} without the other")
    if BEGIN not in page:
        page = f"{page.rstrip()}\n\n{HEADING}\n\n{BEGIN}{END}\n"
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}\n{inside}\n{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    main()

"""Hostile files: every reader against inputs that atheris makes up, which an error of ours must refuse or which are read sanely.

    pip install -e ".[fuzz]"
    python bench/fuzz.py [READER ...] [--seconds N] [--keep] [--json]

Each reader runs in a process of its own, begins from files that our own writers draw and from the inputs kept in
`tests/kept`, and goes where coverage of the readers' code leads. An input fails if anything comes out of it but a
`PerdureError` of one line or a result that `hostile.sanity` takes; if it warns; if it needs more than 5 s of the
processor or 1.5 GiB of memory. Each failure is told once for a place in the code, with the input, which --into keeps.
--keep puts into `tests/kept` the smallest input for each answer of a reader, for every test run. The list of readers is `hostile/readers.py`.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from hostile.kept import chosen, read_kept, write_kept
from hostile.readers import READERS, Reader


@dataclass(frozen=True)
class Hunt:
    """What was tried with a reader."""

    reader: str
    inputs: int
    seconds: float
    corpus: int  # inputs that reach code which the others do not
    failures: tuple[str, ...]  # a line each


def main() -> None:
    arguments = _parser().parse_args()
    names = arguments.readers or list(READERS)
    if unknown := [name for name in names if name not in READERS]:
        sys.exit(f"there is no reader {unknown[0]!r}; there are {', '.join(READERS)}")
    hunts = []
    with tempfile.TemporaryDirectory() as folder:
        place = arguments.into or Path(folder)
        for one in hunted([READERS[name] for name in names], place, arguments.seconds):
            hunts.append(one)
            print(row(one), flush=True)
            if arguments.keep:
                keep(READERS[one.reader], place / one.reader / "corpus")
    print(table(hunts))
    if arguments.json:
        print(json.dumps(summary(hunts)))
    sys.exit(1 if any(one.failures for one in hunts) else 0)


def hunted(readers: Sequence[Reader], place: Path, seconds: float) -> Iterator[Hunt]:
    """Try readers one after the other for some time each, and yield what came of it."""
    for reader in readers:
        _begin(reader, place / reader.name)
    here = Path(__file__).parent
    paths = [str(here), str(here.parent / "src"), *filter(None, [os.environ.get("PYTHONPATH")])]
    settings = {"PYTHONPATH": os.pathsep.join(paths), "OMP_NUM_THREADS": "1", "OPENCV_FOR_THREADS_NUM": "1"}
    words = [sys.executable, "-m", "hostile.hunt", str(place), f"{seconds:g}", *(one.name for one in readers)]
    with subprocess.Popen(words, env={**os.environ, **settings}, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout or ():
            name, status, spent = json.loads(line)
            yield _told(place / name, status, spent)
    if process.returncode:
        sys.exit(f"the process that tries readers ended with status {process.returncode}")


def _begin(reader: Reader, home: Path) -> None:
    """Lay out the folder of a reader: what it begins from, and no failure."""
    shutil.rmtree(home / "found", ignore_errors=True)
    for name in ("corpus", "found"):
        (home / name).mkdir(parents=True, exist_ok=True)
    (home / "log").unlink(missing_ok=True)
    for number, data in enumerate((*reader.seeds(), *(one.data for one in read_kept(reader.name)))):
        (home / "corpus" / f"kept{number:03d}").write_bytes(data)


def _told(home: Path, status: int, spent: float) -> Hunt:
    """What a reader's process left in its folder."""
    said = (home / "log").read_text(encoding="utf-8", errors="replace")
    counts = re.findall(r"number_of_executed_units:\s*(\d+)", said) or re.findall(r"^#(\d+)", said, re.M)
    failed = failures(home / "found")
    if status and not failed:
        failed = (f"the process ended with status {status}: {said[-500:]}",)
    inputs = int(counts[-1]) if counts else 0
    return Hunt(home.name, inputs, round(spent, 1), len(list((home / "corpus").iterdir())), failed)


def failures(found: Path) -> tuple[str, ...]:
    """What failed, in a line each: told by a reader's process, or by what ended it."""
    told = [json.loads(one.read_text()) for one in sorted(found.glob("*.json"))]
    ends = [f"the process ended: {one.name}" for one in sorted(found.glob("*-*"))]
    return (*(f"{one['where']}: {one['fault']}" for one in told), *ends)


def keep(reader: Reader, corpus: Path) -> None:
    """Keep of a corpus the smallest input for each answer."""
    known = read_kept(reader.name)
    inputs = [*(one.read_bytes() for one in sorted(corpus.iterdir())), *(one.data for one in known)]
    write_kept(reader.name, chosen(reader, inputs, known))


def summary(hunts: list[Hunt]) -> dict[str, object]:
    """The figures."""
    return {
        "readers": len(hunts),
        "inputs": sum(one.inputs for one in hunts),
        "seconds": round(sum(one.seconds for one in hunts), 1),
        "failures": sum(len(one.failures) for one in hunts),
        "hunts": [asdict(one) for one in hunts],
    }


def table(hunts: list[Hunt]) -> str:
    """The figures as a table of Markdown, and what failed below it."""
    lines = ["", "| reader | inputs | seconds | corpus | failures |", "|---|---:|---:|---:|---:|"]
    lines += [
        f"| {one.reader} | {one.inputs} | {one.seconds:.0f} | {one.corpus} | {len(one.failures)} |"
        for one in hunts
    ]
    whole = summary(hunts)
    lines.append(
        f"| all {whole['readers']} | {whole['inputs']} | {whole['seconds']:.0f} | | {whole['failures']} |"
    )
    return "\n".join([*lines, *(f"{one.reader}: {failure}" for one in hunts for failure in one.failures)])


def row(one: Hunt) -> str:
    """What was tried with a reader, as a line while others wait."""
    return f"{one.reader:<16} {one.inputs:>8} inputs, {one.seconds:6.1f} s, corpus {one.corpus:>5}: {len(one.failures)} failures"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("readers", nargs="*", metavar="READER", help="all of them if none is named")
    parser.add_argument("--seconds", type=float, default=60.0, help="for each reader")
    parser.add_argument(
        "--into", type=Path, help="a folder for corpus and failures, which also begins from what is there"
    )
    parser.add_argument(
        "--keep", action="store_true", help="put into tests/kept the smallest input for each answer"
    )
    parser.add_argument("--json", action="store_true")
    return parser


if __name__ == "__main__":
    main()

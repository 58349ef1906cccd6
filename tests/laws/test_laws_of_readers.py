"""Every function that reads files is fuzzed, or it is said here why not."""

from __future__ import annotations

import ast
import importlib
import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import pytest
from hostile.readers import READERS
from hostile.trying import scratch, tried

import perdure

HOUSE = Path(perdure.__file__).parent
PARSERS = {  # calls by which a file's content is taken in
    *(
        "json.loads",
        "json.load",
        "json_of",
        "json_with_nan",
        "tomllib.loads",
        "tomllib.load",
        "configparser.ConfigParser",
        "csv.reader",
    ),
    *(
        "csv.DictReader",
        "expat.ParserCreate",
        "zipfile.ZipFile",
        "cv2.imdecode",
        "cv2.imread",
        "np.loadtxt",
        "ET.parse",
    ),
    *(
        "pyarrow.parquet.read_table",
        "shapely.from_wkt",
        "np.load",
        "np.fromfile",
        "struct.unpack",
        "ast.literal_eval",
    ),
}
NOT_FUZZED = {
    "files.networks.read_network": "onnxruntime and OpenVINO open it",
    "files.models.read_embedding": "onnxruntime opens it",
    "files.checkpoints.read_checkpoint": "it is states.load of a file",
    "files.chunks.read_looks": "it is states.load of a file",
}
PARSED_ELSEWHERE = {
    "web/app.py": "requests to the viewer, which are no files",
    "files/rolling.py": "the answer of a process of ours",
    "cli/resuming.py": "what this process has just written",
    "trackers/foreign/libraries.py": "the answers of a process of ours",
    "trackers/foreign/tracker.py": "the answers of a process of ours",
}


def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(HOUSE).with_suffix("").parts)


def reading_functions() -> Iterator[str]:
    """The public functions `read`, `read_…` and `load` of the rooms that open files."""
    for path in (*sorted((HOUSE / "files").rglob("*.py")), HOUSE / "states.py", HOUSE / "cli" / "options.py"):
        for node in parsed(path).body:
            if isinstance(node, ast.FunctionDef) and (
                node.name in ("read", "load") or node.name.startswith("read_")
            ):
                yield f"{module_of(path)}.{node.name}"


def covered() -> set[str]:
    return {name for reader in READERS.values() for name in reader.covers}


def test_every_function_that_reads_is_fuzzed_or_it_is_said_why_not():
    functions = set(reading_functions())
    assert len(functions) > 30
    for name in functions - covered():
        assert NOT_FUZZED.get(name), f"{name} is in no reader of bench/hostile/readers.py"


def test_every_place_where_a_file_is_parsed_belongs_to_a_function_that_is_fuzzed():
    behind = {name.rpartition(".")[0] for name in covered()} | {
        name.rpartition(".")[0].rpartition(".")[0] for name in covered()
    }
    for path in sorted(HOUSE.rglob("*.py")):
        if not any(one in path.read_text(encoding="utf-8") for one in PARSERS):
            continue
        calls = [node.func for node in ast.walk(parsed(path)) if isinstance(node, ast.Call)]
        if {ast.unparse(one) for one in calls} & PARSERS and module_of(path) not in behind:
            assert path.relative_to(HOUSE).as_posix() in PARSED_ELSEWHERE, f"{path} parses what no reader looks at"


def test_what_is_said_of_readers_is_of_functions_that_are_there():
    for name in (*covered(), *NOT_FUZZED):
        parts = name.split(".")
        holder = next(
            n for n in range(len(parts), 0, -1) if (HOUSE / "/".join(parts[:n])).with_suffix(".py").exists()
        )
        value = importlib.import_module("perdure." + ".".join(parts[:holder]))
        for part in parts[holder:]:
            value = getattr(value, part)
        assert inspect.isfunction(value), name


@pytest.mark.parametrize("name", READERS)
def test_a_reader_calls_the_functions_that_it_is_said_to_cover(name: str):
    reader, called = READERS[name], set()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and "perdure" in frame.f_code.co_filename:
            place = Path(frame.f_code.co_filename)
            if place.is_relative_to(HOUSE):
                called.add(f"{module_of(place)}.{frame.f_code.co_qualname}")

    before = sys.getprofile()
    with scratch() as place:
        for data in reader.seeds():
            sys.setprofile(note)
            try:
                tried(reader, data, place)
            finally:
                sys.setprofile(before)
            if set(reader.covers) <= called:
                return
    assert set(reader.covers) <= called, set(reader.covers) - called

"""The laws that no single tracker or detector can keep: imports, names, bytes, distributions."""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.metadata
import itertools
import os
import subprocess
import sys
from pathlib import Path

import pytest

import perdure
from perdure import params
from perdure.detect import DETECTORS
from perdure.trackers import TRACKERS

HOUSE = Path(perdure.__file__).parent
FLOORS = {
    "types": 0, "params": 0, "errors": 0, "states": 0,
    "maths": 1, "features": 2, "scene": 2, "detect": 3, "trackers": 3,
    "fold": 4, "interpret": 4, "learn": 4, "metrics": 4, "files": 4, "draw": 4, "demo": 4, "looks": 4, "stitching": 4,
    "live": 5, "pipeline": 5, "online": 5, "equipment": 5, "detection": 5, "foreign": 5, "owners": 5, "reasons": 5, "comparison": 5, "cluster": 5, "consistency": 5, "tuning": 5, "web": 5, "cli": 5, "__init__": 5, "__main__": 5,
}  # fmt: skip


def modules() -> list[Path]:
    return sorted(HOUSE.rglob("*.py"))


def room(path: Path) -> str:
    return path.relative_to(HOUSE).parts[0].removesuffix(".py")


def imported_rooms(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "perdure":
            parts = node.module.split(".")[1:]
            found |= {parts[0]} if parts else {one.name for one in node.names}
        elif isinstance(node, ast.Import):
            found |= {one.name.split(".")[1] for one in node.names if one.name.startswith("perdure.")}
    return found - {"__version__"}


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(HOUSE)))
def test_imports_point_down(path: Path):
    if path.name == "__init__.py" and path.parent == HOUSE:
        return  # the public names come from everywhere
    for other in imported_rooms(path):
        assert FLOORS[other] <= FLOORS[room(path)], f"{path} imports {other} from a floor above"


@pytest.mark.parametrize("path", sorted((HOUSE / "trackers").glob("[!_]*.py")), ids=lambda path: path.stem)
def test_no_tracker_imports_another(path: Path):
    text = path.read_text()
    others = {one.stem for one in (HOUSE / "trackers").glob("[!_]*.py")} - {path.stem}
    assert not any(f"perdure.trackers.{other}" in text for other in others)


def test_only_the_rooms_for_files_open_files():
    for path in modules():
        if room(path) in ("files", "cli", "web", "cluster"):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            called = node.func if isinstance(node, ast.Call) else None
            name = getattr(called, "id", getattr(called, "attr", ""))
            assert name not in ("open", "imread", "imwrite", "read_text", "write_text"), f"{path} opens a file"


PICKLES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve"}
RUNNING = {"eval", "exec", "compile", "__import__", "os.system", "os.popen", "subprocess.getoutput"}
# Compiled kernels, in a folder of the user's own, by a digest of the source that they were compiled from.
KEEPS_KERNELS = "maths/kernels/kept.py"


@functools.cache
def nodes(path: Path) -> list[ast.AST]:
    return list(ast.walk(ast.parse(path.read_text())))


def called(path: Path) -> list[tuple[str, dict[str | None, object]]]:
    """Whatever a file calls, by the name that it has there, and the constants that are given by name."""
    calls = [node for node in nodes(path) if isinstance(node, ast.Call)]
    return [
        (dotted(call.func), {one.arg: getattr(one.value, "value", one.value) for one in call.keywords})
        for call in calls
    ]


def dotted(node: ast.AST) -> str:
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def imported_modules(path: Path) -> set[str]:
    found = set()
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found |= {f"{node.module}.{one.name}" for one in node.names}
        elif isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
    return found


def test_nothing_from_a_file_is_run():
    """No pickle, no evaluated text, no shell: what a file or a user says is data."""
    for path in modules():
        if path.relative_to(HOUSE).as_posix() != KEEPS_KERNELS:
            assert not {name.split(".")[0] for name in imported_modules(path)} & PICKLES, (
                f"{path} can open a pickle"
            )
        for name, given in called(path):
            assert name not in RUNNING, f"{path} calls {name}"
            assert given.get("shell", False) is False, f"{path} asks a shell"
            assert given.get("allow_pickle", False) is False, f"{path} opens pickles"
            assert name not in ("np.load", "numpy.load"), f"{path} reads arrays by another way than states"
            assert not name.endswith(("yaml.load", "extractall", "unpack_archive")), f"{path} calls {name}"


def test_xml_is_read_without_document_types_and_entities():
    for path in modules():
        xml = {name for name in imported_modules(path) if name.split(".")[0] in ("xml", "lxml", "defusedxml")}
        reading = {name for name in xml if not name.startswith("xml.sax.saxutils.")}
        assert reading <= {"xml.parsers.expat"}, f"{path} reads XML by {reading}"
        if reading:
            handled = {node.attr for node in nodes(path) if isinstance(node, ast.Attribute)}
            assert {"StartDoctypeDeclHandler", "EntityDeclHandler"} <= handled, f"{path} lets entities in"


def test_importing_the_package_loads_neither_numba_nor_cv2():
    code = "import sys, perdure; print([name for name in ('numba', 'cv2', 'av', 'scipy', 'shapely', 'starlette', 'uvicorn') if name in sys.modules])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"


def test_no_two_parameters_of_one_run_share_a_name():
    for tracker, detector in itertools.product(TRACKERS.values(), DETECTORS.values()):
        names = [one.name for kind in (tracker, detector) for one in params.describe(kind)]
        assert len(names) == len(set(names))


def test_every_parameter_says_what_it_means():
    for kind in (*TRACKERS.values(), *DETECTORS.values()):
        for one in params.describe(kind):
            assert len(one.help) > 10
            assert one.range_text or one.kind in (bool, str)  # what words may be said is in the help


@pytest.fixture(scope="module")
def in_two_processes(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Every tracker over one film in a process with one thread, and in another with two."""
    program, place = Path(__file__).parent / "one_run.py", tmp_path_factory.mktemp("threads")
    for threads, seed in (("1", "1"), ("2", "77")):
        settings = {"OMP_NUM_THREADS": threads, "NUMBA_NUM_THREADS": threads, "PYTHONHASHSEED": seed}
        words = [sys.executable, str(program), str(place / threads), threads]
        subprocess.run(words, env={**os.environ, **settings}, check=True)
    return place / "1", place / "2"


@pytest.mark.parametrize("tracker", TRACKERS)
def test_the_same_input_gives_the_same_bytes_in_any_process_with_any_number_of_threads(in_two_processes, tracker):
    digests = set()
    for place in in_two_processes:
        names = ("tracks.jsonl", "tracks.txt", "events.csv")
        contents = b"".join((place / tracker / name).read_bytes() for name in names)
        assert len(contents) > 2000
        digests.add(hashlib.sha256(contents).hexdigest())
    assert len(digests) == 1


def test_only_one_installed_distribution_brings_cv2():
    bringers = {
        distribution.metadata["Name"]
        for distribution in importlib.metadata.distributions()
        if any(file.parts[0] == "cv2" for file in distribution.files or ())
    }
    assert bringers == {"opencv-contrib-python-headless"}, f"{bringers} all bring cv2 and break each other"

"""Kernels are compiled once, kept, found again, and never a reason why a run fails."""

from __future__ import annotations

import dataclasses
import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from worlds import crossing

import perdure
from perdure import fold
from perdure.detect import DETECTORS
from perdure.maths.kernels import ahead, kept
from perdure.maths.kernels.compile import changed, given, kernel_for
from perdure.trackers import TRACKERS
from perdure.types import Regions

ONE = (
    "import numpy as np; from perdure.maths.kernels.overlaps import _shares as kernel, shares as f; "
    "b = np.eye(4, dtype=np.float32); "
)


def grown(number: int) -> int:
    return number + 1


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    folders = [tmp_path / "first", tmp_path / "second"]
    monkeypatch.setattr(kept, "_lasting", lambda: folders)
    monkeypatch.setattr(kept, "_temporary", lambda: tmp_path / "third")
    (tmp_path / "third").write_text("no folder")
    return folders


def compiled_anew() -> bool:
    """Call `grown` as another process would; whether it had to be compiled."""
    made = kernel_for(int)(grown)
    assert made(1) == 2
    return bool(made.stats.cache_misses)


def test_a_kernel_is_compiled_once_and_found_again(places: list[Path]):
    assert compiled_anew()
    assert not compiled_anew()
    assert [path.suffix for path in places[0].iterdir()] == [kept.ENDING]


@pytest.mark.parametrize("left", [0, 10, 40, 2000, -1])
def test_a_truncated_file_is_compiled_anew_and_mended(places: list[Path], left: int):
    compiled_anew()
    (path,) = places[0].iterdir()
    path.write_bytes(path.read_bytes()[:left])
    assert compiled_anew()
    assert not compiled_anew()


def test_a_file_with_one_wrong_byte_is_not_run(places: list[Path]):
    compiled_anew()
    (path,) = places[0].iterdir()
    held = bytearray(path.read_bytes())
    held[-200] ^= 1
    path.write_bytes(held)
    assert compiled_anew()


def test_what_was_compiled_from_another_source_is_replaced(places: list[Path], monkeypatch: pytest.MonkeyPatch):
    compiled_anew()
    monkeypatch.setattr(kept, "_source", lambda: b"a later one")
    assert compiled_anew()
    assert not compiled_anew()
    assert len(list(places[0].iterdir())) == 1


def test_a_place_that_takes_nothing_is_passed_over(places: list[Path]):
    places[0].write_text("no folder")
    assert compiled_anew()
    assert not compiled_anew()
    assert len(list(places[1].iterdir())) == 1


def test_kernels_compiled_into_an_image_are_used_where_nothing_can_be_written(
    places: list[Path], monkeypatch: pytest.MonkeyPatch
):
    compiled_anew()
    monkeypatch.setattr(kept, "_write", lambda path, content: pytest.fail("wrote"))
    assert not compiled_anew()


def test_where_no_place_takes_anything_kernels_work_and_it_is_said_once(
    places: list[Path], caplog: pytest.LogCaptureFixture
):
    for place in places:
        place.write_text("no folder")
    kept._say_that_nothing_is_kept.cache_clear()
    assert compiled_anew()
    assert compiled_anew()
    assert [one.levelno for one in caplog.records] == [logging.WARNING]
    assert "NUMBA_CACHE_DIR" in caplog.text


def test_a_folder_that_others_may_write_into_is_not_used(
    places: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(kept, "_temporary", lambda: tmp_path / "own")
    assert list(kept.searched()) == places
    assert not (tmp_path / "own").exists()
    assert len(list(kept.offered())) == len(list(kept.searched())) == 3
    (tmp_path / "own").chmod(0o777)
    assert list(kept.offered()) == list(kept.searched()) == places


def test_what_converts_is_taken_and_what_does_not_is_refused(places: list[Path]):
    @kernel_for(given(np.float64), changed(np.float64), float)
    def scaled(numbers: np.ndarray, into: np.ndarray, factor: float) -> float:
        for n in range(len(numbers)):
            into[n] = numbers[n] * factor
        return factor

    fixed = np.arange(4.0)
    fixed.flags.writeable = False
    into = np.zeros(2)
    for numbers, factor in ((fixed[::2], 2), (np.array([0.0, 2.0]), 2.0), (np.array([0.0, 2.0]), np.float32(2))):
        assert scaled(numbers, into, factor) == 2.0
        assert into.tolist() == [0.0, 4.0]
    with pytest.raises(TypeError, match="No matching definition"):
        scaled(fixed, fixed, 2.0)
    with pytest.raises(TypeError, match="No matching definition"):
        scaled(np.arange(3), into, 2.0)
    assert len(scaled.signatures) == 1


def test_every_kernel_that_is_called_from_outside_declares_its_types():
    declared = ahead.declared()
    assert "gaussian.compare_and_learn" in declared
    for name, module in sys.modules.items():
        if name.startswith("perdure.maths.kernels."):
            for own, one in vars(module).items():
                if hasattr(one, "py_func") and one.__module__ == name and not own.startswith("_"):
                    only_inside_others = one.targetoptions.get("no_cpython_wrapper", False)
                    assert only_inside_others or f"{name.rpartition('.')[2]}.{own}" in declared


@pytest.mark.parametrize("tracker", TRACKERS)
@pytest.mark.parametrize("detector", ["background", "recorded"])  # others see nobody here, or have no kernels
def test_a_run_compiles_nothing_but_what_warmup_does(tracker: str, detector: str):
    world = crossing()
    made = DETECTORS[detector]()
    if detector == "recorded":
        boxes = {frame.index: Regions.of(regions.boxes) for frame, regions in world.seen()}
        made = dataclasses.replace(made, regions=boxes)
    steps = list(fold.run(world.frames(), made, TRACKERS[tracker](), world.scene))
    assert len(fold.settle(step.report for step in steps)) > 20
    for name, one in ahead.declared().items():
        assert one.signatures in ([], [one.declared]), name


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package beside whose kernels nothing can be kept."""
    folder = tmp_path_factory.mktemp("installed")
    source = Path(perdure.__file__).parent
    shutil.copytree(source, folder / "perdure", ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "perdure/maths/kernels/__pycache__").write_text("no folder")
    return folder


def python(code: str, installed: Path, **settings: str) -> subprocess.Popen[str]:
    known = {key: value for key, value in os.environ.items() if key not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    environment = {**known, "PYTHONPATH": str(installed), "HOME": "/dev/null/nobody", **settings}
    return subprocess.Popen(
        [sys.executable, "-B", "-c", code],
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def test_without_a_home_and_beside_a_read_only_package_kernels_are_kept_among_temporary_files(
    installed: Path, tmp_path: Path
):
    code = ONE + "print(f(b, b).shape, bool(kernel.stats.cache_misses), kernel.stats.cache_path)"
    for miss in (True, False):
        out, err = python(code, installed, TMPDIR=str(tmp_path)).communicate()
        assert out.startswith(f"(4, 4) {miss} {tmp_path}"), err
    out, err = python(code, installed, TMPDIR=str(tmp_path), HOME="").communicate()
    assert (out.split()[:2], err) == (["(4,", "4)"], "")


def test_where_nothing_can_be_written_at_all_a_run_works_and_says_so_in_one_line(installed: Path, tmp_path: Path):
    (tmp_path / f"perdure-{kept._user()}").write_text("no folder")
    out, err = python(ONE + "print(f(b, b).shape)", installed, TMPDIR=str(tmp_path)).communicate()
    assert out == "(4, 4)\n"
    assert len(err.splitlines()) == 1
    assert "NUMBA_CACHE_DIR" in err


def test_two_processes_may_compile_at_once(installed: Path, tmp_path: Path):
    code = ONE + "print(f(b, b).sum())"
    running = [python(code, installed, NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2)]
    assert len({one.communicate() for one in running}) == 1
    (folder,) = tmp_path.iterdir()
    assert {path.suffix for path in folder.iterdir()} == {kept.ENDING}
    again = python(
        ONE + "f(b, b); print(bool(kernel.stats.cache_misses))", installed, NUMBA_CACHE_DIR=str(tmp_path)
    )
    assert again.communicate() == ("False\n", "")

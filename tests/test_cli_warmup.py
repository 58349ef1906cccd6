"""Compiling ahead, and being told where it happens on the way."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from perdure.cli.progress import COMPILING, watched
from perdure.maths.kernels import ahead, kept

PERDURE = [sys.executable, "-c", "from perdure.cli import main; main()"]


def warmup(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*PERDURE, "warmup", *words], capture_output=True, text=True, timeout=120)


def test_warmup_makes_every_kernel_ready_and_says_where_they_are_kept():
    told = json.loads(warmup("--json").stdout.splitlines()[-1])
    assert {one["name"] for one in told["kernels"]} == set(ahead.declared())
    (place,) = told["places"]
    assert any(Path(place).glob("gaussian.*.kernel"))
    again = warmup()
    assert f"all {len(told['kernels'])} kernels were there already" in again.stdout
    assert place in again.stdout


TWO = """
from perdure.maths.kernels import ahead
ahead.os.cpu_count, every, ahead.SLOWEST = lambda: 2, ahead.declared(), "counts.sharing"
ahead.declared = lambda: {name: every[name] for name in ("counts.sharing", "counts.uncontested")}
for one in ahead.ready():
    print(one.name, one.compiled, bool(every[one.name].stats.cache_hits), one.place is not None)
"""


@pytest.mark.parametrize("writable", [True, False])
def test_the_slowest_kernel_is_compiled_by_a_second_process_or_where_it_cannot_keep_it_here(
    tmp_path: Path, writable: bool
):
    folder = tmp_path / "kept"
    if not writable:
        for taken in (folder, tmp_path / f"perdure-{kept._user()}"):
            taken.write_text("no folder")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder), "TMPDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", TWO], capture_output=True, text=True, env=environment, timeout=120
    )
    assert done.stdout.splitlines() == [
        f"counts.uncontested True False {writable}",
        f"counts.sharing True {writable} {writable}",
    ], done.stderr


def test_help_loads_no_compiler():
    code = "import sys; from perdure.cli.commands import app; print('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"


def frames_that_compile() -> Iterator[int]:
    yield 0
    for _ in range(2):
        logging.getLogger("perdure.kernels").info("compiling it")
    yield 1


@pytest.mark.parametrize("terminal", [False, True])
def test_the_progress_tells_that_kernels_are_compiled(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, terminal: bool
):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERM", "xterm")
    assert list(watched(frames_that_compile(), "tracking", 2)) == [0, 1]
    told = capsys.readouterr().err
    assert f"tracking: {COMPILING}" in told
    assert terminal or told.count(COMPILING) == 1
    assert not logging.getLogger("perdure.kernels").handlers


def test_what_kernels_warn_of_is_a_note(capsys: pytest.CaptureFixture[str]):
    for _ in watched([1], "tracking", 1):
        logging.getLogger("perdure.kernels").warning("no folder")
    assert capsys.readouterr().err == "perdure: note: no folder\n"

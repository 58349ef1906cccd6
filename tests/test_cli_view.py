"""`perdure view` as a command: what it prints, what it refuses, how it ends."""

from __future__ import annotations

import contextlib
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from typer.testing import CliRunner

from perdure.cli.commands import app
from perdure.errors import FormatError, OutputError, ParameterError, PerdureError
from perdure.files.log import RunLog
from perdure.files.runs import RunFolder

pytest.importorskip("uvicorn", reason="the viewer's extra is not installed")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    folder = RunFolder.create(tmp_path / "run", overwrite=False)
    folder.write_about({"width": 64, "height": 48, "source": str(tmp_path / "gone.mp4")})
    with RunLog(folder.log):
        pass
    return folder.path


def refused(*words: object) -> Exception | None:
    done = CliRunner().invoke(app, ["view", *map(str, words)])
    assert done.exit_code
    return done.exception


def test_it_prints_an_address_with_a_token_answers_there_and_ends_by_ctrl_c(run: Path):
    code = "from perdure.cli import main; main()"
    command = [sys.executable, "-c", code, "view", str(run), "--port", "0"]
    with subprocess.Popen(command, stdout=-1, stderr=-1, text=True) as server, contextlib.ExitStack() as ends:
        assert server.stdout is not None
        assert server.stderr is not None
        ends.callback(server.kill)
        found = re.match(r"view   (http://127\.0\.0\.1:\d+/)#token=(\S{20,})", server.stdout.readline())
        assert found
        with urllib.request.urlopen(found[1], timeout=20) as answer:
            assert b"<title>Perdure</title>" in answer.read()
        server.send_signal(signal.SIGINT)
        assert server.wait(20) == 0
        assert "Traceback" not in server.stderr.read()


def test_what_is_no_run_is_refused(tmp_path: Path):
    assert isinstance(error := refused(tmp_path), FormatError)
    assert "perdure track" in str(error)


def test_a_truth_that_is_none_is_refused(run: Path, tmp_path: Path):
    assert isinstance(refused(run, "--truth", tmp_path / "gone.txt"), PerdureError)


def test_as_many_truths_as_runs_or_one(run: Path, tmp_path: Path):
    for name in ("a.txt", "b.txt"):
        (tmp_path / name).write_text("1,1,1,1,5,5,1,-1,-1,-1\n")
    assert isinstance(refused(run, "--truth", tmp_path / "a.txt", tmp_path / "b.txt"), ParameterError)


def test_a_port_that_somebody_has_is_refused_with_what_would_do(run: Path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        error = refused(run, "--port", taken.getsockname()[1])
    assert isinstance(error, OutputError)
    assert "--port" in str(error)

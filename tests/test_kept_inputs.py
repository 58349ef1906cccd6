"""Inputs that fuzzing found: an error of one line, or a result that can be, within bounds; `bench/fuzz.py` finds them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hostile.kept import read_kept
from hostile.readers import READERS, Reader
from hostile.sanity import check_tracks
from hostile.trying import scratch, tried
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from perdure.errors import FormatError
from perdure.types import Tracks


@pytest.mark.parametrize("name", READERS)
def test_what_once_failed_or_goes_its_own_way_is_read_or_refused(name: str):
    reader = READERS[name]
    with scratch() as place:
        for data, was in read_kept(name):
            outcome = tried(reader, data, place)
            assert not outcome.fault, f"{outcome.fault}\n{outcome.trace}\n{data!r} ({was})"


@pytest.mark.parametrize("name", READERS)
def test_a_file_of_our_own_writers_is_read(name: str):
    reader = READERS[name]
    with scratch() as place:
        outcomes = [tried(reader, data, place) for data in reader.seeds()]
    assert not any(one.fault for one in outcomes), outcomes
    assert any(not one.word for one in outcomes), outcomes


def failing(look: object) -> str:
    with scratch() as place:
        return tried(Reader("a", look, tuple, ()), b"", place).fault  # type: ignore[arg-type]


def test_an_input_that_fails_in_any_way_is_told():
    def fails(*_: object) -> None:
        raise KeyError("frame")

    def warns(*_: object) -> None:
        np.float32(1e300) + np.array([1e300], np.float32) * 1e30

    def blows_up(*_: object) -> None:
        np.ones(2**31, np.float64)

    def speaks_long(*_: object) -> None:
        raise FormatError("two\nlines")

    def refuses(*_: object) -> None:
        raise FormatError("a line")

    def lies(*_: object) -> None:
        check_tracks(Tracks.of(frames=[0], times=[0.0], ids=[0], boxes=[[0, 0, 1, 1]]))

    assert "KeyError" in failing(fails)
    assert "RuntimeWarning" in failing(warns)
    assert "MemoryError" in failing(blows_up)
    assert "no line" in failing(speaks_long)
    assert "an id below 1" in failing(lies)
    assert failing(refuses) == ""


def test_an_input_that_takes_too_long_is_told(monkeypatch: pytest.MonkeyPatch):
    def hangs(*_: object) -> None:
        while True:
            pass

    monkeypatch.setattr("hostile.trying.bounded.__wrapped__.__defaults__", (0.05, 1536))
    assert "takes longer" in failing(hangs)


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
@settings(max_examples=60, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_files_put_together_of_others_pieces_are_read_or_refused(name: str, data: st.DataObject):
    reader = READERS[name]
    files = st.sampled_from([*reader.seeds(), *(one.data for one in read_kept(name))])
    one, other = data.draw(files), data.draw(files)
    at, upto = data.draw(st.integers(0, len(one))), data.draw(st.integers(0, len(other)))
    word = data.draw(st.sampled_from([b"", *(word.encode() for word in reader.words)]))
    with scratch() as place:
        outcome = tried(reader, one[:at] + word + other[upto:], place)
    assert not outcome.fault, outcome.trace


@pytest.mark.slow
def test_atheris_tries_a_reader(tmp_path: Path):
    pytest.importorskip("atheris", reason="the extra `fuzz` is not installed")
    import fuzz

    (done,) = fuzz.hunted([READERS["blobs"]], tmp_path, 3.0)
    assert done.inputs > 100
    assert not done.failures

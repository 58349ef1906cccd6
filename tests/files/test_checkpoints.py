"""Checkpoints and the log beside them: in an order that outlives a power failure, and cut where they say."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from worlds import lone_walker

from perdure.detect import Background
from perdure.errors import OutputError, StateError
from perdure.files import checkpoints
from perdure.files.checkpoints import Checkpoint, Progress, read_checkpoint, write_checkpoint
from perdure.files.log import LogMark, RunLog, read_log
from perdure.fold import Standing, run
from perdure.states import kind_of
from perdure.trackers import TRACKERS
from perdure.types import Event, Report

KIND = Standing[kind_of(Background()), kind_of(TRACKERS["overlap"]()), type(None)]


def told(k: int) -> Report:
    return Report(events=(Event("light", k, k, why=f"{k} lamps" * k),))


def written(path: Path, count: int) -> list[LogMark]:
    """A log of so many frames, and its marks behind each."""
    with RunLog(path) as log:
        marks = [log.mark]
        for k in range(count):
            log.append(k, k / 10, told(k))
            marks.append(log.mark)
    return marks


def test_a_log_goes_on_from_every_mark_wherever_it_was_cut_behind_it(tmp_path: Path):
    path = tmp_path / "tracks.jsonl"
    marks = written(path, 5)
    whole = path.read_bytes()
    assert marks[-1].size == len(whole)
    for number, mark in enumerate(marks):
        for cut in range(mark.size, len(whole) + 1, 7):
            path.write_bytes(whole[:cut])
            with RunLog(path, mark) as log:
                for k in range(number, 5):
                    log.append(k, k / 10, told(k))
                assert log.mark == marks[-1]
            assert path.read_bytes() == whole


def test_a_log_that_is_not_what_it_was_before_its_mark_is_left_alone(tmp_path: Path):
    path = tmp_path / "tracks.jsonl"
    mark = written(path, 3)[2]
    whole = path.read_bytes()
    changed = bytearray(whole)
    changed[mark.size // 2] ^= 1
    for spoilt in (whole[: mark.size - 1], b"", bytes(changed)):
        path.write_bytes(spoilt)
        with pytest.raises(OutputError, match="is not the log that this run wrote"):
            RunLog(path, mark)
        assert path.read_bytes() == spoilt


def test_nobody_else_writes_a_log_while_it_is_written(tmp_path: Path):
    path = tmp_path / "tracks.jsonl"
    with RunLog(path) as log:
        log.append(0, 0.0, told(1))
        with pytest.raises(OutputError, match="another process"):
            RunLog(path)
    assert [entry.frame for entry in read_log(path)] == [0]
    RunLog(path).__exit__(None, None, None)


def stood(folder: Path, frames: int) -> Checkpoint:
    """Where a run stands behind so many frames."""
    world, standing = lone_walker(count=frames), []
    steps = run(world.frames(), Background(), TRACKERS["overlap"](), world.scene, between=standing.append)
    for _ in steps:
        pass
    return Checkpoint(
        standing[-1], Progress(frames, frames - 1, 0.7, lasting=(("meet", (1, 2), "door"),)), 7, LogMark(5, 6)
    )


def test_a_checkpoint_is_on_the_disk_behind_its_log_before_it_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    order: list[str] = []
    fsync, replace = os.fsync, os.replace

    def name_of(descriptor: int) -> str:
        return Path(os.readlink(f"/proc/self/fd/{descriptor}")).name

    monkeypatch.setattr(os, "fsync", lambda one: (order.append(f"sync {name_of(one)}"), fsync(one)))
    monkeypatch.setattr(os, "replace", lambda *both: (order.append(f"name {Path(both[1]).name}"), replace(*both)))
    with RunLog(tmp_path / "tracks.jsonl") as log:
        write_checkpoint(tmp_path, stood(tmp_path, 3), KIND, log)
    assert order == [
        "sync tracks.jsonl",
        "sync .checkpoint.zip.part",
        "name checkpoint.zip",
        f"sync {tmp_path.name}",
    ]


def test_a_checkpoint_comes_back_and_one_that_cannot_be_written_leaves_the_one_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    assert read_checkpoint(tmp_path, KIND) is None
    first = stood(tmp_path, 3)
    with RunLog(tmp_path / "tracks.jsonl") as log:
        write_checkpoint(tmp_path, first, KIND, log)
        again = read_checkpoint(tmp_path, KIND)
        assert (again.progress, again.picture, again.log) == (first.progress, 7, LogMark(5, 6))
        assert np.array_equal(again.standing.detector.mean, first.standing.detector.mean)

        def full(*_: object) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(checkpoints.states, "write", full)
        with pytest.raises(OutputError, match="No space"):
            write_checkpoint(tmp_path, stood(tmp_path, 5), KIND, log)
    assert read_checkpoint(tmp_path, KIND).progress == first.progress
    assert sorted(one.name for one in tmp_path.iterdir()) == ["checkpoint.zip", "tracks.jsonl"]


def test_a_checkpoint_of_states_that_are_laid_out_otherwise_is_of_another_version(tmp_path: Path):
    with RunLog(tmp_path / "tracks.jsonl") as log:
        write_checkpoint(tmp_path, stood(tmp_path, 3), KIND, log)
    other = Standing[kind_of(Background()), kind_of(TRACKERS["compound"]()), type(None)]
    with pytest.raises(StateError, match=r"saved by another version .* start the run anew with --overwrite"):
        read_checkpoint(tmp_path, other)

"""Many jobs on several processes: who dies is replaced, who errs is told, the others go on."""

from __future__ import annotations

import importlib.util
import json
import os
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
from dying import always_dies_at_one, killed_in_frame_20, refuses_odd_ones, squared_but_once
from test_cli import write_film
from worlds import crossing, two_apart

from perdure.cli import resuming, running
from perdure.cli.jobs import Job, placed, work_here
from perdure.cluster import Ended, Where, work_at
from perdure.errors import ParameterError


def by_place(ends: Iterable[Ended[int]]) -> list[Ended[int]]:
    return sorted(ends, key=lambda one: one.place)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(one.relative_to(folder)): one.read_bytes() for one in folder.rglob("*") if one.is_file()}


def test_the_job_of_a_worker_that_was_killed_is_begun_again_and_the_others_go_on(tmp_path: Path):
    jobs = [(number, tmp_path / "died") for number in range(4)]
    ends = by_place(work_at(jobs, squared_but_once, workers=2))
    assert [one.value for one in ends] == [0, 1, 4, 9]
    assert (tmp_path / "died").exists()


def test_a_job_whose_workers_always_die_is_given_up_and_costs_no_other():
    ends = by_place(work_at([0, 1, 2], always_dies_at_one, workers=1, attempts=2))
    assert [one.value for one in ends] == [0, None, 4]
    assert "died 2 times" in ends[1].failure
    assert not ends[1].defect


def test_a_mistake_and_a_defect_come_back_as_what_they_are():
    ends = by_place(work_at([0, 1, 3], refuses_odd_ones, workers=1))
    assert ends[0].value == 0
    assert (ends[1].failure, ends[1].defect) == ("1 is no video", "")
    assert "ZeroDivisionError" in ends[2].defect


def test_no_job_is_no_work():
    assert list(work_at([], refuses_odd_ones)) == []


@pytest.mark.parametrize("word", ["moon", "ray://", "local://here"])
def test_a_place_that_is_none_is_refused(word: str):
    with pytest.raises(ParameterError, match="must be local, ray"):
        Where.of(word)


@pytest.mark.slow
@pytest.mark.parametrize("on", ["local", "ray"])
def test_all_results_are_there_and_the_same_when_a_worker_is_killed_in_the_middle_of_a_run(
    tmp_path: Path, on: str, monkeypatch: pytest.MonkeyPatch
):
    if on == "ray" and importlib.util.find_spec("ray") is None:
        pytest.skip("Ray is not installed: pip install 'perdure[ray]'")
    places = [str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(places))  # by which Ray's workers find what dies
    films = [
        write_film(tmp_path / f"{name}.avi", [frame.image for frame in world.frames()])
        for name, world in (("apart", two_apart()), ("crossing", crossing()))
    ]
    jobs = [Job(str(film), {}) for film in films]
    for job in jobs:
        work_here((job, placed(job, tmp_path / "alone")))
    tasks = [(job, placed(job, tmp_path / on), tmp_path / "died") for job in jobs]
    ends = list(work_at(tasks, killed_in_frame_20, on=Where.of(on), workers=2))
    assert [one.failure for one in ends] == ["", ""]
    assert (tmp_path / "died").exists()
    assert contents(tmp_path / on) == contents(tmp_path / "alone")
    assert len(contents(tmp_path / on)) == 8


def test_a_run_of_a_job_holds_no_times_so_that_its_bytes_are_the_same_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A checkpoint that falls due at every frame would leave how long it took."""
    monkeypatch.setattr(resuming, "SHARE", 1e9)
    film = write_film(tmp_path / "apart.avi", [frame.image for frame in two_apart().frames()])
    job = Job(str(film), {})
    monkeypatch.setattr(running.Checkpoints, "__init__", hasty(running.Checkpoints.__init__))
    work_here((job, placed(job, tmp_path / "runs")))
    assert "checkpoints" not in json.loads((placed(job, tmp_path / "runs") / "run.json").read_text())


def hasty(made: Callable[..., None]) -> Callable[..., None]:
    """Checkpoints that wait for a millionth of the time that they are told to."""

    def waiting(self: running.Checkpoints, folder: Path, every: float) -> None:
        made(self, folder, every / 1e6)

    return waiting

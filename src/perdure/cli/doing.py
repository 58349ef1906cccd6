"""Doing the jobs of `perdure run`: those of chunks first, then what they are stitched into, and what came of each."""

from __future__ import annotations

import contextlib
import shutil
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from perdure import cluster
from perdure.cli.jobs import (
    Job,
    bring,
    chunks_of,
    discard,
    finished,
    placed,
    stitch_here,
    work_away,
    work_here,
)
from perdure.cli.progress import watched
from perdure.cli.summary import COUNTS, Row
from perdure.cluster import Ended, Where
from perdure.errors import PerdureError


class _Task(NamedTuple):
    """A job, or one of its chunks."""

    row: Row
    job: Job
    folder: Path
    label: str


def do(rows: Sequence[Row], where: Where, workers: int | None, attempts: int, *, overwrite: bool) -> None:
    """Do all jobs that are not done, and note what came of each."""
    for row in rows:
        if not overwrite and (about := finished(row.folder)) is not None:
            row.told, row.before = {key: about[key] for key in ("status", *COUNTS) if key in about}, True
            row.told["message"], row.told["warnings"] = about.get("message", ""), about.get("warnings", [])
        elif overwrite:
            shutil.rmtree(chunks_of(row.folder), ignore_errors=True)
    left = [row for row in rows if row.told is None]
    tasks = [one for row in left for one in _tasks(row)]
    work: Callable[[tuple[Job, Path]], Any] = work_here if where.kind == cluster.LOCAL else work_away
    try:
        with stoppable():
            _work(tasks, work, where, workers, attempts, "runs")
            whole = [
                _Task(row, row.job, row.folder, row.label) for row in left if row.job.chunks and not row.failure
            ]
            _work(whole, stitch_here, Where(), workers, attempts, "stitching")
    except KeyboardInterrupt:
        done = sum(row.told is not None for row in rows)
        print(f"perdure: {done} of {len(rows)} jobs are done; the same command goes on", file=sys.stderr)
        raise
    finally:
        for one in tasks:
            discard(one.folder)


def _tasks(row: Row) -> list[_Task]:
    """What is to be worked at for a job: itself, or those of its chunks that are not done yet."""
    if not row.job.chunks:
        return [_Task(row, row.job, row.folder, row.label)]
    place, count = chunks_of(row.folder), len(row.job.chunks)
    every = [
        _Task(row, job, placed(job, place), f"{row.label} {number}/{count}")
        for number, job in enumerate(row.job.parts, 1)
    ]
    return [one for one in every if finished(one.folder) is None]


def _work(
    tasks: Sequence[_Task],
    work: Callable[[tuple[Job, Path]], Any],
    where: Where,
    workers: int | None,
    attempts: int,
    what: str,
) -> None:
    """Work at some tasks, and note what came of each as it ends."""
    jobs = [(one.job, one.folder) for one in tasks]
    ends: Iterator[Ended[Any]] = cluster.work_at(jobs, work, on=where, workers=workers, attempts=attempts)
    for ended in watched(ends, what, len(tasks), unit="runs"):
        task = tasks[ended.place]
        word = _note(task, ended)
        if not sys.stderr.isatty():
            print(f"perdure: {task.label}: {word}", file=sys.stderr)


def _note(task: _Task, ended: Ended[Any]) -> str:
    """Note what came of a task, and return it in a word; what was done elsewhere is written here."""
    row, told, failure = task.row, ended.value, ended.failure
    if isinstance(told, tuple):
        told, files = told
        try:
            bring(task.folder, files)
        except PerdureError as error:
            told, failure = None, str(error)
    row.failure, row.defect = row.failure or failure, row.defect or ended.defect
    if told is not None:
        row.seconds += told["seconds"]
    if told is not None and task.folder == row.folder:
        rate = round(told["frames"] / row.seconds, 2) if row.seconds else 0.0
        row.told = {**told, "seconds": round(row.seconds, 3), "rate": rate}
    return "failed" if told is None else str(told["status"])


@contextlib.contextmanager
def stoppable() -> Iterator[None]:
    """Within the context a termination signal ends all as Ctrl-C does: no worker is left behind."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)

"""Work for other processes: some of which dies on the way. A marker file tells that it has died before."""

from __future__ import annotations

import os
import signal
from pathlib import Path

from perdure.cli import jobs
from perdure.errors import VideoError
from perdure.files.log import RunLog


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def squared(number: int) -> int:
    return number * number


def squared_but_once(job: tuple[int, Path]) -> int:
    number, marker = job
    if number == 1 and not marker.exists():
        marker.touch()
        die()
    return squared(number)


def always_dies_at_one(number: int) -> int:
    if number == 1:
        die()
    return squared(number)


def refuses_odd_ones(number: int) -> int:
    if number == 1:
        raise VideoError("1 is no video")
    return number // (number - 3)  # a defect at 3


def killed_in_frame_20(task: tuple[jobs.Job, Path, Path]) -> object:
    """The work of `perdure run`, in a process that is killed in the middle of the first job it gets."""
    job, folder, marker = task
    if not marker.exists():
        marker.touch()
        append = RunLog.append

        def until(self: RunLog, frame: int, *rest: object) -> None:
            if frame == 20:
                die()
            append(self, frame, *rest)

        RunLog.append = until
    return jobs.work_here((job, folder))

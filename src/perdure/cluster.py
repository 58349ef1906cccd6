"""Many jobs on the processes of this machine, or on the machines of a Ray cluster.

A job is any picklable value, its work a function of a module. A worker that dies (killed, out of memory) costs the job
that it was at, which is begun again; the others go on. What is mended by trying again is only that: a mistake of the
caller's and a defect of ours come back as what they are. With Ray (https://docs.ray.io), scheduling, retries and
transport are Ray's.
"""

from __future__ import annotations

import contextlib
import importlib.util
import multiprocessing
import os
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from perdure.errors import ParameterError, PerdureError

J = TypeVar("J")
R = TypeVar("R")
ATTEMPTS = 3  # of a job whose workers die
LOCAL, RAY = "local", "ray"
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Ended(Generic[R]):
    """How one job ended; `value` is None where it failed.

    Parameters
    ----------
    place : int
        Which of the jobs it is.
    value : R or None
    failure : str
        Why there is no value, to be read by who started it.
    defect : str
        The traceback, where it is a defect of ours.
    """

    place: int
    value: R | None = None
    failure: str = ""
    defect: str = ""


@dataclass(frozen=True)
class Where:
    """Where jobs are worked at: 'local' or 'ray', with the address of the cluster, if it is not to be found or started.

    >>> Where.of("local")
    Where(kind='local', address='')
    """

    kind: str = LOCAL
    address: str = ""

    @staticmethod
    def of(word: str) -> Where:
        """Read what the user said.

        Raises
        ------
        ParameterError
            For what is neither, and where Ray is not installed.
        """
        if word == LOCAL:
            return Where()
        kind, colon, address = word.partition("://")
        if kind != RAY or (colon and not address):
            raise ParameterError(f"--on {word} is not known: it must be local, ray, or ray://HOST:PORT")
        if importlib.util.find_spec("ray") is None:
            raise ParameterError("--on ray needs Ray, which is not installed: pip install 'perdure[ray]'")
        return Where(RAY, word if colon else "")


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Crew(Protocol):
    """Workers that stay for several rounds of jobs."""

    def work(self, jobs: Sequence[J], work: Callable[[J], R], attempts: int = ATTEMPTS) -> Iterator[Ended[R]]:
        """Yield how each job ended, in the order in which they end.

        Parameters
        ----------
        jobs : sequence of J
            Picklable.
        work : function of a job
            Of a module, so that another process finds it. It may be called again for a job whose worker died.
        attempts : int
            How often a job is begun whose worker dies.
        """
        ...


@contextlib.contextmanager
def crew(on: Where, workers: int | None = None) -> Iterator[Crew]:
    """Have workers at a place; afterwards none is left.

    Parameters
    ----------
    on : Where
        This machine, or a cluster.
    workers : int or None
        Jobs at a time; None: as many as there are cores. Each has an equal share of the cores for its threads.
    """
    with (
        _on_ray(on.address, workers) if on.kind == RAY else _local(cores() if workers is None else workers) as made
    ):
        yield made


def work_at(
    jobs: Sequence[J],
    work: Callable[[J], R],
    *,
    on: Where = Where(),
    workers: int | None = None,
    attempts: int = ATTEMPTS,
) -> Iterator[Ended[R]]:
    """Yield how each of some jobs ended, in the order in which they end; as `crew` and `Crew.work`."""
    if not jobs:
        return
    wanted = cores() if workers is None else workers
    with crew(on, max(1, min(len(jobs), wanted)) if on.kind == LOCAL else workers) as made:
        yield from made.work(jobs, work, attempts)


def _tried(place: int, work: Callable[[J], R], job: J) -> Ended[R]:
    """The work on one job, in the process that does it."""
    try:
        return Ended(place, work(job))
    except PerdureError as error:
        return Ended(place, failure=str(error))
    except Exception as error:
        return Ended(place, failure=f"{type(error).__name__}: {error}", defect=traceback.format_exc())


@contextlib.contextmanager
def _local(workers: int) -> Iterator[_Local]:
    """Processes of this machine, which start when they are needed."""
    made = _Local(max(1, cores() // workers), workers)
    try:
        yield made
    finally:
        made.end()


class _Local:
    """Processes, each in a pool of its own, so that one that dies takes no other with it."""

    def __init__(self, threads: int, workers: int) -> None:
        self._threads = threads
        self._idle = [_worker(threads) for _ in range(workers)]
        self._running: dict[Future[Any], tuple[int, int, ProcessPoolExecutor]] = {}

    def work(self, jobs: Sequence[J], work: Callable[[J], R], attempts: int = ATTEMPTS) -> Iterator[Ended[R]]:
        waiting = deque((place, 1) for place in range(len(jobs)))
        while waiting or self._running:
            while waiting and self._idle:
                pool, (place, attempt) = self._idle.pop(), waiting.popleft()
                with _threads_for_children(self._threads):
                    future = pool.submit(_tried, place, work, jobs[place])
                self._running[future] = place, attempt, pool
            done, _ = wait(self._running, return_when=FIRST_COMPLETED)
            for future in done:
                place, attempt, pool = self._running.pop(future)
                try:
                    ended: Ended[R] = future.result()
                    self._idle.append(pool)
                except BrokenProcessPool:
                    pool.shutdown()
                    self._idle.append(_worker(self._threads))
                    if attempt < attempts:
                        waiting.appendleft((place, attempt + 1))
                        continue
                    ended = Ended(place, failure=_died(attempts))
                yield ended

    def end(self) -> None:
        """End all: at once who is at work, the others in good order."""
        for _, _, pool in self._running.values():
            _end(pool)
        for pool in self._idle:
            pool.shutdown()


def _worker(threads: int) -> ProcessPoolExecutor:
    """A process that starts with its first job."""
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(1, mp_context=context, initializer=_begin_worker, initargs=(threads,))


def _begin_worker(threads: int) -> None:
    """In a new worker: away from the terminal's Ctrl-C, which its parent gets, and no longer alive than that."""
    if hasattr(os, "setpgrp"):
        os.setpgrp()
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    _use_threads(threads)


def _end_with(parent: Any) -> None:
    """End this process when its parent has ended."""
    parent.join()
    os._exit(1)


def _use_threads(threads: int) -> None:
    import cv2

    cv2.setNumThreads(threads)


@contextlib.contextmanager
def _threads_for_children(threads: int) -> Iterator[None]:
    """What is started within has this many threads for its libraries, unless the user has said how many."""
    ours = [name for name in _THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(ours, str(threads)))
    try:
        yield
    finally:
        for name in ours:
            del os.environ[name]


def _end(pool: ProcessPoolExecutor) -> None:
    """End a worker at once, whatever it is at."""
    for process in list((pool._processes or {}).values()):
        process.kill()
    pool.shutdown(cancel_futures=True)


def _died(attempts: int) -> str:
    times = "once" if attempts == 1 else f"{attempts} times"
    return f"the process that worked at it died {times}: killed, or out of memory; try fewer --workers"


@contextlib.contextmanager
def _on_ray(address: str, workers: int | None) -> Iterator[_Ray]:
    """A Ray cluster: the one at the address, else the one of $RAY_ADDRESS, else one that is started here."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nothing is told to others unless the user wants it
    import ray

    given: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
    if address:
        given["address"] = address
    elif "RAY_ADDRESS" not in os.environ:
        given |= {"num_cpus": workers or cores(), "include_dashboard": False}
    try:
        ray.init(**given)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise ParameterError(f"no Ray cluster at {address or 'this machine'}: {error}") from error
    try:
        yield _Ray()
    finally:
        ray.shutdown()


class _Ray:
    """The workers of a cluster, which are Ray's to schedule."""

    def work(self, jobs: Sequence[J], work: Callable[[J], R], attempts: int = ATTEMPTS) -> Iterator[Ended[R]]:
        import ray

        remote: Any = ray.remote(num_cpus=1, max_retries=attempts - 1)(_on_ray_worker)
        waiting = {remote.remote(place, work, job): place for place, job in enumerate(jobs)}
        while waiting:
            done, _ = ray.wait(list(waiting), num_returns=1)
            for one in done:
                place = waiting.pop(one)
                try:
                    yield ray.get(one)
                except ray.exceptions.RayError as error:
                    dead = isinstance(error, (ray.exceptions.WorkerCrashedError, ray.exceptions.NodeDiedError))
                    yield Ended(place, failure=_died(attempts) if dead else f"Ray: {error}")


def _on_ray_worker(place: int, work: Callable[[J], R], job: J) -> Ended[R]:
    """The work on one job in a worker of Ray, which gives each as many cores as it asked for: one."""
    _use_threads(1)
    return _tried(place, work, job)

"""All kernels compiled before they are needed."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import pkgutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from perdure.maths import kernels
from perdure.maths.kernels.compile import compile_declared

SLOWEST = "ibfs.solve"  # nearly half of the work: a second process compiles it beside all others


class Ready(NamedTuple):
    """A kernel that can be called."""

    name: str
    seconds: float
    compiled: bool  # else loaded
    place: Path | None  # where it is kept; None for nowhere


def ready() -> Iterator[Ready]:
    """Compile or load one kernel after the other; where there are two processors, the slowest beside the others."""
    begun, kernels = time.perf_counter(), declared()
    slowest = kernels.pop(SLOWEST, None)
    beside = None
    if slowest is not None and (os.cpu_count() or 1) > 1 and not _is_kept(slowest):
        beside = multiprocessing.get_context("spawn").Process(target=_compile, args=(SLOWEST,))
        beside.start()
    for name, kernel in kernels.items():
        yield _ready(name, kernel, time.perf_counter())
    if beside is not None:
        beside.join()
        yield _ready(SLOWEST, slowest, begun)._replace(compiled=True)
    elif slowest is not None:
        yield _ready(SLOWEST, slowest, time.perf_counter())


def _ready(name: str, kernel: Any, begun: float) -> Ready:
    compile_declared(kernel)
    return Ready(name, time.perf_counter() - begun, bool(kernel.stats.cache_misses), kernel._cache.place)


def _is_kept(kernel: Any) -> bool:
    return bool(kernel._cache.has(kernel.declared, kernel.targetctx.codegen()))


def _compile(name: str) -> None:
    """In a process of its own: what it keeps is there for the one that started it."""
    compile_declared(declared()[name])


def declared() -> dict[str, Any]:
    """Return all kernels that declare types, by module and name; none where NUMBA_DISABLE_JIT is set."""
    found = {}
    for module in pkgutil.iter_modules(kernels.__path__):
        loaded = importlib.import_module(f"{kernels.__name__}.{module.name}")
        for name, one in vars(loaded).items():
            if hasattr(one, "declared") and one.__module__ == loaded.__name__:
                found[f"{module.name}.{name.lstrip('_')}"] = one
    return found

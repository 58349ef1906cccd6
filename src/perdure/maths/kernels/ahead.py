"""All kernels compiled before they are needed."""

from __future__ import annotations

import importlib
import pkgutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from perdure.maths import kernels
from perdure.maths.kernels.compile import compile_declared


class Ready(NamedTuple):
    """A kernel that can be called."""

    name: str
    seconds: float
    compiled: bool  # else loaded
    place: Path | None  # where it is kept; None for nowhere


def ready() -> Iterator[Ready]:
    """Compile or load one kernel after the other."""
    for name, kernel in declared().items():
        begun = time.perf_counter()
        compile_declared(kernel)
        yield Ready(name, time.perf_counter() - begun, bool(kernel.stats.cache_misses), kernel._cache.place)


def declared() -> dict[str, Any]:
    """Return all kernels that declare types, by module and name; none where NUMBA_DISABLE_JIT is set."""
    found = {}
    for module in pkgutil.iter_modules(kernels.__path__):
        loaded = importlib.import_module(f"{kernels.__name__}.{module.name}")
        for name, one in vars(loaded).items():
            if hasattr(one, "declared") and one.__module__ == loaded.__name__:
                found[f"{module.name}.{name}"] = one
    return found

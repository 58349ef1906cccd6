"""How every kernel is compiled: for the types it declares, kept on disk, the GIL released, exact floating point."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeVar, cast

import numba
import numpy as np
from numba import types
from numba.extending import intrinsic

from perdure.maths.kernels.kept import Kept

F = TypeVar("F", bound=Callable[..., Any])


# Nobody calls a kernel from C.
_OPTIONS: dict[str, Any] = {"nogil": True, "fastmath": False, "error_model": "numpy", "no_cfunc_wrapper": True}
_UNCOUNTED: dict[str, Any] = {"_nrt": False}  # no reference to an array is counted: for what makes no arrays


def kernel_for(*declared: Any, counted: bool = True) -> Callable[[F], F]:
    """Compile a kernel at its first call, for the types declared: what converts to them is taken, nothing else.

    One set of types is one compilation, known before anything runs: `perdure warmup` makes them all, and no later
    call has to wait for another.

    Parameters
    ----------
    declared
        The type of every argument: `given` and `changed` arrays, `int`, `float`, `bool`, a NumPy scalar type, or a
        type of Numba's.
    counted
        Whether references to arrays are counted. A kernel that makes no arrays does without, and must if it has
        a `part`.

    >>> @kernel_for(given(np.uint8), float)
    ... def scaled(numbers, factor):
    ...     return numbers.sum() * factor
    >>> print(*scaled.declared)
    readonly array(uint8, 1d, A) float64
    """
    signature = tuple(one if isinstance(one, types.Type) else numba.typeof(one()) for one in declared)

    def decorate(function: F) -> F:
        made: Any = _compiled(function, {} if counted else _UNCOUNTED)
        if hasattr(made, "compile"):
            made.declared = signature
            made._compile_for_args = lambda *_, **__: compile_declared(made)
        return cast(F, made)

    return decorate


def kernel(function: F) -> F:
    """Compile what only kernels call, for the types that they call it with.

    No fastmath and no parallel reductions, so equal input gives equal bytes.
    """
    return cast(F, _compiled(function, {}))


def part(function: F) -> F:
    """Compile a part of an uncounted kernel, which becomes code of its caller: for a call in the innermost loop.

    Every call is a copy, to be compiled again. A part makes no arrays.
    """
    more = {**_UNCOUNTED, "forceinline": True, "no_cpython_wrapper": True}
    return cast(F, numba.njit(**_OPTIONS, **more)(function))


def _compiled(function: Any, more: dict[str, Any]) -> Any:
    made: Any = numba.njit(**_OPTIONS, **more)(function)
    if hasattr(made, "compile"):  # NUMBA_DISABLE_JIT leaves the function as it is
        made._cache = Kept(function)  # what cache=True sets to Numba's own
    return made


def given(kind: type[np.generic], dimensions: int = 1, layout: Literal["A", "C"] = "A") -> Any:
    """Declare an array that is only read; with `layout` 'C' a contiguous one, which is faster to go over."""
    return types.Array(_scalar(kind), dimensions, layout, readonly=True)


def changed(kind: type[np.generic], dimensions: int = 1) -> Any:
    """Declare a contiguous array that is written into."""
    return types.Array(_scalar(kind), dimensions, "C")


def compile_declared(kernel: Any) -> Any:
    """Compile a kernel for the types that it declares, or load it where that has been done; return the kernel."""
    kernel.compile(kernel.declared)
    kernel.disable_compile()  # from now on arguments are converted, or refused
    vars(kernel).pop("_compile_for_args", None)  # what Numba asks for something to call where no types fit exactly
    return kernel


def _scalar(kind: type[np.generic]) -> Any:
    return numba.from_dtype(np.dtype(kind))


def _lowest(typing: Any, bits: Any) -> Any:
    def lowered(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], context.get_constant(types.boolean, True))

    return types.int64(types.int64), lowered


# The place of the lowest bit that is set; some bit must be.
lowest: Any = intrinsic(_lowest)

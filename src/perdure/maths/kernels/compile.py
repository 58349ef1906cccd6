"""How every kernel is compiled: for the types it declares, kept on disk, the GIL released, exact floating point."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeVar, cast

import numba
import numpy as np
from llvmlite.ir import Constant
from numba import types
from numba.extending import intrinsic

from perdure.maths.kernels.kept import Kept

F = TypeVar("F", bound=Callable[..., Any])


def kernel_for(*declared: Any) -> Callable[[F], F]:
    """Compile a kernel at its first call, for the types declared: what converts to them is taken, nothing else.

    One set of types is one compilation, known before anything runs: `perdure warmup` makes them all, and no later
    call has to wait for another.

    Parameters
    ----------
    declared
        The type of every argument: `given` and `changed` arrays, `int`, `float`, `bool` or a NumPy scalar type.

    >>> @kernel_for(given(np.uint8), float)
    ... def scaled(numbers, factor):
    ...     return numbers.sum() * factor
    >>> print(*scaled.declared)
    readonly array(uint8, 1d, A) float64
    """
    signature = tuple(one if isinstance(one, types.Type) else numba.typeof(one()) for one in declared)

    def decorate(function: F) -> F:
        made: Any = kernel(function)
        if hasattr(made, "compile"):
            made.declared = signature
            made._compile_for_args = lambda *_, **__: compile_declared(made)
        return cast(F, made)

    return decorate


def kernel(function: F) -> F:
    """Compile what only kernels call, for the types that they call it with.

    No fastmath and no parallel reductions, so equal input gives equal bytes.
    """
    made: Any = numba.njit(nogil=True, fastmath=False, error_model="numpy")(function)
    if hasattr(made, "compile"):  # NUMBA_DISABLE_JIT leaves the function as it is
        made._cache = Kept(function)  # what cache=True sets to Numba's own
    return cast(F, made)


def part(function: F) -> F:
    """Compile a part of a kernel, which becomes code of its caller: for a call in the innermost loop.

    Every call is a copy, to be compiled again.
    """
    return cast(F, numba.njit(nogil=True, fastmath=False, error_model="numpy", forceinline=True)(function))


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


def _borrowed(typing: Any, array: Any) -> Any:
    def lowered(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        copy = context.make_array(signature.return_type)(context, builder, value=values[0])
        copy.meminfo = Constant(copy.meminfo.type, None)
        copy.parent = Constant(copy.parent.type, None)
        return copy._getvalue()

    return array(array), lowered


def _lowest(typing: Any, bits: Any) -> Any:
    def lowered(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], context.get_constant(types.boolean, True))

    return types.int64(types.int64), lowered


# The same array without its reference count, good for as long as the kernel's caller holds it. Numba counts a reference,
# atomically, each time an array is handed to a part: in a loop over pixels that is most of the time.
borrowed: Any = intrinsic(_borrowed)

# The place of the lowest bit that is set; some bit must be.
lowest: Any = intrinsic(_lowest)

"""How every kernel is compiled: for the types it declares, kept on disk, the GIL released, exact floating point."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal, TypeVar, cast

import numba
import numba._dynfunc
import numpy as np
from numba import types
from numba.core import ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, _LowerResult
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.typed_passes import NativeLowering, NopythonTypeInference
from numba.extending import intrinsic

from perdure.maths.kernels.kept import Kept

F = TypeVar("F", bound=Callable[..., Any])


# Nobody calls a kernel from C. No kernel makes an array, so that no references are counted.
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "fastmath": False,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "_nrt": False,
}


def kernel_for(*declared: Any) -> Callable[[F], F]:
    """Compile a kernel at its first call, for the types declared: what converts to them is taken, nothing else.

    One set of types is one compilation, known before anything runs: `perdure warmup` makes them all, and no later
    call has to wait for another. A kernel makes no arrays: its caller does, which needs nothing compiled. A place in
    a flat array must not be below 0, unless it is a constant.

    Parameters
    ----------
    declared
        The type of every argument: `given` and `changed` arrays, `int`, `float`, `bool`, a NumPy scalar type, or a
        type of Numba's.

    >>> @kernel_for(given(np.uint8), float)
    ... def scaled(numbers, factor):
    ...     return numbers.sum() * factor
    >>> print(*scaled.declared)
    readonly array(uint8, 1d, A) float64
    """
    signature = tuple(one if isinstance(one, types.Type) else numba.typeof(one()) for one in declared)

    def decorate(function: F) -> F:
        made: Any = _compiled(function)
        if hasattr(made, "compile"):
            made.declared = signature
            made._compile_for_args = lambda *_, **__: compile_declared(made)
        return cast(F, made)

    return decorate


def kernel(function: F) -> F:
    """Compile what only kernels call, for the types that they call it with.

    No fastmath and no parallel reductions, so equal input gives equal bytes.
    """
    return cast(F, _written(function, inside=False))


def part(function: F) -> F:
    """Compile a part of a kernel, which becomes code of its caller: for a call in the innermost loop.

    Every call is a copy, to be compiled again.
    """
    return cast(F, _written(function, inside=True))


def _compiled(function: Any) -> Any:
    made: Any = numba.njit(**_OPTIONS, pipeline_class=_Compiler)(function)
    if hasattr(made, "compile"):  # NUMBA_DISABLE_JIT leaves the function as it is
        made._cache = Kept(function)  # what cache=True sets to Numba's own
    return made


def _written(function: Any, *, inside: bool) -> Any:
    more: dict[str, Any] = {"forceinline": inside, "no_cpython_wrapper": True, "pipeline_class": _Writer}
    return numba.njit(**_OPTIONS, **more)(function)


def given(kind: type[np.generic], dimensions: int = 1, layout: Literal["A", "C"] = "A") -> Any:
    """Declare an array that is only read; with `layout` 'C' a contiguous one, which is faster to go over."""
    return types.Array(_scalar(kind), dimensions, layout, readonly=True)


def changed(kind: type[np.generic], dimensions: int = 1) -> Any:
    """Declare a contiguous array that is written into."""
    return types.Array(_scalar(kind), dimensions, "C")


def compile_declared(kernel: Any) -> Any:
    """Compile a kernel for the types that it declares, or load it where that has been done; return the kernel."""
    with _nothing_collected():
        kernel.compile(kernel.declared)
    kernel.disable_compile()  # from now on arguments are converted, or refused
    vars(kernel).pop("_compile_for_args", None)  # what Numba asks for something to call where no types fit exactly
    return kernel


@contextmanager
def _nothing_collected() -> Iterator[None]:
    """Put off the search for garbage: a compiler makes many objects that live, and looks at all of them each time."""
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()


def _scalar(kind: type[np.generic]) -> Any:
    return numba.from_dtype(np.dtype(kind))


def _lowest(typing: Any, bits: Any) -> Any:
    def lowered(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], context.get_constant(types.boolean, True))

    return types.int64(types.int64), lowered


# The place of the lowest bit that is set; some bit must be.
lowest: Any = intrinsic(_lowest)


@register_pass(mutates_CFG=False, analysis_only=False)
class _PlacesFromZero(FunctionPass):
    """Ask of no place in a flat array whether it is below 0, to be counted from the end.

    Where a kernel goes from place to place that is a seventh of its time, and loops with it become no vector code.
    """

    _name = "places_from_zero"

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]

    def run_pass(self, state: Any) -> bool:
        for block in state.func_ir.blocks.values():
            for statement in block.body:
                where = statement if isinstance(statement, ir.SetItem) else getattr(statement, "value", None)
                if where is statement or (isinstance(where, ir.Expr) and where.op == "getitem"):
                    signature = state.calltypes[where]
                    array, place, *rest = signature.args
                    if isinstance(array, types.Array) and isinstance(place, types.Integer):
                        del state.calltypes[where]  # none is ever replaced
                        state.calltypes[where] = signature.replace(args=(array, types.uintp, *rest))
        return True


class _Compiler(CompilerBase):
    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state, "kernel")
        passes.add_pass_after(_PlacesFromZero, NopythonTypeInference)
        passes.finalize()
        return [passes]


# Numba turns every function into machine code of its own, and what calls it takes it in and optimises it once more.
# Nobody else calls what only kernels call: it is written down, and becomes machine code as part of a kernel.


class _Draft(JITCodeLibrary):
    """A function's code, neither linked nor machine code: that is up to the kernel that takes it in."""

    def finalize(self) -> None:
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _Writing(NativeLowering):
    """Write a function down, and tell its callers what they have to take in."""

    _name = "writing"

    def run_pass(self, state: Any) -> bool:
        state.library = _Draft(state.targetctx.codegen(), state.func_id.func_qualname)  # type: ignore[no-untyped-call]
        state.flags.no_compile = True
        super().run_pass(state)  # type: ignore[no-untyped-call]
        about, helper, _, environment = state.cr
        entry = numba._dynfunc.make_function(
            about.lookup_module(), about.qualname, "", 0, environment, (state.library,)
        )
        taken = dict.fromkeys([state.library, *state.library._linking_libraries])
        state.targetctx.insert_user_function(entry, about, list(taken))
        state.cr = _LowerResult(about, helper, cfunc=entry, env=environment)
        return True


class _Writer(_Compiler):
    def define_pipelines(self) -> list[Any]:
        (passes,) = super().define_pipelines()
        passes.passes = [(_Writing if one is NativeLowering else one, why) for one, why in passes.passes]
        passes.finalize()
        return [passes]

"""Saving and loading states: a versioned zip of one JSON tree and its arrays, never a pickle.

A state is a frozen dataclass of arrays, numbers, words, tuples, dicts and other such dataclasses.
Loading follows the types that the class declares, so that a file can name no code.

Examples
--------
>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Walk:
...     steps: int
...     places: np.ndarray  # (N, 2)
>>> again = load(save(Walk(3, np.zeros((2, 2)))), Walk)
>>> again.steps, again.places.shape
(3, (2, 2))
"""

from __future__ import annotations

import dataclasses
import enum
import io
import json
import types
import typing
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from perdure.errors import StateError

S = TypeVar("S")
FORMAT = "perdure-state"
VERSION = 1
_EPOCH = (1980, 1, 1, 0, 0, 0)  # zip wants a date; a fixed one keeps equal states equal in bytes


def save(state: object) -> bytes:
    """Return the state as bytes; equal states give equal bytes, and the state may go on being used.

    Raises
    ------
    StateError
        If the state holds something that is not data.
    """
    arrays: list[NDArray[Any]] = []
    tree = _pack(state, arrays)
    header = {"format": FORMAT, "version": VERSION, "kind": type(state).__qualname__, "tree": tree}
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo("state.json", _EPOCH), json.dumps(header, separators=(",", ":")))
        for number, array in enumerate(arrays):
            data = io.BytesIO()
            np.lib.format.write_array(data, np.asarray(array, order="C"), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{number}.npy", _EPOCH), data.getvalue())
    return out.getvalue()


def load(data: bytes, kind: type[S]) -> S:
    """Return the state that `save` wrote, independent of every other; its arrays are writable.

    Raises
    ------
    StateError
        If the bytes are damaged, of another version, or of another kind of state.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            header = json.loads(archive.read("state.json"))
            _check_header(header, kind)
            names = archive.namelist()
            arrays = [
                np.lib.format.read_array(io.BytesIO(archive.read(f"{number}.npy")), allow_pickle=False)
                for number in range(len(names) - 1)
            ]
        return typing.cast(S, _unpack(header["tree"], kind, arrays))
    except StateError:
        raise
    except _DAMAGE as error:
        raise StateError(f"this saved state is damaged ({error}); start the run anew") from error


_DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    NotImplementedError,
    RuntimeError,
    TypeError,
    ValueError,
)


def _check_header(header: Any, kind: type) -> None:
    if not isinstance(header, Mapping) or header.get("format") != FORMAT:
        raise StateError("this is not a saved state of Perdure")
    if header.get("version") != VERSION:
        raise StateError(
            f"this state has version {header.get('version')}, this Perdure reads version {VERSION}; start the run anew"
        )
    if header.get("kind") != kind.__qualname__:
        raise StateError(
            f"this state is of {header.get('kind')}, not of {kind.__qualname__}; name the same tracker"
        )


def _pack(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """The JSON tree of a value; arrays are put aside and stand as their number."""
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (int, float)):
        return value
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {one.name: _pack(getattr(value, one.name), arrays) for one in dataclasses.fields(value)}
    if isinstance(value, (tuple, list)):
        return [_pack(item, arrays) for item in value]
    if isinstance(value, Mapping):
        return [[_pack(key, arrays), _pack(item, arrays)] for key, item in value.items()]
    raise StateError(f"a state cannot hold {type(value).__name__}: only numbers, words, arrays and dataclasses")


def _unpack(tree: Any, kind: Any, arrays: list[NDArray[Any]]) -> Any:
    """The value of type `kind` that a JSON tree stands for."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (types.UnionType, typing.Union):
        if tree is None:
            return None
        return _unpack(tree, next(one for one in arguments if one is not type(None)), arrays)
    if _is_array(kind):
        return dict(enumerate(arrays))[tree["array"]]
    if origin is tuple:
        if isinstance(arguments[-1], types.EllipsisType):
            return tuple(_unpack(item, arguments[0], arrays) for item in tree)
        return tuple(_unpack(item, one, arrays) for item, one in zip(tree, arguments, strict=True))
    if origin is not None and issubclass(origin, Mapping):
        return {_unpack(key, arguments[0], arrays): _unpack(item, arguments[1], arrays) for key, item in tree}
    if isinstance(kind, type):
        return _unpack_plain(tree, kind, arrays)
    raise StateError(f"a state cannot declare {kind}")


def _is_array(kind: Any) -> bool:
    """Whether a declared type is an array, also by an alias such as `NDArray` (a `type` statement in newer NumPy)."""
    origin = get_origin(kind) or kind
    return origin is np.ndarray or (hasattr(origin, "__value__") and _is_array(origin.__value__))


def _unpack_plain(tree: Any, kind: type, arrays: list[NDArray[Any]]) -> Any:
    if dataclasses.is_dataclass(kind):
        hints = get_type_hints(kind)
        return kind(
            **{one.name: _unpack(tree[one.name], hints[one.name], arrays) for one in dataclasses.fields(kind)}
        )
    if issubclass(kind, tuple):  # a named tuple
        return kind(
            *(_unpack(item, one, arrays) for item, one in zip(tree, get_type_hints(kind).values(), strict=True))
        )
    if issubclass(kind, (enum.Enum, bool, int, float, str)):
        if not issubclass(kind, enum.Enum) and not isinstance(tree, (kind, int)):
            raise StateError(f"this saved state is damaged: {tree!r} is not {kind.__name__}")
        return kind(tree)
    raise StateError(f"a state cannot declare {kind.__name__}")

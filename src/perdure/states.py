"""Saving and loading states: a versioned zip of one JSON tree and its arrays, never a pickle.

A state is a frozen dataclass of arrays, numbers, words, tuples, dicts and other such dataclasses.
Loading follows the types that the class declares, so that a file can name no code. Nothing is packed, so that no file
unfolds into more than its own size.

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
import math
import re
import types
import typing
import zipfile
import zlib
from collections.abc import Mapping
from textwrap import shorten
from typing import IO, Any, TypeVar, cast, get_args, get_origin, get_type_hints

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
    out = io.BytesIO()
    write(state, out)
    return out.getvalue()


def write(state: object, file: IO[bytes], release: str = "") -> None:
    """Write the bytes of `save` into a file that is open and can be sought in, without a copy of all of them in memory.

    `release` says what made it; `load` wants the same.

    Raises
    ------
    StateError
        If the state holds something that is not data; nothing is written then.
    """
    arrays: list[NDArray[Any]] = []
    tree = _pack(state, arrays)
    header = {"format": FORMAT, "version": VERSION, "kind": type(state).__qualname__, "tree": tree}
    header |= {"release": release} if release else {}
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo(_TREE, _EPOCH), json.dumps(header, separators=(",", ":")))
        for number, array in enumerate(arrays):
            archive.writestr(zipfile.ZipInfo(f"{number}.npy", _EPOCH), _packed(array))


def load(data: bytes, kind: type[S], release: str = "") -> S:
    """Return the state that `save` or `write` wrote, independent of every other; its arrays are writable.

    A generic dataclass is given with the types of its parts: `Pair[Walk, Swim]`.

    Raises
    ------
    StateError
        If the bytes are damaged, of another version, or of another kind of state.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            _check_size(archive, len(data))
            header = json.loads(archive.read(_TREE))
            _check_header(header, kind, release)
            count = len(archive.namelist()) - 1
            arrays = [_read_array(archive.read(f"{number}.npy")) for number in range(count)]
        return cast(S, _unpack(header["tree"], kind, arrays))
    except StateError:
        raise
    except _DAMAGE as error:
        raise StateError(f"this saved state is damaged ({error}); start the run anew") from error


def kind_of(part: Any) -> Any:
    """Return the type of the state of a tracker or detector, for `load`: its own `state_kind`, or what `start` returns.

    Raises
    ------
    StateError
        If it says neither.
    """
    own = getattr(part, "state_kind", None)
    kind = get_type_hints(type(part).start).get("return") if own is None else own
    if not dataclasses.is_dataclass(get_origin(kind) or kind):
        raise StateError(f"{type(part).__name__} does not say what its state is; `start` must return a dataclass")
    return kind


def layout(kind: Any) -> str:
    """Return the fields of a kind of state and of all that it holds, in words: another layout is another version."""
    known: dict[str, str] = {}
    _lay_out(kind, known)
    return "; ".join(f"{name}({fields})" for name, fields in sorted(known.items()))


_TREE = "state.json"


def _check_size(archive: zipfile.ZipFile, size: int) -> None:
    """Refuse an archive that would unfold: entries that are packed, lie over each other, or say more than is there."""
    entries = archive.infolist()
    packed = any(one.compress_type != zipfile.ZIP_STORED or one.file_size != one.compress_size for one in entries)
    if packed or sum(one.file_size for one in entries) > size:
        raise StateError("this saved state is damaged (it is larger inside than outside); start the run anew")


def _packed(array: NDArray[Any]) -> memoryview:
    """The bytes of an array as in a `.npy` file."""
    array = np.asarray(array, order="C")
    content = io.BytesIO()
    np.lib.format.write_array_header_1_0(content, np.lib.format.header_data_from_array_1_0(array))
    if array.size:
        content.write(array.reshape(-1).view(np.uint8).data)
    return content.getbuffer()


def _read_array(content: bytes) -> NDArray[Any]:
    """The array of a `.npy` file; ValueError where it says another size than it has, before it takes room."""
    file = io.BytesIO(content)
    if np.lib.format.read_magic(file) != (1, 0) or not _HEADER.match(content, file.tell() + 2):
        raise ValueError("an array of an unknown version")
    shape, in_columns, kind = np.lib.format.read_array_header_1_0(file)
    count = math.prod(shape)
    if kind.hasobject or in_columns or count * kind.itemsize != len(content) - file.tell():
        raise ValueError("an array that is not what it says")
    return np.ndarray(shape, kind, content, file.tell()).copy()


# As `_packed` writes it; what NumPy makes of other headers may warn, or fail in ways of its own.
_HEADER = re.compile(
    rb"\{'descr': '[<>|=][a-zA-Z][0-9]+', 'fortran_order': (False|True), 'shape': \([0-9, ]*\), \} *\n"
)

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


def _check_header(header: Any, kind: type, release: str) -> None:
    if not isinstance(header, Mapping) or header.get("format") != FORMAT:
        raise StateError("this is not a saved state of Perdure")
    if header.get("version") != VERSION:
        raise StateError(
            f"this state has version {header.get('version')}, this Perdure reads version {VERSION}; start the run anew"
        )
    if header.get("release", "") != release:
        raise StateError(
            f"this state was saved by another version ({shorten(str(header.get('release', '')), 60) or 'none'}); this is "
            f"{release or 'none'}; start the run anew"
        )
    name = (get_origin(kind) or kind).__qualname__
    if header.get("kind") != name:
        raise StateError(f"this state is of {header.get('kind')}, not of {name}; name the same tracker")


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
        if value.dtype.hasobject:
            raise StateError("a state cannot hold an array of objects: only of numbers and words")
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
    if kind is types.NoneType:
        return None
    if origin in (types.UnionType, typing.Union):
        if tree is None:
            return None
        return _unpack(tree, next(one for one in arguments if one is not types.NoneType), arrays)
    if _is_array(kind):
        return dict(enumerate(arrays))[tree["array"]]
    if origin is tuple:
        if isinstance(arguments[-1], types.EllipsisType):
            return tuple(_unpack(item, arguments[0], arrays) for item in tree)
        return tuple(_unpack(item, one, arrays) for item, one in zip(tree, arguments, strict=True))
    if dataclasses.is_dataclass(origin or kind):
        return (origin or kind)(**{name: _unpack(tree[name], one, arrays) for name, one in _fields(kind).items()})
    if origin is not None and issubclass(origin, Mapping):
        return {_unpack(key, arguments[0], arrays): _unpack(item, arguments[1], arrays) for key, item in tree}
    if isinstance(kind, type):
        return _unpack_plain(tree, kind, arrays)
    raise StateError(f"a state cannot declare {kind}")


def _fields(kind: Any) -> dict[str, Any]:
    """The fields of a dataclass and their types; those of a generic one with the types that it was given."""
    plain = get_origin(kind) or kind
    given = dict(zip(getattr(plain, "__parameters__", ()), get_args(kind), strict=False))
    hints = get_type_hints(plain)
    return {one.name: given.get(hints[one.name], hints[one.name]) for one in dataclasses.fields(plain)}


def _is_array(kind: Any) -> bool:
    """Whether a declared type is an array, also by an alias such as `NDArray` (a `type` statement in newer NumPy)."""
    origin = get_origin(kind) or kind
    return origin is np.ndarray or (hasattr(origin, "__value__") and _is_array(origin.__value__))


def _unpack_plain(tree: Any, kind: type, arrays: list[NDArray[Any]]) -> Any:
    if issubclass(kind, tuple):  # a named tuple
        return kind(
            *(_unpack(item, one, arrays) for item, one in zip(tree, get_type_hints(kind).values(), strict=True))
        )
    if issubclass(kind, (enum.Enum, bool, int, float, str)):
        if not issubclass(kind, enum.Enum) and not isinstance(tree, (kind, int)):
            raise StateError(f"this saved state is damaged: {tree!r} is not {kind.__name__}")
        return kind(tree)
    raise StateError(f"a state cannot declare {kind.__name__}")


def _lay_out(kind: Any, known: dict[str, str]) -> None:
    """Put down the fields of every dataclass and named tuple in a type."""
    for one in get_args(kind):
        _lay_out(one, known)
    plain = get_origin(kind) or kind
    name = f"{plain.__module__}.{plain.__qualname__}" if isinstance(plain, type) else ""
    named = isinstance(plain, type) and issubclass(plain, tuple) and plain is not tuple
    if (named or dataclasses.is_dataclass(plain)) and name not in known:
        fields = get_type_hints(plain) if named else _fields(kind)
        known[name] = ", ".join(f"{field}: {_word(one)}" for field, one in fields.items())
        for one in fields.values():
            _lay_out(one, known)


def _word(kind: Any) -> str:
    return kind.__qualname__ if isinstance(kind, type) and not get_args(kind) else str(kind)

"""Learnt contexts in files: JSON with weights, levels, measures and training; docs/multi-feature.md has an example.

All of it is checked when it is read; a fault names the file, the key, and what would do.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from perdure.errors import FormatError
from perdure.files.lines import json_with_nan, why_not_json
from perdure.files.span import shown
from perdure.files.whole import whole_file
from perdure.params import unknown_name
from perdure.scene.context import Alone, Context, Training
from perdure.scene.measuring import NAMES, Measures

FORMAT, VERSION = "perdure-context", 1
Json = Any
LIBRARY = Path(__file__).parents[1] / "contexts"
_KEYS = ("format", "version", "name", "weights", "similar", "levels", "measures", "training")
_FLAGS = ("pictures", "ground")
_LARGEST = 1 << 20  # bytes of a file
_LONGEST = 80  # letters of a name


def read_context(path: str | Path) -> Context:
    """Read a context.

    Raises
    ------
    FormatError
        Naming the file, what is wrong, and what would do.
    """
    place = Path(path)
    try:
        if place.stat().st_size > _LARGEST:
            raise FormatError(f"{place} has more than {_LARGEST >> 20} MiB; it is no context of `perdure learn`")
        value = json_with_nan(place.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise FormatError(f"cannot read the context {place}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        line = f", line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise FormatError(f"{place}{line}: not JSON ({why_not_json(error)})") from None
    try:
        return context_of_json(value)
    except ValueError as error:
        raise FormatError(f"{place}: {error}") from None


def write_context(path: Path, context: Context) -> None:
    """Write a context into a file that `read_context` reads; it appears whole or not at all."""
    with whole_file(path) as file:
        json.dump(context_to_json(context), file, indent=1, ensure_ascii=False, allow_nan=False)
        file.write("\n")


def library() -> tuple[Context, ...]:
    """Return the contexts that come with the package, by name."""
    return tuple(read_context(path) for path in sorted(LIBRARY.glob("*.json")))


def context_to_json(context: Context) -> dict[str, Json]:
    """Return a context as JSON, numbers to six digits."""
    measures = {name: value for name in NAMES if (value := getattr(context.measures, name)) is not None}
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": context.name,
        "weights": _rounded(dict(context.weights)),
        "similar": _rounded(context.similar),
        "levels": {name: [_rounded(low), _rounded(high)] for name, (low, high) in context.levels.items()},
        "measures": _rounded(measures),
        "training": _rounded(dataclasses.asdict(context.training)),
    }


def context_of_json(value: Json) -> Context:
    """Return the context that a JSON value describes; ValueError says what is wrong with it."""
    given = _object(value, "a context")
    if given.get("format") != FORMAT:
        raise ValueError(f'it is no context: its "format" is not "{FORMAT}"; `perdure learn` writes one')
    if given.get("version") != VERSION:
        raise ValueError(
            f"it has version {shown(given.get('version'))}, this Perdure reads version {VERSION}; learn it anew"
        )
    _refuse_unknown(given, _KEYS, "key of a context")
    for key in ("name", "weights", "similar"):
        if key not in given:
            raise ValueError(f'"{key}" is missing; learn it anew')
    name = given["name"]
    if not isinstance(name, str) or not name.strip() or len(name) > _LONGEST or not name.isprintable():
        raise ValueError(f"name = {shown(name)} must be a word or more, of {_LONGEST} letters at most")
    return Context(
        name,
        _numbers(given["weights"], "weights"),
        _number(given["similar"], "similar"),
        {key: _pair(pair, f"levels, {key}") for key, pair in _object(given.get("levels", {}), "levels").items()},
        _measures(_object(given.get("measures", {}), "measures")),
        _training(_object(given.get("training", {}), "training")),
    )


def _measures(given: Mapping[str, Json]) -> Measures:
    _refuse_unknown(given, NAMES, "measure")
    values: dict[str, Any] = {}
    for name, value in given.items():
        values[name] = _flag(value, name) if name in _FLAGS else _number(value, name, low=0.0)
    return Measures(**values)


def _training(given: Mapping[str, Json]) -> Training:
    known = [one.name for one in dataclasses.fields(Training)]
    _refuse_unknown(given, known, "key of a training")
    alone = _object(given.get("alone", {}), "alone")
    options = _object(given.get("options", {}), "options")
    for name, value in options.items():
        if not isinstance(value, (bool, int, float, str)):
            raise ValueError(f"options, {name} = {shown(value)} must be a number, a word, or true or false")
    return Training(
        _words(given.get("sources", []), "sources"),
        _whole(given.get("same", 0), "same"),
        _whole(given.get("different", 0), "different"),
        _number(given.get("separation", 0.5), "separation", low=0.0, high=1.0),
        _words(given.get("notes", []), "notes"),
        dict(options),
        {name: _alone(name, value) for name, value in alone.items()},
    )


def _alone(feature: str, value: Json) -> Alone:
    given = _object(value, f"alone, {feature}")
    known = [one.name for one in dataclasses.fields(Alone)]
    _refuse_unknown(given, known, f"key of alone, {feature}")
    for name in known:
        if name not in given:
            raise ValueError(f'alone, {feature} has no "{name}"; learn it anew')
    numbers = {name: _number(given[name], f"alone, {feature}, {name}") for name in known if name != "rounds"}
    return Alone(**numbers, rounds=_whole(given["rounds"], f"alone, {feature}, rounds"))


def _object(value: Json, what: str) -> Mapping[str, Json]:
    if not isinstance(value, dict):
        raise ValueError(f"{what} must be a JSON object {{…}} of values by name, not {shown(value)}")
    return value


def _refuse_unknown(given: Mapping[str, Json], known: Iterable[str], what: str) -> None:
    for key in given:
        if key not in known:
            raise ValueError(unknown_name(what, key, known))


def _number(value: Json, what: str, *, low: float = -math.inf, high: float = math.inf) -> float:
    if type(value) not in (int, float) or not math.isfinite(value):
        raise ValueError(f"{what} = {shown(value)} must be a finite number")
    if not low <= value <= high:
        span = f"{low:g} to {high:g}" if math.isfinite(high) else f"at least {low:g}"
        raise ValueError(f"{what} = {value:g} is out of range: it must be {span}")
    return float(value)


def _numbers(value: Json, what: str) -> dict[str, float]:
    return {key: _number(one, f"{what}, {key}") for key, one in _object(value, what).items()}


def _pair(value: Json, what: str) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"{what} must be two numbers [low, high]")
    return _number(value[0], what), _number(value[1], what)


def _whole(value: Json, what: str) -> int:
    if type(value) is not int or not 0 <= value <= 1 << 53:
        raise ValueError(f"{what} = {shown(value)} must be a whole number from 0 on")
    return value


def _flag(value: Json, what: str) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"{what} = {shown(value)} must be true or false")
    return value


def _words(value: Json, what: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
        raise ValueError(f"{what} must be a list of words")
    return tuple(value)


def _rounded(value: Json) -> Json:
    """The same with numbers of six digits."""
    if isinstance(value, Mapping):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(one) for one in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value

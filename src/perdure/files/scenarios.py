"""Scenarios in a file: TOML, a table a scenario, and what classes and lines they speak of.

    [[scenario]]
    name = "waits_at_the_gate"
    who = "person"
    zone = "gate"
    pace = {below = 0.3}
    lasts = 10
    interesting = true

All of it is checked when it is read; a fault names the scenario, and what would do.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from perdure.errors import FormatError, ParameterError
from perdure.files.span import shown
from perdure.params import unknown_name
from perdure.scene.beliefs import MEASURES, NOISE, USUAL, Kind, Trapezoid
from perdure.scene.counting import Line
from perdure.scene.scenarios import Bounds, Rules, Scenario

SHIPPED = "usual"
_LARGEST = 1 << 20  # bytes of a file
_MOST = 200  # scenarios
_TABLES = ("usual", "scenario", "class", "line")
_WORDS = {"who": "who", "with": "partner", "zone": "zone", "outside": "outside", "line": "line"}
_TEXTS = ("name", "on", "direction", "after")
_NUMBERS = ("over", "near", "apart", "lasts", "forgives", "within")
_BOUNDS = ("pace", "speed", "age", "roams", "count")
_FLAGS = ("interesting", "quiet")
KEYS = (*_TEXTS, *_WORDS, *_NUMBERS, *_BOUNDS, *_FLAGS)


def usual_rules() -> Rules:
    """Return the scenarios that come with Perdure."""
    text = resources.files("perdure").joinpath("scenarios/usual.toml").read_text(encoding="utf-8")
    return rules_of(text, "usual.toml")


def read_rules(path: str | Path) -> Rules:
    """Read scenarios, classes and lines from a file; 'usual' are those that come with Perdure.

    Raises
    ------
    FormatError
        For a file that is none, naming the scenario and what would do.
    """
    if str(path) == SHIPPED:
        return usual_rules()
    path = Path(path)
    try:
        if path.is_dir():
            raise FormatError(
                f"{path} is a folder; name a file of scenarios, or '{SHIPPED}' for those that come along"
            )
        if path.stat().st_size > _LARGEST:
            raise FormatError(f"{path} has {path.stat().st_size >> 10} KiB; a file of scenarios has 1 MiB at most")
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise FormatError(
            f"there is no file {path}; '{SHIPPED}' are the scenarios that come with Perdure"
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"{path} cannot be read as a file of scenarios: {error}") from error
    return rules_of(text, str(path))


def rules_of(text: str, place: str) -> Rules:
    """Return the rules that a text holds; `place` is its name in messages."""
    try:
        given = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise FormatError(f"{place} is not TOML: {error}") from error
    if unknown := next((one for one in given if one not in _TABLES), None):
        raise FormatError(f"{place}: {unknown_name('table or key of the file', unknown, _TABLES)}")
    try:
        if not isinstance(given.get("usual", False), bool):
            raise ParameterError(
                "usual must be true or false: whether the scenarios that come with Perdure hold, too"
            )
        own = tuple(_scenario(number, one) for number, one in enumerate(_tables(given, "scenario"), 1))
        names = {one.name for one in own}
        others = usual_rules().scenarios if given.get("usual", False) else ()
        kinds = {**USUAL, **{name: _kind(name, one) for name, one in _named(given, "class").items()}}
        lines = tuple(_line(name, one) for name, one in _named(given, "line").items())
        if not lines:  # those that come along count every line, where there is any
            others = tuple(one for one in others if not one.line)
        return Rules((*own, *(one for one in others if one.name not in names)), kinds, lines)
    except ParameterError as error:
        raise FormatError(f"{place}: {error}") from error


def _tables(given: Mapping[str, Any], name: str) -> list[Any]:
    tables = given.get(name, [])
    if not isinstance(tables, list):
        raise ParameterError(f"{name} must be written [[{name}]], a table each")
    if len(tables) > _MOST:
        raise ParameterError(f"there are {len(tables)} tables [[{name}]]; {_MOST} is the most")
    return tables


def _named(given: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    tables = given.get(name, {})
    if not isinstance(tables, dict):
        raise ParameterError(f"{name} must be written [{name}.NAME], a table each")
    return tables


def _scenario(number: int, given: object) -> Scenario:
    if not isinstance(given, dict):
        raise ParameterError(f"scenario {number} must be a table [[scenario]]")
    where = f"scenario {number}" + (f" ({given['name']})" if isinstance(given.get("name"), str) else "")
    try:
        if "name" not in given:
            raise ParameterError("it needs a name, which its events will bear")
        values: dict[str, Any] = {}
        for key, value in given.items():
            if key not in KEYS:
                raise ParameterError(unknown_name("key", key, KEYS))
            values[_WORDS.get(str(key), str(key))] = _reader(key)(key, value)
        return Scenario(**values)
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from error


def _reader(key: str) -> Callable[[str, object], object]:
    kinds: tuple[tuple[Iterable[str], Callable[[str, object], object]], ...] = (
        (_WORDS, _words),
        (_TEXTS, _text),
        (_NUMBERS, _number),
        (_BOUNDS, _bounds),
        (_FLAGS, _flag),
    )
    return next(reader for names, reader in kinds if key in names)


def _words(key: str, value: object) -> tuple[str, ...]:
    words = [value] if isinstance(value, str) else value
    if not isinstance(words, list) or not words or not all(isinstance(one, str) and one for one in words):
        raise ParameterError(f"{key} = {shown(value)} must be a word, or a list of words")
    return tuple(words)


def _text(key: str, value: object) -> str:
    if not isinstance(value, str):
        raise ParameterError(f"{key} = {shown(value)} must be a word")
    return value


def _number(key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ParameterError(f"{key} = {shown(value)} must be a number")
    return float(value)


def _flag(key: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise ParameterError(f"{key} = {shown(value)} must be true or false")
    return value


def _bounds(key: str, value: object) -> Bounds:
    if isinstance(value, dict) and (wrong := next((one for one in value if one not in ("above", "below")), None)):
        raise ParameterError(f"{key}: {unknown_name('end of a range', str(wrong), ('above', 'below'))}")
    if not isinstance(value, dict) or not value:
        raise ParameterError(
            f"{key} = {shown(value)} must be a range, such as {{above = 1.5}} or {{above = 1, below = 2}}"
        )
    return Bounds(**{name: _number(f"{key}.{name}", one) for name, one in value.items()})


def _kind(name: str, given: object) -> Kind:
    """A class: measures with four numbers each, or several looks of them, and what detectors call it."""
    if not isinstance(given, dict):
        raise ParameterError(f"class {name}: must be a table [class.{name}]")
    try:
        labels = frozenset(one.lower() for one in _words("labels", given["labels"])) if "labels" in given else None
        looks = given.get(
            "looks", [{key: value for key, value in given.items() if key not in ("labels", "looks")}]
        )
        if not isinstance(looks, list) or not all(isinstance(one, dict) for one in looks):
            raise ParameterError("looks must be a list of tables of measures")
        before = USUAL.get(name)
        known = labels if labels is not None else before.labels if before is not None else frozenset({name})
        return Kind(tuple(_look(one) for one in looks), known)
    except ParameterError as error:
        raise ParameterError(f"class {name}: {error}") from error


def _look(given: Mapping[str, object]) -> dict[str, Trapezoid]:
    look = {}
    for name, four in given.items():
        if name not in MEASURES:
            raise ParameterError(unknown_name("measure", name, MEASURES))
        numbers = [one for one in four if isinstance(one, (int, float))] if isinstance(four, list) else []
        if len(numbers) != 4 or any(math.isnan(one) for one in numbers):
            raise ParameterError(
                f"{name} = {shown(four)} must be four numbers in order, such as [1.1, 1.6, 4.5, inf]"
            )
        look[name] = Trapezoid(*(float(one) for one in numbers))
    return look


def _line(name: str, given: object) -> Line:
    points = given.get("points") if isinstance(given, dict) else given
    pairs = isinstance(points, list) and all(isinstance(one, list) and len(one) == 2 for one in points)
    if not pairs or len(points) < 2:  # type: ignore[arg-type]
        raise ParameterError(
            f"line {name} = {shown(given)} must be two points or more, as [[10, 200], [300, 210]]"
        )
    return Line(name, tuple((_number("x", x), _number("y", y)) for x, y in points))  # type: ignore[union-attr]


def rules_to_json(rules: Rules) -> dict[str, Any]:
    """Return rules as plain values, for `run.json`: names, triggers and classes, so that a run tells what it looked for."""
    return {
        "scenarios": [
            {
                key: _plain(value)
                for key, value in dataclasses.asdict(one).items()
                if value not in (None, (), "", False)
            }
            for one in rules.scenarios
        ],
        "classes": sorted(name for name in rules.kinds if name != NOISE),
        "lines": {one.name: [list(point) for point in one.points] for one in rules.lines},
    }


def _plain(value: Any) -> Any:
    """A value without infinities, which JSON has not."""
    if isinstance(value, dict):
        return {key: one for key, one in value.items() if math.isfinite(one)}
    return list(value) if isinstance(value, tuple) else value

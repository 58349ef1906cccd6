"""Zones in a file: GeoJSON in pixels, a Feature a zone, and the rules between them.

    {"type": "FeatureCollection",
     "features": [{"type": "Feature",
                   "properties": {"kind": "entry", "name": "west door"},
                   "geometry": {"type": "Polygon", "coordinates": [[[0, 120], [30, 120], [30, 260], [0, 260], [0, 120]]]}}],
     "rules": [{"lost_in": "west door", "found_in": "yard", "never": true}]}

All of it is checked when it is read; a fault names the zone or the rule, and what would do.
"""

from __future__ import annotations

import difflib
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from perdure.errors import FormatError, ParameterError
from perdure.files.lines import json_with_nan, why_not_json
from perdure.files.span import shown
from perdure.files.whole import whole_file
from perdure.params import unknown_name
from perdure.scene.zones import ANYWHERE, KINDS, SETTINGS, Polygon, Rule, Zone, Zones, shape_of

Json = Any
_LARGEST = 8 << 20  # bytes of a file
_MOST = 1000  # zones, and rules
_MEMBERS = ("type", "features", "rules")  # that we read; others are anybody's
_POINTS = 10000  # of one zone
_LONGEST = 3600.0  # s that a rule may wait
_WORDS = ("lost_in", "found_in", "after", "within", "never")


def read_zones(path: str | Path, width: int = 0, height: int = 0) -> Zones:
    """Read zones and rules from a file.

    Parameters
    ----------
    path : str or Path
        GeoJSON: a FeatureCollection with a Polygon or MultiPolygon a zone, in pixels.
    width, height : int
        The picture's size, in which every zone must lie; 0 where it is not known.

    Raises
    ------
    FormatError
        For a file that is none, naming the zone or rule and what would do.
    """
    path = Path(path)
    try:
        if path.stat().st_size > _LARGEST:
            raise FormatError(
                f"{path} has {path.stat().st_size >> 20} MiB; a file of zones has {_LARGEST >> 20} MiB at most"
            )
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise FormatError(f"cannot read {path}: {error.strerror or error}") from error
    except UnicodeDecodeError:
        raise FormatError(f"{path} is not JSON: it is not text") from None
    try:
        written = json_with_nan(text)
    except (ValueError, RecursionError) as error:
        line = f", line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise FormatError(f"{path}{line}: not JSON ({why_not_json(error)})") from None
    try:
        zones = zones_of_json(written, width, height)
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from None
    if not zones.zones:
        raise FormatError(f'{path} holds no zone; put one into "features", or leave the file out')
    return zones


def write_zones(path: Path, zones: Zones, reasons: Mapping[str, str] | None = None) -> None:
    """Write zones and rules into a file that `read_zones` reads; it appears whole or not at all.

    `reasons` tell by name why there is a zone; readers leave them alone.
    """
    collection = zones_to_json(zones)
    for feature in collection["features"]:
        if reasons and feature["properties"]["name"] in reasons:
            feature["properties"]["reason"] = reasons[feature["properties"]["name"]]
    with whole_file(path) as file:
        file.write(_rings_in_lines(json.dumps(collection, indent=1, ensure_ascii=False)) + "\n")


def _rings_in_lines(written: str) -> str:
    """Indented JSON with every list of numbers, and every list of such lists, in one line: a ring a line."""
    written = re.sub(r"\[\s*\n([^\[\]{}\"]*)\n\s*\]", lambda one: f"[{' '.join(one[1].split())}]", written)
    several = r"\[\s*\n((?:\s*\[[-0-9.eE+, ]*\],?)+)\s*\n\s*\]"
    return re.sub(several, lambda one: f"[{' '.join(one[1].split())}]", written)


def zones_to_json(zones: Zones) -> dict[str, Json]:
    """Return zones and rules as GeoJSON; settings that are their kind's default are left out."""
    features = [
        {"type": "Feature", "properties": _properties(zone), "geometry": _geometry(zone)} for zone in zones.zones
    ]
    collection: dict[str, Json] = {"type": "FeatureCollection", "features": features}
    if zones.rules:
        collection["rules"] = [_rule_to_json(rule) for rule in zones.rules]
    return collection


def zones_of_json(written: Json, width: int = 0, height: int = 0) -> Zones:
    """Return the zones that a GeoJSON value holds; FormatError names what is wrong."""
    if not isinstance(written, Mapping) or written.get("type") != "FeatureCollection":
        raise FormatError('not GeoJSON of zones: wanted is {"type": "FeatureCollection", "features": [...]}')
    misspelt = [
        key for key in written if key not in _MEMBERS and difflib.get_close_matches(str(key).lower(), ("rules",))
    ]
    if misspelt:
        raise FormatError(unknown_name("member of a file of zones", misspelt[0], ("rules",)))
    features, rules = written.get("features"), written.get("rules", [])
    if not isinstance(features, list):
        raise FormatError('"features" must be a list of zones')
    if not isinstance(rules, list):
        raise FormatError('"rules" must be a list')
    if max(len(features), len(rules)) > _MOST:
        raise FormatError(f"there may be {_MOST} zones and {_MOST} rules at most")
    zones: list[Zone] = []
    for number, feature in enumerate(features, 1):
        zone = _zone(number, feature, width, height)
        same = [other for other, one in enumerate(zones, 1) if one.name == zone.name]
        if same:
            raise FormatError(f"zones {same[0]} and {number} have one name, {zone.name!r}; give each its own")
        zones.append(zone)
    names = [zone.name for zone in zones]
    return Zones(
        tuple(zones),
        tuple(_rule(number, rule, names) for number, rule in enumerate(rules, 1)),
        (height, width),
    )


# Zones ------------------------------------------------------------------------------------------------------


def _zone(number: int, feature: Json, width: int, height: int) -> Zone:
    """A zone; FormatError names it by its number and, where it has one, its name."""
    here = f"zone {number}"
    if not isinstance(feature, Mapping) or feature.get("type") != "Feature":
        raise FormatError(
            f'{here} is no GeoJSON Feature: wanted is {{"type": "Feature", "properties", "geometry"}}'
        )
    properties = feature.get("properties")
    if not isinstance(properties, Mapping):
        raise FormatError(f'{here} has no "properties"; give its kind and name there')
    name, kind = properties.get("name"), properties.get("kind")
    if not isinstance(name, str) or not name.strip() or name == ANYWHERE:
        raise FormatError(
            f'{here} has the name {shown(name)}; give it a word or more in "properties", not {ANYWHERE!r}'
        )
    here = f"zone {number} {name!r:.80}"
    if kind is None:
        raise FormatError(f'{here} has no kind; give it one in "properties": {", ".join(KINDS)}')
    if not isinstance(kind, str) or kind not in KINDS:
        raise FormatError(f"{here}: {unknown_name('kind of zone', shown(kind).strip(chr(39)), KINDS)}")
    try:
        polygons = tuple(_polygons(feature.get("geometry")))
        _check_points(polygons, width, height)
        _check_shape(polygons)
        return Zone(kind, name, polygons, **_settings(properties))
    except (ParameterError, ValueError) as error:
        raise FormatError(f"{here}: {error}") from None


def _settings(properties: Mapping[str, Json]) -> dict[str, Json]:
    """The settings among a zone's properties; a name that is nearly one is refused, what is foreign is left."""
    for word in properties:
        near = difflib.get_close_matches(str(word), (*SETTINGS, "kind", "name"), n=1, cutoff=0.75)
        if near and near[0] != word:
            raise ValueError(f"{word!r} is no setting of a zone; did you mean {near[0]!r}?")
    return {name: properties[name] for name in SETTINGS if name in properties}


def _polygons(geometry: Json) -> Iterator[Polygon]:
    """The polygons of a geometry; ValueError for what is none."""
    if not isinstance(geometry, Mapping) or geometry.get("type") not in ("Polygon", "MultiPolygon"):
        kind = geometry.get("type") if isinstance(geometry, Mapping) else geometry
        raise ValueError(f"its geometry is {shown(kind)}; wanted is a Polygon or a MultiPolygon")
    written = geometry.get("coordinates")
    several = written if geometry["type"] == "MultiPolygon" else [written]
    if not isinstance(several, list) or not several:
        raise ValueError("its geometry has no coordinates")
    for polygon in several:
        if not isinstance(polygon, list) or not polygon:
            raise ValueError("a polygon must be a list of rings, each a list of points [x, y]")
        yield tuple(_ring(ring) for ring in polygon)


def _ring(ring: Json) -> tuple[tuple[float, float], ...]:
    """The points of a ring, the first not repeated at its end."""
    if not isinstance(ring, list) or not all(isinstance(one, list) and len(one) > 1 for one in ring):
        raise ValueError("a ring must be a list of points [x, y] in pixels")
    if len(ring) > _POINTS:
        raise ValueError(f"it has {len(ring)} points; a ring has {_POINTS} at most")
    points = [(_number(one[0]), _number(one[1])) for one in ring]
    if len(points) > 1 and points[0] == points[-1]:
        points.pop()
    if len(set(points)) < 3:
        raise ValueError(f"a ring has {len(set(points))} different points; three at least make an area")
    return tuple(points)


def _number(value: Json) -> float:
    if type(value) not in (int, float) or not math.isfinite(value):
        raise ValueError(f"{shown(value)} is not a finite number of pixels")
    return float(value)


def _check_points(polygons: Sequence[Polygon], width: int, height: int) -> None:
    """Refuse a zone that leaves the picture, which was perhaps drawn on a picture of another size."""
    if not (width and height):
        return
    for x, y in (point for polygon in polygons for ring in polygon for point in ring):
        if not (0 <= x <= width and 0 <= y <= height):
            raise ValueError(
                f"its point [{x:g}, {y:g}] lies outside the picture of {width}x{height}; "
                f"x must be 0 to {width}, y 0 to {height}"
            )


def _check_shape(polygons: Sequence[Polygon]) -> None:
    """Refuse a zone that crosses itself or has no area."""
    import shapely

    shape = shape_of(polygons)
    if not shapely.is_valid(shape):
        reason, _, place = shapely.is_valid_reason(shape).partition("[")
        at = f" at [{', '.join(place.rstrip(']').split())}]" if place else ""
        words = "its outline crosses itself" if "Self-intersection" in reason else f"no proper area ({reason})"
        raise ValueError(f"{words}{at}; draw the points in their order round the zone")
    if shapely.area(shape) <= 0:
        raise ValueError("it has no area")


def _properties(zone: Zone) -> dict[str, Json]:
    known = {
        name: getattr(zone, name) for name, one in KINDS[zone.kind].items() if getattr(zone, name) != one.default
    }
    return {"kind": zone.kind, "name": zone.name, **known}


def _geometry(zone: Zone) -> dict[str, Json]:
    polygons = [
        [[[_plain(x), _plain(y)] for x, y in (*ring, ring[0])] for ring in rings] for rings in zone.polygons
    ]
    if len(polygons) == 1:
        return {"type": "Polygon", "coordinates": polygons[0]}
    return {"type": "MultiPolygon", "coordinates": polygons}


def _plain(number: float) -> float | int:
    return int(number) if number == int(number) else number


# Rules ------------------------------------------------------------------------------------------------------


def _rule(number: int, written: Json, names: Sequence[str]) -> Rule:
    here = f"rule {number}"
    if not isinstance(written, Mapping):
        raise FormatError(f'{here} is no JSON object such as {{"lost_in": "A", "found_in": "B", "within": 20}}')
    for word in written:
        if word not in _WORDS:
            raise FormatError(f"{here}: {unknown_name('word of a rule', str(word), _WORDS)}")
    for word in ("lost_in", "found_in"):
        name = written.get(word)
        if name != ANYWHERE and name not in names:
            raise FormatError(
                f"{here}, {word}: {unknown_name('zone', str(name), names)}, or {ANYWHERE!r} for anywhere"
            )
    never = written.get("never", False)
    if not isinstance(never, bool):
        raise FormatError(f"{here}: never = {shown(never)} must be true or false")
    if never and {"after", "within"} & set(written):
        raise FormatError(f"{here}: 'never' has no times; leave out 'after' and 'within'")
    if not never and "within" not in written:
        raise FormatError(f'{here} says neither "within" how many seconds nor "never": true')
    after, within = _seconds(here, written, "after"), _seconds(here, written, "within", _LONGEST)
    if after > within:
        raise FormatError(f"{here}: after {after:g} s comes later than within {within:g} s; no time is left")
    return Rule(written["lost_in"], written["found_in"], after, within, never)


def _seconds(here: str, written: Mapping[str, Json], word: str, default: float = 0.0) -> float:
    value = written.get(word, default)
    if type(value) not in (int, float) or not 0 <= value <= _LONGEST:
        raise FormatError(f"{here}: {word} = {shown(value)} must be a number of seconds from 0 to {_LONGEST:g}")
    return float(value)


def _rule_to_json(rule: Rule) -> dict[str, Json]:
    places = {"lost_in": rule.lost_in, "found_in": rule.found_in}
    if rule.never:
        return {**places, "never": True}
    return {**places, **({"after": _plain(rule.after)} if rule.after else {}), "within": _plain(rule.within)}

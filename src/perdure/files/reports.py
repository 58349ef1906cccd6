"""Reports as plain values, as the run log holds them; what was read is checked before it becomes one."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Any

import numpy as np

from perdure.files.lines import mask_of_json, mask_to_json, outline_of_json, outline_to_json, short, short_row
from perdure.files.room import Room
from perdure.types import Dropped, Event, Explanation, Ground, Mask, Renamed, Report, Status, Tracks
from perdure.types.regions import FARTHEST

Json = Any


def report_to_json(frame: int, time: float, report: Report) -> Json:
    """Return a report as plain values; columns at their default are left out."""
    value: dict[str, Json] = {"frame": frame, "time": time}
    value["rows"] = [_row_to_json(report.rows, i, frame, time) for i in range(len(report.rows))]
    if report.renamed:
        value["renamed"] = [[one.old, one.new, one.begin, one.end] for one in report.renamed]
    if report.dropped:
        value["dropped"] = [[one.id, one.begin, one.end] for one in report.dropped]
    if report.events:
        value["events"] = [dataclasses.asdict(one) for one in report.events]
    if report.begun:
        value["begun"] = [dataclasses.asdict(one) for one in report.begun]
    if report.explanations:
        value["explanations"] = [
            {"id": one.id, "why": one.why, "figures": dict(one.figures)} for one in report.explanations
        ]
    return value


def report_of_json(value: Mapping[str, Json], with_masks: bool = True) -> Report:
    """Return the report that `report_to_json` wrote, and that `check_report` found good."""
    frame, time = value["frame"], float(value["time"])
    return Report(
        rows=_rows_of_json(value["rows"], frame, time, with_masks),
        renamed=tuple(Renamed(*one) for one in value.get("renamed", ())),
        dropped=tuple(Dropped(*one) for one in value.get("dropped", ())),
        events=_events_of_json(value.get("events", ())),
        begun=_events_of_json(value.get("begun", ())),
        explanations=tuple(Explanation(**one) for one in value.get("explanations", ())),
    )


# What was read ------------------------------------------------------------------------------------------------------


def check_report(value: Mapping[str, Json], newest: int = -1) -> tuple[int, float]:
    """Return frame and time of a report as plain values, where `newest` is the last frame of those before it, -1 for none.

    Raises
    ------
    ValueError, KeyError, TypeError, AttributeError
        If anything in it but its silhouettes and contours, which have checks of their own, cannot be.
    """
    _whole("frame", [value["frame"]], -1)
    if 0 <= value["frame"] <= newest:
        raise ValueError(f"frame {value['frame']} comes after frame {newest}")
    _numbers("time", [value["time"]], _LONGEST)
    _check_rows(value["rows"])
    for one in _listed(value, "renamed", 4):
        _whole("the ids of a renaming", one[:2], 1)
        _whole("its frames", one[2:], -1, _OPEN_END)
    for one in _listed(value, "dropped", 3):
        _whole("the id of what is dropped", one[:1], 1)
        _whole("its frames", one[1:], -1, _OPEN_END)
    for one in (*_listed(value, "events"), *_listed(value, "begun")):
        _check_event(one)
    for one in _listed(value, "explanations"):
        _whole("the id of an explanation", [one["id"]], 1)
        _texts("the why of an explanation", [one["why"]])
        _numbers("the figures of an explanation", one.get("figures", {}).values(), _LARGEST_FIGURE)
    return value["frame"], float(value["time"])


def _check_rows(rows: Json) -> None:
    """Refuse rows of which anything cannot be; looked at column by column, which is quicker."""
    if type(rows) is not list:
        raise ValueError("rows must be a list")
    if not rows:
        return
    _whole("id", [row["id"] for row in rows], 1)
    boxes = [row["box"] for row in rows]
    if {type(one) for one in boxes} != {list} or {len(one) for one in boxes} != {4}:
        raise ValueError("a box must have four sides")
    _numbers("the sides of a box", list(chain.from_iterable(boxes)), FARTHEST)
    if any(x1 > x2 or y1 > y2 for x1, y1, x2, y2 in boxes):
        raise ValueError("a box is inside out")
    if not {row["status"] for row in rows} <= _WORDS:
        raise ValueError(f"status must be one of {', '.join(sorted(_WORDS))}")
    _numbers("confidence", [row["confidence"] for row in rows], _LARGEST_FIGURE)
    _whole("frame", _said(rows, "frame"), 0)
    _numbers("time", _said(rows, "time"), _LONGEST)
    _whole("group", _said(rows, "group"), 0)
    _texts("class", _said(rows, "class"))
    _texts("hidden_side", _said(rows, "hidden_side"))
    if not set(map(type, _said(rows, "inferred"))) <= {bool}:
        raise ValueError("inferred must be true or false")
    for links in _said(rows, "links"):
        _whole("links", links, 0)
    for place in _said(rows, "ground"):
        if type(place) is not list or len(place) not in (2, 3):
            raise ValueError("ground must be [x, y] or [x, y, speed]")
        _numbers("ground", place, _LONGEST)


def _check_event(one: Mapping[str, Json]) -> None:
    _texts("the kind, zone and why of an event", [one["kind"], one.get("zone", ""), one.get("why", "")])
    _whole("the frames of an event", [one["begin"], one["end"]], -_LARGEST)
    if one["begin"] > one["end"]:
        raise ValueError(f"an event ends in frame {one['end']}, before it begins")
    _whole("the ids of an event", one["ids"], 0)
    _numbers("the confidence of an event", [one.get("confidence", 1.0)], _LARGEST_FIGURE)


def _said(rows: list[Json], name: str) -> list[Json]:
    """A column's values where rows have one."""
    return [row[name] for row in rows if name in row]


def _listed(value: Mapping[str, Json], name: str, length: int | None = None) -> list[Json]:
    """A list in a report, of lists so long."""
    several = value.get(name, [])
    if type(several) is not list or any(
        length is not None and (type(one) is not list or len(one) != length) for one in several
    ):
        raise ValueError(f"{name} must be a list" + (f" of lists of {length}" if length else ""))
    return several


def _whole(name: str, values: list[Json], low: int, high: int | None = None) -> None:
    most = _LARGEST if high is None else high
    if (
        type(values) is not list
        or not set(map(type, values)) <= {int}
        or not all(low <= one <= most for one in values)
    ):
        raise ValueError(f"{name} must be whole numbers from {low} to {most}")


def _numbers(name: str, values: Iterable[Json], most: float) -> None:
    there = list(values)
    if not set(map(type, there)) <= {int, float, bool} or not all(abs(one) <= most for one in there):
        raise ValueError(f"{name} must be numbers that can be")


def _texts(name: str, values: Iterable[Json]) -> None:
    if not set(map(type, values)) <= {str}:
        raise ValueError(f"{name} must be texts")


_WORDS = {one.word for one in Status}
_LARGEST = 2**53  # of a whole number that floats hold exactly
_OPEN_END = 2**62  # frame: of a correction without an end
_LONGEST = 1e12  # s, m
_LARGEST_FIGURE = 1e300


# Rows and events ----------------------------------------------------------------------------------------------------


def _events_of_json(value: Iterable[Mapping[str, Json]]) -> tuple[Event, ...]:
    return tuple(Event(**{**one, "ids": tuple(one["ids"])}) for one in value)


def _row_to_json(rows: Tracks, i: int, frame: int, time: float) -> Json:
    row: dict[str, Json] = {"id": int(rows.ids[i]), "box": short_row(rows.boxes[i])}
    if rows.frames[i] != frame or rows.times[i] != time:
        row["frame"], row["time"] = int(rows.frames[i]), float(rows.times[i])
    row["status"] = Status(rows.status[i]).word
    row["confidence"] = short(rows.confidence[i])
    believed, outline, ground = rows.believed[i], rows.outlines[i], rows.ground[i]
    optional = {
        "class": str(rows.classes[i]),
        "group": int(rows.groups[i]),
        "inferred": bool(rows.inferred[i]),
        "hidden_side": str(rows.hidden_side[i]),
        "links": list(rows.links[i]),
        "ground": None if ground is None else [one for one in ground if one is not None],
        "believed": None if believed is None else mask_to_json(believed),
        "outline": None if outline is None else outline_to_json(outline),
        "mask": mask_to_json(rows.masks[i]) if rows.masks[i].bits.size else None,
    }
    return row | {key: value for key, value in optional.items() if value}


def _rows_of_json(rows: list[Json], frame: int, time: float, with_masks: bool) -> Tracks:
    if not rows:
        return Tracks.empty()
    room = Room(len(rows) * _LEAST_BYTES)

    def mask(row: Json, name: str) -> Mask | None:
        return room.keep(mask_of_json(row[name])) if with_masks and name in row else None

    return Tracks.of(
        frames=[row.get("frame", frame) for row in rows],
        times=[row.get("time", time) for row in rows],
        ids=[row["id"] for row in rows],
        boxes=np.array([row["box"] for row in rows], np.float32),
        status=[Status[row["status"].upper()] for row in rows],
        confidence=[row["confidence"] for row in rows],
        classes=[row.get("class", "") for row in rows],
        groups=[row.get("group", 0) for row in rows],
        inferred=[row.get("inferred", False) for row in rows],
        hidden_side=[row.get("hidden_side", "") for row in rows],
        links=[tuple(row.get("links", ())) for row in rows],
        ground=[Ground(*map(float, row["ground"])) if "ground" in row else None for row in rows],
        believed=[mask(row, "believed") for row in rows],
        outlines=[outline_of_json(row["outline"]) if with_masks and "outline" in row else None for row in rows],
        masks=[mask(row, "mask") or _NO_MASK for row in rows],
    )


_NO_MASK = Mask.empty()
_LEAST_BYTES = 64  # of a row

"""What is sane of something that was read: numbers that can be, and the same again when it is written and read."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from perdure.errors import OutputError, ParameterError
from perdure.files.formats import Content, Format, Reading, Trait
from perdure.types import Event, Mask, Regions, Report, Rows, Status, Tracks
from perdure.types.regions import FARTHEST

LAST, LARGEST_ID = 2**31, 2**53


class Insane(AssertionError):
    """A file was read, and what came of it cannot be."""


def want(holds: object, what: str) -> None:
    """Refuse what does not hold."""
    if not holds:
        raise Insane(what)


def check_tracks(tracks: Tracks, size: tuple[int, int] | None = None) -> None:
    """Refuse rows that no tracker could have said; silhouettes must lie in pictures of a size."""
    keys = np.stack([tracks.frames, tracks.ids])
    want(len(np.unique(keys, axis=1).T) == len(tracks), "an id that a frame has twice")
    _check_each(tracks, size)


def _check_each(tracks: Tracks, size: tuple[int, int] | None) -> None:
    """Refuse rows each of which no tracker could have said, whatever the others say."""
    want((tracks.ids >= 1).all() and (tracks.ids <= LARGEST_ID).all(), "an id below 1, or too large")
    want((tracks.frames >= 0).all() and (tracks.frames <= LAST).all(), "a frame below 0, or too late")
    want((tracks.groups >= 0).all(), "a group below 0")
    check_boxes(tracks.boxes)
    want(np.isfinite(tracks.times).all() and (np.abs(tracks.times) <= LAST).all(), "a time that cannot be")
    want(np.isfinite(tracks.confidence).all(), "a confidence that is no number")
    want(np.isin(tracks.status, list(Status)).all(), "an unknown status")
    check_masks(tracks.masks, size)
    check_masks([one for one in tracks.believed if one is not None], None)
    for outline in tracks.outlines:
        want(outline is None or all(np.isfinite(ring).all() for ring in outline.rings), "an outline beyond all")
    for place in tracks.ground:
        want(place is None or all(one is None or math.isfinite(one) for one in place), "no place on the ground")


def check_boxes(boxes: np.ndarray) -> None:
    """Refuse boxes (N, 4) that are inside out or beyond all."""
    want(np.isfinite(boxes).all(), "a box that is no number")
    want((boxes[:, :2] <= boxes[:, 2:]).all(), "a box inside out")
    want((np.abs(boxes) <= FARTHEST).all(), "a box beyond all")


def check_masks(masks: Iterable[Mask], size: tuple[int, int] | None) -> None:
    """Refuse silhouettes that leave a picture of a size."""
    for mask in masks:
        x1, y1, x2, y2 = mask.box
        want(type(mask.x) is int and type(mask.y) is int, "the corner of a mask is no whole number")
        want(mask.bits.ndim == 2 and mask.bits.dtype == np.bool_, "a mask of other things than bits")
        want(max(map(abs, mask.box)) <= FARTHEST + 2**16, "a mask beyond all")
        inside = size is None or not mask.area or (x1 >= 0 and y1 >= 0 and x2 <= size[1] and y2 <= size[0])
        want(inside, "a mask that leaves the picture")


def check_rows(rows: Rows) -> None:
    """Refuse rows for a comparison that cannot be."""
    want((rows.frames >= 0).all() and (rows.frames <= LAST).all(), "a frame below 0, or too late")
    scored = rows.use != 3
    want((rows.ids[scored] >= 1).all() and (rows.ids <= LARGEST_ID).all(), "an id below 1, or too large")
    check_boxes(rows.boxes)
    check_masks(rows.masks, rows.size)


def check_regions(regions: Regions) -> None:
    """Refuse regions that no detector could have seen."""
    check_boxes(regions.boxes)
    want(((regions.scores >= 0) & (regions.scores <= 1)).all(), "a score outside of 0 to 1")
    check_masks(regions.masks, None)
    check_events(regions.events)


def check_events(events: Iterable[Event]) -> None:
    """Refuse events that cannot be."""
    for one in events:
        want(type(one.begin) is int and type(one.end) is int, f"an event at {one.begin!r} to {one.end!r}")
        want(one.begin <= one.end, "an event that ends before it begins")
        want(all(type(number) is int for number in one.ids), "an event of what is no id")
        want(isinstance(one.kind, str) and isinstance(one.zone, str) and isinstance(one.why, str), "no words")
        number = type(one.confidence) in (int, float) and math.isfinite(one.confidence)
        want(number, f"an event of confidence {one.confidence!r}")


def check_report(report: Report) -> None:
    """Refuse a report that no tracker could have given; settling leaves one of two rows of an id."""
    _check_each(report.rows, None)
    check_events(report.events)
    check_events(report.begun)
    for reason in report.explanations:
        want(type(reason.id) is int and isinstance(reason.why, str), "an explanation of nobody, or without words")
        want(all(isinstance(name, str) for name in reason.figures), "figures without names")
        want(all(type(one) in (int, float, bool) for one in reason.figures.values()), "figures that are none")
    for change in (*report.renamed, *report.dropped):
        want(0 <= change.begin <= 2**62 and 0 <= change.end <= 2**62, "a correction of frames that cannot be")


def check_content(content: Content, format_: Format, place: Path) -> None:
    """Refuse what a file of a format cannot hold, and what is not the same when it is written and read again."""
    check_tracks(content.tracks, content.size)
    if content.size is not None:
        want(all(type(side) is int and 1 <= side <= 2**16 for side in content.size), "a picture of no size")
    want(content.fps is None or 0 < content.fps <= 1e6, "a rate that cannot be")
    want(isinstance(content.name, str), "a name that is no word")
    want(all(isinstance(one, str) for one in content.images.values()), "a picture whose name is no word")
    if content.frames is not None:
        want(all(0 <= one <= LAST for one in content.frames), "a frame that cannot be")
        want(list(content.frames) == sorted(set(content.frames)), "frames out of their order")
    if format_.write is not None and (content.size is not None or not format_.needs_size):
        _check_again(content, format_, place)


def _check_again(content: Content, format_: Format, place: Path) -> None:
    """Write it in its own format, read that, and compare what the format holds."""
    assert format_.read is not None
    assert format_.write is not None
    path = place / f"again{format_.suffixes[0] if format_.suffixes else ''}"
    try:
        rows = format_.write(path, content, overwrite=True)
    except (OutputError, ParameterError) as error:
        if "too large" in str(error) or "too much" in str(error):
            return
        raise Insane(f"{format_.name} does not write what it read ({error})") from error
    if sum(content.size or ()) > 2000:
        return
    back = format_.read(path, Reading()).tracks
    tracks = content.tracks
    want(len(back) == rows, f"{rows} rows are written, {len(back)} are read")
    written = {key: row for row, key in enumerate(zip(tracks.frames.tolist(), tracks.ids.tolist(), strict=True))}
    keys = list(zip(back.frames.tolist(), back.ids.tolist(), strict=True))
    want(set(keys) <= set(written), "a row is read that was not written")
    _check_columns(tracks.take([written[key] for key in keys]), back, format_)


def _check_columns(tracks: Tracks, back: Tracks, format_: Format) -> None:
    """Compare rows that were written with those that are read, in what the format holds."""
    holds, rounds = format_.holds, format_.rounds
    if Trait.BOX in holds:
        _check_near(tracks.boxes, back.boxes, rounds.get("boxes", 0.0), "another box")
    if Trait.CHANGING_CONFIDENCE in holds:
        _check_near(tracks.confidence, back.confidence, rounds.get("confidence", 0.0), "another confidence")
    if Trait.TIME in holds:
        _check_near(tracks.times, back.times, rounds.get("times", 0.0), "another time")
    if Trait.CHANGING_CLASS in holds:
        told = np.where(tracks.classes == "", format_.unnamed, tracks.classes)
        if format_.classes:
            told = np.where(np.isin(told, format_.classes), told, format_.unnamed)
        want((told == back.classes).all(), "another class")
    if Trait.STATUS in holds:
        lost = (tracks.status == Status.LOST) & (Trait.LOST not in holds)
        want((np.where(lost, Status.OCCLUDED, tracks.status) == back.status).all(), "another status")
    if Trait.GROUP in holds:
        want((tracks.groups == back.groups).all(), "another group")
    if Trait.MASK in holds and Trait.MASK_TOO in holds:
        for one, other in zip(tracks.masks, back.masks, strict=True):
            pair = [
                Mask.of_image(mask.bits, mask.y, mask.x) if mask.area else Mask.empty() for mask in (one, other)
            ]
            want(pair[0] == pair[1], "another silhouette")


def _check_near(one: np.ndarray, other: np.ndarray, step: float, what: str) -> None:
    """Compare numbers that were rounded to steps, or to six digits of a float32 where these are coarser."""
    away = np.abs(one.astype(float) - other.astype(float))
    want((away <= 0.6 * step + 1e-4 * (step > 0) * np.abs(one) + 1e-12).all(), what)

"""A result against a truth, as files: everything that can be scored of the two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from perdure.draw import Mark
from perdure.errors import FormatError, ParameterError
from perdure.files.scored import Match, Result, Truth, read_result, read_scored_truth
from perdure.files.span import shown
from perdure.metrics.boundary import DavisScore, jaccard_and_boundary
from perdure.metrics.clear import Pairs, pair, switches
from perdure.metrics.compared import Compared, compare
from perdure.metrics.events import EventScore, Identities, merges_of, score_blobs, score_events
from perdure.metrics.mistakes import Mistake, mistakes
from perdure.metrics.scoring import LEAST_OVERLAP, Score, score_compared
from perdure.types import Event, Rows, Use

NO_ROWS = Rows.of(frames=(), ids=())


_NEAR = 5  # frames, by which a truth may reach beyond the rows of a run of the same part


@dataclass(frozen=True)
class Window:
    """The frames that are scored, `first` to `last`, both included, counted from 0; None for no bound."""

    first: int | None = None
    last: int | None = None

    def holds(self, frame: int) -> bool:
        """Return whether a frame is in the window."""
        return (self.first is None or frame >= self.first) and (self.last is None or frame <= self.last)


@dataclass(frozen=True, eq=False)
class Comparison:
    """The scores of one sequence; None for what the files do not hold or nobody asked for.

    Parameters
    ----------
    name : str
    result, truth : Path
    protocol : str
        How rows of the truth were used.
    frames : (int, int) or None
        First and last frame with a row on either side, from 0.
    boxes, masks : Score or None
    davis : DavisScore or None
        J and F of the silhouettes.
    events : EventScore or None
        With a clip whose events are known.
    mistakes : tuple of Mistake
        Of the boxes, or of the silhouettes where only these are compared; empty where not asked for.
    report_confidence : float or None
        Of a run: from which confidence hidden targets counted.
    beyond : int
        Rows of the result in frames of which the truth has no row.
    group : str
        The argument that the result came from, where several hold the same sequences.
    notes : tuple of str
        What the reader must know of these two files.
    """

    name: str
    result: Path
    truth: Path
    protocol: str
    frames: tuple[int, int] | None
    boxes: Score | None
    masks: Score | None
    davis: DavisScore | None
    events: EventScore | None
    mistakes: tuple[Mistake, ...]
    report_confidence: float | None
    beyond: int
    group: str
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Wanted:
    """What of the two is to be compared, and how."""

    masks: bool = False
    mistakes: bool = False
    window: Window = Window()
    protocol: str = "auto"
    report_confidence: float | None = None


def read_window(start: str | None, end: str | None) -> Window:
    """Read a window: plain numbers count from 1 as MOT text does, both included; `300f` as in `perdure track`.

    >>> read_window("301", "600") == read_window("300f", "600f") == Window(300, 599)
    True

    Raises
    ------
    ParameterError
        For what is neither, and for an end before the start.
    """
    window = Window(_bound("start", start, 0), _bound("end", end, 1))
    if window.first is not None and window.last is not None and window.last < window.first:
        raise ParameterError(f"start ({start}) must not lie after end ({end})")
    return window


def compare_files(match: Match, wanted: Wanted) -> Comparison:
    """Score a result against its truth.

    Raises
    ------
    FormatError
        For a file that is not what it should be, and where silhouettes are wanted and a side has none.
    """
    true = read_scored_truth(match.truth, masks=wanted.masks, protocol=wanted.protocol)
    silhouettes = wanted.masks or true.boxes is None
    said = read_result(match.result, masks=silhouettes, report_confidence=wanted.report_confidence)
    _refuse_other_sizes(said, true)
    window = wanted.window
    laid = _lay_boxes(said, true, window), _lay_masks(said, true, window) if silhouettes else None
    main = laid[0] or laid[1] or compare(NO_ROWS, NO_ROWS)
    pairs = pair(main, LEAST_OVERLAP)
    events = None if true.events is None else _events(true, window)
    sides = [side.frames for side in (main.truth, main.said) if len(side)]
    return Comparison(
        name=match.name,
        result=match.result,
        truth=match.truth,
        protocol=true.protocol,
        frames=(int(min(one[0] for one in sides)), int(max(one[-1] for one in sides))) if sides else None,
        boxes=score_compared(laid[0], pairs) if laid[0] else None,
        masks=score_compared(laid[1], None if laid[0] else pairs, masks=True) if laid[1] else None,
        davis=_davis(said, true, window) if laid[1] else None,
        events=None if events is None else _score_events(said, true, events, main, pairs, window),
        mistakes=tuple(mistakes(main, pairs, merges_of(events or ()))) if wanted.mistakes else (),
        report_confidence=said.report_confidence,
        beyond=_beyond(main, true),
        group=match.group,
        notes=(*said.notes, *_notes(main, true, pairs), *_of_part(said, main, window)),
    )


def marks_by_frame(run: Path, truth: Path, linger: int) -> dict[int, list[Mark]]:
    """Return what of a run departs from a truth, by frame, to be drawn.

    Parameters
    ----------
    run, truth : Path
        Boxes are compared, those of its silhouettes where the truth has no others.
    linger : int
        Frames for which a change of id stays marked.

    Raises
    ------
    FormatError
        For a file that is not what it should be.
    """
    said, true = read_result(run, masks=False), read_scored_truth(truth, masks=False)
    _refuse_other_sizes(said, true)
    rows = true.boxes if true.boxes is not None else true.masks
    compared = compare(said.boxes, NO_ROWS if rows is None else rows)
    pairs = pair(compared, LEAST_OVERLAP)
    marks: dict[int, list[Mark]] = {}

    def mark(kind: str, text: str, side: Rows, row: int) -> None:
        x1, y1, x2, y2 = side.boxes[row].tolist()
        marks.setdefault(int(side.frames[row]), []).append(Mark(kind, text, (x1, y1, x2, y2)))

    for row in np.setdiff1d(np.arange(len(compared.truth)), pairs.truth).tolist():
        mark("missed", f"missed {compared.truth.ids[row]}", compared.truth, row)
    for row in np.setdiff1d(np.arange(len(compared.said)), pairs.said).tolist():
        mark("wrong", "", compared.said, row)
    names = compared.said.ids[pairs.said]
    objects = compared.truth.ids[pairs.truth]
    for place in switches(compared, pairs).tolist():
        mine = np.flatnonzero(objects == objects[place])
        here = int(np.searchsorted(mine, place))
        text = f"{names[mine[here - 1]]} → {names[place]}"
        until = compared.said.frames[pairs.said[place]] + linger
        for later in mine[here:]:
            row = int(pairs.said[later])
            if names[later] == names[place] and compared.said.frames[row] < until:
                mark("changed", text, compared.said, row)
            else:
                break
    return marks


def _lay_boxes(said: Result, true: Truth, window: Window) -> Compared | None:
    if true.boxes is None:
        return None
    return compare(_inside(said.boxes, window), _inside(true.boxes, window))


def _lay_masks(said: Result, true: Truth, window: Window) -> Compared:
    rows = _silhouettes(said.masks, said.path), _silhouettes(true.masks, true.path)
    return compare(*(_inside(one, window) for one in rows), masks=True)


def _silhouettes(rows: Rows | None, path: Path) -> Rows:
    if rows is None or (len(rows) and not rows.masks):
        raise FormatError(
            f"{path} holds no silhouettes, only boxes; silhouettes are compared with --masks, or where"
            " a truth holds nothing else"
        )
    return rows


def _refuse_other_sizes(said: Result, true: Truth) -> None:
    """Refuse two sides whose pictures are known to differ in size."""
    here = next((one.size for one in (said.boxes, said.masks) if one is not None and one.size), None)
    there = next((one.size for one in (true.boxes, true.masks) if one is not None and one.size), None)
    if here and there and here != there:
        raise FormatError(
            f"{said.path} is of pictures of {here[1]}x{here[0]}, {true.path} of {there[1]}x{there[0]}:"
            " not of the same video"
        )


def _of_part(said: Result, compared: Compared, window: Window) -> list[str]:
    """That a run of a part of the video is held against the whole truth."""
    if not said.part or window != Window() or said.tracks is None or not len(said.tracks):
        return []
    first, last = int(said.tracks.frames.min()), int(said.tracks.frames.max())
    true = compared.truth.frames
    if not len(true) or (true.min() >= first - _NEAR and true.max() <= last + _NEAR):
        return []
    return [
        f"{said.path} is of a part of the video ({said.part}), and what is true of the rest counts as missed; "
        "to score the part alone, name it by --start and --end"
    ]


def _notes(compared: Compared, true: Truth, pairs: Pairs) -> list[str]:
    """What is empty, and why."""
    notes = []
    rows = true.boxes if true.boxes is not None else true.masks
    if not len(compared.truth):
        why = f"as {true.protocol}" if rows is not None and len(rows) else "it is empty"
        hint = "; name another --protocol" if rows is not None and len(rows) and true.boxes is not None else ""
        notes.append(f"no row of {true.path} is asked for in these frames ({why}{hint}): all figures are 0")
    if not len(compared.said):
        notes.append("nothing was said in these frames")
    elif len(compared.truth) and not len(pairs.said):
        notes.append(f"no row lies on one of {true.path}: is it the truth of this video?")
    return notes


def _davis(said: Result, true: Truth, window: Window) -> DavisScore:
    rows = _silhouettes(true.masks, true.path)
    asked = rows.take(rows.use == Use.SCORED)
    every = true.pictures
    if every is None:
        every = tuple(range(int(asked.frames[0]), int(asked.frames[-1]) + 1)) if len(asked) else ()
    return jaccard_and_boundary(
        _silhouettes(said.masks, said.path), rows, [frame for frame in every if window.holds(frame)]
    )


def _events(true: Truth, window: Window) -> tuple[Event, ...]:
    return tuple(one for one in true.events or () if window.holds(one.begin))


def _score_events(
    said: Result, true: Truth, events: Sequence[Event], compared: Compared, pairs: Pairs, window: Window
) -> EventScore:
    identities = Identities(compared, pairs)
    told = None if said.events is None else [one for one in said.events if window.holds(one.begin)]
    if said.tracks is None or true.blobs is None:
        return score_events(told, events, identities)
    blobs = {frame: parts for frame, parts in true.blobs.items() if window.holds(frame)}
    return score_events(told, events, identities, blobs=score_blobs(said.tracks, blobs, identities))


def _inside(rows: Rows, window: Window) -> Rows:
    return rows.between(window.first, window.last)


def _beyond(compared: Compared, true: Truth) -> int:
    known = compared.truth.frames if true.pictures is None else np.array(true.pictures, np.int64)
    return int(np.count_nonzero(~np.isin(compared.said.frames, known)))


def _bound(name: str, given: str | None, past: int) -> int | None:
    """A frame from 0; `past` is 1 for an end, before which `300f` stops."""
    if given is None:
        return None
    text = given.strip()
    number = text.removesuffix("f")
    if not (number.isascii() and number.isdigit()) or len(number) > 9 or (text == number and int(number) < 1):
        raise ParameterError(
            f"{name} = {shown(given)} is no frame: give a number from 1, as in MOT text, or '300f', from 0"
        )
    frame = int(number) - (1 if text == number else past)
    if frame < 0:
        raise ParameterError(f"{name} = {shown(given)} leaves no frame: the first is 1, or 0f")
    return frame

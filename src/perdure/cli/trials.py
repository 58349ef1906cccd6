"""What `perdure tune` has its workers do: record regions, and judge settings on one piece of a source."""

from __future__ import annotations

import contextlib
import dataclasses
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from perdure import fold
from perdure.consistency import backwards, explained
from perdure.errors import FormatError, ParameterError
from perdure.files.regions import read_regions, write_regions
from perdure.files.scored import read_scored_truth
from perdure.metrics.compared import compare
from perdure.metrics.scoring import score_compared
from perdure.pipeline import plan
from perdure.tuning import Judged, Part
from perdure.types import Rows, Tracks

LEAST_SEGMENT = 25  # frames
SEGMENTS = 5  # of a piece, at most


@dataclass(frozen=True)
class Piece:
    """A part of a source that is tracked and judged by itself.

    Parameters
    ----------
    name, source : str
    settings : mapping
        Keywords of `plan` that all trials share.
    first, end : int
        Frames of the source, the end excluded.
    truth : Path or None
        Without one, the run is held against itself backwards.
    regions : Path or None
        Recorded ones, which spare detection.
    """

    name: str
    source: str
    settings: Mapping[str, Any]
    first: int
    end: int
    truth: Path | None = None
    regions: Path | None = None


def pieces_of(name: str, source: str, settings: Mapping[str, Any], truth: Path | None, parts: int) -> list[Piece]:
    """Divide a source into parts that are equally long.

    Raises
    ------
    ParameterError
        For a source that passes only once, or is too short.
    """
    opened = plan(source, **settings).source
    wanted, again = opened.wanted, opened.rereadable
    opened.close()
    if wanted is None or not again:
        raise ParameterError(f"{source} passes only once, or its length is not known; it cannot be tuned on")
    if len(wanted) < parts * LEAST_SEGMENT:
        raise ParameterError(f"{source} has {len(wanted)} frames, too few: {parts * LEAST_SEGMENT} are needed")
    cuts = np.linspace(wanted.start, wanted.stop, parts + 1).astype(int).tolist()
    names = [name] if parts == 1 else [f"{name}, frames {cuts[k]} to {cuts[k + 1] - 1}" for k in range(parts)]
    return [
        Piece(named, source, settings, cuts[place], cuts[place + 1], truth) for place, named in enumerate(names)
    ]


def record(task: tuple[Piece, Path]) -> int:
    """Write the regions of a piece into a file."""
    piece, path = task
    made = _plan(piece, {})
    try:
        return write_regions(path, made.prepared().seen())
    finally:
        made.source.close()


def judge(task: tuple[Piece, Mapping[str, Any]]) -> Judged:
    """Track a piece with settings, and hold that against its truth, or against itself backwards."""
    piece, parameters = task
    made = _plan(piece, parameters)
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            steps = made.prepared().steps()
            tracks = fold.settle(step.report for step in steps)
            if piece.truth is None:
                back = backwards(made, piece.first, piece.end, piece.settings.get("fps"))
                true = Rows.of_tracks(back.counted())
            else:
                true = true_rows(piece.truth).between(piece.first, piece.end - 1)
    finally:
        made.source.close()
    return _judged(tracks.counted(), _bare(true), piece)


def true_rows(path: Path) -> Rows:
    """Return the boxes of a truth.

    Raises
    ------
    FormatError
        Where it holds silhouettes only.
    """
    rows = read_scored_truth(path, masks=False).boxes
    if rows is None:
        raise FormatError(f"{path} holds silhouettes; `perdure tune` wants boxes, as MOT text")
    return rows


def _plan(piece: Piece, parameters: Mapping[str, Any]) -> Any:
    settings = dict(piece.settings)
    if piece.regions is not None:
        settings["detector"] = str(piece.regions)
    settings["parameters"] = {**settings.get("parameters", {}), **parameters}
    return plan(piece.source, **settings, start=f"{piece.first}f", end=f"{piece.end}f")


def _judged(counted: Tracks, true: Rows, piece: Piece) -> Judged:
    """Hold a run against what is true, as a whole and by segments."""
    said = _bare(Rows.of_tracks(counted))
    regions = dict(read_regions(piece.regions)) if piece.truth is None and piece.regions is not None else None
    count = max(1, min(SEGMENTS, (piece.end - piece.first) // LEAST_SEGMENT))
    cuts = np.linspace(piece.first, piece.end, count + 1).astype(int)

    def part(begin: int, end: int) -> Part:
        score = score_compared(compare(said.between(begin, end - 1), true.between(begin, end - 1)))
        if regions is None:
            return Part(score)
        rows = counted.take((counted.frames >= begin) & (counted.frames < end))
        return Part(score, explained(rows, {frame: one for frame, one in regions.items() if begin <= frame < end}))

    parts = [part(begin, end) for begin, end in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True)]
    return Judged(part(piece.first, piece.end), tuple(parts))


def _bare(rows: Rows) -> Rows:
    """Rows without silhouettes, which are not compared and take time."""
    return dataclasses.replace(rows, masks=())

"""Drawing films: from a settled run, or while a source that cannot be read twice is running."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from perdure.cli.progress import watched
from perdure.draw import Mark, Trails, paint
from perdure.errors import DamagedVideo
from perdure.files.film import Film
from perdure.files.runs import RunFolder
from perdure.files.video import Source
from perdure.fold import Step
from perdure.types import Scene, Tracks


def draw_film(
    source: Source,
    scene: Scene,
    folder: RunFolder,
    count: int | None,
    path: Path | None = None,
    marks: Mapping[int, Sequence[Mark]] | None = None,
) -> DamagedVideo | None:
    """Draw the settled tracks of a run over its source; return the damage at which the source broke off, if any.

    The film ends where the source does; without a frame there is none. `marks` are the departures from a truth
    by frame, where they are to be shown.
    """
    rows_of = _Rows(folder.settled_by_frame())
    frames = 0
    trails = Trails.empty()
    with Film(path or folder.film, scene.width, scene.height, fps=scene.fps) as film:
        try:
            for frame in watched(source, "drawing the film", count):
                rows = rows_of.at(frame.index)
                trails = trails.extended(rows, frame.time)
                here = None if marks is None else marks.get(frame.index, ())
                film.write(paint(frame, rows, trails, scene, marks=here), frame.time)
                frames += 1
                if count is not None and frames >= count:
                    break
        except DamagedVideo as damage:
            return damage
    return None


def drawn_while_running(steps: Iterable[Step], scene: Scene, path: Path) -> Iterator[Step]:
    """Yield the steps while their rows, as first said, are drawn into a film."""
    trails = Trails.empty()
    with Film(path, scene.width, scene.height, fps=scene.fps) as film:
        for step in steps:
            if step.frame is not None:
                rows = step.report.rows.in_frame(step.frame.index)
                trails = trails.extended(rows, step.frame.time)
                film.write(paint(step.frame, rows, trails, scene), step.frame.time)
            yield step


class _Rows:
    """Settled rows by frame, read forward once."""

    def __init__(self, settled: Iterator[tuple[int, Tracks]]) -> None:
        self._settled = settled
        self._next: tuple[int, Tracks] | None = next(settled, None)

    def at(self, index: int) -> Tracks:
        while self._next is not None and self._next[0] < index:
            self._next = next(self._settled, None)
        if self._next is not None and self._next[0] == index:
            return self._next[1]
        return Tracks.empty()

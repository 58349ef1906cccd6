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
from perdure.types import Event, Scene, Tracks


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
    doings = Doings.of(folder.scenario_events(), scene.fps)
    frames = 0
    trails = Trails.empty()
    with Film(path or folder.film, scene.width, scene.height, fps=scene.fps) as film:
        try:
            for frame in watched(source, "drawing the film", count):
                rows = rows_of.at(frame.index)
                trails = trails.extended(rows, frame.time)
                here = None if marks is None else marks.get(frame.index, ())
                film.write(paint(frame, rows, trails, scene, marks=here, words=doings.at(frame.index)), frame.time)
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


class Doings:
    """What targets do, by scenarios, to be written behind their ids: while it lasts, and for a second after a moment."""

    def __init__(self, spans: Sequence[tuple[int, int, int, str]]) -> None:
        self._spans = sorted(spans)  # begin, end, id, word
        self._next = 0
        self._now: list[tuple[int, int, int, str]] = []

    @staticmethod
    def of(events: Sequence[Event], fps: float) -> Doings:
        """Return the doings that events tell of."""
        return Doings(
            [
                (one.begin, max(one.end, one.begin + round(fps)), identity, one.kind.replace("_", " "))
                for one in events
                for identity in one.ids
            ]
        )

    def at(self, frame: int) -> dict[int, str]:
        """Return what is written in a frame, by id; frames are asked for in order."""
        while self._next < len(self._spans) and self._spans[self._next][0] <= frame:
            self._now.append(self._spans[self._next])
            self._next += 1
        self._now = [one for one in self._now if one[1] >= frame]
        words: dict[int, list[str]] = {}
        for _, _, identity, word in self._now:
            if word not in (known := words.setdefault(identity, [])):
                known.append(word)
        return {identity: ", ".join(some) for identity, some in words.items()}


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

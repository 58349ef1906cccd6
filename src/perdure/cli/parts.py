"""A long source in chunks: where it is cut, how a part is tracked, and how the runs of the parts become one."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from perdure.cli.film import draw_film
from perdure.cli.running import Outcome, run
from perdure.errors import ParameterError
from perdure.files.chunks import Whole, write_looks, write_whole
from perdure.files.runs import Reporting, RunFolder
from perdure.files.span import Moment, read_moment
from perdure.files.video import Source
from perdure.fold import Corrections, Step
from perdure.looks import Album, looked_at, portraits
from perdure.pipeline import Plan
from perdure.trackers.multifeature.weights import looks_for
from perdure.types import Report

OVERLAP = 4.0  # s: twice the time for which trackers look for who is not seen
_OF_PARTS = ("format", "version", "perdure")  # what `run.json` has of a part alone
_LEAST = 4  # frames of an overlap: one to see, one to say, on both sides


@dataclass(frozen=True)
class Chunks:
    """How long parts are, and for how long a part sees what the one before it sees, too; None for the usual."""

    length: Moment
    overlap: Moment | None = None

    @staticmethod
    def of(length: str, overlap: str | None) -> Chunks:
        """Read what the user gave.

        Raises
        ------
        ParameterError
            For what is no length of time.
        """
        long, more = read_moment("--chunks", length), read_moment("--overlap", overlap)
        assert long is not None
        if not (long.frame or long.seconds):
            raise ParameterError(
                f"--chunks = {length} leaves no frame; give a length such as '10:00', '90' or '3000f'"
            )
        return Chunks(long, more)

    @property
    def is_hasty(self) -> bool:
        """Whether the overlap is shorter than trackers look for who is not seen, as far as the user says seconds."""
        return self.overlap is not None and 0 < self.overlap.seconds < OVERLAP / 2

    def cut(self, source: Source, stride: int = 1) -> tuple[tuple[int, int], ...]:
        """Return the spans of frames of the parts of a source, each but the first with its overlap; () for only one.

        A time is so many frames at the source's own rate. What would be left at the end and is no longer than an
        overlap belongs to the part before it.

        Raises
        ------
        ParameterError
            If the source passes only once, or an overlap does not fit.
        """
        wanted = source.wanted
        if not source.rereadable or wanted is None:
            raise ParameterError(
                f"{source.name} cannot be entered in its middle, as --chunks must; leave it out, or record it into a file"
            )
        length = max(1, _frames(self.length, source.fps, stride))
        overlap = self._overlap(length, source.fps, stride)
        if not _LEAST <= overlap < length:
            raise ParameterError(
                f"{overlap * stride} frames of overlap do not fit chunks of {length * stride}: the overlap must be "
                f"{_LEAST * stride} frames at least, and shorter than the chunks; give other --chunks or --overlap"
            )
        count = max(1, math.ceil((len(wanted) - overlap) / length))
        if count == 1:
            return ()
        begins = [wanted[max(0, k * length - overlap)] for k in range(count)]
        ends = [wanted[(k + 1) * length] for k in range(count - 1)]
        return tuple(zip(begins, [*ends, wanted.stop], strict=True))

    def _overlap(self, length: int, fps: float, stride: int) -> int:
        """Frames of an overlap; where none is asked for, no more than half a chunk."""
        if self.overlap is not None:
            return _frames(self.overlap, fps, stride)
        return min(max(_frames(Moment(OVERLAP), fps, stride), _LEAST), length // 2)


def _frames(moment: Moment, fps: float, stride: int) -> int:
    """How many of the wanted frames a length of time is."""
    return round((moment.seconds * fps if moment.frame is None else moment.frame) / stride)


def run_part(
    made: Plan, folder: RunFolder, reporting: Reporting, window: Mapping[str, Any], whole: Source
) -> Outcome:
    """Track a part of a `whole` source into a folder, with the looks of its identities; first looks are over the whole."""
    album = Album.empty(_kinds(made))
    corrections: list[Report] = []

    def look(step: Step) -> None:
        nonlocal album
        if step.frame is not None:
            album = looked_at(album, step.frame, len(corrections), step.report.rows)
        corrections.append(Report(renamed=step.report.renamed, dropped=step.report.dropped))

    outcome = run(
        dataclasses.replace(made, whole=whole),
        folder,
        reporting,
        window=window,
        film=False,
        every=math.inf,
        beside=look,
    )
    write_looks(folder.path, portraits(album, Corrections.of(corrections).identity))
    return outcome


def stitch_parts(
    made: Plan,
    folder: RunFolder,
    reporting: Reporting,
    window: Mapping[str, Any],
    parts: Sequence[tuple[Path, tuple[int, int]]],
    *,
    film: bool,
) -> Outcome:
    """Make the run of a whole source out of the runs of its parts, as far as the first that broke off."""
    begun = time.monotonic()
    folders = [RunFolder.open(place) for place, _ in parts]
    told = [one.read_about() for one in folders]
    used = next((k for k, one in enumerate(told, 1) if one.get("status") != "done"), len(told))
    spans = [span for _, span in parts][:used]
    whole = write_whole(folder, list(zip(folders[:used], spans, strict=True)), made.scene, _kinds(made))
    totals = folder.write_results(reporting)
    ended, warnings = told[used - 1], _warnings(told[:used])
    about = {key: value for key, value in told[0].items() if key not in _OF_PARTS}
    about |= {"window": dict(window), "frames": whole.frames, "warnings": warnings, **dataclasses.asdict(totals)}
    about |= {"chunks": _about(spans, whole), "status": ended["status"], "message": ended.get("message", "")}
    folder.write_about(about)
    drawn = time.monotonic()
    if film:
        draw_film(made.source, made.scene, folder, whole.frames)
    return Outcome(
        frames=whole.frames,
        totals=totals,
        seconds=drawn - begun,
        film_seconds=time.monotonic() - drawn,
        status=str(ended["status"]),
        message=str(ended.get("message", "")),
        warnings=tuple(warnings),
        has_film=folder.film.exists(),
    )


def _about(spans: Sequence[tuple[int, int]], whole: Whole) -> dict[str, Any]:
    """For `run.json`, where it was cut and what was joined there."""
    return {
        "parts": [{"begin": first, "end": behind} for first, behind in spans],
        "borders": [one._asdict() for one in whole.borders],
    }


def _warnings(told: Sequence[Mapping[str, Any]]) -> list[str]:
    """What the user should know, each once."""
    return list(dict.fromkeys(one for about in told for one in about.get("warnings", ())))


def _kinds(made: Plan) -> list[Any]:
    """The features of looks, with the tracker's own network where it has one."""
    return looks_for(made.scene, getattr(made.tracker, "network", None)) if made.source.has_images else []

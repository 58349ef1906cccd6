"""One job of `perdure run`: a source, a detector, a tracker and their parameters, named by its hash."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from perdure import __version__, params
from perdure.cli.parts import run_part, stitch_parts
from perdure.cli.running import Outcome, run
from perdure.detection import file_of
from perdure.errors import FormatError, PerdureError
from perdure.files.runs import Reporting, RunFolder
from perdure.files.shapes import is_file
from perdure.files.video import open_source
from perdure.files.whole import cannot_write
from perdure.pipeline import plan

_FILES = ("class_names", "init", "roi", "calibration", "zones", "scenarios", "context", "embedding")
_WINDOW = ("fps", "start", "end", "stride", "roi", "zones", "calibration", "object_height")
_FINISHED = ("done", "damaged")


@dataclass(frozen=True)
class Job:
    """What one run rests on.

    Parameters
    ----------
    source : str
        As `perdure track` takes it.
    settings : mapping
        Keywords of `perdure.pipeline.plan`, those that were given.
    reporting : mapping
        Values of `Reporting` that were given.
    film : bool
        Whether `tracked.mp4` is drawn.
    chunks : tuple of (int, int)
        Spans of frames, each a job of its own, whose tracks are stitched; empty for a source that is tracked in one go.
    within : mapping or None
        Of such a part: `start` and `end` of the whole, over which first looks are taken.
    """

    source: str
    settings: Mapping[str, Any]
    reporting: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    film: bool = False
    chunks: tuple[tuple[int, int], ...] = ()
    within: Mapping[str, Any] | None = None

    @property
    def name(self) -> str:
        """A short name of the source, fit for a folder."""
        return name_of_source(self.source)

    @property
    def key(self) -> str:
        """The hash: of the version, the settings, the contents of the files that they name, and the source.

        A source that is a file, or a folder of them, is known by its place, sizes and times of change.
        """
        value = {
            "perdure": __version__,
            "source": _identity(self.source),
            "settings": self.settings,
            "files": [_digest(one) for one in self.files],
            "reporting": self.reporting,
            "film": self.film,
            **({"chunks": self.chunks} if self.chunks else {}),
            **({"within": self.within} if self.within is not None else {}),
        }
        return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()[:12]

    @property
    def files(self) -> list[Path]:
        """The files that the settings name."""
        return [Path(word) for word in _words(self.settings) if is_file(word)]

    @property
    def parts(self) -> list[Job]:
        """The jobs that its chunks are."""
        within = {name: self.settings[name] for name in ("start", "end") if name in self.settings}
        spans = ({**self.settings, "start": f"{first}f", "end": f"{behind}f"} for first, behind in self.chunks)
        return [Job(self.source, own, self.reporting, within=within) for own in spans]


def placed(job: Job, into: Path) -> Path:
    """Return the folder of a job among others: its source's name and its hash."""
    return into / f"{job.name}-{job.key}"


def finished(folder: Path) -> dict[str, Any] | None:
    """Return what `run.json` says of a job that was done before; None where there is none that ended."""
    try:
        about = RunFolder.open(folder).read_about()
    except FormatError:
        return None
    return about if about.get("status") in _FINISHED else None


def work_here(task: tuple[Job, Path]) -> dict[str, Any]:
    """Do a job into its folder, which appears whole or not at all; return what is to be told of it."""
    job, folder = task
    with whole_folder(folder) as part:
        return _done(job, RunFolder.create(part, overwrite=True, inputs=_inputs(job)))


@contextlib.contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Have a hidden folder that takes its name when all in it is written, in place of a run that is there."""
    part = folder.with_name(f".{folder.name}.part")
    discard(folder)
    try:
        yield part
        if folder.exists():
            RunFolder.create(folder, overwrite=True).discard()
        os.replace(part, folder)
    except OSError as error:
        raise cannot_write(folder, error) from error
    finally:
        discard(folder)


def discard(folder: Path) -> None:
    """Remove what a job left that did not end."""
    shutil.rmtree(folder.with_name(f".{folder.name}.part"), ignore_errors=True)


def work_away(task: tuple[Job, Path]) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Do a job on a machine that may not see the folder; return what is to be told, and the run's files."""
    job, folder = task
    with tempfile.TemporaryDirectory(prefix="perdure-") as place:
        made = RunFolder.create(Path(place) / folder.name, overwrite=False)
        told = _done(job, made)
        return told, {one.name: one.read_bytes() for one in sorted(made.path.iterdir())}


def bring(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write the files of a run that was done elsewhere into its folder, whole or not at all."""
    with whole_folder(folder) as part:
        part.mkdir(parents=True)
        for name, content in files.items():
            (part / name).write_bytes(content)


def _done(job: Job, folder: RunFolder) -> dict[str, Any]:
    """Run a job into a folder; whatever is printed meanwhile is nobody's to read.

    One whose worker dies is begun again from its first frame, so that there are no checkpoints.
    """
    reporting = params.build(Reporting, job.reporting)
    with contextlib.redirect_stderr(io.StringIO()):
        made = plan(job.source, **job.settings)
        if job.within is None:
            outcome = run(made, folder, reporting, window=window_of(job), film=job.film, every=math.inf)
        else:
            with contextlib.closing(open_source(job.source, fps=job.settings.get("fps"), **job.within)) as whole:
                outcome = run_part(made, folder, reporting, window_of(job), whole)
    if outcome.status == "interrupted":
        raise PerdureError("interrupted")
    return told_of(outcome)


def stitch_here(task: tuple[Job, Path]) -> dict[str, Any]:
    """Make the run of a job out of those of its chunks, which are there and then are no more."""
    job, folder = task
    reporting = params.build(Reporting, job.reporting)
    spans = zip((placed(part, chunks_of(folder)) for part in job.parts), job.chunks, strict=True)
    with contextlib.redirect_stderr(io.StringIO()), whole_folder(folder) as part:
        made = plan(job.source, **job.settings)
        into = RunFolder.create(part, overwrite=True, inputs=_inputs(job))
        with contextlib.closing(made.source):
            outcome = stitch_parts(made, into, reporting, window_of(job), list(spans), film=job.film)
    shutil.rmtree(chunks_of(folder), ignore_errors=True)
    return told_of(outcome)


def chunks_of(folder: Path) -> Path:
    """Return where the runs of a job's chunks are until they are stitched."""
    return folder.with_name(f".{folder.name}.chunks")


def window_of(job: Job) -> dict[str, Any]:
    """Return for `run.json` which part of its source a job is of, and what it knows of the place."""
    return {name: job.settings[name] for name in _WINDOW if job.settings.get(name) is not None}


def told_of(outcome: Outcome) -> dict[str, Any]:
    """Return what is to be told of a job that has ended."""
    return {
        "status": outcome.status,
        "message": outcome.message,
        "frames": outcome.frames,
        "seconds": round(outcome.seconds, 3),
        "rate": round(outcome.rate, 2),
        **dataclasses.asdict(outcome.totals),
        "warnings": list(outcome.warnings),
    }


def name_of_source(source: str) -> str:
    """Return a short name of a source without opening it.

    >>> name_of_source("clips/street.mp4"), name_of_source("frames/*.png"), name_of_source("rtsp://10.0.0.7:554/a")
    ('street', 'frames', '10.0.0.7-554-a')
    """
    if "://" in source:
        words = source.partition("://")[2].rpartition("@")[2]
        return "".join(letter if letter.isalnum() or letter in "._-" else "-" for letter in words)
    path = Path(os.path.abspath(source))
    if any(letter in path.name for letter in "*?["):
        path = path.parent
    return path.name if path.is_dir() else path.stem


def told_apart(sources: Sequence[str]) -> list[str]:
    """Return names of sources that differ, with as many of their folders as that needs.

    >>> told_apart(["a/video.mp4", "b/video.mp4", "street.mp4"])
    ['a/video', 'b/video', 'street']
    """
    names = [name_of_source(one) for one in sources]
    above = [Path(os.path.abspath(one)).parent for one in sources]
    while len(set(names)) < len(set(sources)) and any(one != one.parent for one in above):
        alike = [names.count(name) > 1 and "://" not in one for name, one in zip(names, sources, strict=True)]
        names = [
            f"{folder.name}/{name}" if other and folder.name else name
            for name, folder, other in zip(names, above, alike, strict=True)
        ]
        above = [folder.parent for folder in above]
    return names


def _inputs(job: Job) -> list[Path]:
    return [*job.files, *([Path(job.source)] if is_file(job.source) else [])]


def _words(settings: Mapping[str, Any]) -> list[str]:
    """Everything among the settings that may be the name of a file."""
    detector = file_of(settings.get("detector"))
    words: list[str] = [] if detector is None else [str(detector)]
    for name in _FILES:
        value = settings.get(name)
        words += [str(one) for one in (value if isinstance(value, (list, tuple)) else [value]) if one is not None]
    return [word.rpartition("@")[0] if not is_file(word) and "@" in word else word for word in words]


def _identity(source: str) -> Any:
    """By what a source is known."""
    if "://" in source:
        return source
    path = Path(source)
    if path.is_file():
        files = [path]
    elif path.is_dir():
        files = sorted(one for one in path.rglob("*") if one.is_file())
    else:
        files = sorted(one for one in path.parent.glob(path.name) if one.is_file()) if path.parent.is_dir() else []
    return [source, *((str(one), one.stat().st_size, one.stat().st_mtime_ns) for one in files)]


def _digest(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise FormatError(f"cannot read {path}: {error.strerror or error}") from error

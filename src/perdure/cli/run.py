"""`perdure run`: many videos in, a run folder for each out, on all cores or on many machines."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Optional

import typer
from typer.core import TyperCommand

from perdure import cluster, params
from perdure.cli import options
from perdure.cli.doing import do
from perdure.cli.jobs import Job, name_of_source, placed, told_apart
from perdure.cli.parts import OVERLAP, Chunks
from perdure.cli.spreading import spread
from perdure.cli.summary import Row, code_of, page, value_of
from perdure.cluster import Where
from perdure.detect import DETECTORS
from perdure.errors import FormatError, ParameterError, VideoError
from perdure.files.runs import Reporting
from perdure.files.scored import find_truths, paired
from perdure.files.shapes import is_file
from perdure.files.video import open_source
from perdure.interpret import Feedback
from perdure.pipeline import plan
from perdure.trackers import TRACKERS

_FAMILIES = (
    ("tracker", TRACKERS),
    ("detector", DETECTORS),
    ("", {"What counts": Reporting, "Scenarios": Feedback}),
)


class RunCommand(TyperCommand):
    """Reads `--truth A B` as several, as people write it."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the option before every one of its words, then parse as usual."""
        return list(super().parse_args(ctx, spread(args, ("--truth",))))


SourcesArgument = Annotated[
    list[str],
    typer.Argument(metavar="SOURCE...", help="Films, as `perdure track` takes them.", show_default=False),
]
OnOption = Annotated[
    str,
    typer.Option(
        "--on",
        metavar="local|ray[://ADDRESS]",
        help="'local': processes of this machine; 'ray': a Ray cluster, the one at the address, else that of "
        "$RAY_ADDRESS, else one that is started here.",
    ),
]
WorkersOption = Annotated[
    Optional[int],  # noqa: UP045 - typer reads this at run time
    typer.Option(
        "--workers", metavar="N", min=1, help="Jobs at a time (default: as many as cores).", show_default=False
    ),
]
TruthsOption = Annotated[
    Optional[list[Path]],  # noqa: UP045
    typer.Option(
        "--truth",
        metavar="TRUTH...",
        help="One for each source, of the same names or in the same order: as `perdure score` takes them.",
        show_default=False,
    ),
]


@options.with_parameters(*_FAMILIES)
def run(
    sources: SourcesArgument,
    chosen: dict[str, object],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where a folder for each job goes.")
    ] = Path("perdure-runs"),
    on: OnOption = "local",
    workers: WorkersOption = None,
    attempts: Annotated[
        int, typer.Option("--attempts", metavar="N", min=1, help="How often a job is begun whose worker dies.")
    ] = cluster.ATTEMPTS,
    truth: TruthsOption = None,
    tracker: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            metavar="NAME", help="As in `perdure track`; repeated: each on every source.", show_default=False
        ),
    ] = None,
    tracker_settings: options.TrackerSettingsOption = None,
    tracker_environment: options.TrackerEnvironmentOption = None,
    detector: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--detector",
            metavar="NAME|FILE",
            help="As in `perdure track`; repeated: each on every source. In all names of files, {name} stands for the "
            "source's name and {folder} for its folder.",
            show_default=False,
        ),
    ] = None,
    box_masks: options.BoxMasksOption = None,
    class_names: options.ClassNamesOption = None,
    init: options.InitOption = None,
    roi: options.RoiOption = None,
    calibration: options.CalibrationOption = None,
    object_height: options.ObjectHeightOption = None,
    zones: options.ZonesOption = None,
    class_: options.ClassOption = None,
    scenarios: options.ScenariosOption = None,
    context: options.ContextOption = None,
    embedding: options.EmbeddingOption = None,
    fps: options.FpsOption = None,
    start: options.StartOption = None,
    end: options.EndOption = None,
    stride: options.StrideOption = 1,
    parameters: options.ParametersOption = None,
    chunks: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--chunks",
            metavar="LENGTH",
            help="Cut sources into parts of this length, seconds, mm:ss or 3000f, each a job; their tracks are stitched.",
            show_default=False,
        ),
    ] = None,
    overlap: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--overlap",
            metavar="LENGTH",
            help=f"How much of the part before it a part sees, too (default: {OVERLAP:g} s, or half a short part).",
            show_default=False,
        ),
    ] = None,
    video: Annotated[bool, typer.Option("--video", help="Draw tracked.mp4 for each job.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Do anew what was done before.")] = False,
    json_: options.JsonOption = False,
) -> None:
    """Track every moving thing in each of SOURCEs, many at a time, into a folder of runs."""
    where = Where.of(on)
    given = options.read_parameters(parameters, chosen)
    reporting = {name: given.pop(name) for name in list(given) if name == "report_confidence"}
    settings = {
        "tracker_settings": tracker_settings,
        "tracker_environment": tracker_environment,
        "box_masks": box_masks,
        "class_names": class_names,
        "init": init,
        "roi": roi,
        "calibration": calibration,
        "object_height": object_height,
        "zones": zones,
        "classes": class_,
        "scenarios": scenarios,
        "context": context,
        "embedding": embedding,
        "fps": fps,
        "start": start,
        "end": end,
        "stride": stride,
        "parameters": given,
    }
    kinds = [(one, other) for one in tracker or (None,) for other in detector or (None,)]
    cutting = _cutting(chunks, overlap, settings)
    jobs = [_cut(job, cutting) for job in _jobs(sources, kinds, settings, reporting, video)]
    truths = truths_of(sources, truth or [])
    if truths and stride != 1:
        raise ParameterError("--truth and --stride: what is true of frames left out would count as missed")
    _check(jobs[0])
    rows = [Row(job, placed(job, output), label) for job, label in zip(jobs, _labels(jobs), strict=True)]
    do(rows, where, workers, attempts, overwrite=overwrite)
    for row in rows:
        if truths and row.told:
            row.score(truths[row.job.source], windowed=start is not None or end is not None)
    print(json.dumps(value_of(rows)) if json_ else page(rows))
    if code := code_of(rows):
        raise typer.Exit(code)


def truths_of(sources: Sequence[str], truths: Sequence[Path]) -> dict[str, Path]:
    """Return the truth of each source, by its whole name; empty where none are given.

    Raises
    ------
    ParameterError, FormatError
        Where it cannot be told which belongs to which.
    """
    if not truths:
        return {}
    found = find_truths(truths)
    known = {name for name, _ in found}

    def name(source: str) -> str:
        folder = Path(os.path.abspath(source)).parent.name
        own = name_of_source(source)
        return folder if own not in known and folder in known else own

    pairs = paired({one: [(name(one), Path(one))] for one in dict.fromkeys(sources)}, found)
    if len(set(sources)) > len(found):
        raise ParameterError(
            f"{len(set(sources))} sources and {len(found)} truths; give one --truth for each source"
        )
    return {_place(source): match.truth for source, match in zip(dict.fromkeys(sources), pairs, strict=True)}


def _jobs(
    sources: Sequence[str],
    kinds: Sequence[tuple[str | None, str | None]],
    settings: Mapping[str, Any],
    reporting: Mapping[str, Any],
    film: bool,
) -> list[Job]:
    """A job for each source and each tracker and detector; one that is asked for twice is done once."""
    jobs: dict[tuple[str, str | None, str | None], Job] = {}
    for source, (tracker, detector) in itertools.product(sources, kinds):
        if source.isdecimal():
            raise ParameterError(f"camera {source} has no end; `perdure live {source}` follows it")
        own = own_words({"tracker": tracker, "detector": detector, **settings}, source)
        jobs.setdefault((source, tracker, detector), Job(own.pop("source"), own, reporting, film))
    return list(jobs.values())


def own_words(settings: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Return the settings that are given, with a source's own names filled in; and the source by its whole name."""
    own = {name: _own(value, source) for name, value in settings.items() if value is not None}
    return {**own, "source": _place(source)}


def _own(value: Any, source: str) -> Any:
    """A setting with the source's own names filled in, and files by their whole names: another machine has other places."""
    if isinstance(value, list):
        return [_own(one, source) for one in value]
    if not isinstance(value, (str, Path)):
        return value
    path = Path(os.path.abspath(source))
    folder = path if path.is_dir() else path.parent
    text = str(value).replace("{name}", name_of_source(source)).replace("{folder}", str(folder))
    engine, colon, file = text.partition(":")
    if colon and is_file(file):
        return f"{engine}:{os.path.abspath(file)}"
    return os.path.abspath(text) if is_file(text) else text


def _place(source: str) -> str:
    return source if "://" in source else os.path.abspath(source)


def _labels(jobs: Sequence[Job]) -> list[str]:
    """Names by which the rows of the table are told apart."""
    names = told_apart([job.source for job in jobs])
    parts = [names]
    for key in ("tracker", "detector"):
        words = [str(job.settings.get(key) or "") for job in jobs]
        if len(set(words)) > 1:
            parts.append([word if "/" not in word else Path(word).name for word in words])
    return [" ".join(filter(None, words)) for words in zip(*parts, strict=True)]


def _cutting(chunks: str | None, overlap: str | None, settings: Mapping[str, Any]) -> Chunks | None:
    """How sources are cut; None where they are not."""
    if chunks is None:
        if overlap is not None:
            raise ParameterError("--overlap goes with --chunks LENGTH; leave it out")
        return None
    if settings["scenarios"] is not None:
        raise ParameterError(
            "--scenarios and --chunks: what is done may begin in one chunk and end in the next; leave out --scenarios, "
            "and run `perdure scenarios RUN` over the stitched run"
        )
    if settings["init"] is not None:
        raise ParameterError(
            "--init and --chunks: what is marked is known in one chunk alone; leave out one of the two"
        )
    cutting = Chunks.of(chunks, overlap)
    if cutting.is_hasty:
        print(
            "perdure: note: with less than 2 s of --overlap, who is hidden at a border may come out as another",
            file=sys.stderr,
        )
    return cutting


def _cut(job: Job, cutting: Chunks | None) -> Job:
    """The job in chunks, if its source is long enough; what cannot be opened tells that itself when its turn comes."""
    if cutting is None:
        return job
    window = {name: job.settings[name] for name in ("fps", "start", "end", "stride") if name in job.settings}
    try:
        source = open_source(job.source, **window)
    except (VideoError, FormatError):
        return job
    with contextlib.closing(source):
        return dataclasses.replace(job, chunks=cutting.cut(source, window["stride"]))


def _check(job: Job) -> None:
    """Find a mistake in what all jobs share before the first begins; what is wrong with one source alone, it tells itself."""
    params.build(Reporting, job.reporting)
    with contextlib.suppress(VideoError, FormatError):
        plan(job.source, **job.settings).source.close()

"""`perdure track`: a video in, a run folder out."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from perdure import params
from perdure.cli import options
from perdure.cli.resuming import EVERY, found, is_finished
from perdure.cli.rolled import run_rolled
from perdure.cli.running import asked, finished, run, show
from perdure.detect import DETECTORS
from perdure.detection import file_of
from perdure.errors import ParameterError
from perdure.files.checkpoints import digest
from perdure.files.live_events import LiveEvents, lines_to
from perdure.files.marks import files_of
from perdure.files.runs import Reporting, RunFolder
from perdure.files.shapes import is_file
from perdure.interpret import Feedback
from perdure.pipeline import plan
from perdure.trackers import TRACKERS

_FAMILIES = (
    ("tracker", TRACKERS),
    ("detector", DETECTORS),
    ("", {"What counts": Reporting, "Scenarios": Feedback}),
)


@options.with_parameters(*_FAMILIES)
def track(
    source: options.SourceArgument,
    chosen: dict[str, object],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Run folder; default perdure-runs/NAME.", show_default=False
        ),
    ] = None,
    tracker: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=f"One of: {', '.join(TRACKERS)}; or one of another library, as trackers:CLASS or norfair:CLASS. "
            "Default: compound; with --init, the first that follows marks.",
            show_default=False,
        ),
    ] = None,
    tracker_settings: options.TrackerSettingsOption = None,
    tracker_environment: options.TrackerEnvironmentOption = None,
    detector: options.DetectorOption = None,
    box_masks: options.BoxMasksOption = None,
    class_names: options.ClassNamesOption = None,
    init: options.InitOption = None,
    roi: options.RoiOption = None,
    calibration: options.CalibrationOption = None,
    object_height: options.ObjectHeightOption = None,
    zones: options.ZonesOption = None,
    class_: options.ClassOption = None,
    scenarios: options.ScenariosOption = None,
    events: Annotated[
        str | None,
        typer.Option(
            "--events",
            metavar="-",
            help="'-' writes events to stdout as they happen, a JSON object a line; all else is then on stderr.",
            show_default=False,
        ),
    ] = None,
    context: options.ContextOption = None,
    embedding: options.EmbeddingOption = None,
    fps: options.FpsOption = None,
    start: options.StartOption = None,
    end: options.EndOption = None,
    stride: options.StrideOption = 1,
    parameters: options.ParametersOption = None,
    no_video: Annotated[bool, typer.Option("--no-video", help="Do not draw tracked.mp4.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the run that DIR holds.")] = False,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Go on with the run that DIR holds, from its last checkpoint; begin one where there is none.",
        ),
    ] = False,
    checkpoint_every: Annotated[
        float,
        typer.Option(
            "--checkpoint-every",
            metavar="SECONDS",
            min=0.0,
            max=86400.0,
            help="How often it is put down where a run stands; more seldom where that takes long.",
        ),
    ] = EVERY,
    roll: Annotated[
        str | None,
        typer.Option(
            "--roll",
            metavar="TIME",
            help="For a camera or a URL: run folders in DIR, of which the clock begins a new one every so often: '1h'.",
            show_default=False,
        ),
    ] = None,
    keep: Annotated[
        int, typer.Option("--keep", metavar="N", min=0, help="With --roll, how many finished folders; 0 for all.")
    ] = 0,
    json_: options.JsonOption = False,
) -> None:
    """Track every moving thing in SOURCE into a run folder."""
    _agree(events=events, json_=json_, resume=resume, overwrite=overwrite, roll=roll, keep=keep)
    given = options.read_parameters(parameters, chosen)
    reporting = params.build(
        Reporting, {name: given.pop(name) for name in list(given) if name == "report_confidence"}
    )
    made = plan(
        source,
        tracker=tracker,
        tracker_settings=tracker_settings,
        tracker_environment=tracker_environment,
        detector=detector,
        box_masks=box_masks,
        class_names=class_names,
        init=init,
        fps=fps,
        start=start,
        end=end,
        stride=stride,
        roi=roi,
        calibration=calibration,
        object_height=object_height,
        zones=zones,
        classes=class_ or (),
        context=context or None,
        embedding=embedding,
        scenarios=scenarios,
        parameters=given,
    )
    window: dict[str, Any] = {"fps": fps, "start": start, "end": end, "stride": stride, "roi": roi}
    if zones is not None:
        window["zones"] = str(zones)
    if calibration is not None:
        window |= {"calibration": calibration, "object_height": object_height}
    read = {
        "--detector": file_of(detector),
        "--class-names": class_names,
        "--roi": roi,
        "--embedding": embedding,
        **{f"--context {one}": one for one in context or ()},
        **{f"--init {one}": one for one in files_of(init or [])},
    }
    also = (source, zones, calibration, parameters, scenarios)
    inputs = [Path(one) for one in (*read.values(), *also) if one is not None and is_file(one)]
    digests = {name: digest(Path(one)) for name, one in read.items() if one is not None and is_file(one)}
    place = output or Path("perdure-runs") / made.source.name
    told = LiveEvents(lines_to(sys.stdout)) if events else None
    if roll is not None:
        run_rolled(made, place, reporting, roll, keep, window=window, inputs=digests, live=told, as_json=json_)
        return
    try:
        earlier = found(made, place, asked(made, reporting, window, digests)) if resume else None
        folder = earlier or RunFolder.create(place, overwrite=overwrite, inputs=inputs)
    except BaseException:
        made.source.close()
        raise
    film = not no_video
    if earlier is not None and is_finished(earlier):
        outcome = finished(made, earlier, film=film)
    else:
        outcome = run(
            made,
            folder,
            reporting,
            window=window,
            inputs=digests,
            film=film,
            live=told,
            resume=earlier is not None,
            every=checkpoint_every,
        )
    with contextlib.redirect_stdout(sys.stderr) if events else contextlib.nullcontext():
        show(outcome, folder, as_json=json_)
    if outcome.code:
        raise typer.Exit(outcome.code)


def _agree(*, events: str | None, json_: bool, resume: bool, overwrite: bool, roll: str | None, keep: int) -> None:
    """Refuse options that contradict each other."""
    if events not in (None, "-"):
        raise ParameterError(f"--events {events}: only '-', for stdout, is known; the run folder has events.csv")
    if events and json_:
        raise ParameterError("--events - and --json both write to stdout; leave out one of them")
    if resume and overwrite:
        raise ParameterError("--resume goes on with a run and --overwrite replaces it; leave out one of them")
    if roll is not None and (resume or overwrite):
        raise ParameterError(
            "--roll writes new folders beside those that are there; leave out --resume and --overwrite"
        )
    if keep and roll is None:
        raise ParameterError("--keep goes with --roll; leave it out")

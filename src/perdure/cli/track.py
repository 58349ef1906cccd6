"""`perdure track`: a video in, a run folder out."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import sys
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from perdure import equipment, foreign, params
from perdure.cli import options
from perdure.cli.film import draw_film, drawn_while_running
from perdure.cli.progress import watched
from perdure.cli.stopping import Ending
from perdure.detect import DETECTORS
from perdure.detect.plausible import LeftOut, left_out
from perdure.detection import about as about_detector
from perdure.detection import file_of
from perdure.equipment import chosen_by
from perdure.errors import OutputError, ParameterError
from perdure.files.calibration import value_of
from perdure.files.live_events import LiveEvents, lines_to
from perdure.files.log import RunLog
from perdure.files.runs import Reporting, RunFolder, Totals
from perdure.files.scenarios import rules_to_json
from perdure.files.shapes import is_file
from perdure.files.zones import zones_to_json
from perdure.fold import Step
from perdure.interpret import Feedback
from perdure.pipeline import Plan, plan
from perdure.scene.zones import Zones
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
    json_: options.JsonOption = False,
) -> None:
    """Track every moving thing in SOURCE into a run folder."""
    if events not in (None, "-"):
        raise ParameterError(f"--events {events}: only '-', for stdout, is known; the run folder has events.csv")
    if events and json_:
        raise ParameterError("--events - and --json both write to stdout; leave out one of them")
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
    place = output or Path("perdure-runs") / made.source.name
    inputs = [
        Path(one)
        for one in (
            source,
            file_of(detector),
            class_names,
            roi,
            zones,
            calibration,
            parameters,
            embedding,
            scenarios,
            *(context or ()),
        )
        if one is not None and is_file(one)
    ]
    folder = RunFolder.create(place, overwrite=overwrite, inputs=inputs)
    window: dict[str, Any] = {"fps": fps, "start": start, "end": end, "stride": stride, "roi": roi}
    if zones is not None:
        window["zones"] = str(zones)
    if calibration is not None:
        window |= {"calibration": calibration, "object_height": object_height}
    live = LiveEvents(lines_to(sys.stdout)) if events else None
    outcome = run(made, folder, reporting, window=window, film=not no_video, live=live)
    with contextlib.redirect_stdout(sys.stderr) if events else contextlib.nullcontext():
        show(outcome, folder, as_json=json_)
    if outcome.code:
        raise typer.Exit(outcome.code)


@dataclass(frozen=True)
class Outcome:
    """How a run ended."""

    frames: int
    totals: Totals
    seconds: float  # of tracking: first look, detection, tracking, results
    film_seconds: float  # of drawing; 0 where it was drawn while tracking, or not at all
    status: str  # done, damaged, interrupted
    message: str  # of the damage
    warnings: tuple[str, ...]
    has_film: bool

    @property
    def code(self) -> int:
        """The exit code."""
        return {"done": 0, "damaged": 3, "interrupted": 130}[self.status]

    @property
    def rate(self) -> float:
        """Frames tracked a second."""
        return self.frames / self.seconds if self.seconds > 0 else 0.0


def run(
    made: Plan,
    folder: RunFolder,
    reporting: Reporting,
    *,
    window: dict[str, Any] | None = None,
    film: bool = True,
    live: LiveEvents | None = None,
) -> Outcome:
    """Run a plan into a folder: log, results, film; whatever happens, what was tracked so far is kept."""
    about = about_run(made, reporting, window or {})
    folder.write_about({**about, "status": "running"})
    counted = _Count()
    try:
        with Ending() as ending:
            return _run(made, folder, reporting, about, film, ending, counted, live)
    except BaseException:
        if counted.frames:
            with contextlib.suppress(OutputError):
                folder.write_about({**about, "status": "failed", "frames": counted.frames})
        else:
            folder.discard()
        raise
    finally:
        made.source.close()


def _run(
    made: Plan,
    folder: RunFolder,
    reporting: Reporting,
    about: dict[str, Any],
    film: bool,
    ending: Ending,
    counted: _Count,
    live: LiveEvents | None,
) -> Outcome:
    begun = time.monotonic()
    live_film = film and not made.source.rereadable
    context, unusable = "", LeftOut()
    with RunLog(folder.log) as log:
        frames = ending.frames(watched(made.source, f"tracking {made.source.name}", made.source.count))
        made = ending.first_look(made)
        about |= _ground(made)
        steps: Iterable[Step] = made.steps(frames)
        if live_film:
            steps = drawn_while_running(steps, made.scene, folder.film)
        for step in steps:
            unusable = left_out(step.regions.events, unusable)
            context = next(filter(None, (chosen_by(made.tracker, one) for one in step.report.events)), context)
            if live is not None:
                live.tell(step)
            log.append(-1 if step.frame is None else step.frame.index, counted.time(step.frame), step.report)
    totals = folder.write_results(reporting)
    tracked = time.monotonic()
    status, message = ending.status, str(ending.damage or "")
    warnings = (*made.source.warnings, *made.notes(), *unusable.notes)
    about |= equipment.about(made.tracker, made.contexts, context)
    about |= {"frames": counted.frames, "warnings": list(warnings), **dataclasses.asdict(totals)}
    folder.write_about({**about, "status": status, "message": message})
    if film and not live_film and not ending.interrupted:
        try:
            ending.at_once()
            draw_film(made.source, made.scene, folder, counted.frames)
        except KeyboardInterrupt:
            status, message = "interrupted", "the film is not finished, the tracks are; `perdure draw` draws it"
            folder.write_about({**about, "status": status, "message": message})
    return Outcome(
        frames=counted.frames,
        totals=totals,
        seconds=tracked - begun,
        film_seconds=time.monotonic() - tracked if film and not live_film else 0.0,
        status=status,
        message=message,
        warnings=warnings,
        has_film=folder.film.exists(),
    )


def show(outcome: Outcome, folder: RunFolder, *, as_json: bool) -> None:
    """Print how the run ended; as one JSON object on the last line of stdout if asked."""
    for warning in outcome.warnings:
        print(f"perdure: note: {warning}", file=sys.stderr)
    if outcome.message:
        print(f"perdure: {outcome.message}", file=sys.stderr)
    if outcome.status == "interrupted":
        print(f"perdure: interrupted; everything so far is in {folder.path}", file=sys.stderr)
    if as_json:
        value = {
            "status": outcome.status,
            "message": outcome.message,
            "run": str(folder.path),
            "frames": outcome.frames,
            "seconds": round(outcome.seconds, 3),
            "rate": round(outcome.rate, 2),
            "film_seconds": round(outcome.film_seconds, 3),
            **dataclasses.asdict(outcome.totals),
        }
        print(json.dumps(value))
        return
    print(f"frames   {outcome.frames}, tracked in {outcome.seconds:.1f} s ({outcome.rate:.0f} frames/s)")
    print(f"tracks   {outcome.totals.tracks} ({outcome.totals.rows} rows), {outcome.totals.events} events")
    told = Counter(one.kind for one in folder.scenario_events())
    if told:
        print(f"told     {', '.join(f'{count} {kind}' for kind, count in sorted(told.items()))}")
    print(f"results  {folder.path / 'tracks.txt'}")
    if outcome.has_film:
        drawn = f"  (drawn in {outcome.film_seconds:.1f} s)" if outcome.film_seconds else ""
        print(f"film     {folder.film}{drawn}")


class _Count:
    """How many frames were logged, and the time of the last."""

    def __init__(self) -> None:
        self.frames = 0
        self._last = 0.0

    def time(self, frame: Any) -> float:
        if frame is not None:
            self.frames += 1
            self._last = frame.time
        return self._last


def about_run(made: Plan, reporting: Reporting, window: dict[str, Any]) -> dict[str, Any]:
    """Return what `run.json` says of a run before it has begun."""
    source = made.source
    return {
        "source": str(source.origin),
        "width": source.width,
        "height": source.height,
        "fps": source.fps,
        "window": window,
        "classes": list(made.classes),
        "detector": about_detector(made.detector, made.detector_name),
        "init": list(made.init),
        "tracker": {
            "name": made.tracker_name,
            "parameters": params.values(made.tracker),
            **foreign.about(made.tracker),
        },
        **equipment.about(made.tracker, made.contexts),
        **({"embedding": made.tracker.network.name} if getattr(made.tracker, "network", None) else {}),
        "reporting": params.values(reporting),
        **_interpretation(made),
        **_ground(made),
        **({"zones": zones_to_json(Zones.of(made.scene))} if made.scene.zones else {}),
    }


def _interpretation(made: Plan) -> dict[str, Any]:
    """Which scenarios are looked for, and what they do to tracks; nothing where none are."""
    if made.rules is None:
        return {}
    return {"scenarios": {**rules_to_json(made.rules), "feedback": params.values(made.feedback)}}


def _ground(made: Plan) -> dict[str, Any]:
    """What is known of the ground plane, and the estimate as a calibration file has it; nothing where nothing is."""
    ground, told = made.scene.ground, made.estimate
    if ground is None:
        return {}
    return {"ground": {**ground.about(), **({} if told is None else {"calibration": value_of(told, ground.size)})}}

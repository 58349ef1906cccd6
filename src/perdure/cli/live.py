"""`perdure live`: a camera or a stream in, run folders by the hour and events as they happen out, without end."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from perdure import params
from perdure.cli import options
from perdure.cli.running import asked
from perdure.cli.stopping import Ending
from perdure.detect import DETECTORS
from perdure.detection import detector_name, file_of
from perdure.errors import FormatError, ParameterError
from perdure.files.live_events import LiveEvents, lines_to
from perdure.files.live_source import LiveSource, Patience, open_live
from perdure.files.rolling import Rolling, check_place
from perdure.files.runs import Reporting
from perdure.files.scenarios import read_rules
from perdure.files.span import seconds_of
from perdure.files.webhook import Webhook
from perdure.fold import Step
from perdure.interpret import Feedback
from perdure.live import Vital, followed, warmed
from perdure.pipeline import plan
from perdure.trackers import TRACKERS
from perdure.types import Frame

_FAMILIES = (
    ("tracker", TRACKERS),
    ("detector", DETECTORS),
    ("", {"What counts": Reporting, "Scenarios": Feedback, "The source": Patience}),
)


@options.with_parameters(*_FAMILIES)
def live(
    source: Annotated[
        str, typer.Argument(metavar="SOURCE", help="A camera's number, or a URL: rtsp://…", show_default=False)
    ],
    chosen: dict[str, object],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="DIR",
            help="A folder for run folders; default perdure-runs/NAME.",
            show_default=False,
        ),
    ] = None,
    roll: Annotated[
        str,
        typer.Option(
            "--roll",
            metavar="TIME",
            help="How long a run folder is written, on the clock: '1:00:00' begins one on the hour; 0 for one.",
        ),
    ] = "1:00:00",
    keep: Annotated[
        int, typer.Option("--keep", metavar="N", min=0, help="How many finished run folders are kept; 0 for all.")
    ] = 0,
    until: Annotated[
        str | None,
        typer.Option("--for", metavar="TIME", help="End after so long; without it, never.", show_default=False),
    ] = None,
    tracker: Annotated[str, typer.Option(metavar="NAME", help=f"One of: {', '.join(TRACKERS)}.")] = "compound",
    detector: options.DetectorOption = None,
    roi: options.RoiOption = None,
    calibration: options.CalibrationOption = None,
    zones: options.ZonesOption = None,
    scenarios: options.ScenariosOption = None,
    class_: options.ClassOption = None,
    context: options.ContextOption = None,
    fps: options.FpsOption = None,
    wait: Annotated[
        bool,
        typer.Option(
            "--wait", help="Wait for a source that cannot be reached yet, until --give-up; else that ends it."
        ),
    ] = False,
    parameters: options.ParametersOption = None,
    events: Annotated[
        str | None,
        typer.Option(
            "--events", metavar="-", help="'-' writes events to stdout, a JSON object a line.", show_default=False
        ),
    ] = None,
    webhook: Annotated[
        str | None,
        typer.Option(
            "--webhook", metavar="URL", help="Post each event as JSON to an address.", show_default=False
        ),
    ] = None,
    health: Annotated[
        int | None,
        typer.Option(
            "--health",
            metavar="PORT",
            help="Serve a page on 127.0.0.1 that tells how the run is, and /health.json; 0 for any free port.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Follow everything a camera or a stream shows, for as long as it goes on; lost connections come back."""
    if events not in (None, "-"):
        raise ParameterError(f"--events {events}: only '-', for stdout, is known")
    given = options.read_parameters(parameters, chosen)
    reporting = _taken(given, Reporting)
    every, limit = seconds_of(roll, "roll"), None if until is None else seconds_of(until, "for")
    if limit == 0:
        raise ParameterError("for = 0 leaves nothing to follow; leave it out to go on for ever")
    if health is not None and not 0 <= health < 65536:
        raise ParameterError(f"health = {health} is no port: it must be 0 to 65535")
    rules = None if scenarios is None else read_rules(scenarios)  # before the camera is asked
    detector_name(detector)
    if (file := file_of(detector)) is not None and not file.is_file():
        raise FormatError(f"{file}: there is no such file")
    hook = None if webhook is None else Webhook(webhook)
    if output is not None:
        check_place(output)
    opened = open_live(source, fps=fps, patience=_taken(given, Patience), wait=wait)
    try:
        made = plan(
            opened,
            tracker=tracker,
            detector=detector,
            roi=roi,
            calibration=calibration,
            zones=zones,
            scenarios=rules,
            classes=class_ or (),
            context=context or None,
            parameters=given,
        )
        place = output or Path("perdure-runs") / opened.name
        check_place(place)
        rolling = Rolling(place, asked(made, reporting, {"roi": roi}), reporting, every, keep)
        vital = Vital(opened)
        with _served(health, vital) as url, Ending() as ending:
            print(f"perdure: following {opened.origin} into {place}{url}; Ctrl-C ends it", file=sys.stderr)
            opened.told = _say
            for note in made.of_lines():
                _say(f"note: {note}")
            warmed(made)
            told = _told(events is not None, hook, opened)
            frames = ending.frames(_limited(opened, limit))
            try:
                followed(iter(made.steps(frames)), opened, rolling, told, vital)
            finally:
                opened.close()
                rolling.close(ending.status, str(ending.damage or ""))
    finally:
        opened.close()
        if hook is not None:
            hook.close()
    _close(vital, rolling, hook, ending)


def _say(text: str) -> None:
    print(f"perdure: {text}", file=sys.stderr)


def _taken(given: dict[str, object], kind: type[Any]) -> Any:
    """The parameters of a kind, taken out of what was given."""
    names = [one.name for one in params.describe(kind)]
    return params.build(kind, {name: given.pop(name) for name in names if name in given})


def _limited(source: LiveSource, limit: float | None) -> Iterator[Frame]:
    for frame in source:
        if limit is not None and frame.time >= limit:
            return
        yield frame


@contextlib.contextmanager
def _served(port: int | None, vital: Vital) -> Iterator[str]:
    """Serve the health page, if it is wanted; gives where, in words."""
    if port is None:
        yield ""
        return
    from perdure.web.health import Health

    served = Health(port, vital.figures)
    try:
        yield f", how it is at {served.url}"
    finally:
        served.close()


def _told(to_stdout: bool, hook: Webhook | None, source: LiveSource) -> Callable[[Step], None]:
    """What events are told to."""
    outs: list[LiveEvents] = []
    if to_stdout:
        outs.append(LiveEvents(lines_to(sys.stdout)))
    if hook is not None:
        outs.append(LiveEvents(lambda value: hook.post({"source": source.origin, **value})))

    def tell(step: Step) -> None:
        for out in outs:
            out.tell(step)

    return tell


def _close(vital: Vital, rolling: Rolling, hook: Webhook | None, ending: Ending) -> None:
    """Say how it ended."""
    figures = vital.figures()
    for text in (*vital.source.warnings, *rolling.failed):
        print(f"perdure: note: {text}", file=sys.stderr)
    if hook is not None and hook.dropped:
        print(f"perdure: note: {hook.dropped} events could not be posted ({hook.why})", file=sys.stderr)
    counts = (("frame", "frames"), ("connection", "connections"), ("event", "events"))
    parts = [f"{figures[many]} {one if figures[many] == 1 else many}" for one, many in counts]
    parts.insert(1, f"{figures['dropped']} dropped")
    words = f"{', '.join(parts)}, {rolling.begun} run folder{'' if rolling.begun == 1 else 's'} in {rolling.place}"
    print(f"perdure: {words}", file=sys.stderr)
    if ending.damage is not None:
        print(f"perdure: {ending.damage}", file=sys.stderr)
        raise typer.Exit(3)
    if ending.interrupted:
        raise typer.Exit(130)

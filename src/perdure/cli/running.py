"""A run: a plan into a folder, from its beginning or from where it stood; how it ended, in words."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from perdure import equipment, foreign, params
from perdure.cli.film import draw_film, drawn_while_running
from perdure.cli.progress import watched
from perdure.cli.resuming import EVERY, Checkpoints, behind, cannot_resume
from perdure.cli.stopping import Ending
from perdure.detect.plausible import left_out
from perdure.detection import about as about_detector
from perdure.equipment import chosen_by
from perdure.errors import OutputError
from perdure.files.calibration import value_of
from perdure.files.checkpoints import Progress, read_checkpoint, remove_checkpoint
from perdure.files.live_events import LiveEvents
from perdure.files.log import RunLog
from perdure.files.runs import Reporting, RunFolder, Totals
from perdure.files.scenarios import rules_to_json
from perdure.files.zones import zones_to_json
from perdure.fold import Step
from perdure.pipeline import Plan
from perdure.scene.zones import Zones
from perdure.types import Frame


@dataclass(frozen=True)
class Outcome:
    """How a run ended."""

    frames: int
    totals: Totals
    seconds: float  # of tracking: first look, detection, tracking, results; since the run was gone on with
    film_seconds: float  # of drawing; 0 where it was drawn while tracking, or not at all
    status: str  # done, damaged, interrupted
    message: str  # of the damage
    warnings: tuple[str, ...]
    has_film: bool
    before: int = 0  # frames that were tracked before the run was gone on with

    @property
    def code(self) -> int:
        """The exit code."""
        return {"done": 0, "damaged": 3, "interrupted": 130}[self.status]

    @property
    def rate(self) -> float:
        """Frames tracked a second."""
        return (self.frames - self.before) / self.seconds if self.seconds > 0 else 0.0


@dataclass
class _Running:
    """A run while it goes on: what it has told beside its log."""

    made: Plan
    about: dict[str, Any]
    live: LiveEvents | None
    beside: Callable[[Step], None] | None = None  # told of every step, too
    progress: Progress = field(default_factory=Progress)
    frame: Frame | None = None  # the last
    before: int = 0  # frames tracked before it was gone on with
    begun: bool = False  # whether anything was written

    def note(self, step: Step) -> None:
        """Take up what a step tells."""
        now, frame = self.progress, step.frame
        context = next(
            filter(None, (chosen_by(self.made.tracker, one) for one in step.report.events)), now.context
        )
        unusable = left_out(step.regions.events, now.left_out)
        if frame is not None:
            self.frame, now = frame, replace(now, frames=now.frames + 1, frame=frame.index, time=frame.time)
            now = replace(now, regions=now.regions + len(step.regions))
        if self.live is not None:
            self.live.tell(step)
        if self.beside is not None:
            self.beside(step)
        self.progress = replace(now, context=context, left_out=unusable)

    def now(self) -> tuple[Progress, Frame | None]:
        """Where it is, for a checkpoint, and the last frame."""
        lasting = () if self.live is None else self.live.lasting
        return replace(self.progress, lasting=lasting), self.frame

    def go_on(self, progress: Progress) -> None:
        """Take up where an earlier run was."""
        self.progress, self.before = progress, progress.frames
        if self.live is not None:
            self.live.go_on(progress.lasting, progress.time)


def run(
    made: Plan,
    folder: RunFolder,
    reporting: Reporting,
    *,
    window: Mapping[str, Any] | None = None,
    inputs: Mapping[str, str] | None = None,
    film: bool = True,
    live: LiveEvents | None = None,
    resume: bool = False,
    every: float = EVERY,
    beside: Callable[[Step], None] | None = None,
) -> Outcome:
    """Run a plan into a folder: log, results, film; whatever happens, what was tracked so far is kept.

    With `resume` the run that the folder holds is gone on with from its last checkpoint, or from the beginning where it
    has none; `every` so many seconds there is a new one. `beside` is told of every step.
    """
    running = _Running(made, asked(made, reporting, window or {}, inputs), live, beside)
    try:
        with Ending() as ending:
            outcome = _tracked(running, folder, reporting, film, ending, resume, every)
            if film and made.source.rereadable and not ending.interrupted:
                outcome = _with_film(outcome, made, folder, ending)
            return outcome
    finally:
        made.source.close()


def finished(made: Plan, folder: RunFolder, *, film: bool) -> Outcome:
    """Return how a run ended that is over; if its film is wanted and missing, it is drawn."""
    about = folder.read_about()
    outcome = Outcome(
        frames=int(about.get("frames", 0)),
        totals=Totals(*(int(about.get(one.name, 0)) for one in dataclasses.fields(Totals))),
        seconds=0.0,
        film_seconds=0.0,
        status=str(about["status"]),
        message=str(about.get("message", "")),
        warnings=(f"the run in {folder.path} is finished: there is nothing to go on with",),
        has_film=folder.film.exists(),
        before=int(about.get("frames", 0)),
    )
    try:
        with Ending() as ending:
            return _with_film(outcome, made, folder, ending) if film and not outcome.has_film else outcome
    finally:
        made.source.close()


def _tracked(
    running: _Running,
    folder: RunFolder,
    reporting: Reporting,
    film: bool,
    ending: Ending,
    resume: bool,
    every: float,
) -> Outcome:
    """Track all of the source into the log, and settle the results."""
    begun = time.monotonic()
    try:
        if not resume:
            running.begun = True
            folder.write_about({**running.about, "status": "running"})
        running.made = made = ending.first_look(running.made)
        if resume and ending.interrupted:
            raise KeyboardInterrupt  # nothing was begun, so that nothing is to be ended
        running.about |= _ground(made)
        checkpoints = Checkpoints(folder.path, every)
        _logged(running, folder, film, ending, resume, checkpoints)
        totals = folder.write_results(reporting)
        warnings = (
            *made.source.warnings,
            *made.notes(),
            *made.of_classes(running.progress.regions),
            *running.progress.left_out.notes,
            *checkpoints.notes,
        )
        _conclude(running, folder, ending, checkpoints, totals, warnings)
    except BaseException:
        if running.begun:
            _break_off(running, folder, resume)
        raise
    return Outcome(
        frames=running.progress.frames,
        totals=totals,
        seconds=time.monotonic() - begun,
        film_seconds=0.0,
        status=ending.status,
        message=str(ending.damage or ""),
        warnings=warnings,
        has_film=folder.film.exists(),
        before=running.before,
    )


def _logged(
    running: _Running, folder: RunFolder, film: bool, ending: Ending, resume: bool, checkpoints: Checkpoints
) -> None:
    """Track all frames, or those that are left, into the log."""
    made, earlier = running.made, None
    frames: Iterable[Frame] = made.source
    reason = cannot_resume(made)
    if resume and not reason:
        earlier = read_checkpoint(folder.path, made.standing_kind())
    if earlier is not None:
        with ending.at_once_within():
            frames = behind(made, earlier)
        running.go_on(earlier.progress)
    count = made.source.count
    left = None if count is None else max(0, count - running.before)
    with RunLog(folder.log, None if earlier is None else earlier.log) as log:
        if resume:
            _say_resumed(running, folder, reason)
        frames = ending.frames(watched(frames, f"tracking {made.source.name}", left))
        between = checkpoints.taken_by(made, log, running.now)
        steps: Iterable[Step] = made.steps(frames, None if earlier is None else earlier.standing, between)
        if film and not made.source.rereadable:
            steps = drawn_while_running(steps, made.scene, folder.film)
        for step in steps:
            running.note(step)
            log.append(-1 if step.frame is None else step.frame.index, running.progress.time, step.report)
        log.sync()


def _say_resumed(running: _Running, folder: RunFolder, reason: str) -> None:
    """Say from where the run goes on, in its description, too."""
    progress = running.progress
    resumed = [*folder.read_about().get("resumed", ()), progress.frame + 1]
    running.begun = True
    running.about["resumed"] = resumed
    folder.write_about({**running.about, "status": "running"})
    where = f"goes on behind frame {progress.frame} ({progress.time:.2f} s)" if progress.frames else "begins anew"
    where += f": {reason}" if reason else ""
    print(f"perdure: the run in {folder.path} {where}", file=sys.stderr)


def _conclude(
    running: _Running,
    folder: RunFolder,
    ending: Ending,
    checkpoints: Checkpoints,
    totals: Totals,
    warnings: Sequence[str],
) -> None:
    """Write how the run ended; its checkpoint goes, unless it can be gone on with."""
    running.about |= equipment.about(running.made.tracker, running.made.contexts, running.progress.context)
    if checkpoints.count:
        running.about["checkpoints"] = {"count": checkpoints.count, "seconds": round(checkpoints.seconds, 3)}
    running.about |= {"frames": running.progress.frames, "warnings": list(warnings), **dataclasses.asdict(totals)}
    folder.write_about({**running.about, "status": ending.status, "message": str(ending.damage or "")})
    if not ending.interrupted:
        remove_checkpoint(folder.path)


def _break_off(running: _Running, folder: RunFolder, resume: bool) -> None:
    """Leave what there is for a look, and to go on with; where there is nothing, nothing."""
    if not running.progress.frames and not resume:
        folder.discard()
        return
    with contextlib.suppress(OutputError):
        folder.write_about({**running.about, "status": "failed", "frames": running.progress.frames})


def _with_film(outcome: Outcome, made: Plan, folder: RunFolder, ending: Ending) -> Outcome:
    """Draw the film of a run whose results are there."""
    begun = time.monotonic()
    try:
        ending.at_once()
        draw_film(made.source, made.scene, folder, outcome.frames)
    except KeyboardInterrupt:
        message = "the film is not finished, the tracks are; `perdure draw` draws it, or --resume"
        return replace(outcome, status="interrupted", message=message)
    return replace(outcome, film_seconds=time.monotonic() - begun, has_film=folder.film.exists())


def show(outcome: Outcome, folder: RunFolder, *, as_json: bool) -> None:
    """Print how the run ended; as one JSON object on the last line of stdout if asked."""
    for warning in outcome.warnings:
        print(f"perdure: note: {warning}", file=sys.stderr)
    if outcome.message:
        print(f"perdure: {outcome.message}", file=sys.stderr)
    if outcome.status == "interrupted":
        print(f"perdure: interrupted; everything so far is in {folder.path}, --resume goes on", file=sys.stderr)
    if as_json:
        value = {
            "status": outcome.status,
            "message": outcome.message,
            "run": str(folder.path),
            "frames": outcome.frames,
            "seconds": round(outcome.seconds, 3),
            "rate": round(outcome.rate, 2),
            **({"before": outcome.before} if outcome.before else {}),
            "film_seconds": round(outcome.film_seconds, 3),
            **dataclasses.asdict(outcome.totals),
        }
        print(json.dumps(value))
        return
    here = f"{outcome.frames - outcome.before} of them tracked" if outcome.before else "tracked"
    rate = f", {here} in {outcome.seconds:.1f} s ({outcome.rate:.0f} frames/s)" if outcome.seconds else ""
    print(f"frames   {outcome.frames}{rate}")
    print(f"tracks   {outcome.totals.tracks} ({outcome.totals.rows} rows), {outcome.totals.events} events")
    told = Counter(one.kind for one in folder.scenario_events())
    if told:
        print(f"told     {', '.join(f'{count} {kind}' for kind, count in sorted(told.items()))}")
    print(f"results  {folder.path / 'tracks.txt'}")
    if outcome.has_film:
        drawn = f"  (drawn in {outcome.film_seconds:.1f} s)" if outcome.film_seconds else ""
        print(f"film     {folder.film}{drawn}")


def asked(
    made: Plan, reporting: Reporting, window: Mapping[str, Any], inputs: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return for `run.json` what is asked of a run; `inputs` are the digests of files that were named."""
    source = made.source
    return {
        "source": str(source.origin),
        "width": source.width,
        "height": source.height,
        "fps": source.fps,
        "window": dict(window),
        **({"inputs": dict(inputs)} if inputs else {}),
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

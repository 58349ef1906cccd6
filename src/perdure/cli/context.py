"""`perdure context`: a source in, what it is like and which learnt context is near it out."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Optional

import typer

from perdure.cli import options
from perdure.cli.progress import watched
from perdure.cli.tables import aligned
from perdure.detect import DETECTORS
from perdure.errors import DamagedVideo
from perdure.files.contexts import library, read_context
from perdure.pipeline import plan
from perdure.scene.context import Context, ranking
from perdure.scene.measuring import SCALES, Measures, measure, measures_of
from perdure.scene.measuring import start as begin


@options.with_parameters(("detector", DETECTORS))
def context(
    source: options.SourceArgument,
    chosen: dict[str, object],
    detector: options.DetectorOption = None,
    contexts: Annotated[
        Optional[list[Path]],  # noqa: UP045 - typer reads this at run time
        typer.Option(
            "--context",
            metavar="FILE",
            help="A context to compare with, beside those that come with Perdure; may be repeated.",
            show_default=False,
        ),
    ] = None,
    calibration: options.CalibrationOption = None,
    object_height: options.ObjectHeightOption = None,
    roi: options.RoiOption = None,
    class_: options.ClassOption = None,
    fps: options.FpsOption = None,
    start: options.StartOption = None,
    end: options.EndOption = None,
    parameters: options.ParametersOption = None,
    json_: options.JsonOption = False,
) -> None:
    """Measure SOURCE: density, occlusions, light, contrast, depth; and rank the learnt contexts by nearness."""
    known = (*library(), *(read_context(path) for path in contexts or ()))
    made = plan(
        source,
        detector=detector,
        calibration=calibration,
        object_height=object_height,
        fps=fps,
        start=start,
        end=end,
        roi=roi,
        classes=class_ or (),
        parameters=options.read_parameters(parameters, chosen),
    ).prepared()
    state = begin()
    lost: DamagedVideo | None = None
    try:
        frames = watched(made.source, f"measuring {made.source.name}", made.source.count)
        for frame, regions in made.seen(frames):
            state = measure(state, frame, regions, made.scene, math.inf)
    except DamagedVideo as damage:
        lost = damage  # what came before is measured
    finally:
        made.source.close()
        for note in (*made.source.warnings, *made.notes()):
            print(f"perdure: note: {note}", file=sys.stderr)
    found = measures_of(state, made.scene)
    ranked = ranking(known, found)
    print(json.dumps(_value(source, found, ranked)) if json_ else _words(found, ranked))
    if lost is not None:
        raise lost


def _value(source: str, found: Measures, ranked: list[tuple[Context, float]]) -> dict[str, Any]:
    return {
        "source": source,
        "measures": asdict(found),
        "contexts": [{"name": one.name, "distance": distance} for one, distance in ranked],
    }


def _words(found: Measures, ranked: list[tuple[Context, float]]) -> str:
    rows = [
        [name, "-" if (value := getattr(found, name)) is None else f"{value:.3g}", scale.words]
        for name, scale in SCALES.items()
    ]
    wide = max(len(row[1]) for row in rows)
    lines = [f"{name:14}{value:>{wide}}  {words}" for name, value, words in rows]
    lines.append(f"{'pictures':14}{'yes' if found.pictures else 'no'}")
    lines.append(f"{'ground':14}{'known' if found.ground else 'not known'}")
    if not ranked:
        return "\n".join([*lines, "", "there is no learnt context; `perdure learn` makes one, --context names it"])
    table = [["context", "distance", "weights"]]
    for one, distance in ranked:
        weights = ", ".join(f"{name} {one.weights[name]:.2f}" for name in one.used)
        table.append([one.name, f"{distance:.2f}", weights])
    return "\n".join([*lines, "", aligned(table)])

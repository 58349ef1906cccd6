"""`perdure calibrate`: a source or a run in, where its ground plane lies out."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Optional

import typer

from perdure.cli import options
from perdure.detect import DETECTORS
from perdure.errors import FormatError, ParameterError, PerdureError
from perdure.files.calibration import value_of, write_calibration
from perdure.files.runs import RunFolder
from perdure.files.whole import refuse_existing
from perdure.pipeline import check_body, plan
from perdure.scene.perspective import Estimate, estimate
from perdure.types import Tracks


@options.with_parameters(("detector", DETECTORS))
def calibrate(
    source: Annotated[
        str,
        typer.Argument(
            metavar="SOURCE|RUN",
            help="A run folder of `perdure track`, or what `perdure track` takes.",
            show_default=False,
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="The calibration, .json.")],
    chosen: dict[str, object],
    detector: options.DetectorOption = None,
    object_height: options.ObjectHeightOption = None,
    focal: Annotated[
        Optional[float],  # noqa: UP045 - typer reads this at run time
        typer.Option(
            "--focal",
            metavar="PX",
            help="The focal length in pixels, where it is known; else a usual one is taken, and the doubt told.",
            show_default=False,
        ),
    ] = None,
    roi: options.RoiOption = None,
    class_: options.ClassOption = None,
    fps: options.FpsOption = None,
    start: options.StartOption = None,
    end: options.EndOption = None,
    parameters: options.ParametersOption = None,
    overwrite: options.OverwriteOption = False,
    json_: options.JsonOption = False,
) -> None:
    """Estimate the ground plane from people who walk on it, and write it as a calibration file."""
    refuse_existing(output, overwrite=overwrite)
    body = check_body(object_height)
    if focal is not None and not (math.isfinite(focal) and focal > 0):
        raise ParameterError(f"focal = {focal:g} is out of range: it must be above 0 pixels")
    if (Path(source) / "tracks.jsonl").is_file():
        rows, size = _of_run(RunFolder.open(Path(source)))
    else:
        made = plan(
            source,
            tracker="overlap",
            detector=detector,
            fps=fps,
            start=start,
            end=end,
            roi=roi,
            classes=class_ or (),
            parameters=options.read_parameters(parameters, chosen),
        )
        rows, size = made.prepared().people(), (made.scene.width, made.scene.height)
        made.source.close()
    told = estimate(rows, size, body=body, focal=focal)
    if told.ground is None:
        raise PerdureError(
            f"{source} does not tell where its ground lies: {told.verdict}; write a calibration file"
        )
    value = value_of(told, size)
    write_calibration(output, value)
    print(json.dumps({"output": str(output), **value}) if json_ else _words(told, output))


def _of_run(folder: RunFolder) -> tuple[Tracks, tuple[int, int]]:
    about = folder.read_about()
    size = about.get("width"), about.get("height")
    if not (isinstance(size[0], int) and isinstance(size[1], int)):
        raise FormatError(
            f"{folder.path / 'run.json'} does not tell the size of the pictures; `perdure track --overwrite` makes it anew"
        )
    return folder.tracks(), (size[0], size[1])


def _words(told: Estimate, output: Path) -> str:
    """The estimate in lines, each with its deviation."""
    off = [math.sqrt(told.covariance[i, i]) for i in range(4)]
    return "\n".join(
        [
            f"people   {told.people}, seen whole {told.rows} times; heights scatter by {100 * told.scatter:.1f} %",
            f"height   {told.height:.2f} m ± {told.height * off[3]:.2f}",
            f"tilt     {math.degrees(told.tilt):.1f}° ± {math.degrees(off[1]):.1f}",
            f"roll     {math.degrees(told.roll):.1f}° ± {math.degrees(off[2]):.1f}",
            f"focal    {told.focal:.0f} px ± {told.focal * off[0]:.0f}",
            f"written  {output}",
        ]
    )

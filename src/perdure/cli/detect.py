"""`perdure detect`: a video in, a file of regions out."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from perdure.cli import options
from perdure.cli.progress import watched
from perdure.cli.stopping import Ending
from perdure.detect import DETECTORS
from perdure.detect.plausible import LeftOut, left_out
from perdure.files.regions import check_ending, write_regions
from perdure.files.whole import refuse_existing
from perdure.pipeline import plan
from perdure.types import Frame, Regions


@options.with_parameters(("detector", DETECTORS))
def detect(
    source: options.SourceArgument,
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="FILE", help=".jsonl (boxes, scores, masks) or .txt (MOTChallenge boxes)."
        ),
    ],
    chosen: dict[str, object],
    detector: options.DetectorOption = None,
    box_masks: options.BoxMasksOption = None,
    class_names: options.ClassNamesOption = None,
    roi: options.RoiOption = None,
    class_: options.ClassOption = None,
    fps: options.FpsOption = None,
    start: options.StartOption = None,
    end: options.EndOption = None,
    stride: options.StrideOption = 1,
    parameters: options.ParametersOption = None,
    overwrite: options.OverwriteOption = False,
    json_: options.JsonOption = False,
) -> None:
    """Write the regions of SOURCE to a file that `perdure track --detector FILE` reads."""
    check_ending(output)
    refuse_existing(output, overwrite=overwrite)
    made = plan(
        source,
        detector=detector,
        box_masks=box_masks,
        class_names=class_names,
        fps=fps,
        start=start,
        end=end,
        stride=stride,
        roi=roi,
        classes=class_ or (),
        parameters=options.read_parameters(parameters, chosen),
    )
    frames, unusable = 0, LeftOut()

    def counted(seen: Iterator[tuple[Frame, Regions]]) -> Iterator[tuple[Frame, Regions]]:
        nonlocal frames, unusable
        for frame, regions in seen:
            frames, unusable = frames + 1, left_out(regions.events, unusable)
            yield frame, regions

    with Ending() as ending:
        watched_frames = ending.frames(watched(made.source, f"detecting in {made.source.name}", made.source.count))
        count = write_regions(output, counted(ending.first_look(made).seen(watched_frames)))
    made.source.close()
    for warning in (*made.source.warnings, *unusable.notes, *made.of_classes(count)):
        print(f"perdure: note: {warning}", file=sys.stderr)
    if json_:
        print(json.dumps({"status": ending.status, "output": str(output), "frames": frames, "regions": count}))
    else:
        print(f"{count} regions in {frames} frames: {output}")
    if ending.interrupted:
        raise KeyboardInterrupt
    if ending.damage is not None:
        raise ending.damage

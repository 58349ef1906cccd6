"""`perdure draw`: a source and a run in, a film out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from perdure.cli import options
from perdure.cli.film import draw_film
from perdure.cli.stopping import Ending
from perdure.comparison import marks_by_frame
from perdure.errors import OutputError, VideoError
from perdure.files.runs import RunFolder
from perdure.files.video import open_source
from perdure.files.whole import refuse_existing
from perdure.files.zones import zones_of_json
from perdure.pipeline import zoned


def draw(
    source: options.SourceArgument,
    run: options.RunArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The film: .mp4 or .webm.", show_default=False)
    ],
    truth: Annotated[
        Path | None,
        typer.Option(
            "--truth",
            metavar="TRUTH",
            help="Show what departs from it, as `perdure score --errors` lists: MOT or MOTS text, or a folder with gt/gt.txt.",
            show_default=False,
        ),
    ] = None,
    overwrite: options.OverwriteOption = False,
    fps: options.FpsOption = None,
    start: options.StartOption = None,
    end: options.EndOption = None,
    stride: Annotated[
        int | None, typer.Option("--stride", metavar="N", help="Take every N-th frame.", show_default=False)
    ] = None,
    json_: options.JsonOption = False,
) -> None:
    """Draw the tracks of RUN over SOURCE: boxes, outlines, ids, trails."""
    folder = RunFolder.open(run)
    refuse_existing(output, overwrite=overwrite)
    about = folder.read_about()
    window = about.get("window", {})
    opened = open_source(
        source,
        fps=fps if fps is not None else window.get("fps"),
        start=start if start is not None else window.get("start"),
        end=end if end is not None else window.get("end"),
        stride=stride if stride is not None else window.get("stride", 1),
    )
    if not opened.rereadable:
        raise VideoError(f"{source} cannot be read a second time; its film was drawn while it was tracked")
    size = (about.get("width", opened.width), about.get("height", opened.height))
    if size != (opened.width, opened.height):
        raise VideoError(
            f"{source} is {opened.width}x{opened.height}, the run was over {about.get('source')} of {size[0]}x{size[1]}"
        )
    if opened.rereadable and Path(source).exists() and output.exists() and output.samefile(source):
        raise OutputError(f"{output} is the source itself; name another file with -o")
    scene = opened.scene(None)
    if about.get("zones"):
        scene = zoned(scene, zones_of_json(about["zones"]))
    marks = None if truth is None else marks_by_frame(run, truth, linger=round(opened.fps))
    with Ending() as ending:
        ending.at_once()
        damage = draw_film(opened, scene, folder, opened.count, output, marks)
    opened.close()
    if damage is not None and not output.exists():
        raise damage
    print(json.dumps({"output": str(output)}) if json_ else f"film: {output}")
    if damage is not None:
        raise damage

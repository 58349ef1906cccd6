"""`perdure draw`: a source and a run in, a film out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from perdure.cli import options
from perdure.cli.film import draw_film
from perdure.errors import OutputError, VideoError
from perdure.files.runs import RunFolder
from perdure.files.video import open_source


def draw(
    source: options.SourceArgument,
    run: Annotated[
        Path, typer.Argument(metavar="RUN", help="A run folder of `perdure track`.", show_default=False)
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The film: .mp4 or .webm.", show_default=False)
    ],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE.")] = False,
    fps: options.FpsOption = None,
    start: options.StartOption = None,
    end: options.EndOption = None,
    stride: options.StrideOption = 1,
) -> None:
    """Draw the tracks of RUN over SOURCE: boxes, outlines, ids, trails."""
    folder = RunFolder.open(run)
    if output.exists() and not overwrite:
        raise OutputError(f"{output} is there already; add --overwrite or name another file with -o")
    window = folder.read_about().get("window", {})
    opened = open_source(
        source,
        fps=fps if fps is not None else window.get("fps"),
        start=start if start is not None else window.get("start"),
        end=end if end is not None else window.get("end"),
        stride=stride if stride != 1 else window.get("stride", 1),
    )
    if not opened.rereadable:
        raise VideoError(f"{source} cannot be read a second time; its film was drawn while it was tracked")
    draw_film(opened, opened.scene(None), folder, opened.count, output)
    opened.close()
    print(f"film: {output}")

"""`perdure demo`: draw a film, track it, and say how well that went against the film's own truth."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from perdure.cli import options
from perdure.cli.progress import watched
from perdure.cli.running import run
from perdure.demo import demo_world
from perdure.errors import OutputError
from perdure.files.film import Film
from perdure.files.mot import write_rows
from perdure.files.runs import Reporting, RunFolder
from perdure.files.whole import whole_file
from perdure.metrics.clear import clear
from perdure.pipeline import plan
from perdure.types import Status, Tracks


def demo(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Where film, truth and run go.")
    ] = Path("perdure-runs/demo"),
    tracker: Annotated[str, typer.Option(metavar="NAME", help="The tracker to show.")] = "compound",
    json_: options.JsonOption = False,
) -> None:
    """Draw a short film with meetings, a group and an occluder; track it; score it against its own truth."""
    strangers = {one.name for one in output.iterdir()} - _OWN if output.is_dir() else set()
    if strangers:
        raise OutputError(f"{output} holds other files ({min(strangers)}); name a new folder with -o")
    world = demo_world()
    film = output / "film.mp4"
    with Film(film, world.width, world.height, fps=world.fps) as written:
        for frame in watched(world.frames(), "drawing a film of people in a square", world.count):
            if frame.image is not None:
                written.write(frame.image, frame.time)
    truth = world.truth()
    with whole_file(output / "truth.txt") as file:
        write_rows(file, truth)
    folder = RunFolder.create(output / "run", overwrite=True)
    outcome = run(plan(film, tracker=tracker), folder, Reporting())
    if outcome.status == "interrupted":
        raise KeyboardInterrupt
    figures = clear(folder.tracks().counted(), to_find(truth))
    things = len(set(truth.ids.tolist()))
    print(f"A film of {things} moving things was drawn and tracked from its pixels alone:")
    print(f"  found      {figures.recall:.0%} of what was to be seen (box overlap of at least one half)")
    print(f"  right      {figures.precision:.0%} of what was said")
    print(f"  identities {outcome.totals.tracks} tracks for {things} things, {figures.switches} switches")
    print(f"  MOTA       {figures.mota:.3f} (1 is perfect: no miss, no false row, no switch)")
    print(f"  rate       {outcome.rate:.0f} frames/s")
    if tracker == "overlap":
        print("The tracker 'overlap' is the smallest one: where people meet, they become one target.")
    print(f"Look at it: {folder.film}\nTry your own: perdure track VIDEO")
    if json_:
        value = {
            "status": outcome.status,
            "film": str(film),
            "run": str(folder.path),
            "frames": outcome.frames,
            "rate": round(outcome.rate, 2),
            "objects": things,
            "tracks": outcome.totals.tracks,
            "recall": round(figures.recall, 4),
            "precision": round(figures.precision, 4),
            "mota": round(figures.mota, 4),
            "switches": figures.switches,
        }
        print(json.dumps(value))


def to_find(truth: Tracks) -> Tracks:
    """Return the rows of the truth that a tracker should have: not those that are hidden altogether."""
    return truth.take(truth.status != Status.OCCLUDED)


_OWN = {"film.mp4", "truth.txt", "run", ".DS_Store"}  # what an earlier demo left there

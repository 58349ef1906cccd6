"""The entry point: commands, and what an error looks like from outside."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from typing import Annotated

import typer

from perdure import __version__
from perdure.cli.demo import demo
from perdure.cli.detect import detect
from perdure.cli.draw import draw
from perdure.cli.export import export
from perdure.cli.track import track
from perdure.errors import DamagedVideo, PerdureError

DONE, DEFECT, MISTAKE, PART_LOST, INTERRUPTED = 0, 1, 2, 3, 130

app = typer.Typer(
    name="perdure",
    help="Follow every moving thing in a video, on an ordinary CPU, with no training.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _interruptible(command: Callable[..., None]) -> Callable[..., None]:
    """Say so when the user interrupts where nothing else does."""

    @functools.wraps(command)
    def run(*arguments: object, **named: object) -> None:
        try:
            command(*arguments, **named)
        except KeyboardInterrupt:
            raise typer.Exit(_say("interrupted", INTERRUPTED)) from None

    return run


for command in (track, detect, draw, export, demo):
    app.command()(_interruptible(command))


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"perdure {__version__}")
        raise typer.Exit


@app.callback()
def about(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and end.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Follow every moving thing in a video, on an ordinary CPU, with no training."""


def main() -> None:
    """Run the command line.

    Exit codes: 0 done, 1 a defect of ours, 2 the caller's mistake, 3 done but part of the input was lost,
    130 interrupted with everything so far kept.
    """
    try:
        code = app(standalone_mode=True)
    except DamagedVideo as damage:
        code = _say(str(damage), PART_LOST)
    except PerdureError as error:
        code = _say(str(error), MISTAKE)
    except KeyboardInterrupt:
        code = _say("interrupted", INTERRUPTED)
    sys.exit(code)


def _say(text: str, code: int) -> int:
    print(f"perdure: {text}", file=sys.stderr)
    return code

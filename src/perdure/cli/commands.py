"""The entry point: commands, and what an error looks like from outside."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable
from typing import Annotated, Any

import typer

from perdure import __version__
from perdure.cli.calibrate import calibrate
from perdure.cli.context import context
from perdure.cli.convert import convert
from perdure.cli.count import count
from perdure.cli.demo import demo
from perdure.cli.detect import detect
from perdure.cli.draw import draw
from perdure.cli.explain import explain
from perdure.cli.export import export
from perdure.cli.learn import LearnCommand, learn
from perdure.cli.learn_zones import learn as learn_zones
from perdure.cli.live import live
from perdure.cli.run import RunCommand
from perdure.cli.run import run as run_many
from perdure.cli.scenarios import scenarios
from perdure.cli.score import ScoreCommand, score
from perdure.cli.track import track
from perdure.cli.tune import TuneCommand, tune
from perdure.cli.view import ViewCommand, view
from perdure.cli.warmup import warmup
from perdure.errors import DamagedVideo, PerdureError

DONE, MISTAKE, PART_LOST, INTERRUPTED = 0, 2, 3, 130  # and 1: a defect of ours, by its traceback

app = typer.Typer(
    name="perdure",
    help="Follow every moving thing in a video, on an ordinary CPU, with no training.",
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


for command in (
    track,
    live,
    detect,
    draw,
    export,
    convert,
    count,
    calibrate,
    context,
    explain,
    scenarios,
    demo,
    warmup,
):
    app.command()(_interruptible(command))
app.command(cls=LearnCommand)(_interruptible(learn))
app.command("learn-zones")(_interruptible(learn_zones))
app.command(cls=ScoreCommand)(_interruptible(score))
app.command(cls=ViewCommand)(_interruptible(view))
app.command("run", cls=RunCommand)(_interruptible(run_many))
app.command(cls=TuneCommand)(_interruptible(tune))


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


def run() -> int:
    """Run the command that was typed and return the exit code.

    0 done, 1 a defect of ours, 2 the caller's mistake, 3 done but part of the input was lost, 130 interrupted
    with everything so far kept.
    """
    try:
        code = app(None if sys.argv[1:] else ["--help"], standalone_mode=False)
        sys.stdout.flush()
        return code if isinstance(code, int) else DONE
    except _UsageError as error:
        return _say(_usage(error), MISTAKE)
    except DamagedVideo as damage:
        return _say(str(damage), PART_LOST)
    except PerdureError as error:
        return _say(str(error), MISTAKE)
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # whoever read has heard enough
        return DONE
    except OSError as error:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")
        return _say(f"cannot write: {error.strerror or error}", MISTAKE)


# What typer raises for a mistyped command line; typer names only its child publicly.
_UsageError: type[Exception] = typer.BadParameter.__mro__[1]


def _usage(error: Any) -> str:
    """One line: what was mistyped, and what the option means and takes."""
    text = " ".join(error.format_message().split())
    about = getattr(getattr(error, "param", None), "help", None)
    command = error.ctx.command_path if getattr(error, "ctx", None) else "perdure"
    hint = f"; {about[0].lower()}{about[1:]}" if about else f" (see '{command} --help')"
    return text.rstrip(".") + hint


def _say(text: str, code: int) -> int:
    print(f"perdure: {text}", file=sys.stderr)
    return code

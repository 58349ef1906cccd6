"""`perdure view`: runs in, a page on this machine out, until interrupted."""

from __future__ import annotations

import contextlib
import secrets
import socket
import sys
import webbrowser
from pathlib import Path
from typing import Annotated, Any, Optional

import typer
from typer.core import TyperCommand

from perdure.cli.spreading import spread
from perdure.errors import OutputError, ParameterError, PerdureError
from perdure.files.runs import RunFolder

HOST = "127.0.0.1"


class ViewCommand(TyperCommand):
    """Reads `--truth A B` as two truths, as people write it."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put `--truth` before every one of its words, then parse as usual."""
        return list(super().parse_args(ctx, spread(args, ("--truth",))))


def view(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN...", help="Run folders of `perdure track`.", show_default=False),
    ],
    truth: Annotated[
        Optional[list[Path]],  # noqa: UP045 - typer reads this at run time
        typer.Option(
            "--truth",
            metavar="TRUTH...",
            help="What is true, to be seen beside it and scored: MOT or MOTS text, or a folder with gt/gt.txt. One for "
            "all runs, or one for each.",
            show_default=False,
        ),
    ] = None,
    source: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--source",
            metavar="SOURCE",
            help="Where the film is now, if not where it was when it was tracked.",
            show_default=False,
        ),
    ] = None,
    zones: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--zones",
            metavar="FILE",
            help="Where zones are read from and drawn ones saved (default: zones.json in the run folder).",
            show_default=False,
        ),
    ] = None,
    calibration: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--calibration",
            metavar="FILE",
            help="Where the ground plane is read from and saved (default: calibration.json in the run folder).",
            show_default=False,
        ),
    ] = None,
    port: Annotated[
        int, typer.Option("--port", metavar="N", min=0, max=65535, help="The port; 0 for any that is free.")
    ] = 8321,
    open_: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
) -> None:
    """Show runs in the browser, on this machine only: look, doubt, repair, draw zones."""
    try:
        import uvicorn

        from perdure.web.app import Shown, application
    except ModuleNotFoundError as error:
        raise PerdureError(f"the viewer needs {error.name}: pip install 'perdure[web]'") from None
    from perdure.web.run import OpenRun
    from perdure.web.truths import OpenTruth

    folders = [RunFolder.open(_folder(one)) for one in runs]
    truths = _truths(truth or [], len(folders))
    known = {path: OpenTruth(path) for path in dict.fromkeys(one for one in truths if one is not None)}
    shown = Shown(
        tuple(OpenRun(folder, source) for folder in folders),
        tuple(None if one is None else known[one] for one in truths),
        zones,
        calibration,
    )
    token = secrets.token_urlsafe(18)
    listening = _listen(port)
    address = f"http://{HOST}:{listening.getsockname()[1]}/#token={token}"
    print(f"view   {address}", flush=True)
    print("perdure: for this machine only; who has the address may correct. Ctrl-C ends it", file=sys.stderr)
    if open_:
        webbrowser.open(address)
    settings = uvicorn.Config(
        application(shown, token),
        log_level="error",
        access_log=False,
        server_header=False,
        lifespan="on",
        ws="none",
        timeout_graceful_shutdown=2,
    )
    with contextlib.suppress(KeyboardInterrupt):  # the usual end
        uvicorn.Server(settings).run([listening])


def _folder(path: Path) -> Path:
    """The run folder that is meant, also by its log."""
    return path.parent if path.name == "tracks.jsonl" else path


def _truths(given: list[Path], count: int) -> list[Path | None]:
    """A truth for each run."""
    if len(given) in (0, 1):
        return [given[0] if given else None] * count
    if len(given) != count:
        raise ParameterError(
            f"{len(given)} truths for {count} runs: give one for all, or one for each in their order"
        )
    return list(given)


def _listen(port: int) -> socket.socket:
    """A socket of this machine only; OutputError if somebody else has the port."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((HOST, port))
        listening.listen(128)  # from now on who comes waits: the address may be printed
    except OSError as error:
        listening.close()
        raise OutputError(
            f"port {port} cannot be had ({error.strerror}); take another with --port, or 0"
        ) from None
    return listening

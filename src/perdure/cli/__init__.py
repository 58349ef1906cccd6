"""The command line: `perdure track | detect | draw | view | export | score | demo | warmup`."""

import os
import sys

__all__ = ["main"]


def main() -> None:
    """Run the command line; an interruption is 130 even while Perdure is still being loaded."""
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    try:
        from perdure.cli.commands import run

        code = run()
    except KeyboardInterrupt:
        print("perdure: interrupted", file=sys.stderr)
        code = 130
    sys.exit(code)

"""The command line: `perdure track | detect | draw | export | demo`."""

from perdure.cli.main import main

__all__ = ["main"]

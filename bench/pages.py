"""What scripts that write their tables into a page of docs share: marks, versions, clips that are not there."""

from __future__ import annotations

import argparse
import itertools
import json
import platform
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import cv2
from regions import plain

from perdure.errors import ParameterError
from perdure.files.whole import whole_file


class Marks(NamedTuple):
    """The lines between which a script's tables stand in a page."""

    begin: str
    end: str
    page: str  # its name

    @staticmethod
    def of(script: str, page: Path) -> Marks:
        """Return those of a script, which is named as `bench/NAME.py`."""
        return Marks(f"<!-- {script} begins -->", f"<!-- {script} ends -->", page.name)

    @property
    def script(self) -> str:
        """As `bench/NAME.py`."""
        return self.begin.split()[1]

    def replaced(self, page: str, inside: str) -> str:
        """Return a page with what is between the marks replaced; ParameterError where they are not there."""
        before, begin, rest = page.partition(self.begin)
        _, end, after = rest.partition(self.end)
        if not begin or not end:
            raise ParameterError(f"{self.page} must have the lines {self.begin!r} and {self.end!r}, in this order")
        return f"{before}{begin}\n{inside}\n{end}{after}"

    def tables(self, page: str) -> list[tuple[str, str]]:
        """Return the titles, and the tables with their titles, that a page has between the marks."""
        blocks = page.partition(self.begin)[2].partition(self.end)[0].strip().split("\n\n")
        return [
            (title[2:-2], f"{title}\n\n{table}")
            for title, table in itertools.pairwise(blocks)
            if title.startswith("**")
        ]


def given(
    result: Any, arguments: argparse.Namespace, page: Path, marks: Marks, section: Callable[..., str]
) -> None:
    """Print the tables of a result; with `--write` put its section into a page, with `--json` print what it told."""
    print("\n\n".join(plain(one) for one in result.tables))
    if arguments.write:
        text = page.read_text(encoding="utf-8")
        with whole_file(page) as file:
            file.write(marks.replaced(text, section(f"python {marks.script} --write", result, text)))
    if arguments.json:
        print(json.dumps(result.told))


def versions() -> dict[str, str]:
    """Return what figures may depend on."""
    return {"python": platform.python_version(), "perdure": metadata.version("perdure"), "cv2": cv2.__version__}


def absent(path: Path) -> bool:
    """Say on stderr that a clip is not there, if it is not."""
    if path.exists():
        return False
    print(f"note: {path.parent.name}/{path.name} is not there; it is left out", file=sys.stderr)
    return True

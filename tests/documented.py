"""The commands that README and docs name, as the shell would take them apart."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.M | re.S)
OPERATORS = {"&&", "||", "|", ";"}


class Command(NamedTuple):
    """One command of a page."""

    page: str
    line: int
    words: tuple[str, ...]
    block: int = 0  # the line at which its block begins

    def __str__(self) -> str:
        """Where it stands, and what is typed."""
        return f"{self.page}:{self.line}: {shlex.join(self.words)}"


def typed(page: Path) -> list[Command]:
    """Every command in the shell blocks of a page, in order; pipes and `&&` are taken apart."""
    text, found = page.read_text(encoding="utf-8"), []
    for block in BLOCK.finditer(text):
        if block[1] == "sh":
            first = text[: block.start(2)].count("\n") + 1
            for number, line in enumerate(block[2].replace("\\\n", "  ").splitlines()):
                found += [Command(page.name, first + number, words, first) for words in parts(line)]
    return found


def named(page: Path) -> list[Command]:
    """Every `perdure …` within the text of a page, outside blocks: synopses and mentions."""
    text = BLOCK.sub(lambda block: "\n" * block[0].count("\n"), page.read_text(encoding="utf-8"))
    return [
        Command(page.name, text[: span.start()].count("\n") + 1, tuple(shlex.split(plain(span[1]))))
        for span in re.finditer(r"`(perdure [a-z][^`]*)`", text)
    ]


def parts(line: str) -> list[tuple[str, ...]]:
    """The commands of one line, each as its words."""
    split = shlex.shlex(line, posix=True, punctuation_chars="&|;")
    split.whitespace_split = True
    split.commenters = "#"
    found: list[list[str]] = [[]]
    for word in split:
        if word in OPERATORS:
            found.append([])
        else:
            found[-1].append(word)
    return [tuple(words) for words in found if words]


def plain(synopsis: str) -> str:
    """A synopsis as it could be typed: brackets gone, a number where one is wanted."""
    typed = re.sub(r"[\[\]…]|\.\.\.", " ", synopsis)
    return re.sub(r"(?<=--)(id|frame|start|end|stride|keep|most) [A-Z]+", r"\1 1", typed)

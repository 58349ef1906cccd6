"""Every paragraph and equation of a paper has its place: the tables of the pages name functions that are there."""

from __future__ import annotations

import pkgutil
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PAPERS = {
    "compound-targets.md": [
        "III.B, fig. 1",
        "III.B",
        "III.C",
        "IV.A",
        "IV.B, equation",
        "IV.B",
        "IV.C, fig. 2",
        "IV.C",
        "IV.D",
    ],
    "contour-observer.md": [
        *(f"eq. {number}" for number in range(1, 7)),
        "§III, prediction",
        "§III, initialisation",
    ],
    "multi-feature.md": [
        *(f"eq. {number}" for number in range(1, 19)),
        "§2.1.3",
        "§2.1.5",
        "§4.1",
        "§4.3",
        "§4.4",
        "§6",
    ],
    "track-and-cut.md": [*(f"eq. {number}" for number in range(1, 19)), "§3.3", "§3.4", "§4", "§6"],
}


def table(page: str) -> list[tuple[str, list[str]]]:
    """Return (place in the paper, names in code) of each row of a page's first table."""
    text = (DOCS / page).read_text(encoding="utf-8").split("\n## ")[0]
    rows = [line.split("|")[1:-1] for line in text.splitlines() if line.startswith("| ") and "---" not in line]
    return [(row[0].strip(), re.findall(r"`([\w.]+)`", row[2])) for row in rows[1:]]


@pytest.mark.parametrize("page", PAPERS)
def test_every_part_of_the_paper_is_in_the_list(page: str):
    assert {place for place, _ in table(page)} == set(PAPERS[page])


@pytest.mark.parametrize("page", PAPERS)
def test_every_function_in_the_list_is_there_and_tells_its_place(page: str):
    for place, names in table(page):
        for name in names:
            found = pkgutil.resolve_name(f"perdure.{name}")
            assert found.__doc__, f"{place}: {name} has no docstring"

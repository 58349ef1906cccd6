"""What docs/formats.md says of the formats is what they say of themselves."""

from __future__ import annotations

from pathlib import Path

import pytest

from perdure.files.formats import FORMATS, Format, Trait

TEXT = (Path(__file__).parents[1] / "docs" / "formats.md").read_text(encoding="utf-8")


def cells(name: str) -> dict[str, str]:
    """The row of a format in the first table, by the names of its columns."""
    heading = next(line for line in TEXT.splitlines() if line.startswith("| format | is |"))
    (row,) = [line for line in TEXT.splitlines() if line.startswith(f"| `{name}` |") and line.count("|") == 12]
    names, values = ([cell.strip() for cell in line.strip("|").split("|")] for line in (heading, row))
    return dict(zip(names, values, strict=True))


def told(format_: Format) -> dict[str, str]:
    """The same by what the format declares."""
    holds, rounds = format_.holds, format_.rounds
    told = {
        "boxes": _held(Trait.BOX in holds, rounds.get("boxes"), " px"),
        "silhouettes": _held(Trait.MASK in holds),
        "contours": _held(Trait.OUTLINE in holds),
        "classes": _held(Trait.CLASS in holds),
        "confidence": _held(Trait.CONFIDENCE in holds, rounds.get("confidence")),
        "status": _held(Trait.STATUS in holds),
        "groups": _held(Trait.GROUP in holds),
        "times": _held(Trait.TIME in holds, rounds.get("times"), " s"),
    }
    if told["silhouettes"] == "yes" and Trait.OVERLAP not in holds:
        told["silhouettes"] = "one a pixel"
    if told["silhouettes"] == "yes" and Trait.MASK_TOO not in holds:
        told["silhouettes"] = "without contour"
    if told["classes"] == "yes" and Trait.CHANGING_CLASS not in holds:
        told["classes"] = "a track"
    if format_.classes:
        told["classes"] = ", ".join(format_.classes)
    if told["confidence"] == "yes" and Trait.CHANGING_CONFIDENCE not in holds:
        told["confidence"] = "a track's mean"
    if told["status"] == "yes" and Trait.LOST not in holds:
        told["status"] = "but lost"
    if Trait.RATE in holds and Trait.TIME not in holds:
        told["times"] = "as `fps`"
    return told


def _held(holds: bool, step: float | None = None, unit: str = "") -> str:
    if not holds:
        return "–"
    return "yes" if step is None else f"{step:.6f}".rstrip("0") + unit


@pytest.mark.parametrize("name", FORMATS)
def test_the_table_says_what_each_format_holds(name: str):
    row, format_ = cells(name), FORMATS[name]
    assert {column: row[column] for column in told(format_)} == told(format_)
    assert (row["size"] == "needed") == format_.needs_size
    for suffix in format_.suffixes[:1]:
        assert f"`{suffix}`" in row["is"] or name == "cvat-mask"

"""A run folder as a source of rows: those that count, settled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from perdure import params
from perdure.errors import FormatError, ParameterError
from perdure.files.formats.content import Content, Format, Reading
from perdure.files.formats.traits import ALL
from perdure.files.runs import Reporting, RunFolder, unended

LOG = "tracks.jsonl"


def is_run(path: Path) -> bool:
    """Return whether a folder holds a run's log."""
    return (path / LOG).is_file()


def read(path: Path, reading: Reading) -> Content:
    """Return the rows of a run that count, as its own `report_confidence` has it."""
    folder = RunFolder.open(path.parent if path.name == LOG else path)
    about = folder.read_about()
    try:
        least = params.build(Reporting, dict(about.get("reporting", {}))).report_confidence
    except ParameterError as error:
        raise FormatError(f"{path / 'run.json'}: {error}") from error
    return content_of(folder, about, least)


def content_of(folder: RunFolder, about: dict[str, Any], report_confidence: float) -> Content:
    """Return the rows of a run that count, and what it says of its film."""
    height: Any = about.get("height")
    width: Any = about.get("width")
    are_known = type(height) is int and type(width) is int and height > 0 and width > 0
    source = about.get("source")
    frames = tuple(entry.frame for entry in folder.entries(with_masks=False) if entry.frame >= 0)
    note = unended(folder, about, len(frames))
    return Content(
        folder.tracks().counted(report_confidence),
        size=(height, width) if are_known else None,
        frames=frames,
        timed=True,
        name=Path(source).stem if isinstance(source, str) else folder.path.resolve().name,
        notes=(note,) if note else (),
    )


FORMAT = Format("run", "a run folder of perdure track", read, None, is_folder=True, holds=ALL)

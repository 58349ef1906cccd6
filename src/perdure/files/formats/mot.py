"""MOTChallenge: a text, or a sequence's folder with `seqinfo.ini`; frames and pixels count from 1."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from perdure.files.formats.content import MOST_FRAMES, Content, Format, Reading, ordered
from perdure.files.formats.traits import Trait
from perdure.files.images import read_seqinfo
from perdure.files.mot import CLASSES, protocol_of, read_said, write_rows
from perdure.files.mot_table import read_table
from perdure.files.whole import refuse_existing, whole_file
from perdure.types import Tracks

SEQUENCE = "seqinfo.ini"
_TEXTS = ("gt/gt.txt", "gt.txt", "tracks.txt")


def is_mot_folder(path: Path) -> bool:
    """Return whether a folder is a MOTChallenge sequence's, with a truth in it."""
    return path.is_dir() and any((path / name).is_file() for name in _TEXTS[:2])


def read(path: Path, reading: Reading) -> Content:
    """Return the rows of a text, or of the truth in a sequence's folder.

    The 7th column is the confidence, also the flag of a truth, by which rows that are not asked for have 0; the 8th
    is the class, where nine columns make this a truth of MOT16 or later.

    Raises
    ------
    FormatError
        Naming file and line.
    """
    text = next((path / name for name in _TEXTS if (path / name).is_file()), path)
    read_said(text)  # says which line is wrong
    table = read_table(text)
    tracks = Tracks.of(
        frames=table.values[:, 0] - 1,
        times=0.0,
        ids=table.values[:, 1],
        boxes=table.boxes,
        confidence=table.column(6, 1.0),
    )
    notes: tuple[str, ...] = ()
    if len(tracks) and protocol_of(table) == "mot17":
        words = np.array(["", *CLASSES])
        tracks = tracks.replace(classes=words[table.column(7, 0).astype(int)])
    flags = np.isin(tracks.confidence, (0.0, 1.0)).all()  # a truth: 0 is what is not asked for
    if aside := int(np.count_nonzero(tracks.confidence == 0)) if flags else 0:
        what = "rows that the truth does not ask for (flag 0), here of confidence 0"
        notes = (f"{what}: {aside}; of another format `score` asks for them, too",)
    content = Content(ordered(tracks), notes=notes)
    about = text.parent.parent if text.parent.name == "gt" else text.parent
    return _with_sequence(content, about / SEQUENCE) if path.is_dir() else content


def write(path: Path, content: Content, *, overwrite: bool) -> int:
    """Write a text of results."""
    refuse_existing(path, overwrite=overwrite)
    with whole_file(path) as file:
        write_rows(file, content.tracks)
    return len(content.tracks)


def _with_sequence(content: Content, file: Path) -> Content:
    """The content with what `seqinfo.ini` says of the film."""
    if not file.is_file():
        return content
    told = read_seqinfo(file)
    frames = range(told.length) if told.length <= MOST_FRAMES else None
    return content.replace(
        size=(told.height, told.width), fps=told.rate, name=file.resolve().parent.name, frames=frames
    )


FORMAT = Format(
    "mot",
    "MOTChallenge text, frames and pixels from 1; a sequence's folder with gt/gt.txt can be read",
    read,
    write,
    suffixes=(".txt",),
    holds=frozenset({Trait.BOX, Trait.CONFIDENCE, Trait.CHANGING_CONFIDENCE}),
    rounds={"boxes": 0.01, "confidence": 1e-4},
)

"""KITTI tracking labels: 17 columns between blanks, and an 18th, the score, in results; frames count from 0.

`frame id type truncated occluded alpha left top right bottom height width length x y z rotation_y [score]`, by the
development kit of the benchmark (Geiger, Lenz & Urtasun, CVPR 2012). What is not known of a row is written as the kit
wants it of results: truncated -1, alpha -10, dimensions -1, location -1000, rotation -10. Words of a class are joined
by `_`, as in its own `Person_sitting`.
"""

from __future__ import annotations

from pathlib import Path

from perdure.files.formats.content import Content, Format, Gathering, Reading, counted_from_one
from perdure.files.formats.traits import Trait
from perdure.files.lines import number_of, short
from perdure.files.mot_table import read_lines
from perdure.files.span import shown
from perdure.files.whole import refuse_existing, whole_file
from perdure.types import Status

AREA = "DontCare"  # rows that are areas and no objects
COLUMNS = 17
_OCCLUDED = {Status.VISIBLE: 0, Status.PARTLY_OCCLUDED: 1, Status.OCCLUDED: 2, Status.LOST: 2, Status.AMBIGUOUS: 3}
_STATUS = (Status.VISIBLE, Status.PARTLY_OCCLUDED, Status.OCCLUDED, Status.AMBIGUOUS)


def is_kitti(path: Path) -> bool:
    """Return whether the first line of a text has 17 or 18 words of which the third is a type."""
    first = next((line for line in read_lines(path) if line.strip()), "")
    words = first.split()
    return len(words) in (COLUMNS, COLUMNS + 1) and words[2][:1].isalpha()


def read(path: Path, reading: Reading) -> Content:
    """Return the objects of a label file; areas that nobody need care about are left out, and a note says so.

    Raises
    ------
    FormatError
        Naming file and line.
    """
    rows, areas, columns = Gathering(path), 0, 0
    for number, line in enumerate(read_lines(path), 1):
        words = line.split()
        if words[2:3] == [AREA]:
            areas += 1
        elif words:
            _add(rows, f"line {number}", words)
            columns = columns or len(words)
            if len(words) != columns:
                raise rows.refuse(
                    f"line {number}", f"{len(words)} words where others have {columns}; is the file whole?"
                )
    tracks, notes = counted_from_one(rows.tracks())
    if areas:
        notes = (*notes, f"areas of type {AREA} left out: {areas}")
    return Content(tracks, notes=notes)


def _add(rows: Gathering, place: str, words: list[str]) -> None:
    if len(words) not in (COLUMNS, COLUMNS + 1):
        raise rows.refuse(place, f"{len(words)} words; a row has {COLUMNS}, or {COLUMNS + 1} with its score")
    numbers: dict[int, float] = {}
    for column in (0, 1, 4, 6, 7, 8, 9, *range(COLUMNS, len(words))):
        try:
            numbers[column] = number_of(words[column])
        except ValueError:
            raise rows.refuse(place, f"{shown(words[column])} in column {column + 1} is no number") from None
    if numbers[4] not in (-1, 0, 1, 2, 3):
        raise rows.refuse(place, f"occluded is {words[4]}; wanted is 0, 1, 2 or 3, or -1 for not known")
    rows.add(
        place,
        frame=numbers[0],
        identity=numbers[1],
        box=[numbers[column] for column in (6, 7, 8, 9)],
        status=_STATUS[max(0, int(numbers[4]))],
        confidence=numbers.get(COLUMNS, 1.0),
        kind=words[2],
    )


def write(path: Path, content: Content, *, overwrite: bool) -> int:
    """Write a label file, with scores where any is not 1; a class of several words is joined by `_`."""
    refuse_existing(path, overwrite=overwrite)
    tracks = content.tracks
    scored = bool((tracks.confidence != 1).any())
    with whole_file(path) as file:
        for k in range(len(tracks)):
            kind = "_".join(str(tracks.classes[k]).split()) or FORMAT.unnamed
            box = " ".join(f"{short(side):.12g}" for side in tracks.boxes[k])
            occluded = _OCCLUDED[Status(tracks.status[k])]
            score = f" {short(tracks.confidence[k]):.12g}" if scored else ""
            file.write(
                f"{tracks.frames[k]} {tracks.ids[k]} {kind} -1 {occluded} -10 {box} -1 -1 -1 -1000 -1000 -1000 -10{score}\n"
            )
    return len(tracks)


FORMAT = Format(
    "kitti",
    "KITTI tracking labels, a line a row; frames and pixels from 0",
    read,
    write,
    suffixes=(".txt",),
    holds=frozenset(
        {Trait.BOX, Trait.CLASS, Trait.CHANGING_CLASS, Trait.CONFIDENCE, Trait.CHANGING_CONFIDENCE, Trait.STATUS}
    ),
    unnamed="Misc",
    blank="_",
)

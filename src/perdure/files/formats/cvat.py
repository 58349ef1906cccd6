"""CVAT for video 1.1: XML with a track an object and a shape a frame; frames and pixels from 0.

As CVAT's documentation of its XML has it. `cvat` writes boxes, which CVAT shows and interpolates; `cvat-mask` writes
silhouettes, run lengths row by row in their crop. Both are read alike, by `perdure.files.formats.cvat_reading`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import IO
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from perdure.errors import OutputError
from perdure.files.formats.coco import UNNAMED, commonest
from perdure.files.formats.content import Content, Format
from perdure.files.formats.cvat_reading import read
from perdure.files.formats.traits import Trait
from perdure.files.lines import short
from perdure.files.whole import refuse_existing, whole_file
from perdure.types import Mask, Status, Tracks

_OCCLUDED = (Status.PARTLY_OCCLUDED, Status.OCCLUDED, Status.LOST)
_TELLING = (Status.VISIBLE, Status.PARTLY_OCCLUDED)  # said by `occluded` alone


def write(path: Path, content: Content, *, overwrite: bool) -> int:
    """Write boxes, all of them keyframes; where a track pauses or ends before the film, its box is `outside` there."""
    return _write(path, content, content.tracks, overwrite=overwrite, masks=False)


def write_masks(path: Path, content: Content, *, overwrite: bool) -> int:
    """Write silhouettes; rows without one are left out."""
    seen = content.tracks.take(np.array([mask.bits.size > 0 for mask in content.tracks.masks], np.bool_))
    return _write(path, content, seen, overwrite=overwrite, masks=True)


def _write(path: Path, content: Content, rows: Tracks, *, overwrite: bool, masks: bool) -> int:
    refuse_existing(path, overwrite=overwrite)
    attributes = _attributes(rows)
    last = content.film[-1] if len(content.film) else 0
    with whole_file(path) as file:
        _write_head(file, content, rows, attributes, last)
        for identity in np.unique(rows.ids).tolist():
            mine = rows.of_id(identity)
            file.write(
                f'  <track id="{identity}" label={_quoted(commonest(mine.classes) or UNNAMED)} source="auto">\n'
            )
            file.writelines(_shapes(mine, attributes, last, masks=masks))
            file.write("  </track>\n")
        file.write("</annotations>\n")
    return len(rows)


def _attributes(rows: Tracks) -> tuple[str, ...]:
    """Which attributes are needed: every shape then has them, as CVAT else takes those of the shape before."""
    needed = {
        "status": bool((~np.isin(rows.status, _TELLING)).any()),
        "confidence": bool((rows.confidence != 1).any()),
    }
    return tuple(name for name, is_needed in needed.items() if is_needed)


def _write_head(file: IO[str], content: Content, rows: Tracks, attributes: tuple[str, ...], last: int) -> None:
    """Write what is said of the task."""
    file.write(
        '<?xml version="1.0" encoding="utf-8"?>\n<annotations>\n  <version>1.1</version>\n  <meta>\n    <task>\n'
    )
    file.write(f"      <name>{escape(_legal(content.name or 'film'))}</name>\n      <size>{last + 1}</size>\n")
    file.write("      <mode>interpolation</mode>\n      <overlap>0</overlap>\n      <flipped>False</flipped>\n")
    file.write(f"      <start_frame>0</start_frame>\n      <stop_frame>{last}</stop_frame>\n      <labels>\n")
    for name in np.unique(rows.classes).tolist():
        declared = "".join(_declared(one) for one in attributes)
        file.write(
            f"        <label>\n          <name>{escape(_legal(name or UNNAMED))}</name>\n"
            f"          <attributes>\n{declared}          </attributes>\n        </label>\n"
        )
    file.write("      </labels>\n")
    if content.size is not None:
        height, width = content.size
        sides = f"<width>{width}</width>\n        <height>{height}</height>"
        file.write(f"      <original_size>\n        {sides}\n      </original_size>\n")
    file.write("    </task>\n  </meta>\n")


def _declared(name: str) -> str:
    """The declaration of an attribute of a label."""
    kind, default, values = {
        "status": ("select", Status.VISIBLE.word, "\n".join(one.word for one in Status)),
        "confidence": ("text", "1", "1"),
    }[name]
    return (
        f"            <attribute>\n              <name>{name}</name>\n              <mutable>True</mutable>\n"
        f"              <input_type>{kind}</input_type>\n              <default_value>{default}</default_value>\n"
        f"              <values>{values}</values>\n            </attribute>\n"
    )


def _shapes(rows: Tracks, attributes: tuple[str, ...], last: int, *, masks: bool) -> Iterator[str]:
    """The shapes of a track, in the order of their frames."""
    frames = rows.frames.tolist()
    for k, (frame, following) in enumerate(zip(frames, [*frames[1:], last + 1], strict=True)):
        yield _shape(rows, k, frame, attributes, outside=False, masks=masks)
        if following > frame + 1:
            yield _shape(rows, k, frame + 1, attributes, outside=True, masks=masks)


def _shape(rows: Tracks, k: int, frame: int, attributes: tuple[str, ...], *, outside: bool, masks: bool) -> str:
    status = Status(rows.status[k])
    flags = f'frame="{frame}" outside="{outside:d}" occluded="{status in _OCCLUDED:d}" keyframe="1"'
    tag, place = ("mask", _written_mask(rows.masks[k])) if masks else ("box", _written_box(rows.boxes[k].tolist()))
    said = {"status": status.word, "confidence": f"{short(rows.confidence[k]):.12g}"}
    children = "".join(f'      <attribute name="{one}">{said[one]}</attribute>\n' for one in attributes)
    return f'    <{tag} {flags} {place} z_order="0">\n{children}    </{tag}>\n'


def _written_box(box: list[float]) -> str:
    sides = zip(("xtl", "ytl", "xbr", "ybr"), box, strict=True)
    return " ".join(f'{name}="{short(side):.12g}"' for name, side in sides)


def _written_mask(mask: Mask) -> str:
    """The run lengths of the crop row by row, beginning with what is not in the mask."""
    flat = mask.bits.ravel()
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    runs = np.diff(np.concatenate([[0], changes, [flat.size]])).tolist()
    runs = [0, *runs] if flat[0] else runs
    height, width = mask.bits.shape
    listed = ", ".join(map(str, runs))
    return f'rle="{listed}" left="{mask.x}" top="{mask.y}" width="{width}" height="{height}"'


def _quoted(text: str) -> str:
    return quoteattr(_legal(text))


def _legal(text: str) -> str:
    """The text; OutputError where it has a character that XML cannot hold."""
    if any(
        (ord(one) < 32 and one not in "\t\n\r") or 0xD800 <= ord(one) < 0xE000 or one in "\ufffe\uffff"
        for one in text
    ):
        raise OutputError(f"{text!r} has a character that XML cannot hold; give another class or name")
    return text


_TOLD = frozenset({Trait.CLASS, Trait.CONFIDENCE, Trait.CHANGING_CONFIDENCE, Trait.STATUS, Trait.LOST})
FORMAT = Format(
    "cvat",
    "CVAT for video 1.1 XML, boxes; frames from 0",
    read,
    write,
    suffixes=(".xml",),
    holds=_TOLD | {Trait.BOX},
)
MASKS = Format(
    "cvat-mask",
    "CVAT for video 1.1 XML, silhouettes; read as cvat",
    read,
    write_masks,
    suffixes=(".xml",),
    holds=_TOLD | {Trait.MASK, Trait.MASK_TOO, Trait.OVERLAP},
)

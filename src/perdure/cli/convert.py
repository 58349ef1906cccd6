"""`perdure convert`: a file of one format in, a file of another out."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Optional

import typer

from perdure.cli import options
from perdure.errors import FormatError, OutputError, ParameterError
from perdure.files.folders import whole_files
from perdure.files.formats import FORMATS, READ, WRITTEN, for_output, named, recognised
from perdure.files.formats.converting import (
    Wishes,
    Written,
    gathered,
    is_of_masks,
    refuse_own_place,
    sequences_in,
    write,
)


def convert(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="A",
            help="What to read: a file, a folder of index PNGs, a MOTChallenge folder, a run folder, or a folder of "
            "files of several sequences.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Argument(metavar="B", help="What to write: a file, or a folder.", show_default=False)
    ],
    from_: Annotated[
        Optional[str],  # noqa: UP045 - typer reads this at run time
        typer.Option(
            "--from",
            metavar="FORMAT",
            help=f"What A is, where suffix and content do not tell: {', '.join(READ)}.",
            show_default=False,
        ),
    ] = None,
    to: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--to",
            metavar="FORMAT",
            help=f"What B shall be, where its suffix does not tell: {', '.join(WRITTEN)}.",
            show_default=False,
        ),
    ] = None,
    fps: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(
            "--fps",
            help="Frames per second, for times that A does not have or has wrong. Default: 25.",
            show_default=False,
        ),
    ] = None,
    size: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--size",
            metavar="WxH",
            help="Width and height of the pictures, where A does not tell.",
            show_default=False,
        ),
    ] = None,
    kind: Annotated[
        str, typer.Option("--class", metavar="NAME", help="The class of rows that have none.", show_default=False)
    ] = "",
    video: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--video", metavar="NAME", help="Which video of a COCO file that holds several.", show_default=False
        ),
    ] = None,
    overwrite: options.OverwriteOption = False,
    json_: options.JsonOption = False,
) -> None:
    """Convert tracks from one format to another, and warn of what that cannot hold.

    perdure convert gt.txt gt.xml

    perdure convert perdure-runs/street street.json --to coco-vis

    perdure convert label_02 boxes --to mot

    perdure convert boxes.txt street.json --to coco-video --size 1920x1080 --fps 30
    """
    if fps is not None and not 0.001 <= fps <= 1000:
        raise ParameterError(f"fps {fps:g} is out of range: 0.001 to 1000")
    wishes = Wishes(fps, None if size is None else _size(size), kind, video)
    read_as = None if from_ is None else named(from_, READ)
    refuse_own_place(source, output)
    if read_as is None and source.is_dir() and _is_of_several(source):
        written = _convert_several(source, output, to, wishes, overwrite=overwrite)
    else:
        target = for_output(output) if to is None else named(to, WRITTEN)
        content, source_format = gathered(source, read_as, wishes)
        written = [write(output, content, source_format.name, target, overwrite=overwrite)]
    for one in written:
        say(one)
    _print(written, output, json_=json_)


def say(written: Written) -> None:
    """Print notes and warnings of what was written to standard error."""
    for note in written.notes:
        print(f"perdure: note: {note}", file=sys.stderr)
    if written.left_out:
        what = "a silhouette" if is_of_masks(FORMATS[written.target]) else "an area"
        print(f"perdure: warning: rows left out, without {what}: {written.left_out}", file=sys.stderr)
    if written.losses:
        listed = "; ".join(map(str, written.losses))
        print(f"perdure: warning: {written.target} does not hold {listed}", file=sys.stderr)


def value_of(written: Written) -> dict[str, Any]:
    """Return what was written as plain values."""
    return {
        "output": str(written.path),
        "from": written.source,
        "to": written.target,
        "rows": written.rows,
        "ids": written.ids,
        "left_out": written.left_out,
        "lost": [one._asdict() for one in written.losses],
        "notes": list(written.notes),
    }


def _is_of_several(source: Path) -> bool:
    """Whether a folder is no format of its own."""
    try:
        recognised(source)
    except FormatError:
        return True
    return False


def _convert_several(
    source: Path, output: Path, to: str | None, wishes: Wishes, *, overwrite: bool
) -> list[Written]:
    """Convert the files in a folder, each to one of the same name."""
    found = sequences_in(source)
    if to is None:
        raise ParameterError(f"{source} holds files of several sequences; name the format of the new ones by --to")
    target = named(to, WRITTEN)
    if target.is_folder:
        raise ParameterError(f"{target.name} is a folder a sequence; convert the files in {source} one by one")
    paths = {path.with_suffix(target.suffixes[0]).name: path for path in found}
    if len(paths) < len(found):
        raise OutputError(f"{source} holds files that differ in their suffix only; convert them one by one")
    written = []
    with whole_files(output, paths, overwrite=overwrite) as part:
        for name, path in paths.items():
            content, read_as = gathered(path, None, wishes)
            one = write(part / name, content, read_as.name, target, overwrite=False)
            written.append(replace(one, path=output / name))
    return written


def _size(text: str) -> tuple[int, int]:
    """Height and width out of 'WxH'."""
    match = re.fullmatch(r"([1-9]\d{0,4})[xX×]([1-9]\d{0,4})", text.strip())
    if match is None:
        raise ParameterError(f"size {text!r} is not WIDTHxHEIGHT, as in 1920x1080")
    return int(match[2]), int(match[1])


def _print(written: list[Written], output: Path, *, json_: bool) -> None:
    if json_:
        values = [value_of(one) for one in written]
        print(json.dumps(values[0] if len(values) == 1 else {"output": str(output), "files": values}))
        return
    for one in written:
        print(f"{one.rows} rows, {one.ids} ids: {one.path}  ({one.source} → {one.target})")

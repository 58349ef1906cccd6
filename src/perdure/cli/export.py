"""`perdure export`: a run in, another program's format out."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Annotated, NamedTuple, cast

import typer

from perdure import params
from perdure.cli import options
from perdure.cli.convert import say
from perdure.errors import FormatError, OutputError, ParameterError
from perdure.files import mask_pngs
from perdure.files.contours import (
    POINT_COLUMNS,
    contours_of,
    write_features,
    write_geojson_begin,
    write_geojson_end,
    write_points,
)
from perdure.files.folders import refuse_existing_folder, whole_folder
from perdure.files.formats import named, table
from perdure.files.formats.converting import write
from perdure.files.formats.run import content_of
from perdure.files.mot import write_rows
from perdure.files.mots import write_masks
from perdure.files.runs import Reporting, RunFolder, unended
from perdure.files.whole import refuse_existing, whole_file
from perdure.fold import Corrections, settle_with
from perdure.types import Tracks

OWN = ("csv", "mot", "mots", "mask-png", "geojson", "contour-csv", "svg")  # written frame by frame
WHOLE = ("coco-vis", "coco-video", "cvat", "cvat-mask", "kitti", "parquet")  # written by `perdure.files.formats`
FOLDERS = {"mask-png": mask_pngs.SUFFIX, "svg": ".svg"}  # of one file a frame, with this suffix
OF_BOXES = ("csv", "mot", "cvat", "kitti")


@options.with_parameters(("", {"What counts": Reporting}))
def export(
    run: options.RunArgument,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            help="The file to write; a folder for mask-png and svg.",
            show_default=False,
        ),
    ],
    chosen: dict[str, object],
    format_: Annotated[
        str,
        typer.Option(
            "--format",
            help="mot: MOTChallenge text, frames and pixels from 1; csv: all plain columns, frames and pixels from 0; "
            "mots: MOTS text, silhouettes, frames from 1; mask-png: a folder with a picture a frame, pixel = id; "
            "contours between pixels: geojson: polygons with holes; contour-csv: a line a point; svg: a folder with a "
            "drawing a frame, dashed where not seen; for other programs: coco-vis (YouTube-VIS), coco-video, cvat (CVAT for "
            "video 1.1, boxes), cvat-mask (silhouettes), kitti, parquet.",
        ),
    ] = "mot",
    believed: Annotated[
        bool,
        typer.Option(
            "--believed", help="Whole silhouettes, as far as one is believed, instead of the pixels seen."
        ),
    ] = False,
    overwrite: options.OverwriteOption = False,
    json_: options.JsonOption = False,
) -> None:
    """Write the rows of RUN that count in another format."""
    if format_ not in (known := (*OWN, *WHOLE)):
        raise ParameterError(params.unknown_name("format", format_, known))
    if believed and format_ in OF_BOXES:
        raise ParameterError(
            f"--believed does not go with --format {format_}: what it says is of the whole already"
        )
    if believed and format_ == "parquet":
        raise ParameterError("--believed does not go with --format parquet, which holds both silhouettes")
    _refuse(output, run, format_, overwrite=overwrite)
    folder = RunFolder.open(run)
    about = folder.read_about()
    reporting = params.build(Reporting, {**about.get("reporting", {}), **chosen})
    if format_ == "mask-png":
        written = _write_pictures(output, folder, reporting, believed=believed, overwrite=overwrite)
    elif format_ in WHOLE:
        written = _write_whole(output, folder, reporting, format_, believed=believed, overwrite=overwrite)
    elif format_ == "svg":
        written = _write_drawings(output, folder, reporting, believed=believed, overwrite=overwrite)
    else:
        written = _write_text(output, folder, reporting, format_, believed=believed)
    if note := unended(folder, about, sum(one.frame >= 0 for one in folder.entries(with_masks=False))):
        print(f"perdure: note: {note}", file=sys.stderr)
    if written.left_out:
        print(f"perdure: note: rows left out, without a silhouette: {written.left_out}", file=sys.stderr)
    if believed and not any(one is not None for _, rows in _counted(folder, reporting) for one in rows.believed):
        print(
            "perdure: note: --believed changes nothing: this run says only what was seen; trackcut and contour believe whole ones",
            file=sys.stderr,
        )
    if json_:
        pictures = {} if written.frames is None else {"frames": written.frames}
        print(json.dumps({"output": str(output), "rows": written.rows, **pictures}))
    else:
        pictures_too = "" if written.frames is None else f" in {written.frames} pictures"
        print(f"{written.rows} rows{pictures_too}: {output}")


class _Written(NamedTuple):
    """What was written."""

    rows: int
    left_out: int = 0  # rows that count, without a silhouette
    frames: int | None = None  # pictures


def _refuse(output: Path, run: Path, format_: str, *, overwrite: bool) -> None:
    """Refuse to write over what is there, unless that is asked; over what the run rests on, never."""
    if output.resolve() in {(run / name).resolve() for name in ("run.json", "tracks.jsonl")}:
        raise OutputError(f"{output} is a part of the run itself; name another place with -o")
    if format_ in FOLDERS:
        refuse_existing_folder(output, FOLDERS[format_], overwrite=overwrite)
    else:
        refuse_existing(output, overwrite=overwrite)


def _counted(folder: RunFolder, reporting: Reporting) -> Iterator[tuple[int, Tracks]]:
    """The rows that count, by frame."""
    for frame, settled in folder.settled_by_frame():
        yield frame, settled.counted(reporting.report_confidence)


def _write_text(
    output: Path, folder: RunFolder, reporting: Reporting, format_: str, *, believed: bool
) -> _Written:
    """Write one file."""
    writers: dict[str, Callable[[IO[str], RunFolder, Iterator[Tracks], bool], int]] = {
        "csv": _write_csv,
        "mot": _write_mot,
        "mots": _write_mots,
        "geojson": _write_geojson,
        "contour-csv": _write_points,
    }
    counted = 0

    def rows() -> Iterator[Tracks]:
        nonlocal counted
        for _, here in _counted(folder, reporting):
            counted += len(here)
            yield here

    with whole_file(output) as file:
        written = writers[format_](file, folder, rows(), believed)
    return _Written(written, counted - written)


def _write_whole(
    output: Path, folder: RunFolder, reporting: Reporting, format_: str, *, believed: bool, overwrite: bool
) -> _Written:
    """Write one file of which the format wants to know all rows at once, and warn of what it does not hold."""
    content = content_of(folder, folder.read_about(), reporting.report_confidence)
    content = content.replace(tracks=_as_asked(content.tracks, believed))
    written = write(output, content, "run", named(format_, WHOLE), overwrite=overwrite)
    say(written)
    return _Written(written.rows)


def _write_pictures(
    output: Path, folder: RunFolder, reporting: Reporting, *, believed: bool, overwrite: bool
) -> _Written:
    """Write a folder with a picture for each frame of the run."""
    height, width = _size(folder)
    frames = _frames_of(folder)
    corrections = Corrections.of(one.report for one in folder.entries(with_masks=False))
    counted = largest = 0
    for _, settled in settle_with(corrections, (one.report for one in folder.entries(with_masks=False))):
        rows = settled.counted(reporting.report_confidence)
        counted += len(rows)
        largest = max(largest, *rows.ids.tolist(), 0)
    pictures = ((frame, _as_asked(rows, believed)) for frame, rows in _counted(folder, reporting))
    written = mask_pngs.write_masks(
        output, pictures, frames, height, width, largest_id=largest, overwrite=overwrite
    )
    return _Written(written, counted - written, len(frames))


def _write_drawings(
    output: Path, folder: RunFolder, reporting: Reporting, *, believed: bool, overwrite: bool
) -> _Written:
    """Write a folder with an SVG for each frame of the run."""
    from perdure.draw.svg import svg_of

    height, width = _size(folder)
    frames = _frames_of(folder)
    counted = written = 0
    drawn: set[int] = set()
    with whole_folder(output, FOLDERS["svg"], overwrite=overwrite) as write:
        for frame, rows in _counted(folder, reporting):
            found = [(one.row, one.outline, one.of == "contour") for one in contours_of(rows, believed=believed)]
            write(frame, svg_of(rows, found, frame, height, width).encode())
            counted, written = counted + len(rows), written + len(found)
            drawn.add(frame)
        for frame in set(frames) - drawn:
            write(frame, svg_of(Tracks.empty(), (), frame, height, width).encode())
    return _Written(written, counted - written, len(frames))


def _frames_of(folder: RunFolder) -> list[int]:
    """The frames of a run, also those in which nothing is said."""
    return [entry.frame for entry in folder.entries(with_masks=False) if entry.frame >= 0]


def _as_asked(rows: Tracks, believed: bool) -> Tracks:
    """The rows with the silhouettes that are asked for as their masks."""
    if not believed:
        return rows
    whole = (mask if one is None else one for one, mask in zip(rows.believed, rows.masks, strict=True))
    return rows.replace(masks=tuple(whole))


def _size(folder: RunFolder) -> tuple[int, int]:
    """Height and width of the run's pictures."""
    about = folder.read_about()
    size = about.get("height"), about.get("width")
    if not all(type(side) is int and 0 < side <= _LONGEST_SIDE for side in size):
        raise FormatError(
            f"{folder.path / 'run.json'} does not tell the size of the pictures; `perdure track --overwrite` makes it anew"
        )
    return cast("tuple[int, int]", size)


def _write_mot(file: IO[str], folder: RunFolder, frames: Iterator[Tracks], believed: bool) -> int:
    count = 0
    for rows in frames:
        write_rows(file, rows)
        count += len(rows)
    return count


def _write_mots(file: IO[str], folder: RunFolder, frames: Iterator[Tracks], believed: bool) -> int:
    height, width = _size(folder)
    return sum(write_masks(file, _as_asked(rows, believed), height, width) for rows in frames)


def _write_geojson(file: IO[str], folder: RunFolder, frames: Iterator[Tracks], believed: bool) -> int:
    count = 0
    write_geojson_begin(file, _size(folder))
    for rows in frames:
        count += write_features(file, rows, believed=believed, first=not count)
    write_geojson_end(file)
    return count


def _write_points(file: IO[str], folder: RunFolder, frames: Iterator[Tracks], believed: bool) -> int:
    csv.writer(file, lineterminator="\n").writerow(POINT_COLUMNS)
    return sum(write_points(file, rows, believed=believed) for rows in frames)


def _write_csv(file: IO[str], folder: RunFolder, frames: Iterator[Tracks], believed: bool) -> int:
    count, on_ground = 0, bool(folder.read_about().get("ground"))
    table.write_names(file, on_ground=on_ground)
    for rows in frames:
        table.write_lines(file, rows, on_ground=on_ground)
        count += len(rows)
    return count


_LONGEST_SIDE = 1 << 16  # px

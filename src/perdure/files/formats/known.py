"""All formats by name; telling what a file is; reading and writing any of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from perdure import params
from perdure.errors import FormatError, ParameterError
from perdure.files.formats import (
    coco_video,
    coco_vis,
    cvat,
    geojson,
    kitti,
    mask_png,
    mot,
    mots,
    parquet,
    run,
    table,
)
from perdure.files.formats.content import Content, Format, Reading, with_times
from perdure.files.formats.jsons import read_json
from perdure.files.mots import is_mots

FORMATS: Mapping[str, Format] = {
    one.name: one
    for one in (
        *(mot.FORMAT, mots.FORMAT, mask_png.FORMAT, coco_vis.FORMAT, coco_video.FORMAT, cvat.FORMAT, cvat.MASKS),
        *(kitti.FORMAT, table.FORMAT, parquet.FORMAT, geojson.FORMAT, run.FORMAT),
    )
}
WRITTEN = tuple(name for name, one in FORMATS.items() if one.write is not None)
READ = tuple(name for name, one in FORMATS.items() if one.read is not None)


def named(name: str, known: tuple[str, ...]) -> Format:
    """Return the format of a name; ParameterError, with those that there are, for another."""
    if name not in known:
        raise ParameterError(params.unknown_name("format", name, known))
    return FORMATS[name]


def recognised(path: Path) -> Format:
    """Return the format of what is at a path, by its suffix and by what is in it.

    Raises
    ------
    FormatError
        If nothing is there, or it is none that is known; the known ones are listed.
    """
    if not path.exists():
        raise FormatError(f"there is no {path}")
    found = _of_folder(path) if path.is_dir() else _of_file(path)
    if found is None:
        raise FormatError(f"{path} is none of the known formats: {', '.join(READ)}; if it is, name it by --from")
    return FORMATS[found]


def for_output(path: Path) -> Format:
    """Return the format that a name asks for; ParameterError where it asks for none, or for one of several."""
    suffix = path.suffix.lower()
    fitting = [name for name in WRITTEN if suffix and suffix in FORMATS[name].suffixes]
    if suffix == ".json":
        raise ParameterError(f"{path} may be of several formats; name one by --to: {', '.join(fitting)}")
    if not fitting:
        raise ParameterError(f"{path} does not tell its format; name one by --to: {', '.join(WRITTEN)}")
    return FORMATS[fitting[0]]


def read(path: Path, format_: Format, *, reading: Reading | None = None, fps: float | None = None) -> Content:
    """Return what a file holds, with a time for each row: frames / `fps` where given or where there are none."""
    if format_.read is None:
        raise ParameterError(f"{format_.name} is only written")
    return with_times(format_.read(path, reading or Reading()), fps)


def _of_folder(path: Path) -> str | None:
    checks: Mapping[str, Callable[[Path], bool]] = {
        run.FORMAT.name: run.is_run,
        mot.FORMAT.name: mot.is_mot_folder,
        mask_png.FORMAT.name: mask_png.is_mask_folder,
    }
    return next((name for name, is_one in checks.items() if is_one(path)), None)


def _of_file(path: Path) -> str | None:
    """By the suffix; of those that several formats share, by the first words."""
    suffix = path.suffix.lower()
    if path.name == run.LOG:
        return run.FORMAT.name
    if suffix in (".json", ".geojson"):
        return _of_json(path)
    if suffix == ".csv":
        return table.FORMAT.name if table.is_table(path) else mot.FORMAT.name
    if suffix == ".txt":
        return (
            kitti.FORMAT.name if kitti.is_kitti(path) else mots.FORMAT.name if is_mots(path) else mot.FORMAT.name
        )
    return next((name for name, one in FORMATS.items() if suffix in one.suffixes), None)


def _of_json(path: Path) -> str | None:
    value = read_json(path)
    if not isinstance(value, Mapping):
        return None
    if value.get("type") == geojson.KIND:
        return geojson.FORMAT.name
    if "images" in value:
        return coco_video.FORMAT.name
    return coco_vis.FORMAT.name if "videos" in value else None

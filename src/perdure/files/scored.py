"""What is at a path, for a comparison: a result (run folder, MOT or MOTS text, index PNGs), a truth (these, a clip).

Files of other formats, those of `perdure.files.formats`, are read as either; all their rows count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from perdure import params
from perdure.errors import FormatError, ParameterError
from perdure.files import mask_pngs, mots
from perdure.files.clip import read_blobs, read_clip
from perdure.files.formats import FORMATS, read, recognised
from perdure.files.images import natural_order
from perdure.files.mot import protocol_of, read_said, read_truth
from perdure.files.mot_table import read_table
from perdure.files.mots import is_mots
from perdure.files.runs import Reporting, RunFolder, unended
from perdure.types import Event, Rows, Tracks

_BOXES, _VISIBLE, _CLIP, _BLOBS = "gt/gt.txt", "gt/visible.txt", "clip.json", "gt/blobs.txt"
_AS_ALWAYS = ("mot", "mots")  # formats with rules of their own for what counts
_OTHERS = {suffix for one in FORMATS.values() for suffix in one.suffixes} - {".txt"}
_PLAIN_NAMES = ("gt", "tracks", "visible", "amodal")  # of a file that its folder gives a better name


@dataclass(frozen=True, eq=False)
class Result:
    """What somebody said of a sequence.

    Parameters
    ----------
    boxes : Rows
        The rows that count.
    masks : Rows or None
        The same with silhouettes, where there are any.
    tracks, events
        Of a run: all its rows, those of groups too, and its events; None of anything else.
    report_confidence : float or None
        Of a run: from which confidence hidden targets count.
    notes : tuple of str
        What the reader must know: that a run is not complete.
    part : str
        The options by which a run was kept to a part of its video; empty for the whole.
    """

    path: Path
    boxes: Rows
    masks: Rows | None = None
    tracks: Tracks | None = None
    events: tuple[Event, ...] | None = None
    report_confidence: float | None = None
    notes: tuple[str, ...] = ()
    part: str = ""


@dataclass(frozen=True, eq=False)
class Truth:
    """What is true of a sequence, as far as it is known.

    Parameters
    ----------
    boxes, masks : Rows or None
    protocol : str
        How rows are used: 'mot15', 'mot17', 'mot20', 'mots', 'masks', or 'rows' of another format.
    events : tuple of Event or None
    blobs : frame → the ids in each connected blob, or None
    pictures : tuple of int or None
        The frames that have a picture, of a folder of these.
    """

    path: Path
    boxes: Rows | None
    masks: Rows | None
    protocol: str
    events: tuple[Event, ...] | None = None
    blobs: Mapping[int, Sequence[frozenset[int]]] | None = None
    pictures: tuple[int, ...] | None = None


@dataclass(frozen=True)
class Match:
    """A result and its truth; `group` is the argument that it came from, where several hold the same sequences."""

    name: str
    result: Path
    truth: Path
    group: str = ""


Named = tuple[str, Path]


def find_results(path: Path) -> list[Named]:
    """Return (name, path) of every result at a path; a folder of several is opened.

    Raises
    ------
    FormatError
        If there is none.
    """
    return _find(path, _is_result, "result")


def find_truths(paths: Iterable[Path]) -> list[Named]:
    """Return (name, path) of every truth at the paths; a folder of several is opened.

    Raises
    ------
    FormatError
        If there is none at a path.
    """
    return [one for path in paths for one in _find(path, _is_truth, "truth")]


def paired(results: Mapping[str, Sequence[Named]], truths: Sequence[Named]) -> list[Match]:
    """Pair results, by the argument that they came from, with truths.

    By names where all have one that a truth has too; where several arguments hold the same names, each is a group
    of its own. Several arguments may be held against one truth. Only where no name is that of a truth are as many
    results and truths paired in their order.

    Raises
    ------
    ParameterError
        If none of these can be done.
    """
    by_name, every = dict(truths), [(group, *one) for group, several in results.items() for one in several]
    names = [name for _, name, _ in every]
    known = [name in by_name for name in names] if len(by_name) == len(truths) else [False] * len(names)
    if all(known):
        if len(set(names)) == len(names):
            return [Match(name, path, by_name[name]) for _, name, path in every]
        if all(len(dict(several)) == len(several) for several in results.values()):
            return [Match(name, path, by_name[name], group) for group, name, path in every]
    if len(truths) == 1 and all(len(several) == 1 for several in results.values()):
        alone = [truths[0][0]] if len(every) == 1 else names
        return [Match(name, path, truths[0][1]) for name, (_, _, path) in zip(alone, every, strict=True)]
    if not any(known) and len(every) == len(truths):
        return [Match(name, path, truth) for (_, _, path), (name, truth) in zip(every, truths, strict=True)]
    lost = next((name for name, one in zip(names, known, strict=True) if not one), names[0])
    shown = ", ".join(sorted(by_name)[:8]) + (", …" if len(by_name) > 8 else "")
    raise ParameterError(
        f"cannot tell which of {len(every)} results belongs to which of {len(truths)} truths: name them alike (there is"
        f" no truth {lost!r} among {shown}), or give as many of both under other names, in the same order"
    )


def read_result(path: Path, *, masks: bool, report_confidence: float | None = None) -> Result:
    """Read a result.

    Parameters
    ----------
    path : Path
        A run folder, a MOT or MOTS text, a folder of index PNGs, a file of another format.
    masks : bool
        Silhouettes are wanted, which of a run takes longer to read.
    report_confidence : float or None
        From which confidence hidden targets of a run count; None for the run's own.

    Raises
    ------
    FormatError
        Naming file and line.
    """
    if (path / "tracks.jsonl").is_file():
        return _read_run(RunFolder(path), masks, report_confidence)
    if path.is_dir():
        rows = mask_pngs.read_masks(path)
        return Result(path, rows, rows)
    if _is_other(path):
        rows, notes = _read_other(path)
        return Result(path, rows, rows if rows.masks else None, notes=notes)
    if is_mots(path):
        rows = mots.read_masks(path)
        return Result(path, rows, rows)
    return Result(path, read_said(path))


def read_scored_truth(path: Path, *, masks: bool, protocol: str = "auto") -> Truth:
    """Read a truth; silhouettes of a clip only where they are wanted.

    Raises
    ------
    FormatError
        Naming file and line.
    """
    if not path.is_dir() and _is_other(path):
        rows, _ = _read_other(path)
        return Truth(path, rows, rows if rows.masks else None, "rows")
    boxes = _in_folder(path) if path.is_dir() else path
    if boxes is None:
        pictures = [frame for frame, _ in mask_pngs.pictures_in(path)]
        return Truth(path, None, mask_pngs.read_masks(path, void=True), "masks", pictures=tuple(pictures))
    home = boxes.parent.parent if boxes.parent.name == "gt" else boxes.parent
    clip, blobs = home / _CLIP, home / _BLOBS
    events, size = read_clip(clip) if clip.is_file() else (None, None)
    shared = read_blobs(blobs) if blobs.is_file() else None
    if is_mots(boxes):
        return Truth(path, None, mots.read_masks(boxes), "mots", events, shared)
    visible = home / _VISIBLE
    seen = mots.read_masks(visible) if masks and visible.is_file() else None
    used = protocol_of(read_table(boxes)) if protocol == "auto" else protocol
    return Truth(path, read_truth(boxes, used).replace(size=size), seen, used, events, shared)


def _is_other(path: Path) -> bool:
    """Whether a file is of a format without rules of its own."""
    known = path.is_file() and (path.suffix == ".txt" or path.suffix.lower() in _OTHERS)
    return known and recognised(path).name not in _AS_ALWAYS


def _read_other(path: Path) -> tuple[Rows, tuple[str, ...]]:
    """The rows of a file of another format, and what was left out of it."""
    content = read(path, recognised(path))
    return Rows.of_tracks(content.tracks).replace(size=content.size), content.notes


def _read_run(folder: RunFolder, masks: bool, report_confidence: float | None) -> Result:
    about = folder.read_about()
    given = {} if report_confidence is None else {"report_confidence": report_confidence}
    try:
        least = params.build(Reporting, {**about.get("reporting", {}), **given}).report_confidence
    except ParameterError as error:
        raise FormatError(f"{folder.path / 'run.json'}: {error}") from error
    tracks, events, frames = folder.read(with_masks=masks)
    counted = Rows.of_tracks(tracks.counted(least)).replace(size=_size(about))
    notes = [note for note in (unended(folder, about, frames),) if note]
    seen = counted if masks else None
    return Result(folder.path, counted, seen, tracks, events, least, tuple(notes), _part(about))


def _part(about: Mapping[str, Any]) -> str:
    window = about.get("window")
    limits = window if isinstance(window, dict) else {}
    return " ".join(f"--{name} {limits[name]}" for name in ("start", "end") if limits.get(name) is not None)


def _size(about: Mapping[str, object]) -> tuple[int, int] | None:
    """Height and width, where both are told."""
    height, width = about.get("height"), about.get("width")
    return (height, width) if isinstance(height, int) and isinstance(width, int) else None


def _find(path: Path, is_one: Callable[[Path], bool], what: str) -> list[tuple[str, Path]]:
    if path.name == "tracks.jsonl" and path.is_file():
        path = path.parent
    if not path.exists():
        raise FormatError(f"there is no {path}")
    if is_one(path) or not path.is_dir():
        return [(name_of(path), path)]
    if not any(is_one(one) for one in path.iterdir()) and (path / "data").is_dir():
        path = path / "data"  # as TrackEval lays out a tracker's results
    inside = sorted(path.iterdir(), key=natural_order)
    found = [(name_of(one), one) for one in inside if not one.name.startswith(".") and is_one(one)]
    if not found:
        wanted = "a run folder, MOT or MOTS text, or a folder of index PNGs" + (
            "" if what == "result" else ", or a folder with gt/gt.txt"
        )
        raise FormatError(f"{path} holds no {what}; wanted is {wanted}, or a folder of these")
    return found


def _is_result(path: Path) -> bool:
    if path.is_dir():
        return (path / "tracks.jsonl").is_file() or any(path.glob("*.png"))
    return path.suffix == ".txt"


def _is_truth(path: Path) -> bool:
    if path.is_dir():
        return _in_folder(path) is not None or any(path.glob("*.png"))
    return path.suffix == ".txt"


def _in_folder(folder: Path) -> Path | None:
    """The text of a sequence's truth in its folder."""
    for name in (_BOXES, "gt.txt", _VISIBLE):
        if (folder / name).is_file():
            return folder / name
    return None


def name_of(path: Path) -> str:
    """Return the name of the sequence that a result or truth is of."""
    if path.is_dir():
        return path.parent.name if path.name == "gt" else path.resolve().name
    stem = path.name.removesuffix(path.suffix).removesuffix(".gt")
    if stem not in _PLAIN_NAMES:
        return stem
    home = path.resolve().parent
    return home.parent.name if home.name == "gt" else home.name

"""`perdure learn-zones`: a run in, proposed zones out, as a file and drawn over a frame."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Optional

import numpy as np
import typer

from perdure.cli import options
from perdure.cli.pictures import new_picture
from perdure.detect.occluders import no_passages, note, occluders
from perdure.errors import FormatError, OutputError, ParameterError, PerdureError
from perdure.files.runs import PARTS, RunFolder
from perdure.files.video import Source, open_source
from perdure.files.whole import refuse_existing
from perdure.files.zones import write_zones
from perdure.scene.learning import Learnt, Standing, learn_zones
from perdure.scene.zones import Zones
from perdure.types import Frame, Image, Mask, Regions, Scene, Tracks

LOOKS = 25  # frames of the source that tell what the place looks like
_LONGEST_SIDE = 1 << 16  # px


def learn(
    run: options.RunArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The zones, .json.", show_default=False)
    ],
    draw: Annotated[
        Optional[Path],  # noqa: UP045 - typer reads this at run time
        typer.Option(
            "--draw",
            metavar="FILE",
            help="The picture of the zones over a frame, .png (default: beside the zones).",
            show_default=False,
        ),
    ] = None,
    source: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--source",
            metavar="SOURCE",
            help="Where the run's film is now, if it was moved.",
            show_default=False,
        ),
    ] = None,
    overwrite: options.OverwriteOption = False,
    json_: options.JsonOption = False,
) -> None:
    """Propose entries, exits, occluders and noise from the tracks of RUN, for you to look at and edit."""
    picture = _checked(run, output, draw, overwrite=overwrite)
    folder = RunFolder.open(run)
    _refuse_to_replace_the_film(picture, folder, source)
    if folder.read_about().get("zones"):
        words = (
            "this run was tracked with zones, which decide where things are born and kept; one without tells more"
        )
        print(f"perdure: note: {words}", file=sys.stderr)
    size = _size(folder)
    looks = _looks(folder, size, source)
    learnt = learnt_from(folder.settled_by_frame(), _times(folder), size, [one.image for one in looks])
    if not learnt.proposals:
        reasons = dict.fromkeys(learnt.missing.values())
        kinds = {why: ", ".join(kind for kind, one in learnt.missing.items() if one == why) for why in reasons}
        why = "; ".join(f"{kinds[reason]}: {reason}" for reason in reasons)
        raise PerdureError(f"{run} tells of no zone ({why}); track a longer film, or draw the zones yourself")
    zones = Zones(tuple(one.zone for one in learnt.proposals), (), size)
    told = {one.zone.name: one.reason for one in learnt.proposals}
    with new_picture(picture, _drawn(zones, looks)):
        write_zones(output, zones, told)
    if json_:
        print(json.dumps(_as_json(learnt, output, picture)))
    else:
        print(_words(learnt, output, picture))


def learnt_from(
    settled: Iterable[tuple[int, Tracks]],
    times: Sequence[float],
    size: tuple[int, int],
    looks: Sequence[Image | None] = (),
) -> Learnt:
    """Propose zones from settled rows, frame by frame, and pictures of the place.

    Parameters
    ----------
    settled : iterable of (int, Tracks)
        The rows of each frame in which there are any.
    times : sequence of float
        Of the first frame and the last, in seconds.
    size : (int, int)
        Height and width of the picture.
    looks : sequence of (H, W, 3) uint8
        Frames from all over the film; without them, nothing is known of what stands in front.
    """
    passages, kept, before = no_passages(*size), [], times[0]
    for _, rows in settled:
        now = float(rows.times[0]) if len(rows) else before
        seen = [mask for mask, group in zip(rows.masks, rows.is_group, strict=True) if mask.area and not group]
        boxes = np.array([mask.box for mask in seen], np.float32).reshape(-1, 4)
        note(passages, Regions.of(boxes, masks=seen), max(0.0, now - before))
        before = now
        kept.append(rows.replace(masks=(Mask.empty(),) * len(rows)))
    note(passages, Regions.empty(), max(0.0, times[1] - before) + 1.0)  # closes the last visits
    pictures = [look for look in looks if look is not None]
    standing: list[Standing] = []
    if pictures:
        mean = np.median(np.stack(pictures), axis=0).astype(np.float32)
        standing = [Standing(one.polygon, one.ended, one.confidence) for one in occluders(passages, mean)]
    return learn_zones(Tracks.join(kept), size, (times[0], times[1]), standing)


# What is asked ---------------------------------------------------------------------------------------------


def _checked(run: Path, output: Path, draw: Path | None, *, overwrite: bool) -> Path:
    """Return where the picture goes; refuse what would replace something that is not asked to be replaced."""
    if output.suffix.lower() not in (".json", ".geojson"):
        raise ParameterError(f"{output} must end in .json or .geojson, as files of zones do")
    picture = output.with_suffix(".png") if draw is None else draw
    if picture.suffix.lower() != ".png":
        raise ParameterError(f"--draw {picture} must end in .png")
    parts = {(run / name).resolve() for name in PARTS}
    for place in (output, picture):
        if place.resolve() in parts:
            raise OutputError(f"{place} is a part of the run itself; name another place")
    refuse_existing(output, overwrite=overwrite)
    if picture.is_dir() or (picture.exists() and not overwrite):
        what = "is a folder" if picture.is_dir() else "is there already; add --overwrite or"
        raise OutputError(f"{picture} {what}{';' if picture.is_dir() else ''} name another file with --draw")
    return picture


def _refuse_to_replace_the_film(picture: Path, folder: RunFolder, source: str | None) -> None:
    """Refuse a picture that is there among the film's own."""
    place = folder.read_about().get("source") if source is None else source
    film = Path(place).resolve() if isinstance(place, str) else None
    mine = picture.resolve()
    among = film is not None and (
        mine == film or film in mine.parents or ("*" in film.name and mine.parent == film.parent)
    )
    if among and picture.exists():
        raise OutputError(f"{picture} may be a picture of the film itself; name another file with --draw")


def _size(folder: RunFolder) -> tuple[int, int]:
    about = folder.read_about()
    height, width = about.get("height"), about.get("width")
    for side in (height, width):
        if type(side) is not int or not 0 < side <= _LONGEST_SIDE:
            raise FormatError(
                f"{folder.path / 'run.json'} does not tell the size of the pictures; "
                "`perdure track --overwrite` makes it anew"
            )
    return int(height), int(width)  # type: ignore[arg-type]


def _times(folder: RunFolder) -> tuple[float, float]:
    """Times of the run's first frame and its last."""
    times = [entry.time for entry in folder.entries(with_masks=False) if entry.frame >= 0]
    if not times:
        raise FormatError(f"{folder.log} holds no frame; `perdure track --overwrite` makes it anew")
    return min(times), max(times)


def _looks(folder: RunFolder, size: tuple[int, int], given: str | None) -> list[Frame]:
    """Return frames from all over the run's film; none, with a note, where it is not there any more."""
    about = folder.read_about()
    place = about.get("source") if given is None else given
    try:
        if not isinstance(place, str):
            raise FormatError(f"{folder.path / 'run.json'} does not name the source")
        opened = _opened(place, about.get("window", {}))
        try:
            looks = opened.sample(LOOKS)
        finally:
            opened.close()
        if (opened.height, opened.width) != size:
            raise ParameterError(
                f"{place} is {opened.width}x{opened.height}, the run was over {size[1]}x{size[0]}"
            )
        if not looks:
            raise ParameterError(f"{place} cannot be read a second time")
    except PerdureError as error:
        if given is not None:
            raise
        print(
            f"perdure: note: {error}; occluders come from the tracks alone, and the picture has no frame "
            "(--source tells where the film is)",
            file=sys.stderr,
        )
        return []
    return looks


def _opened(place: str, window: dict[str, Any]) -> Source:
    return open_source(
        place,
        fps=window.get("fps"),
        start=window.get("start"),
        end=window.get("end"),
        stride=window.get("stride", 1),
    )


# What is told ----------------------------------------------------------------------------------------------


def _drawn(zones: Zones, looks: Sequence[Frame]) -> Image:
    """The zones over the frame in the middle of the film, or over a dark canvas."""
    from perdure.draw import Trails, paint

    height, width = zones.size
    frame = looks[len(looks) // 2] if looks else Frame(0, 0.0, None)
    return paint(frame, Tracks.empty(), Trails.empty(), Scene(width, height, zones=zones.zones))


def _as_json(learnt: Learnt, output: Path, picture: Path) -> dict[str, Any]:
    zones = [
        {"kind": one.zone.kind, "name": one.zone.name, "count": one.count, "reason": one.reason}
        for one in learnt.proposals
    ]
    return {
        "output": str(output),
        "picture": str(picture),
        "walks": learnt.walks,
        "zones": zones,
        "missing": dict(learnt.missing),
    }


def _words(learnt: Learnt, output: Path, picture: Path) -> str:
    wide = max(len(one.zone.name) for one in learnt.proposals)
    return "\n".join(
        [
            *(f"{one.zone.kind:10}{one.zone.name:{wide}}  {one.reason}" for one in learnt.proposals),
            *(f"{kind:10}{'none':{wide}}  {why}" for kind, why in learnt.missing.items()),
            f"zones     {output}",
            f"picture   {picture}",
        ]
    )

"""Options that every command shares, and those read off the parameters' declarations."""

from __future__ import annotations

import functools
import inspect
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Optional, TypeVar

import typer

from perdure import params
from perdure.equipment import USUAL
from perdure.errors import ParameterError

F = TypeVar("F", bound=Callable[..., None])

SourceArgument = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE",
        help="A video file, a folder or glob of images, a MOTChallenge folder, a camera number, or a URL.",
        show_default=False,
    ),
]
RunArgument = Annotated[
    Path, typer.Argument(metavar="RUN", help="A run folder of `perdure track`.", show_default=False)
]
FpsOption = Annotated[
    Optional[float],  # noqa: UP045 - typer reads this at run time
    typer.Option("--fps", help="Frames per second, where the source has none or a wrong one.", show_default=False),
]
StartOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--start",
        metavar="T",
        help="Begin here: seconds, mm:ss, h:mm:ss, or a frame such as 300f (from 0).",
        show_default=False,
    ),
]
EndOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--end", metavar="T", help="Stop before this time or frame.", show_default=False),
]
StrideOption = Annotated[int, typer.Option("--stride", metavar="N", help="Take every N-th frame.")]
RoiOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--roi",
        metavar="ROI",
        help="Where things may be seen: an image (not black = inside), a box x,y,w,h, a polygon 'x,y x,y …', "
        "or a file of polygons.",
        show_default=False,
    ),
]
CalibrationOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--calibration",
        metavar="FILE|auto",
        help="Where the ground plane lies, a JSON file: places are told in metres, speeds in m/s. "
        "'auto' estimates it from people who walk about, in a first look over the source.",
        show_default=False,
    ),
]
ObjectHeightOption = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option(
        "--object-height",
        metavar="M",
        help="How high in metres are those from whom the ground is estimated, on the mean (default 1.7).",
        show_default=False,
    ),
]
ZonesOption = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(
        "--zones",
        metavar="FILE",
        help="Entries, exits, occluders and other zones of the place, and rules between them: GeoJSON in pixels.",
        show_default=False,
    ),
]
ScenariosOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--scenarios",
        metavar="FILE|usual",
        help="What is to be recognised, a TOML file of scenarios, or 'usual' for those that come with Perdure: told "
        "as events. Targets taken for noise are then taken back, who does something of interest is kept for longer.",
        show_default=False,
    ),
]
ContextOption = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--context",
        metavar="FILE|auto|default",
        help="What features weigh with --tracker multifeature: a file of `perdure learn`; of several, as it may be "
        "repeated, the nearest to the video is in force. 'auto' are those that come with Perdure, 'default' the "
        f"tracker's own weights. Default: {USUAL}.",
        show_default=False,
    ),
]
EmbeddingOption = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(
        "--embedding",
        metavar="FILE",
        help="An ONNX file of a re-identification network, by which --tracker multifeature tells looks apart, too.",
        show_default=False,
    ),
]
ClassOption = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--class", metavar="NAME", help="Only regions of this class; may be repeated.", show_default=False
    ),
]
TargetClassOption = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--class", metavar="NAME", help="Only targets of this class; may be repeated.", show_default=False
    ),
]
ParametersOption = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(
        "--parameters",
        metavar="FILE",
        help="A JSON file of parameters by name; options on the command line win.",
        show_default=False,
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print the result as one JSON object on the last line, for machines.")
]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace the file that is there.")]
DetectorOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--detector",
        metavar="NAME|FILE",
        help="'background' needs nothing; 'people' finds upright people in each picture by itself; 'onnx:FILE' and "
        "'openvino:FILE' are networks; or a file of regions: .jsonl of `perdure detect`, MOTChallenge .txt. "
        "Default: background, or det/det.txt of a MOTChallenge folder without images.",
        show_default=False,
    ),
]
TrackerSettingsOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--tracker-settings",
        metavar="JSON|FILE",
        help="Arguments of another library's tracker, as a JSON object or a file of one; 'fps' stands for the "
        "source's frames per second.",
        show_default=False,
    ),
]
TrackerEnvironmentOption = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(
        "--tracker-environment",
        metavar="DIR",
        help="The virtual environment that has the other library. Default: $PERDURE_PEERS, else this one.",
        show_default=False,
    ),
]
ClassNamesOption = Annotated[
    Optional[Path],  # noqa: UP045
    typer.Option(
        "--class-names",
        metavar="FILE",
        help="The names of a network's classes, one a line, the first that of number 0. Default: those that its file "
        "tells, COCO's for 80 classes, else numbers.",
        show_default=False,
    ),
]
BoxMasksOption = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--box-masks",
        metavar="none|background|cut",
        help="Silhouettes for a detector that gives boxes: 'background', what differs from a background model that "
        "is learnt beside it (fixed camera); 'cut', what its colours tell from what lies around the box (slow).",
        show_default=False,
    ),
]

InitOption = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option(
        "--init",
        metavar="WHAT[@FRAME]",
        help="Follow what is marked in a frame (from 0; default 0): an index PNG (pixel value = id, 0 = nothing), "
        "a box x,y,w,h, or a polygon 'x,y x,y …'; may be repeated. With no detector, unless --detector names one: "
        "then what that sees is observed, and new things are found, too.",
        show_default=False,
    ),
]


def with_parameters(*families: tuple[str, Mapping[str, type[Any]]]) -> Callable[[F], F]:
    """Give a command an option for each declared parameter; it gets those that were given as `chosen`.

    `families` are (heading, name -> dataclass); a parameter that several classes share is one option.
    """

    def decorate(command: F) -> F:
        declared: dict[str, tuple[params.Parameter, list[str]]] = {}
        for heading, kinds in families:
            for name, kind in kinds.items():
                for one in params.describe(kind):
                    declared.setdefault(one.name, (one, []))[1].append(f"{heading} {name}".strip())
        own = inspect.signature(command, eval_str=True)

        @functools.wraps(command)
        def run(**arguments: Any) -> None:
            given = {name: arguments.pop(name) for name in declared}
            chosen = {name: value for name, value in given.items() if value is not None}
            for name, value in chosen.items():
                params.check_value(declared[name][0], value)
            command(**arguments, chosen=chosen)

        kept = [one for one in own.parameters.values() if one.name != "chosen"]
        added = [_option(one, owners) for one, owners in declared.values()]
        run.__signature__ = own.replace(parameters=[*kept, *added])  # type: ignore[attr-defined]
        run.__annotations__ = {one.name: one.annotation for one in [*kept, *added]} | {"return": None}
        del run.__wrapped__
        return run  # type: ignore[return-value]

    return decorate


def read_parameters(file: Path | None, chosen: Mapping[str, object]) -> dict[str, object]:
    """Return the parameters of a JSON file with those of the command line over them.

    Raises
    ------
    ParameterError
        If the file is not a JSON object of values by name.
    """
    if file is None:
        return dict(chosen)
    try:
        values = json.loads(file.read_text(encoding="utf-8-sig"), object_pairs_hook=_once)
    except OSError as error:
        raise ParameterError(f"cannot read {file}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise ParameterError(f"{file} is not JSON: {error}") from error
    if not isinstance(values, dict):
        raise ParameterError(f'{file}: wanted is a JSON object such as {{"patience": 2.0}}')
    return {**values, **chosen}


def _once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """A JSON object whose keys are all different."""
    values = dict(pairs)
    if len(values) < len(pairs):
        names = [name for name, _ in pairs]
        raise ParameterError(
            f"{next(name for name in names if names.count(name) > 1)!r} stands twice in the parameter file"
        )
    return values


def _option(declared: params.Parameter, owners: list[str]) -> inspect.Parameter:
    """The keyword of a command that stands for one parameter; None where it is not given."""
    flag = declared.name.replace("_", "-")
    names = [f"--{flag}/--no-{flag}"] if declared.kind is bool else [f"--{flag}"]
    default = f"{declared.default:g}" if _is_number(declared) else str(declared.default).lower()
    notes = "; ".join(part for part in (declared.range_text, f"default {default}") if part)
    text = f"{declared.help[0].upper()}{declared.help[1:]} ({notes})."
    option = typer.Option(*names, help=text, show_default=False, rich_help_panel=_heading(owners))
    kind = str if declared.kind is params.Schedule else declared.kind
    annotation: Any = Annotated[Optional[kind], option]  # noqa: UP045
    return inspect.Parameter(declared.name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)


def _heading(owners: list[str]) -> str:
    """The panel of the help: 'Detector background', 'What counts', several joined."""
    names = " · ".join(owners)
    return names[0].upper() + names[1:]


def _is_number(declared: params.Parameter) -> bool:
    return declared.kind in (int, float)

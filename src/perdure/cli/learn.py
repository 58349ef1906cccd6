"""`perdure learn`: sources and their truths in, a context out."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Optional

import typer
from typer.core import TyperCommand

from perdure import params
from perdure.cli import options
from perdure.cli.pictures import new_picture
from perdure.cli.progress import watched
from perdure.cli.spreading import spread
from perdure.cli.tables import aligned
from perdure.errors import DamagedVideo, FormatError, OutputError, ParameterError
from perdure.features.pool import POOL
from perdure.files.contexts import context_to_json, write_context
from perdure.files.scored import read_scored_truth
from perdure.files.whole import refuse_existing
from perdure.learn import PAPER, Film, Learning, Learnt
from perdure.learn import learn as learn_from
from perdure.pipeline import plan
from perdure.scene.context import Alone, Context
from perdure.types import Frame, Rows

_MANY = ("--truth", "--detector")


class LearnCommand(TyperCommand):
    """Reads `--truth A B` and `--detector A B` as several, as people write them."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the option before every one of its words, then parse as usual."""
        return list(super().parse_args(ctx, spread(args, _MANY)))


@options.with_parameters(("Learning", {"": Learning}))
def learn(
    sources: Annotated[
        list[str],
        typer.Argument(metavar="SOURCE...", help="Films, as `perdure track` takes them.", show_default=False),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The context, .json.", show_default=False)
    ],
    chosen: dict[str, object],
    truth: Annotated[
        Optional[list[Path]],  # noqa: UP045 - typer reads this at run time
        typer.Option(
            "--truth",
            metavar="TRUTH...",
            help="As many, in the same order: MOT text, or folders with gt/gt.txt.",
            show_default=False,
        ),
    ] = None,
    detector: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--detector",
            metavar="NAME|FILE...",
            help="What the tracker will see, one for each source or one for all: 'background', or files of regions. "
            "Default: the truth's own boxes, which tell less of false detections and ragged boxes.",
            show_default=False,
        ),
    ] = None,
    name: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option("--name", help="The context's name (default: that of the file).", show_default=False),
    ] = None,
    paper: Annotated[
        bool,
        typer.Option(
            "--paper", help="As in the paper: all pairs of consecutive frames, one threshold for all features."
        ),
    ] = False,
    draw: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--draw",
            metavar="FILE",
            help="The picture of how alike pairs are, .png (default: beside the context).",
            show_default=False,
        ),
    ] = None,
    calibration: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--calibration",
            metavar="FILE|auto",
            help="Where the ground plane lies, for all sources: distances in metres are a feature, too.",
            show_default=False,
        ),
    ] = None,
    fps: options.FpsOption = None,
    start: options.StartOption = None,
    end: options.EndOption = None,
    overwrite: options.OverwriteOption = False,
    json_: options.JsonOption = False,
) -> None:
    """Learn from SOURCEs and their truths by what things are told apart: weights of features, as a context."""
    if output.suffix.lower() != ".json":
        raise ParameterError(f"{output} must end in .json, as files of contexts do")
    picture = output.with_suffix(".png") if draw is None else draw
    if picture.suffix.lower() != ".png":
        raise ParameterError(f"--draw {picture} must end in .png")
    refuse_existing(output, overwrite=overwrite)
    if picture.is_dir() or (picture.exists() and not overwrite):
        raise OutputError(f"{picture} is there already; add --overwrite or name another file with --draw")
    learning = params.build(Learning, {**(params.values(PAPER) if paper else {}), **chosen})
    named = output.stem if name is None else name.strip()
    if not named:
        raise ParameterError("--name is empty; give a word or more")
    window = {"fps": fps, "start": start, "end": end, "calibration": calibration}
    lost: list[DamagedVideo] = []
    films = _films(sources, truth or [], detector or [], window, lost)
    learnt = learn_from(films, learning, named)
    from perdure.draw.learnt import plot

    with new_picture(picture, plot(learnt)):
        write_context(output, learnt.context)
    if json_:
        about = {"output": str(output), "picture": str(picture)}
        print(json.dumps({**about, **context_to_json(learnt.context)}))
    else:
        print(_words(learnt, output, picture))
    if lost:
        raise lost[0]


def _films(
    sources: list[str],
    truths: list[Path],
    detectors: list[str],
    window: Mapping[str, Any],
    lost: list[DamagedVideo],
) -> Iterator[Film]:
    """Check that all belong together; then yield each film when its turn comes, damages into `lost`."""
    if len(truths) != len(sources):
        raise ParameterError(
            f"{len(sources)} sources and {len(truths)} truths; give one --truth for each source, in the same order"
        )
    if len(detectors) not in (0, 1, len(sources)):
        raise ParameterError(
            f"{len(sources)} sources and {len(detectors)} detectors; give one for each source, or one for all"
        )
    if len(detectors) == 1 < len(sources) and detectors[0] != "background":
        raise ParameterError(f"{detectors[0]} holds regions of one source; give a --detector for each")
    known = [_rows(path) for path in truths]
    given: Sequence[str | None] = detectors or [None]
    each = given if len(given) == len(sources) else [given[0]] * len(sources)
    return (
        _film(source, path, rows, one, window, lost)
        for source, path, rows, one in zip(sources, truths, known, each, strict=True)
    )


def _rows(path: Path) -> Rows:
    """The boxes of a truth."""
    rows = read_scored_truth(path, masks=False).boxes
    if rows is None:
        raise FormatError(f"{path} holds silhouettes; `perdure learn` wants boxes, as MOT text")
    return rows


def _film(
    source: str, path: Path, truth: Rows, detector: str | None, window: Mapping[str, Any], lost: list[DamagedVideo]
) -> Film:
    """Open a source; without a detector the truth's own boxes stand for one, for the ground's sake."""
    own = (
        path if path.is_file() else next(one for one in (path / "gt" / "gt.txt", path / "gt.txt") if one.is_file())
    )
    made = plan(source, detector=detector or own, **window).prepared()

    def frames() -> Iterator[Frame]:
        try:
            yield from watched(made.source, f"learning from {made.source.name}", made.source.count)
        except DamagedVideo as damage:
            lost.append(damage)  # what came before is learnt from
        finally:
            made.source.close()
            for note in (*made.source.warnings, *(made.notes() if detector else ())):
                print(f"perdure: note: {note}", file=sys.stderr)

    return Film(made.source.name, made.seen(frames()), truth, made.scene, detector is not None)


def _words(learnt: Learnt, output: Path, picture: Path) -> str:
    """A table of all features, and what else was learnt."""
    context = learnt.context
    told = context.training
    rows = [["feature", "AUC", "threshold", "error %", "known %", "rounds", "weight"]]
    for name in POOL:
        weight = f"{context.weights.get(name, 0.0):.3f}"
        figures = _figures(told.alone[name]) if name in told.alone else ["-"] * 5
        rows.append([name, *figures, weight])
    return "\n".join(
        [
            aligned(rows),
            f"together  AUC {told.separation:.4f}; linked from a similarity of {context.similar:.3f}",
            f"pairs     {told.same} of one object, {told.different} of two",
            *(f"note      {note}" for note in told.notes),
            *_missing(context),
            f"context   {output}",
            f"picture   {picture}",
        ]
    )


def _figures(one: Alone) -> list[str]:
    percent = [f"{100 * one.error:.2f}", f"{100 * one.known:.0f}"]
    return [f"{one.separation:.4f}", f"{one.threshold:.3f}", *percent, str(one.rounds)]


def _missing(context: Context) -> list[str]:
    """The features of which nothing is known, in a line; none if all are known."""
    missing = [name for name in POOL if name not in context.training.alone]
    return [f"unknown   {', '.join(missing)}: no ground plane, or no pictures"] if missing else []

"""`perdure score`: results and truths in, figures out."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Optional

import typer
from typer.core import TyperCommand

from perdure import params
from perdure.cli import options, tables
from perdure.cli.spreading import spread
from perdure.comparison import Comparison, Wanted, compare_files, read_window
from perdure.errors import ParameterError, PerdureError
from perdure.files.mot import PROTOCOLS
from perdure.files.runs import Reporting
from perdure.files.scored import Match, find_results, find_truths, name_of, paired
from perdure.metrics.boundary import DavisScore
from perdure.metrics.events import EventScore, Tally
from perdure.metrics.mistakes import Mistake
from perdure.metrics.scoring import LEAST_DICE, LEAST_OVERLAP, Score

TOGETHER = "together"
SHOWN = 30  # mistakes of the list; --json has all
_PROTOCOLS = {
    "mot15": "MOT15: rows of the truth with flag 0 are not asked for; a row said on one is wrong",
    "mot17": "MOT17: pedestrians whose flag is not 0; rows said on a distractor (class 2, 7, 8, 12) are taken away",
    "mot20": "MOT20: pedestrians whose flag is not 0; rows said on a distractor (class 2, 6, 7, 8, 12) are taken away",
    "mots": "MOTS: objects of all classes alike; rows said for more than half in an ignored area (class 10), and on nothing else, are taken away",
    "rows": "other formats: every row of the truth counts",
    "masks": "index PNGs: every object of the truth counts; 255 is void where it is not the only value",
}


class ScoreCommand(TyperCommand):
    """Reads `--truth A B C` as three truths, as people write it."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put `--truth` before every one of its words, then parse as usual."""
        return list(super().parse_args(ctx, spread(args, ("--truth",))))


@options.with_parameters(("", {"What counts": Reporting}))
def score(
    chosen: dict[str, object],
    results: Annotated[
        Optional[list[Path]],  # noqa: UP045 - typer reads this at run time
        typer.Argument(
            metavar="RESULT...",
            help="Run folders, MOT or MOTS text, folders of index PNGs, files of any format of `perdure convert`, or "
            "folders of these.",
            show_default=False,
        ),
    ] = None,
    truth: Annotated[
        Optional[list[Path]],  # noqa: UP045
        typer.Option(
            "--truth",
            metavar="TRUTH...",
            help="As many, of the same names or in the same order: MOT or MOTS text, folders of index PNGs, "
            "files of any format of `perdure convert`, folders with gt/gt.txt (and clip.json, gt/blobs.txt), or folders of these. One truth will do for "
            "several results.",
            show_default=False,
        ),
    ] = None,
    masks: Annotated[
        bool, typer.Option("--masks", help="Compare silhouettes too: MOTSA, sMOTSA, J, F and all the rest.")
    ] = False,
    start: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--start",
            metavar="N",
            help="First frame that is scored, as MOT text counts, from 1; or '300f' as in track, from 0.",
            show_default=False,
        ),
    ] = None,
    end: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--end",
            metavar="N",
            help="Last frame that is scored, included; or '600f', before which to stop.",
            show_default=False,
        ),
    ] = None,
    errors: Annotated[
        bool, typer.Option("--errors", help="List every mistake, worst first: frame, ids, box.")
    ] = False,
    protocol: Annotated[
        str,
        typer.Option(
            "--protocol", metavar="NAME", help=f"How rows of a MOT truth are used: auto, {', '.join(PROTOCOLS)}."
        ),
    ] = "auto",
    json_: options.JsonOption = False,
) -> None:
    """Score RESULTs against TRUTHs: HOTA, CLEAR, IDF1, ETISEO; silhouettes; events; mistakes."""
    if protocol not in (known := ("auto", *PROTOCOLS)):
        raise ParameterError(params.unknown_name("protocol", protocol, known))
    results, truth = _both(results or [], truth or [])
    wanted = Wanted(masks, errors, read_window(start, end), protocol, _confidence(chosen))
    found = {str(path): find_results(path) for path in dict.fromkeys(results)}
    truths = find_truths(dict.fromkeys(truth))
    comparisons = [_compare(match, wanted) for match in paired(found, truths)]
    used = {one.truth for one in comparisons}
    without = [] if len(truths) == 1 else [name for name, path in truths if path not in used]
    if json_:
        print(json.dumps(_value(comparisons, without, wanted)))
    else:
        print("\n\n".join(_page(comparisons, without, wanted)))


def _both(results: list[Path], truths: list[Path]) -> tuple[list[Path], list[Path]]:
    """Results and truths; where all stand behind `--truth`, the first half are truths."""
    if not truths:
        raise ParameterError("no truth: name it behind --truth, as in `perdure score RUN --truth gt.txt`")
    if results:
        return results, truths
    if len(truths) % 2:
        raise ParameterError("no result: name it before --truth, as in `perdure score RUN --truth gt.txt`")
    return truths[len(truths) // 2 :], truths[: len(truths) // 2]


def _confidence(chosen: Mapping[str, object]) -> float | None:
    value = chosen.get("report_confidence")
    return float(value) if isinstance(value, float) else None


def _compare(match: Match, wanted: Wanted) -> Comparison:
    try:
        return compare_files(match, wanted)
    except ValueError as error:
        raise PerdureError(f"{match.result} against {match.truth}: {error}") from error


def _together(comparisons: Sequence[Comparison]) -> dict[str, list[Comparison]]:
    """The sequences of each group that has several, by the name of their row."""
    groups: dict[str, list[Comparison]] = {}
    for one in comparisons:
        groups.setdefault(one.group, []).append(one)
    return {
        f"{group} {TOGETHER}".strip(): parts
        for group, parts in groups.items()
        if len({one.truth for one in parts}) == len(parts) > 1
    }


def _value(comparisons: Sequence[Comparison], without: Sequence[str], wanted: Wanted) -> dict[str, Any]:
    value: dict[str, Any] = {"sequences": [_sequence(one, wanted) for one in comparisons]}
    joined = {name: _families(parts) for name, parts in _together(comparisons).items()}
    if list(joined) == [TOGETHER]:
        value[TOGETHER] = joined[TOGETHER]
    elif joined:
        value["groups"] = {name.removesuffix(f" {TOGETHER}"): figures for name, figures in joined.items()}
    return value | {"without_result": list(without)}


def _sequence(one: Comparison, wanted: Wanted) -> dict[str, Any]:
    about: dict[str, Any] = {
        "name": one.name,
        **({"group": one.group} if one.group else {}),
        "result": str(one.result),
        "truth": str(one.truth),
        "protocol": one.protocol,
        "frames": None if one.frames is None else [frame + 1 for frame in one.frames],
        "report_confidence": one.report_confidence,
        "rows_beyond_truth": one.beyond,
        "notes": list(one.notes),
        **_families([one]),
    }
    return about | ({"errors": [_mistake(fault) for fault in one.mistakes]} if wanted.mistakes else {})


def _families(parts: Sequence[Comparison]) -> dict[str, Any]:
    """The figures of one sequence or of several together, by family."""
    found: dict[str, Any] = {}
    boxes, masks = ([score for one in parts if (score := getattr(one, kind))] for kind in ("boxes", "masks"))
    davis = [one.davis for one in parts if one.davis]
    events = [one.events for one in parts if one.events]
    if boxes:
        found["boxes"] = Score.together(boxes).figures
    if masks:
        found["masks"] = Score.together(masks).figures
    if davis:
        whole = DavisScore.together(davis)
        found["masks"] |= {"J": whole.j, "F": whole.f, "J&F": whole.jf}
    if events:
        found["events"] = _event_figures(EventScore.together_of(events))
    return found


def _event_figures(score: EventScore) -> dict[str, Any]:
    tallies = {
        "merges": score.merges,
        "splits": score.splits,
        "occlusions": score.occlusions,
        "blobs": score.together,
    }
    return {
        **{
            name: {**one._asdict(), "precision": one.precision, "recall": one.recall}
            for name, one in tallies.items()
        },
        "merges_judged": score.judged,
        "merges_returned": score.returned,
        "returned": score.returned / score.judged if score.judged else None,
    }


def _mistake(fault: Mistake) -> dict[str, Any]:
    return {
        "kind": fault.kind,
        "frame": fault.begin + 1,
        "end": fault.end + 1,
        "true_ids": list(fault.true_ids),
        "ids": list(fault.said_ids),
        "box": [round(side, 2) for side in fault.box],
        "cost": fault.cost,
        "text": fault.text,
    }


def _page(comparisons: Sequence[Comparison], without: Sequence[str], wanted: Wanted) -> list[str]:
    """The tables, the mistakes, and what the figures rest on."""
    names = _names(comparisons)
    rows = {name: _families([one]) for name, one in zip(names, comparisons, strict=True)}
    rows |= {name: _families(parts) for name, parts in _together(comparisons).items()}
    parts = []
    for family, titles in (
        ("boxes", {"boxes, %": tables.BOXES, "counts": tables.COUNTS, "ETISEO, %": tables.ETISEO}),
        ("masks", {"masks, %": tables.MASKS, "counts": tables.COUNTS, "ETISEO, %": tables.ETISEO}),
    ):
        figures = {name: one[family] for name, one in rows.items() if family in one}
        parts += [tables.table(title, columns, figures) for title, columns in titles.items() if figures]
    told = {name: one["events"] for name, one in rows.items() if "events" in one}
    if told:
        parts.append(tables.aligned([_EVENT_HEADING, *(_event_row(name, one) for name, one in told.items())]))
    if wanted.mistakes:
        parts += [_list(name, one.mistakes) for name, one in zip(names, comparisons, strict=True)]
    return [*parts, "\n".join(_notes(comparisons, without, wanted))]


def _names(comparisons: Sequence[Comparison]) -> list[str]:
    """A name for each row of a table: that of the sequence, in its group; or of the result where these are alike."""
    names = [f"{one.group}/{one.name}" if one.group else one.name for one in comparisons]
    return names if len(set(names)) == len(names) else [str(one.result) for one in comparisons]


_EVENT_HEADING = ("events", "merges P", "R", "splits P", "R", "total occl. P", "R", "one blob P", "R", "ids back")


def _event_row(name: str, figures: Mapping[str, Any]) -> list[str]:
    row = [name]
    for kind in ("merges", "splits", "occlusions", "blobs"):
        one = Tally(*(figures[kind][key] for key in Tally._fields))
        row += [_share(one.right, one.said), _share(one.found, one.true)]
    return [*row, _share(figures["merges_returned"], figures["merges_judged"])]


def _share(part: int, whole: int) -> str:
    return f"{part}/{whole}" if whole else "-"


def _list(name: str, faults: Sequence[Mistake]) -> str:
    if not faults:
        return f"{name}: no mistake"
    rows = [
        [
            fault.kind,
            str(fault.begin + 1),
            str(fault.cost),
            " ".join(f"{side:.0f}" for side in fault.box),
            fault.text,
        ]
        for fault in faults[:SHOWN]
    ]
    lines = tables.aligned(
        [row[:4] for row in [["mistake", "frame", "rows", "box x1 y1 x2 y2, from 0"], *rows]]
    ).splitlines()
    texts = ["", *(row[4] for row in rows)]
    counted = ", ".join(
        f"{sum(fault.kind == kind for fault in faults)} {kind}"
        for kind in dict.fromkeys(one.kind for one in faults)
    )
    listed = "\n".join(f"{line}  {text}".rstrip() for line, text in zip(lines, texts, strict=True))
    more = f"\n… and {len(faults) - SHOWN} more; --json has all" if len(faults) > SHOWN else ""
    return f"{name}: {counted}; worst first\n{listed}{more}"


def _notes(comparisons: Sequence[Comparison], without: Sequence[str], wanted: Wanted) -> list[str]:
    """Which rows count, and how they were compared."""
    lines = []
    confidences = sorted({one.report_confidence for one in comparisons if one.report_confidence is not None})
    if confidences:
        shown = " or ".join(f"{one:g}" for one in confidences)
        lines.append(
            "rows of a run that count: visible, partly occluded and ambiguous ones, and occluded ones of confidence"
            f" ≥ {shown}; never lost ones, never groups"
        )
    if any(one.report_confidence is None for one in comparisons):
        lines.append("rows of text and pictures: all count, whatever their confidence")
    lines += [_PROTOCOLS[one] for one in dict.fromkeys(one.protocol for one in comparisons)]
    lines.append(
        f"a match needs IoU ≥ {LEAST_OVERLAP:g} (HOTA: mean over .05 to .95; ETISEO: Dice ≥ {LEAST_DICE:g}); frames count"
        " from 1, as in text (films and run logs: from 0)"
    )
    if any(one.events for one in comparisons):
        lines.append(
            "events match within 5 frames, of the same objects; 'ids back': merges after which all ids are as before"
        )
    if len(comparisons) == 1 and (span := comparisons[0].frames):
        lines.append(f"frames {span[0] + 1} to {span[1] + 1}")
    lines += [
        f"paired in their order: {one.result} with {one.truth}"
        for one in comparisons
        if name_of(one.result) != name_of(one.truth) and len({other.truth for other in comparisons}) > 1
    ]
    lines += [f"note: {note}" for note in dict.fromkeys(note for one in comparisons for note in one.notes)]
    lines += [
        f"note: {one.beyond} rows of {one.result} lie in frames of which {one.truth} has no row; they are wrong"
        for one in comparisons
        if one.beyond
    ]
    excused = [
        (one.name, score.excused) for one in comparisons if (score := one.boxes or one.masks) and score.excused
    ]
    lines += [f"note: {count} rows of {name} were taken away, as the benchmark says" for name, count in excused]
    if without:
        lines.append(f"note: no result for {', '.join(without)}; they are in no figure")
    return lines

"""`perdure tune`: sources with their truths in, a file of parameters out, and what they are worth elsewhere."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Optional

import typer

from perdure import cluster, params
from perdure.cli import options
from perdure.cli.doing import stoppable
from perdure.cli.jobs import told_apart
from perdure.cli.progress import watched
from perdure.cli.run import (
    OnOption,
    RunCommand,
    SourcesArgument,
    TruthsOption,
    WorkersOption,
    own_words,
    truths_of,
)
from perdure.cli.tables import aligned
from perdure.cli.trials import Piece, judge, pieces_of, record
from perdure.cluster import Crew, Where
from perdure.detection import detector_name, kinds_of
from perdure.errors import ParameterError, PerdureError
from perdure.files.whole import refuse_existing, whole_file
from perdure.params import Value
from perdure.trackers import TRACKERS
from perdure.tuning import METRICS, Gain, Judged, Settings, Span, figure, gain, search, span_of

TuneCommand = RunCommand  # --truth A B is several
LEFT_OUT = ("on_ground", "explain")  # of what a tracker declares: which places it tells, not how well it follows


def tune(
    sources: SourcesArgument,
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="FILE", help="The parameters, .json, for --parameters.", show_default=False
        ),
    ],
    truth: TruthsOption = None,
    trials: Annotated[
        int, typer.Option("--trials", metavar="N", min=2, help="Settings that are tried, the defaults among them.")
    ] = 40,
    metric: Annotated[
        str,
        typer.Option("--metric", metavar="NAME", help=f"What is to be as high as can be: {', '.join(METRICS)}."),
    ] = "IDF1",
    tracker: Annotated[str, typer.Option("--tracker", metavar="NAME", help="Whose parameters.")] = "compound",
    detector: options.DetectorOption = None,
    only: Annotated[
        Optional[list[str]],  # noqa: UP045 - typer reads this at run time
        typer.Option(
            "--tune",
            metavar="NAME[=LOW:HIGH]",
            help="A parameter of the tracker or the detector that is searched, and where; may be repeated. Default: all "
            "of the tracker's.",
            show_default=False,
        ),
    ] = None,
    roi: options.RoiOption = None,
    zones: options.ZonesOption = None,
    class_: options.ClassOption = None,
    fps: options.FpsOption = None,
    parameters: options.ParametersOption = None,
    folds: Annotated[
        int, typer.Option("--folds", metavar="N", min=2, help="Parts that are held out in turn, at most.")
    ] = 5,
    seed: Annotated[int, typer.Option("--seed", min=0, help="The same seed finds the same.")] = 0,
    live: Annotated[
        bool, typer.Option("--detect-anew", help="Detect in every trial, instead of once for all.")
    ] = False,
    on: OnOption = "local",
    workers: WorkersOption = None,
    overwrite: options.OverwriteOption = False,
    json_: options.JsonOption = False,
) -> None:
    """Search for parameters that follow SOURCEs better, and say by how much they do on what the search did not see."""
    where = Where.of(on)
    _check(output, metric, tracker, overwrite)
    given = options.read_parameters(parameters, {})
    spans = _spans(tracker, detector, only or [], given)
    settings = {
        "tracker": tracker,
        "detector": detector,
        "roi": roi,
        "zones": zones,
        "classes": class_,
        "fps": fps,
    }
    truths = truths_of(sources, truth or [])
    ours = {one.name for one in params.describe(TRACKERS[tracker])}
    fixed = all(one.name in ours for one in spans) and not live  # the detector does the same in every trial
    if not truths and not fixed:
        raise ParameterError("without --truth only a tracker's parameters can be tuned, on regions detected once")
    pieces = _pieces(sources, {**settings, "parameters": given}, truths)
    with (
        stoppable(),
        tempfile.TemporaryDirectory(prefix="perdure-") as place,
        cluster.crew(where, workers) as crew,
    ):
        lab = _Lab(crew, pieces, metric)
        if fixed and (where.kind == cluster.LOCAL or not truths):
            lab.recorded(Path(place))
        held = _folds(len(pieces), folds)
        outcome = _tuned(lab, held, spans, trials, seed)
    with whole_file(output) as file:
        json.dump(outcome.settings, file, indent=2, sort_keys=True)
        file.write("\n")
    value = _value(outcome, spans, metric, output, truths=bool(truths))
    print(json.dumps(value) if json_ else _page(outcome, spans, metric, output, truths=bool(truths)))


@dataclass(frozen=True)
class Outcome:
    """What a search has found."""

    settings: dict[str, Value]
    seen: float  # the metric on what it was chosen by
    seen_default: float
    gain: Gain
    runs: int


class _Lab:
    """Judges settings on pieces, each once."""

    def __init__(self, crew: Crew, pieces: Sequence[Piece], metric: str) -> None:
        self.crew, self.pieces, self.metric = crew, list(pieces), metric
        self._searched = list(pieces)  # as the search sees them: with recorded regions, where there are
        self._known: dict[tuple[int, str, bool], Judged] = {}

    def recorded(self, place: Path) -> None:
        """Detect once for all trials."""
        paths = [place / f"{number}.jsonl" for number in range(len(self.pieces))]
        self._all(list(zip(self.pieces, paths, strict=True)), record, "detecting")
        self._searched = [
            dataclasses.replace(piece, regions=path) for piece, path in zip(self.pieces, paths, strict=True)
        ]
        if self.pieces[0].truth is None:  # what is followed backwards must have been recorded
            self.pieces = self._searched

    def worth(self, places: Sequence[int], what: str) -> Callable[[Sequence[Settings]], list[float]]:
        """Return what several settings are worth on some pieces, by the metric of all together."""

        def of(several: Sequence[Settings]) -> list[float]:
            judged = self.judged([(place, one) for one in several for place in places], self._searched, what)
            parts = [judged[k : k + len(places)] for k in range(0, len(judged), len(places))]
            return [figure([one.whole for one in part], self.metric) for part in parts]

        return of

    def truly(self, wanted: Sequence[tuple[int, Settings]], what: str) -> list[Judged]:
        """Judge settings on pieces as `perdure track` would run them: detector and tracker together."""
        return self.judged(wanted, self.pieces, what)

    def judged(self, wanted: Sequence[tuple[int, Settings]], pieces: Sequence[Piece], what: str) -> list[Judged]:
        keys = [(place, json.dumps(dict(one), sort_keys=True), pieces is self.pieces) for place, one in wanted]
        new = dict(zip(keys, wanted, strict=True))
        left = [key for key in new if key not in self._known]
        tasks = [(pieces[new[key][0]], dict(new[key][1])) for key in left]
        self._known.update(zip(left, self._all(tasks, judge, what), strict=True))
        return [self._known[key] for key in keys]

    @property
    def runs(self) -> int:
        return len(self._known)

    def _all(self, tasks: Sequence[Any], work: Callable[[Any], Any], what: str) -> list[Any]:
        found: dict[int, Any] = {}
        for ended in watched(self.crew.work(tasks, work), what, len(tasks), unit="runs"):
            if ended.defect:
                raise RuntimeError(ended.defect)
            if ended.failure:
                raise PerdureError(ended.failure)
            found[ended.place] = ended.value
        return [found[place] for place in range(len(tasks))]


def _tuned(lab: _Lab, held: Sequence[Sequence[int]], spans: Sequence[Span], trials: int, seed: int) -> Outcome:
    """Search on all pieces; and, to know what that is worth, without each of the held-out parts in turn."""
    every = list(range(len(lab.pieces)))
    chosen: dict[int, Settings] = {}
    for number, part in enumerate(held, 1):
        rest = [place for place in every if place not in part]
        found, _ = search(spans, lab.worth(rest, f"searching, {number} of {len(held) + 1}"), trials, seed)
        chosen |= dict.fromkeys(part, found)
    best, seen = search(spans, lab.worth(every, f"searching, {len(held) + 1} of {len(held) + 1}"), trials, seed)
    (default,) = lab.worth(every, "judging")([{}])
    defaults = lab.truly([(place, {}) for place in every], "judging the defaults")
    tuned = lab.truly([(place, chosen[place]) for place in every], "judging what was found")
    return Outcome(best, seen, default, gain(defaults, tuned, lab.metric, seed), lab.runs)


def _folds(count: int, most: int) -> list[list[int]]:
    """Pieces that are held out together, as even as can be."""
    parts = min(count, most)
    return [list(range(part, count, parts)) for part in range(parts)]


def _pieces(sources: Sequence[str], settings: Mapping[str, Any], truths: Mapping[str, Path]) -> list[Piece]:
    """A piece for each source, or both halves of a single one."""
    sources = list(dict.fromkeys(sources))
    found = []
    for name, source in zip(told_apart(sources), sources, strict=True):
        given = own_words(settings, source)
        place = given.pop("source")
        found += pieces_of(name, place, given, truths.get(place), 2 if len(sources) == 1 else 1)
    return found


def _spans(tracker: str, detector: str | None, only: Sequence[str], given: Mapping[str, object]) -> list[Span]:
    """Where which parameters are searched: those named, else all of the tracker's that have values to choose from."""
    own = params.describe(TRACKERS[tracker])
    others = (
        [one for kind in kinds_of(detector_name(detector), None) for one in params.describe(kind)] if only else []
    )
    declared = {one.name: one for one in (*own, *others)}
    if not only:
        found = [span_of(one) for one in own if one.name not in (*LEFT_OUT, *given)]
        return [one for one in found if one is not None]
    spans = []
    for word in only:
        name, asked, bounds = word.partition("=")
        name = name.replace("-", "_")
        if name not in declared:
            raise ParameterError(params.unknown_name("parameter of the tracker or the detector", name, declared))
        span = span_of(declared[name], _bounds(word, bounds) if asked else None)
        if span is None:
            raise ParameterError(f"--tune {name}: say where, as in --tune {name}=1:10")
        spans.append(span)
    return spans


def _bounds(word: str, text: str) -> tuple[float, float]:
    try:
        low, high = (float(one) for one in text.split(":"))
    except ValueError:
        raise ParameterError(f"--tune {word} is no range; wanted is NAME=LOW:HIGH") from None
    return low, high


def _check(output: Path, metric: str, tracker: str, overwrite: bool) -> None:
    if importlib.util.find_spec("optuna") is None:
        raise ParameterError("perdure tune needs Optuna, which is not installed: pip install 'perdure[tune]'")
    if output.suffix.lower() != ".json":
        raise ParameterError(f"{output} must end in .json, as files of parameters do")
    refuse_existing(output, overwrite=overwrite)
    for what, word, known in (("metric", metric, METRICS), ("tracker", tracker, TRACKERS)):
        if word not in known:
            raise ParameterError(params.unknown_name(what, word, known))


def _verdict(outcome: Outcome, metric: str, *, truths: bool) -> str:
    """What may be said of the gain, and no more."""
    one = outcome.gain
    interval = f"95 % interval {100 * one.low:+.1f} to {100 * one.high:+.1f}"
    where = f"on what the search had not seen; better in {one.better} of {one.pieces} parts"
    what = metric if truths else f"agreement with itself ({metric}, and what it explains), which is not truth,"
    if one.claimed:
        return f"better by {100 * one.gain:.1f} points of {what} {where} ({interval} of segments)"
    why = "within the noise" if one.gain > 0 else "no better than the defaults"
    return f"no gain is shown: {100 * one.gain:+.1f} points of {what} {where}; {why} ({interval} of segments)"


def _page(outcome: Outcome, spans: Sequence[Span], metric: str, output: Path, *, truths: bool) -> str:
    """The table of parameters, and what they are worth."""
    rows = [["parameter", "default", "found", "searched"]]
    for span in spans:
        found = outcome.settings.get(span.name, span.default)
        rows.append([span.name, _shown(span.default), _shown(found), span.text])
    one = outcome.gain
    scores = [
        [f"{metric}, %" if truths else "self-score, %", "default", "found"],
        ["not seen by the search", f"{100 * one.default:.1f}", f"{100 * one.found:.1f}"],
        ["seen by the search", f"{100 * outcome.seen_default:.1f}", f"{100 * outcome.seen:.1f}"],
    ]
    words = [_verdict(outcome, metric, truths=truths), f"{outcome.runs} runs; parameters in {output}"]
    return "\n".join([aligned(rows), "", aligned(scores), "", *words])


def _shown(value: Value) -> str:
    return f"{value:g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value).lower()


def _value(outcome: Outcome, spans: Sequence[Span], metric: str, output: Path, *, truths: bool) -> dict[str, Any]:
    return {
        "output": str(output),
        "metric": metric,
        "against": "truth" if truths else "itself backwards",
        "parameters": outcome.settings,
        "searched": {one.name: one.text for one in spans},
        "seen": {"default": outcome.seen_default, "found": outcome.seen},
        "unseen": {**dataclasses.asdict(outcome.gain), "gain": outcome.gain.gain},
        "claimed": outcome.gain.claimed,
        "verdict": _verdict(outcome, metric, truths=truths),
        "runs": outcome.runs,
    }

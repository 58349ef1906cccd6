"""Search for better parameters, with Optuna, and say what that is worth where the search has not looked.

The search proposes settings in rounds of a fixed size, whatever the number of workers, so that the same seed finds the
same. What it is worth is measured by cross-validation: for each part of the material the search is made without it, and
what it finds is held against the defaults there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from perdure.errors import ParameterError
from perdure.metrics import Score
from perdure.params import Parameter, Value

Settings = Mapping[str, Value]
METRICS = ("IDF1", "HOTA", "MOTA", "M")
ROUND = 4  # settings proposed at a time
DRAWS = 1000  # of the bootstrap
LEAST_SEGMENTS = 8  # with fewer nothing is claimed
_DIGITS = 3
_NEAR = 4.0  # a wide range is searched from a quarter of the default to four times it
_WIDE = 10.0  # a range is wide that reaches to more than so many times the default


@dataclass(frozen=True)
class Span:
    """Where one parameter is searched.

    Parameters
    ----------
    name : str
    default : bool, int, float or str
    low, high : float
        Both included; 0 and 0 for words.
    log : bool
        Whether equal ratios are equally likely, rather than equal differences.
    choices : tuple
        The values, where it is a word or a yes or no.
    """

    name: str
    default: Value
    low: float = 0.0
    high: float = 0.0
    log: bool = False
    choices: tuple[Value, ...] = ()

    @property
    def text(self) -> str:
        """In words.

        >>> Span("patience", 2.0, 0.5, 8.0, log=True).text
        '0.5 to 8, by ratios'
        """
        if self.choices:
            return " or ".join(str(one).lower() if isinstance(one, bool) else str(one) for one in self.choices)
        return f"{self.low:g} to {self.high:g}{', by ratios' if self.log else ''}"


def span_of(declared: Parameter, given: tuple[float, float] | None = None) -> Span | None:
    """Return where a parameter is searched; None where it has no values to choose from.

    Over its declared range; where that reaches far beyond the default, from a quarter to four times that, by ratios.
    A `given` range goes first.

    Raises
    ------
    ParameterError
        For a given range that is none, or lies outside the declared one.

    Examples
    --------
    >>> span_of(Parameter("patience", float, 2.0, "", "s", 0.0, 3600.0, (), "")).text
    '0.5 to 8, by ratios'
    >>> span_of(Parameter("likeness", float, 0.75, "", "", 0.0, 1.0, (), "")).text
    '0 to 1'
    """
    if declared.choices:
        return Span(declared.name, declared.default, choices=declared.choices)
    if declared.kind is bool:
        return Span(declared.name, declared.default, choices=(False, True))
    if declared.kind not in (int, float):
        return None
    default = float(declared.default)
    if given is not None:
        low, high = given
        if not declared.low <= low < high <= declared.high:
            raise ParameterError(
                f"{declared.name}={low:g}:{high:g} is no range in which to search: it must lie in {declared.range_text}"
            )
        return Span(declared.name, declared.default, low, high)
    if declared.high <= _WIDE * abs(default) and math.isfinite(declared.low):
        return Span(declared.name, declared.default, declared.low, declared.high)
    if default > 0:
        low, high = max(declared.low, default / _NEAR), min(declared.high, default * _NEAR)
        if declared.kind is int:
            low, high = max(1.0, math.ceil(low)), max(2.0, math.floor(high))
        return Span(declared.name, declared.default, low, high, log=True)
    if declared.high <= 1.0 and math.isfinite(declared.low):
        return Span(declared.name, declared.default, declared.low, declared.high)
    return None


def search(
    spans: Sequence[Span], worth: Callable[[Sequence[Settings]], Sequence[float]], trials: int, seed: int
) -> tuple[dict[str, Value], float]:
    """Return the best settings found and what they are worth; the defaults are tried first, and win where all are equal.

    Parameters
    ----------
    spans : sequence of Span
        Where each parameter is searched.
    worth : function of several settings
        What each is worth, higher is better. Settings hold only what differs from the defaults.
    trials : int
        How many settings are tried, the defaults among them.
    seed : int
        Of Optuna's tree-structured Parzen estimator.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=seed))
    study.enqueue_trial({one.name: one.default for one in spans})
    best: dict[str, Value] = {}
    reached = -math.inf
    for begin in range(0, trials, ROUND):
        asked = [study.ask() for _ in range(min(ROUND, trials - begin))]
        settings = [{name: value for one in spans for name, value in _suggested(trial, one)} for trial in asked]
        for trial, one, value in zip(asked, settings, worth(settings), strict=True):
            study.tell(trial, value)
            if value > reached:
                best, reached = one, value
    return best, reached


def _suggested(trial: object, span: Span) -> list[tuple[str, Value]]:
    """What a trial proposes for a parameter; nothing where it is the default."""
    value: Value
    if span.choices:
        value = trial.suggest_categorical(span.name, span.choices)  # type: ignore[attr-defined]
    elif isinstance(span.default, int):
        value = int(trial.suggest_int(span.name, int(span.low), int(span.high), log=span.log))  # type: ignore[attr-defined]
    else:
        found = trial.suggest_float(span.name, span.low, span.high, log=span.log)  # type: ignore[attr-defined]
        value = min(span.high, max(span.low, float(f"{found:.{_DIGITS}g}")))
    return [] if value == span.default else [(span.name, value)]


@dataclass(frozen=True, eq=False)
class Part:
    """The score of a part of the material; without truth, also how much of what was seen the run explains, in [0, 1]."""

    score: Score
    explained: float | None = None


@dataclass(frozen=True, eq=False)
class Judged:
    """One piece of the material, and each of its segments in time."""

    whole: Part
    segments: tuple[Part, ...]


@dataclass(frozen=True)
class Gain:
    """By how much settings beat the defaults on what they were not chosen by.

    Parameters
    ----------
    default, found : float
        The metric over all held-out pieces, with the defaults, and with what was found without each.
    low, high : float
        Between them lies the difference in 95 % of the bootstrap's draws, of segments that are scored by themselves.
    better, pieces : int
        In how many of the pieces it was better.
    segments : int
        On how many segments the bootstrap rests.
    """

    default: float
    found: float
    low: float
    high: float
    better: int
    pieces: int
    segments: int

    @property
    def gain(self) -> float:
        """The difference."""
        return self.found - self.default

    @property
    def claimed(self) -> bool:
        """Whether it is more than noise: a gain, an interval above 0, enough segments, better in most pieces."""
        most = 2 * self.better > self.pieces
        return self.gain > 0.0 and self.low > 0.0 and self.segments >= LEAST_SEGMENTS and most


def gain(defaults: Sequence[Judged], found: Sequence[Judged], metric: str, seed: int, draws: int = DRAWS) -> Gain:
    """Return by how much the second are better than the first, piece by piece; with a bootstrap in two stages.

    Each draw takes as many pieces as there are, with replacement, and of each as many segments as it has, with
    replacement, the same of both sides; figures are of all that is drawn, together.
    """
    random = np.random.default_rng(seed)
    differences = []
    for _ in range(draws):
        drawn: tuple[list[Part], list[Part]] = ([], [])
        for place in random.integers(len(defaults), size=len(defaults)).tolist():
            count = len(defaults[place].segments)
            for segment in random.integers(count, size=count).tolist():
                drawn[0].append(defaults[place].segments[segment])
                drawn[1].append(found[place].segments[segment])
        differences.append(figure(drawn[1], metric) - figure(drawn[0], metric))
    low, high = np.percentile(differences, [2.5, 97.5])
    pairs = list(zip(defaults, found, strict=True))
    return Gain(
        default=figure([one.whole for one in defaults], metric),
        found=figure([one.whole for one in found], metric),
        low=float(low),
        high=float(high),
        better=sum(figure([new.whole], metric) > figure([old.whole], metric) for old, new in pairs),
        pieces=len(pairs),
        segments=sum(len(one.segments) for one in defaults),
    )


def figure(parts: Sequence[Part], metric: str) -> float:
    """Return what several parts are worth together: the metric; without truth, its geometric mean with what is explained."""
    value = _metric(Score.together([one.score for one in parts]), metric)
    shares = [one.explained for one in parts if one.explained is not None]
    return math.sqrt(max(0.0, value) * sum(shares) / len(shares)) if shares else value


def _metric(together: Score, metric: str) -> float:
    """One figure of a score."""
    if metric == "IDF1":
        return float(together.identity.f1)
    if metric == "HOTA":
        return float(together.hota.hota.mean())
    return float(together.clear.mota if metric == "MOTA" else together.etiseo.mean)

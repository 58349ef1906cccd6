"""How far each target is believed to be what: person, group, vehicle, animal, or noise (IV.D, by fuzzy sets).

A class is one or several *looks*; a look is a trapezoid for each of some measures. A target belongs to a look as far as
to the trapezoid that it fits worst (Zadeh's *and*, the minimum), and to a class as far as to the look that it fits best
(*or*, the maximum). A class of something real holds only as far as noise does not. The belief coefficient of a target is
that of the real class it fits best: what fits none, or flickers as leaves do, is not believed.

>>> walker = {"ratio": 2.5, "height": 1.7, "way": 30.0, "restless": 0.05, "presence": 1.0}
>>> beliefs(walker, USUAL).best
'person'
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from perdure.errors import ParameterError
from perdure.params import unknown_name
from perdure.scene.lives import HEIGHT, SEEN, SPEED, WIDTH, Life

Float = NDArray[np.float64]
NOISE = "noise"
INF = math.inf
MEASURES: Mapping[str, str] = {
    "height": "m, where the ground plane is known",
    "width": "m, where the ground plane is known",
    "speed": "m/s, where the ground plane is known",
    "size": "height as a share of the picture's",
    "ratio": "height over width",
    "pace": "own heights a second",
    "age": "s since it was first seen",
    "lifetime": "s that it was there, known when it is gone",
    "way": "length of its way, own sizes (the root of its area)",
    "reach": "how far it has been from where it was first seen, own sizes",
    "straightness": "distance from where it was first seen over the length of its way, 0 to 1",
    "restless": "mean change of the logarithm of its area from frame to frame",
    "presence": "share of its frames in which it was seen, 0 to 1",
}
METRIC = (
    "height",
    "width",
    "speed",
)  # say nothing where the ground is not known; others not known speak against a look
_BORDER = 2.0  # px from the picture's edge, from which a box may be cut


@dataclass(frozen=True)
class Trapezoid:
    """A fuzzy set of numbers: 0 up to a, 1 from b to c, 0 from d on; an infinite end is never left.

    >>> Trapezoid(0, 1, 2, 4)(3)
    0.5
    """

    a: float
    b: float
    c: float
    d: float

    def __post_init__(self) -> None:
        """Refuse numbers out of order."""
        if not (self.a <= self.b <= self.c <= self.d):
            raise ParameterError(
                f"a trapezoid must be four numbers in order, not {[self.a, self.b, self.c, self.d]}"
            )

    def __call__(self, value: float) -> float:
        """Return how far a number belongs to it, 0 to 1."""
        if self.b <= value <= self.c:
            return 1.0
        if not self.a < value < self.d:
            return 0.0
        low, high = (self.a, self.b) if value < self.b else (self.d, self.c)
        return 1.0 if math.isinf(low) else (value - low) / (high - low)


Look = Mapping[str, Trapezoid]


@dataclass(frozen=True)
class Kind:
    """A class: its looks, and what detectors call it."""

    looks: tuple[Look, ...]
    labels: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        """Refuse a class that nothing can be seen of, and measures that there are not."""
        if not self.looks or not all(self.looks):
            raise ParameterError("a class needs a look, and a look a measure")
        for name in (one for look in self.looks for one in look):
            if name not in MEASURES:
                raise ParameterError(unknown_name("measure", name, MEASURES))


@dataclass(frozen=True)
class Belief:
    """How far a target is believed to be of each class, 0 to 1, and what decided."""

    of: Mapping[str, float]
    why: Mapping[str, str]  # of each class the measure of its best look that fits worst, in words

    @property
    def best(self) -> str:
        """The class that it fits best, noise among them; empty where it fits none."""
        name = max(self.of, key=lambda one: self.of[one], default="")
        return name if name and self.of[name] > 0 else ""

    @property
    def coefficient(self) -> float:
        """How far it is believed to be anything real (the belief coefficient of IV.D)."""
        return max((belief for name, belief in self.of.items() if name != NOISE), default=0.0)


def beliefs(
    measures: Mapping[str, float], kinds: Mapping[str, Kind], votes: Mapping[str, float] | None = None
) -> Belief:
    """Return how far a target is believed to be of each class.

    Parameters
    ----------
    measures : mapping
        Numbers by name, some of `MEASURES`; NaN or left out where not known.
    kinds : mapping
        A Kind by name.
    votes : mapping or None
        Shares by label: what the detector calls it: a share of labels that belongs to one class is believed of it at least, and taken
        from the others.
    """
    found = {
        name: max((_fit(look, measures) for look in kind.looks), key=lambda one: one[0])
        for name, kind in kinds.items()
    }
    of = {name: belief for name, (belief, _) in found.items()}
    if NOISE in of:
        of = {name: belief if name == NOISE else min(belief, 1.0 - of[NOISE]) for name, belief in of.items()}
    shares = {
        name: sum(share for label, share in (votes or {}).items() if label.lower() in kind.labels)
        for name, kind in kinds.items()
    }
    named = sum(shares.values())
    if named > 0:
        of = {name: max(min(belief, 1.0 - named + shares[name]), shares[name]) for name, belief in of.items()}
    return Belief(of, {name: why for name, (_, why) in found.items()})


def _fit(look: Look, measures: Mapping[str, float]) -> tuple[float, str]:
    """How far a target fits a look, and the measure that fits worst in words."""
    worst, why, told = 1.0, "", False
    for name, trapezoid in look.items():
        value = measures.get(name, math.nan)
        if math.isnan(value):
            if name in METRIC:
                continue
            return 0.0, f"{name} is not known"
        told = True
        fit = trapezoid(value)
        if fit < worst or not why:
            worst, why = min(fit, worst), f"{name} {value:.2g}"
    return (worst, why) if told else (0.0, "nothing is known")


def measured(life: Life, size: tuple[int, int], heights: Sequence[float] = ()) -> dict[str, float]:
    """Return the measures of a life, NaN where one is not known.

    Of one whom the picture's border cuts most of the time nobody knows how far it moves, or how it changes.

    Parameters
    ----------
    life : Life
        With a path.
    size : (int, int)
        Height and width of the picture.
    heights : sequence of float
        Its height in metres in the rows of its path, where the ground is known.
    """
    path, (high, wide) = life.path, size
    seen = path[path[:, SEEN] > 0]
    uncut = seen[_uncut(seen, high, wide)]
    cut = 2 * len(uncut) < len(seen)
    whole = next(some for some in (uncut, seen, path) if len(some))
    width, height = (_median(whole[:, column]) for column in (WIDTH, HEIGHT))
    scale = max(math.sqrt(width * height), 1.0)
    metres = _median([one for one in heights if math.isfinite(one)])
    speeds = path[:, SPEED]
    net = math.hypot(*(path[-1, 2:4] - [life.origin[0], life.origin[1] + path[-1, HEIGHT] / 2]))
    return {
        "height": metres,
        "width": metres * width / height if height else math.nan,
        "speed": _median(speeds[speeds > _STILL])
        if (speeds > _STILL).any()
        else (0.0 if math.isfinite(metres) else math.nan),
        "size": height / high,
        "ratio": height / max(width, 1.0),
        "pace": life.way / max(height, 1.0) / max(life.age, _LEAST_AGE),
        "age": life.age,
        "lifetime": life.age if life.gone else math.nan,
        "way": life.way / scale,
        "reach": math.nan if cut else life.reach / scale,
        "straightness": min(1.0, net / life.way) if life.way > 0 else math.nan,
        "restless": math.nan if cut or life.compared < _LEAST_COMPARED else life.restless / life.compared,
        "presence": life.seen / max(life.frames, life.seen, 1),
    }


def _uncut(path: Float, high: int, wide: int) -> NDArray[np.bool_]:
    """Which rows of a path (T, 10) have boxes that the picture's border does not cut."""
    left, right = path[:, 2] - path[:, WIDTH] / 2, path[:, 2] + path[:, WIDTH] / 2
    top, bottom = path[:, 3] - path[:, HEIGHT], path[:, 3]
    return np.asarray(
        (left >= _BORDER) & (right <= wide - _BORDER) & (top >= _BORDER) & (bottom <= high - _BORDER)
    )


def _median(values: ArrayLike) -> float:
    some = np.asarray(values, np.float64)
    return float(np.median(some)) if some.size else math.nan


_STILL = 0.2  # m/s
_LEAST_AGE = 0.5  # s
_LEAST_COMPARED = 5  # changes of area, from which their mean is known


def _look(**sides: tuple[float, float, float, float]) -> Look:
    return {name: Trapezoid(*four) for name, four in sides.items()}


USUAL: Mapping[str, Kind] = {
    "person": Kind(
        (_look(ratio=(1.1, 1.6, 4.5, 7.0), height=(0.8, 1.2, 2.2, 2.7), speed=(-INF, -INF, 5.0, 12.0)),),
        frozenset({"person", "pedestrian", "people", "man", "woman", "child", "cyclist", "rider"}),
    ),
    "group": Kind(
        (
            _look(
                ratio=(0.3, 0.6, 1.4, 2.0),
                height=(1.0, 1.4, 2.5, 3.5),
                width=(0.8, 1.2, 6.0, 12.0),
                speed=(-INF, -INF, 3.0, 6.0),
                pace=(-INF, -INF, 1.2, 2.5),
            ),
        ),
        frozenset({"group", "crowd"}),
    ),
    "vehicle": Kind(
        (
            _look(
                ratio=(0.08, 0.2, 1.1, 1.6),
                height=(0.9, 1.2, 4.0, 5.0),
                width=(1.2, 1.8, 12.0, 20.0),
                straightness=(0.3, 0.7, 1.0, 1.0),
            ),
        ),
        frozenset({"vehicle", "car", "truck", "bus", "van", "motorcycle", "motorbike", "bicycle", "train"}),
    ),
    "animal": Kind(
        (_look(ratio=(0.15, 0.3, 1.8, 3.5), height=(0.02, 0.1, 1.2, 1.8), size=(0.0, 0.004, 0.5, 1.0)),),
        frozenset(
            {
                "animal",
                "dog",
                "cat",
                "horse",
                "cow",
                "sheep",
                "bird",
                "bear",
                "elephant",
                "zebra",
                "giraffe",
                "fish",
                "fly",
                "mouse",
            }
        ),
    ),
    NOISE: Kind(
        (
            _look(lifetime=(-INF, -INF, 0.5, 1.2), reach=(-INF, -INF, 1.0, 1.4)),
            _look(reach=(-INF, -INF, 0.6, 1.2), restless=(0.07, 0.12, INF, INF)),
            _look(reach=(-INF, -INF, 1.0, 2.0), restless=(0.1, 0.2, INF, INF)),
            _look(reach=(-INF, -INF, 1.0, 2.0), presence=(-INF, -INF, 0.4, 0.6)),
        ),
        frozenset({"noise"}),
    ),
}

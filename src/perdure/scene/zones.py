"""Zones of the place, and what they change (III.C): births, deaths, suspension, thresholds, and who may be found where.

A zone is a polygon with a kind and a free name. Trackers ask `Zones` a few questions, all of them batched, and each of
them answers "nothing is changed" where no zone of the kind is there:

=============  =========================================================================================
`counted`      ignore: what is seen there does not count
`evidence`     entry, noise, ground: how long a newcomer must be seen; for ever where nobody can stand
`behind`       occlusion: the occluder behind which a lost target may be
`reach`        low-contrast: times the distance up to which a region may be the target
`kept`         exit, occlusion, low-contrast, and rules: how long a lost target is kept
`left`         exit: through which exit a lost target has left
`verdicts`     rules and occluders: whether a lost target may be a newcomer
=============  =========================================================================================

A box is *in* a zone if its foot, the middle of its lower edge, is in it, or half of the box. The edge belongs to the
zone. Boxes are taken as far as they lie in the picture, so that a zone along the border holds who is cut by it.

>>> door = Zone("entry", "door", rectangle(0, 0, 20, 60))
>>> zones = Zones((door,), size=(60, 100))
>>> zones.evidence(np.float32([[5, 20, 15, 50], [60, 20, 70, 50]])).tolist()
[0.0, 1.0]
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from perdure.errors import ParameterError
from perdure.features.boxes import areas
from perdure.params import unknown_name
from perdure.types import Boxes, Regions, Report, Scene, Tracks

Float = NDArray[np.float64]
Bools = NDArray[np.bool_]
Index = NDArray[np.intp]
Polygon = tuple[tuple[tuple[float, float], ...], ...]  # rings of points x, y: the outer one, then holes

S = TypeVar("S")
ANYWHERE = "*"  # in a rule: any zone, or none
FORBIDDEN, OPEN, EXPECTED = -1, 0, 1  # verdicts on a lost target and a newcomer
HALF = 0.5  # share of a box, from which it is in a zone
_HIDING = 0.2  # share of a box in an occluder, from which a lost target may be behind it
_RATIO = (
    3.0  # of areas of a lost target and a newcomer: who comes out from behind something is seen in part at first
)
_FIRST = 0.01  # of a logarithm of areas: of two, who was lost first is found first
_EDGE = 0.25  # widths of a newcomer round an occluder, within which she may have come out from behind it


@dataclass(frozen=True)
class Setting:
    """What a zone of a kind may say besides its place."""

    default: float
    low: float
    high: float
    help: str


KINDS: Mapping[str, Mapping[str, Setting]] = {
    "entry": {
        "evidence": Setting(1.0, 0.0, 3600.0, "seconds for which who comes in outside all entries must be seen")
    },
    "exit": {
        "patience": Setting(1.0, 0.0, 3600.0, "seconds after which who is lost there has left"),
        "longer": Setting(2.0, 1.0, 100.0, "times as long who is lost outside all exits is kept"),
    },
    "occlusion": {"patience": Setting(10.0, 0.0, 3600.0, "seconds for which who is hidden there is kept")},
    "low-contrast": {
        "longer": Setting(2.0, 1.0, 100.0, "times as long who is lost there is kept"),
        "distance": Setting(1.5, 1.0, 10.0, "times as far a region may be from who is there"),
    },
    "noise": {"evidence": Setting(2.0, 0.0, 3600.0, "seconds for which who comes in there must be seen")},
    "ignore": {},
    "ground": {},
}


@dataclass(frozen=True)
class Zone:
    """A part of the picture with a kind and a name.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    name : str
        Free; no two zones of a place have the same.
    polygons : tuple of polygons
        Each a tuple of rings, the outer one and then holes; a ring is a tuple of points (x, y) in pixels, where pixel
        (0, 0) reaches from (0, 0) to (1, 1).
    patience, evidence, longer, distance : float or None
        Settings of the kind; None for its default, or for a kind that has no such setting.
    """

    kind: str
    name: str
    polygons: tuple[Polygon, ...]
    patience: float | None = None
    evidence: float | None = None
    longer: float | None = None
    distance: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ParameterError(unknown_name("kind of zone", self.kind, KINDS))
        for name in SETTINGS:
            object.__setattr__(self, name, _checked(self, name, getattr(self, name)))


SETTINGS = tuple(dict.fromkeys(name for kind in KINDS.values() for name in kind))


@dataclass(frozen=True)
class Rule:
    """Whether a target lost in one zone may be found again in another.

    `lost_in` and `found_in` are names of zones, or '*' for anywhere. It may after `after` seconds and within `within`,
    at no other time; or `never`. The first rule that speaks of both places decides.
    """

    lost_in: str
    found_in: str
    after: float = 0.0
    within: float = 3600.0
    never: bool = False


def rectangle(x1: float, y1: float, x2: float, y2: float) -> tuple[Polygon, ...]:
    """Return the polygons of a zone that is a box."""
    return ((((x1, y1), (x2, y1), (x2, y2), (x1, y2)),),)


@dataclass(frozen=True)
class Zones:
    """All zones of a place, and the rules between them; false if there is none.

    Parameters
    ----------
    zones : tuple of Zone
        Z.
    rules : tuple of Rule
        The first that speaks of two places decides.
    size : (int, int)
        Height and width of the picture.
    """

    zones: tuple[Zone, ...] = ()
    rules: tuple[Rule, ...] = ()
    size: tuple[int, int] = (0, 0)

    @staticmethod
    def of(scene: Scene) -> Zones:
        """Return the zones of a scene."""
        return Zones(tuple(scene.zones), tuple(scene.rules), (scene.height, scene.width))

    def __bool__(self) -> bool:
        return bool(self.zones)

    def has(self, kind: str) -> bool:
        """Return whether a zone of a kind is there."""
        return kind in self._numbers

    def name(self, number: int) -> str:
        """Return the name of a zone; '' for -1."""
        return self.zones[number].name if number >= 0 else ""

    # Where ------------------------------------------------------------------------------------------------------

    def holding(self, points: NDArray[Any], kinds: Sequence[str] | None = None) -> Bools:
        """Return which zones hold which points: (N, Z) of points (N, 2); none but those of some kinds, if they are named."""
        import shapely

        points = np.asarray(points, np.float64)
        found = np.zeros((len(points), len(self.zones)), np.bool_)
        for number in self._of(kinds):
            found[:, number] = shapely.intersects_xy(self._shapes[number], points[:, 0], points[:, 1])
        return found

    def shares(self, boxes: Boxes, kinds: Sequence[str] | None = None) -> Float:
        """Return the share of each box (N, 4) in each zone (N, Z), of some kinds if they are named; 0 without area."""
        inside = self._inside(boxes)
        found = np.zeros((len(inside), len(self.zones)))
        for number in self._of(kinds):
            found[:, number] = _shares(inside, self._shapes[number], self._limits[number])
        return found

    def within(self, boxes: Boxes, kinds: Sequence[str] | None = None) -> Bools:
        """Return which boxes (N, 4) are in which zones (N, Z), of some kinds if they are named: by foot, or by half."""
        return np.asarray(self.holding(self._feet(boxes), kinds) | (self.shares(boxes, kinds) >= HALF))

    def first(self, boxes: Boxes, kind: str) -> Index:
        """Return in which zone of a kind each box (N, 4) is; of several the first, -1 for none."""
        return self._first(self.within(boxes, (kind,)), kind)

    # What a tracker asks ----------------------------------------------------------------------------------------

    def counted(self, boxes: Boxes) -> Bools:
        """Return which regions (N,) count: less than half of them lies in what is to be ignored."""
        if not self.has("ignore"):
            return np.ones(len(boxes), np.bool_)
        import shapely

        return np.asarray(_shares(self._inside(boxes), self._ignored, shapely.bounds(self._ignored)) < HALF)

    def evidence(self, boxes: Boxes) -> Float:
        """Return for how many seconds (N,) newcomers first seen at boxes (N, 4) must be seen; inf: nobody comes in there.

        Where entries are drawn, who comes in elsewhere must be seen for their `evidence`; in noise for that of the
        noise; and where ground is drawn, nobody comes in who does not stand on it.
        """
        wait = np.zeros(len(boxes))
        if not len(boxes) or not (self.has("entry") or self.has("noise") or self.has("ground")):
            return wait
        within = self.within(boxes, ("entry", "noise"))
        if self.has("entry"):
            elsewhere = ~within[:, self._numbers["entry"]].any(axis=1)
            wait[elsewhere] = max(self.zones[number].evidence or 0.0 for number in self._numbers["entry"])
        for number in self._numbers.get("noise", ()):
            wait = np.where(within[:, number], np.maximum(wait, self.zones[number].evidence or 0.0), wait)
        if self.has("ground"):
            wait[~self.holding(self._feet(boxes), ("ground",))[:, self._numbers["ground"]].any(axis=1)] = np.inf
        return wait

    def behind(self, seen: Boxes, expected: Boxes) -> Index:
        """Return behind which occluder (N,) lost targets may be, by where they were seen last and are expected; else -1."""
        if not self.has("occlusion") or not len(seen):
            return np.full(len(seen), -1, np.intp)
        one, other = (self.shares(boxes, ("occlusion",)) for boxes in (seen, expected))
        shares = np.maximum(one, other)[:, self._numbers["occlusion"]]
        best = shares.argmax(axis=1)
        found = shares[np.arange(len(seen)), best] >= _HIDING
        return np.where(found, np.asarray(self._numbers["occlusion"])[best], -1)

    def reach(self, boxes: Boxes) -> Float:
        """Return how many times as far (N,) a region may be from targets at boxes (N, 4)."""
        return self._times(boxes, "low-contrast", "distance")

    def held(self, boxes: Boxes, behind: Index) -> Boxes:
        """Return boxes (N, 4), those of who is behind an occluder moved until the middle is behind it: else it were seen."""
        hidden = np.flatnonzero(behind >= 0)
        if not len(hidden):
            return boxes
        limits = self._limits[behind[hidden]]
        middle = (boxes[hidden, :2] + boxes[hidden, 2:]) / 2
        moved = boxes.copy()
        moved[hidden] += np.tile(np.clip(middle, limits[:, :2], limits[:, 2:]) - middle, 2)
        return moved

    def kept(self, boxes: Boxes, behind: Index, usual: Float, leaving: Bools) -> Float:
        """Return for how many seconds (N,) targets are kept that were lost at boxes (N, 4), instead of the usual ones.

        Through an exit one is gone soon; behind an occluder, in low contrast, and where exits are drawn but one is in
        none of them and not `leaving` over the border, one is kept for longer. Who may be found again by a rule is kept
        for as long as the rule says.
        """
        if not len(boxes):
            return usual
        within = self.within(boxes, None if self.rules else ("exit", "low-contrast"))
        times = self._times(boxes, "low-contrast", "longer", within)
        kept = usual * times
        for number in self._numbers.get("occlusion", ()):
            kept = np.where(behind == number, np.maximum(kept, self.zones[number].patience or 0.0), kept)
        exits = self._numbers.get("exit", ())
        if exits:
            through = self._first(within, "exit")
            longer = max(self.zones[number].longer or 1.0 for number in exits)
            kept = np.where((through < 0) & (behind < 0) & (times == 1) & ~leaving, usual * longer, kept)
            for number in exits:
                kept = np.where(through == number, self.zones[number].patience or 0.0, kept)
        for rule in self.rules:
            if not rule.never:
                kept = np.where(self._where(within, rule.lost_in), np.maximum(kept, rule.within), kept)
        return np.asarray(kept, np.float64)

    def stays(self, boxes: Boxes) -> Float:
        """Return how many times as long (N,) targets lost at boxes (N, 4) are looked for where they are expected."""
        return self._times(boxes, "low-contrast", "longer")

    def left(self, boxes: Boxes) -> Index:
        """Return through which exit (N,) targets lost at boxes (N, 4) have left; -1 for none."""
        return self.first(boxes, "exit")

    def verdicts(self, lost: Boxes, behind: Index, found: Boxes, gaps: Float) -> NDArray[np.int8]:
        """Say of lost targets and of what is seen whether it may be they: FORBIDDEN, OPEN (nothing is known), EXPECTED.

        Parameters
        ----------
        lost : (L, 4)
            Boxes where targets were seen last.
        behind : (L,) int
            The occluders they are behind; -1 for none.
        found : (F, 4)
            Boxes where something is seen.
        gaps : (L, F)
            Seconds between the two.
        """
        verdict = np.full(gaps.shape, OPEN, np.int8)  # (L, F)
        if not verdict.size:
            return verdict
        for number in self._numbers.get("occlusion", ()):
            out = (behind == number)[:, None] & self._at_edge(found, number)[None]
            verdict[out & (gaps <= (self.zones[number].patience or 0.0) + 1e-9)] = EXPECTED
        if self.rules:
            ins, outs = self.within(lost), self.within(found)
        for rule in reversed(self.rules):
            both = self._where(ins, rule.lost_in)[:, None] & self._where(outs, rule.found_in)[None]
            timely = (gaps >= rule.after - 1e-9) & (gaps <= rule.within + 1e-9) & (not rule.never)
            verdict[both] = np.where(timely, EXPECTED, FORBIDDEN)[both]
        return verdict

    def returning(self, lost: Boxes, behind: Index, found: Boxes, gaps: Float) -> Float:
        """Return how unlike (L, F) lost targets and newcomers are whom an occluder or a rule lets expect; inf: not one.

        Arguments are those of `verdicts`. Told apart are they by their areas, which differ by the factor 3 at most, and
        by who was lost first.
        """
        cost = np.full(gaps.shape, np.inf)
        if not cost.size or not (self.has("occlusion") or self.rules):
            return cost
        one, other = (np.log(np.maximum(areas(boxes).astype(np.float64), 1.0)) for boxes in (lost, found))
        unlike = np.abs(one[:, None] - other[None])  # (L, F)
        expected = (self.verdicts(lost, behind, found, gaps) == EXPECTED) & (unlike <= np.log(_RATIO)) & (gaps > 0)
        first = np.argsort(np.argsort(-gaps, axis=0, kind="stable"), axis=0, kind="stable")
        return np.where(expected, unlike + _FIRST * first, cost)

    def rule(self, lost: Boxes, found: Boxes) -> Rule | None:
        """Return the rule that decides on one lost box (4,) and one found (4,), if any."""
        ins, outs = self.within(lost[None]), self.within(found[None])
        speaking = (
            one for one in self.rules if self._where(ins, one.lost_in)[0] and self._where(outs, one.found_in)[0]
        )
        return next(speaking, None)

    # Below ------------------------------------------------------------------------------------------------------

    @cached_property
    def _shapes(self) -> tuple[Any, ...]:
        """The zones as shapely's geometries, prepared; made when first asked for, never saved."""
        import shapely

        shapes = tuple(shape_of(zone.polygons) for zone in self.zones)
        shapely.prepare(list(shapes))
        return shapes

    @cached_property
    def _ignored(self) -> Any:
        """All that is to be ignored, as one geometry."""
        import shapely

        return shapely.union_all([self._shapes[number] for number in self._numbers["ignore"]])

    @cached_property
    def _limits(self) -> Float:
        import shapely

        return np.asarray(shapely.bounds(list(self._shapes)), np.float64).reshape(-1, 4)

    @cached_property
    def _numbers(self) -> dict[str, list[int]]:
        """The zones of each kind that is there."""
        found: dict[str, list[int]] = {}
        for number, zone in enumerate(self.zones):
            found.setdefault(zone.kind, []).append(number)
        return found

    @cached_property
    def _named(self) -> dict[str, int]:
        return {zone.name: number for number, zone in enumerate(self.zones)}

    def _of(self, kinds: Sequence[str] | None) -> Iterable[int]:
        """The numbers of the zones of some kinds; of all, if none is named."""
        if kinds is None:
            return range(len(self.zones))
        return [number for kind in kinds for number in self._numbers.get(kind, ())]

    def _inside(self, boxes: Boxes) -> Float:
        """Boxes (N, 4) as far as they lie in the picture."""
        height, width = self.size
        return np.clip(np.asarray(boxes, np.float64).reshape(-1, 4), 0.0, [width, height, width, height])

    def _feet(self, boxes: Boxes) -> Float:
        """Middles of the lower edges (N, 2) of boxes (N, 4), in the picture."""
        inside = self._inside(boxes)
        return np.column_stack([(inside[:, 0] + inside[:, 2]) / 2, inside[:, 3]])

    def _where(self, within: Bools, name: str) -> Bools:
        return np.ones(len(within), np.bool_) if name == ANYWHERE else np.asarray(within[:, self._named[name]])

    def _first(self, within: Bools, kind: str) -> Index:
        numbers = self._numbers.get(kind)
        if not numbers:
            return np.full(len(within), -1, np.intp)
        mine = within[:, numbers]
        return np.where(mine.any(axis=1), np.asarray(numbers)[mine.argmax(axis=1)], -1)

    def _times(self, boxes: Boxes, kind: str, setting: str, within: Bools | None = None) -> Float:
        """The largest setting (N,) of the zones of a kind that boxes (N, 4) are in; 1 for none."""
        times = np.ones(len(boxes))
        if self.has(kind) and len(boxes):
            within = self.within(boxes, (kind,)) if within is None else within
            for number in self._numbers[kind]:
                times = np.where(within[:, number], np.maximum(times, getattr(self.zones[number], setting)), times)
        return times

    def _at_edge(self, boxes: Boxes, number: int) -> Bools:
        """Which boxes (N,) touch an occluder, or nearly."""
        import shapely

        inside = self._inside(boxes)
        margin = _EDGE * (inside[:, 2:] - inside[:, :2])
        near = shapely.box(*np.column_stack([inside[:, :2] - margin, inside[:, 2:] + margin]).T)
        return np.asarray(shapely.intersects(self._shapes[number], near), np.bool_)


def counting(
    zones: Zones, regions: Regions, step: Callable[[Regions], tuple[S, Report]]
) -> tuple[S, Report, NDArray[np.intp] | None]:
    """Step on the regions that count alone; return their numbers too, None where all do."""
    kept = zones.counted(regions.boxes)
    if "mark" in regions.data:  # what the user marked counts anywhere
        kept = kept | (regions.data["mark"] > 0)
    if kept.all():
        return (*step(regions), None)
    return (*step(regions.take(kept)), np.flatnonzero(kept))


def renumbered(rows: Tracks, frame: int, numbers: Index | None) -> Tracks:
    """Return rows whose links in one frame are numbers among all of its regions, not among those that count."""
    if numbers is None or not len(rows):
        return rows
    links = [
        tuple(int(numbers[one]) for one in some) if when == frame else some
        for when, some in zip(rows.frames.tolist(), rows.links, strict=True)
    ]
    return rows.replace(links=links)


def shape_of(polygons: Sequence[Polygon]) -> Any:
    """Return polygons as one geometry of shapely."""
    import shapely

    shapes = [shapely.Polygon(rings[0], rings[1:]) for rings in polygons]
    return shapes[0] if len(shapes) == 1 else shapely.MultiPolygon(shapes)


def _shares(boxes: Float, shape: Any, limits: Float) -> Float:
    """The share (N,) of each box (N, 4) in a geometry whose bounds are x1 y1 x2 y2."""
    import shapely

    found = np.zeros(len(boxes))
    near = np.flatnonzero((boxes[:, :2] < limits[2:]).all(axis=1) & (boxes[:, 2:] > limits[:2]).all(axis=1))
    if len(near):
        area = (boxes[near, 2] - boxes[near, 0]) * (boxes[near, 3] - boxes[near, 1])
        shared = shapely.area(shapely.intersection(shapely.box(*boxes[near].T), shape))
        found[near] = np.minimum(shared / np.maximum(area, 1e-9), 1.0)
    return found


def _checked(zone: Zone, name: str, value: float | None) -> float | None:
    """A setting of a zone, its kind's default if it is not given; ParameterError for one that is out of range."""
    known = KINDS[zone.kind]
    if name not in known:
        if value is not None:
            raise ParameterError(_misplaced(zone, name))
        return None
    setting = known[name]
    if value is None:
        return setting.default
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not setting.low <= value <= setting.high:
        raise ParameterError(
            f"{name} = {value!r} must be a number from {setting.low:g} to {setting.high:g}: {setting.help}"
        )
    return float(value)


def _misplaced(zone: Zone, name: str) -> str:
    owners = ", ".join(kind for kind, known in KINDS.items() if name in known)
    own = ", ".join(KINDS[zone.kind]) or "nothing"
    return f"{name} belongs to the kinds {owners}; a zone of kind {zone.kind} may set {own}"

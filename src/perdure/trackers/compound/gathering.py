"""Who is in which region: targets and regions bound to each other, one frame (IV.B and IV.C)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import areas, distances_between, hull, intersections, sizes
from perdure.trackers.compound.bodies import Bodies
from perdure.trackers.compound.inside import believe
from perdure.trackers.compound.matrix import Knot, Matched, distances
from perdure.trackers.compound.targets import Float, Targets
from perdure.types import Boxes, Frame, Mask, Regions

Index = NDArray[np.intp]
HIDDEN = 0.25  # share of a target's form; of whom less is seen is hidden
_YOUNG = 1.5  # s, for which a target may turn out to be a piece
_FILLED = 0.6  # of a region, that its targets fill at least
_OWN = 0.5  # share that is granted to whoever has a region for herself
_SPECK = 0.1  # of a target's area; a smaller region does not hold it while there are others
_OVER = 0.5  # share of a member in another's region, where she may have gone
_TORN = 1.0  # s in pieces, after which a target may be two
_TWINS = 0.4  # area of the smaller of two, in areas of the larger
_PIECE = 0.5  # of a region inside a target, that makes it a piece


class Held(NamedTuple):
    """Where each of N targets is, in a frame."""

    region: Index  # (N,) the region that holds it; -1 for none
    boxes: Boxes  # (N, 4) where it is believed: predicted, or fitted into the regions of its knot
    share: Float  # (N,) of its form that is seen; 1 where it has a region by itself
    masks: dict[int, Mask]  # row -> own pixels, of targets fitted into a knot
    pieces: dict[int, tuple[int, ...]]  # row -> further regions that are pieces of it
    parted: set[int]  # rows whose pieces have turned out to be others


class Sight(NamedTuple):
    """What a frame is looked at with."""

    frame: Frame
    regions: Regions
    size: tuple[int, int]  # height and width of the picture
    bodies: Bodies
    near: float  # widths within which regions are neighbours; below 0 for none
    colours: bool  # whether the picture is looked at


def gather(
    targets: Targets, expected: Boxes, active: Index, found: Matched, fresh: NDArray[np.bool_], sight: Sight
) -> Held:
    """Bind targets to regions: visible ones to their own, ambiguous ones to the one that holds them.

    Parameters
    ----------
    targets : Targets
        N.
    expected : (N, 4)
        Predicted boxes.
    active : (T,) int
        The rows that were matched.
    found : Matched
        What the ambiguity matrix says of them.
    fresh : (N,) bool
        Seen too shortly to be anybody.
    sight : Sight
        What is seen, and what is known of the place.
    """
    count = len(targets)
    held = Held(np.full(count, -1, np.intp), expected.copy(), np.zeros(count, np.float32), {}, {}, set())
    rows, regions = active[found.pairs[:, 0]], found.pairs[:, 1]
    single = ~targets.temporary[rows]
    held.region[rows[single]], held.share[rows[single]] = regions[single], 1.0
    knots = [Knot(tuple(active[list(knot.rows)].tolist()), knot.regions) for knot in found.knots]
    knots += [
        Knot((int(row),), (int(region),)) for row, region in zip(rows[~single], regions[~single], strict=True)
    ]
    if not knots:
        return held
    alone = list(zip(rows[single].tolist(), regions[single].tolist(), strict=True))
    nodes = [*knots, *(Knot((row,), (region,)) for row, region in alone)]
    over = _gone_over(targets, nodes, expected, sight.regions.boxes) if sight.near >= 0 else set()
    companies = _with_neighbours(nodes, len(knots), sight.regions.boxes, sight.near, over)
    members = [_members(targets, knot, fresh, rows[single]) for knot in companies]
    twice, times = np.unique(np.concatenate(members), return_counts=True)
    if (times > 1).any():
        members = _decided(held, targets, companies, members, twice[times > 1], expected, sight)
    for knot, some in zip(companies, members, strict=True):
        if len(some):
            _place(held, targets, some, np.array(knot.regions), expected, sight)
    return held


def _decided(
    held: Held,
    targets: Targets,
    knots: list[Knot],
    members: list[Index],
    twice: Index,
    expected: Boxes,
    sight: Sight,
) -> list[Index]:
    """Members of the knots, those that are in two of them left only where more of them is seen.

    Who is hidden in her compound may have gone over into the region of somebody else.
    """
    share = np.full((len(knots), len(targets)), -1.0, np.float32)  # (K, N); of who is not in a knot -1
    for one, (knot, some) in enumerate(zip(knots, members, strict=True)):
        if np.isin(some, twice).any():
            trial = Held(held.region.copy(), held.boxes.copy(), held.share.copy(), {}, {}, set())
            _place(trial, targets, some, np.array(knot.regions), expected, sight)
            share[one, some] = trial.share[some]
    best = share.argmax(axis=0)  # (N,)
    return [some[~np.isin(some, twice) | (best[some] == one)] for one, some in enumerate(members)]


def _gone_over(targets: Targets, nodes: list[Knot], expected: Boxes, boxes: Boxes) -> set[tuple[int, int]]:
    """Pairs of a company and a node, where a member of the company is expected in the region of the node.

    She has gone on with others while what was left of her company parted from them.
    """
    found = set()
    for one, node in enumerate(nodes):
        rows = np.array(node.rows, np.intp)
        members = np.flatnonzero(
            targets.frozen & np.isin(targets.within, targets.keys[rows[targets.temporary[rows]]])
        )
        if len(members) < 2:
            continue
        whole = np.maximum(areas(expected[members]), 1e-6)
        shares = [
            (intersections(expected[members], boxes[list(other.regions)]) / whole[:, None]).max(axis=1)
            for other in nodes
        ]
        home = shares[one]  # (M,)
        found |= {(one, other) for other, away in enumerate(shares) if ((away >= _OVER) & (away > home)).any()}
    return found


def _with_neighbours(
    nodes: list[Knot], count: int, boxes: Boxes, near: float, over: set[tuple[int, int]]
) -> list[Knot]:
    """The first `count` nodes, which are knots, joined with each other and with visible targets where they belong together.

    That is where their regions are near, and where a member of one has gone over into the other.
    """
    places = [boxes[list(node.regions)] for node in nodes]
    widths = [float(sizes(place).min()) for place in places]
    joined = list(range(len(nodes)))  # the first node of each one's company
    for one in range(count):
        for other in range(len(nodes)):
            apart = joined[one] != joined[other]
            reach = near * min(widths[one], widths[other])
            if apart and ((one, other) in over or distances_between(places[one], places[other]).min() <= reach):
                first, last = sorted((joined[one], joined[other]))
                joined = [first if company == last else company for company in joined]
    kept = sorted({joined[number] for number in range(count)})
    companies = [[node for node, company in zip(nodes, joined, strict=True) if company == one] for one in kept]
    return [
        Knot(
            tuple(sorted({row for node in company for row in node.rows})),
            tuple(sorted({region for node in company for region in node.regions})),
        )
        for company in companies
    ]


def _members(targets: Targets, knot: Knot, fresh: NDArray[np.bool_], single: Index) -> Index:
    """The targets of a knot that are not temporary: free ones, and those that its temporary ones hold."""
    rows = np.array(knot.rows, np.intp)
    temporary = targets.temporary[rows]
    held = targets.frozen & np.isin(targets.within, targets.keys[rows[temporary]])
    held[single] = False  # a hidden one that has come out elsewhere
    alone = rows[~temporary]
    if held.any() or not fresh[alone].all():
        alone = alone[~fresh[alone]]  # nobody yet: not worth an ambiguity
    elif len(alone) > 1 and len(knot.regions) == 1:
        alone = alone[[np.argmin(targets.born[alone])]]  # pieces that grow together
    return np.union1d(np.flatnonzero(held), alone)


def _place(held: Held, targets: Targets, rows: Index, numbers: Index, expected: Boxes, sight: Sight) -> None:
    """Find where the members of a knot are in its regions, and note it in `held`."""
    if len(numbers) == 1:
        rows = _grown_together(targets, rows, sight.regions.boxes[numbers[0]], sight.frame.time)
    if len(rows) == len(numbers) == 1:
        held.region[rows], held.share[rows] = numbers, 1.0
        return
    seen = sight.regions.take(numbers)
    unseen = targets.missed[rows] > 0
    start = np.where(unseen[:, None], _moved_inside(expected[rows], hull(seen.boxes)), expected[rows])
    image = sight.frame.image if sight.colours else None
    inside = believe(start, targets.looks[rows], seen.boxes, seen.masks, image, sight.size)
    holder = _holders(inside.boxes, seen.boxes)
    hidden = inside.share < HIDDEN
    single = np.bincount(holder, minlength=len(numbers))[holder] == 1
    held.share[rows] = np.where(single, np.maximum(inside.share, _OWN), inside.share)
    # Who is hidden is where she was going, but inside: else she would be seen.
    held.boxes[rows] = np.where((hidden & ~single)[:, None], start, inside.boxes)
    held.region[rows] = numbers[holder]
    held.masks.update(zip(rows.tolist(), inside.masks, strict=True))
    for place in np.setdiff1d(np.arange(len(numbers)), holder):
        box = seen.boxes[place]
        part = intersections(box[None], inside.boxes)[0] / max(float(areas(box[None])[0]), 1e-6)
        owner = int(np.argmax(part))
        row = int(rows[owner])
        torn = sight.frame.time - targets.whole[row] >= _TORN
        if part[owner] < _PIECE:
            continue
        if not _is_piece(sight.bodies, box, seen.boxes[holder[owner]], torn):
            held.parted.add(row)
        else:
            held.pieces[row] = (*held.pieces.get(row, ()), int(numbers[place]))


def _grown_together(targets: Targets, rows: Index, region: Float, time: float) -> Index:
    """The targets of a region without those that were pieces of it: young ones, all together far too small for it.

    What comes out from behind something comes in pieces, each a target at first.
    """
    young = time - targets.born[rows] < _YOUNG
    filled = targets.size[rows].prod(axis=1).sum() > _FILLED * areas(region[None])[0]
    if len(rows) < 2 or filled or not young.all():
        return rows
    return rows[[int(np.argmin(targets.born[rows]))]]


def _moved_inside(boxes: Boxes, limits: Float) -> Boxes:
    """Boxes (N, 4) moved so that they do not leave a larger one."""
    one, other = limits[:2] - boxes[:, :2], limits[2:] - boxes[:, 2:]
    return np.asarray(boxes + np.tile(np.clip(0.0, np.minimum(one, other), np.maximum(one, other)), 2), np.float32)


def _is_piece(bodies: Bodies, region: Float, main: Float, torn: bool) -> bool:
    """Whether a region is a piece of the target that has the main one, not a body by itself.

    Where bodies are not known yet, what has been `torn` for long into two of a size is two.
    """
    if not bodies.known:
        small, large = sorted(areas(np.stack([region, main])).tolist())
        return not torn or small < _TWINS * large
    whole, one, other = bodies.strangeness(np.stack([hull(np.stack([region, main])), main, region]))
    return bool(whole <= (one + other) / 2)


def _holders(boxes: Boxes, regions: Boxes) -> Index:
    """Return which region (N,) holds each target.

    That with which it shares most; but a region of a body's size that would stay empty gets, of a crowded one, the
    target that fits it best.
    """
    shared, apart = intersections(boxes, regions), distances(boxes, regions)  # (N, M)
    speck = areas(regions)[None] < _SPECK * areas(boxes)[:, None]
    speck &= ~speck.all(axis=1, keepdims=True)
    shared, apart = np.where(speck, 0.0, shared), np.where(speck, np.inf, apart)
    holder = np.where(shared.max(axis=1) > 0, shared.argmax(axis=1), apart.argmin(axis=1))
    for region in np.setdiff1d(np.arange(len(regions)), holder):
        crowded = np.bincount(holder, minlength=len(regions))[holder] > 1
        can = np.flatnonzero(crowded & (areas(regions)[region] > 0.4 * areas(boxes)) & (apart[:, region] < 1.2))
        if len(can):
            holder[can[np.argmin(apart[can, region])]] = region
    return np.asarray(holder, np.intp)

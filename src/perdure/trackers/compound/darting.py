"""Who has darted off: farther in one frame than its own length, so that no region touches where it was expected (ours).

Where a target is gone that nobody covers, and a region is there that comes out from behind nobody, the one has become
the other, if it is near enough; of several, the paths are chosen that are shortest together (sum of squares, as
C. J. Veenman, M. J. T. Reinders and E. Backer, Resolving motion correspondence for densely moving points, 2001).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perdure.features.boxes import centres, intersections, overlaps, sizes
from perdure.maths.assign import assign
from perdure.trackers.compound.matrix import Matched, Possible
from perdure.types import Boxes

_REACH = 2.0  # lengths of a body, that it may lie off where it was expected
_TOUCHING = 0.15  # overlap with where it was expected, from which it was refused for a reason
_UNLIKE = 2.0  # ratio of lengths, from which it is another


def darted(
    found: Matched,
    regions: Boxes,
    sure: NDArray[np.bool_],
    targets: Boxes,
    eager: NDArray[np.bool_],
    possible: Possible | None,
    size: tuple[int, int],
) -> Matched:
    """Return the correspondences, with those of targets and regions that were left over.

    Parameters
    ----------
    found : Matched
        What the ambiguity matrix says.
    regions : (R, 4)
        Boxes.
    sure : (R,) bool
        Which may be anybody's.
    targets : (T, 4)
        Predicted boxes.
    eager : (T,) bool
        Who was seen by herself in the last frame, and has a name.
    possible : function or None
        Of rows of regions (K,) and of targets (K,): which pairs may correspond, for all that is known of the place.
    size : (int, int)
        Height and width of the picture; who goes over its border has not darted off.
    """
    if not len(regions) or not eager.any():
        return found
    here, taken = _used(found, len(targets), len(regions))
    gone = np.flatnonzero(~here & eager & _inside(targets, size))
    new = np.flatnonzero(~taken & sure & _inside(regions, size)) if len(gone) else gone
    gone = gone[~(intersections(targets[gone], regions[taken]) > 0).any(axis=1)]
    new = new[~(intersections(regions[new], targets[here]) > 0).any(axis=1)]
    if not len(gone) or not len(new):
        return found
    long, other = sizes(targets[gone]).max(axis=1)[:, None], sizes(regions[new]).max(axis=1)
    way = centres(targets[gone])[:, None] - centres(regions[new])
    far = np.hypot(way[..., 0], way[..., 1]) / np.maximum(np.maximum(long, other), 1.0)  # (G, N)
    can = (far < _REACH) & (overlaps(targets[gone], regions[new]) < _TOUCHING)
    can &= (long < _UNLIKE * other) & (other < _UNLIKE * long)
    if possible is not None:
        row, column = np.nonzero(can)
        can[row, column] = possible(new[column], gone[row])
    if not can.any():
        return found
    pairs = assign(np.where(can, far.astype(np.float64) ** 2, np.inf)).pairs
    more = np.stack([gone[pairs[:, 0]], new[pairs[:, 1]]], axis=1)
    return found._replace(pairs=np.concatenate([found.pairs.reshape(-1, 2), more]))


def _used(found: Matched, targets: int, regions: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which targets (T,) and which regions (R,) have found each other."""
    here, taken = np.zeros(targets, np.bool_), np.zeros(regions, np.bool_)
    here[found.pairs[:, 0]] = taken[found.pairs[:, 1]] = True
    for knot in found.knots:
        here[list(knot.rows)] = taken[list(knot.regions)] = True
    return here, taken


def _inside(boxes: Boxes, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Which boxes (N, 4) lie inside the picture, without touching its border."""
    return np.asarray((boxes[:, :2] > 0).all(axis=1) & (boxes[:, 2:] < np.array(size[::-1])).all(axis=1))

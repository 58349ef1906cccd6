"""What zones change for one object at a time: where it was seen last, and who waits to be born.

For trackers that keep their objects one by one; those that keep them in columns ask `Zones` itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from perdure.features.masks import mask_shares
from perdure.scene.zones import EXPECTED, FORBIDDEN, Zones
from perdure.types import Boxes, Mask

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Whereabouts:
    """Where an object was seen last, and behind which occluder it is since then; -1 for none."""

    box: Box = (0.0, 0.0, 0.0, 0.0)
    behind: int = -1

    def after(self, zones: Zones, seen: Box | None, expected: Box) -> Whereabouts:
        """Return the whereabouts after a frame in which the object was seen in a box, or should be in one."""
        if not zones:
            return self
        if seen is not None:
            return Whereabouts(tuple(map(float, seen)))  # type: ignore[arg-type]
        if self.behind >= 0:
            return self
        return replace(self, behind=int(zones.behind(_row(self.box), _row(expected))[0]))

    def kept(self, zones: Zones, usual: float, leaving: bool) -> float:
        """Return for how many seconds the object is kept while it is not seen."""
        if not zones:
            return usual
        behind = np.array([self.behind])
        return float(zones.kept(_row(self.box), behind, np.array([usual]), np.array([leaving]))[0])

    def exit(self, zones: Zones) -> int:
        """Return the exit in which the object was seen last; -1 for none."""
        return int(zones.left(_row(self.box))[0])

    def verdict(self, zones: Zones, box: Box, gap: float) -> int:
        """Return whether what is seen in a box so many seconds later may be it: FORBIDDEN, OPEN or EXPECTED."""
        if not zones.rules and self.behind < 0:
            return 0
        return int(zones.verdicts(_row(self.box), np.array([self.behind]), _row(box), np.array([[gap]]))[0, 0])

    def is_forbidden(self, zones: Zones, box: Box, gap: float) -> bool:
        """Return whether a rule forbids that what is seen in a box is it."""
        return self.verdict(zones, box, gap) == FORBIDDEN

    def is_expected(self, zones: Zones, box: Box, gap: float) -> bool:
        """Return whether an occluder or a rule lets expect it in a box."""
        return self.verdict(zones, box, gap) == EXPECTED


NOWHERE = Whereabouts()


class Waiting(NamedTuple):
    """A region that is nobody's and waits to be somebody."""

    mask: Mask
    since: float  # s, first seen
    evidence: float  # s for which it must be seen; inf where nobody comes in
    entry: int  # the entry in which it was seen first; -1 for none

    @staticmethod
    def first(zones: Zones, mask: Mask, time: float) -> Waiting:
        """Return what is seen for the first time."""
        if not zones:
            return Waiting(mask, time, 0.0, -1)
        box = _row(mask.box)
        return Waiting(mask, time, float(zones.evidence(box)[0]), int(zones.first(box, "entry")[0]))

    def is_due(self, time: float) -> bool:
        """Return whether it has been seen for long enough."""
        return time - self.since >= self.evidence - 1e-9


def awaited(mask: Mask, before: Sequence[Waiting], same: float) -> Waiting | None:
    """Return the region as one of those that waited a frame ago, if it shares enough with one; of several the oldest."""
    shares = mask_shares([mask], [one.mask for one in before])  # (1, W)
    known = [one for one, share in zip(before, shares[0].tolist(), strict=True) if share > same] if before else []
    return min(known, key=lambda one: one.since)._replace(mask=mask) if known else None


def _row(box: Sequence[float]) -> Boxes:
    return np.array([box], np.float32)

"""Named values divided among those who declare them: the tracker, the detector, scenarios."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from perdure import params
from perdure.detect import DETECTORS
from perdure.detection import kinds_of
from perdure.errors import ParameterError
from perdure.interpret import Feedback
from perdure.scene.scenarios import Rules
from perdure.trackers import TRACKERS


class Split(NamedTuple):
    """Named values divided between tracker and detector."""

    tracker: dict[str, object]
    detector: dict[str, object]


def split(given: Mapping[str, object], tracker: str, detector: str, box_masks: str | None = None) -> Split:
    """Divide named values between tracker and detector, and the background model that makes silhouettes of its boxes.

    Raises
    ------
    ParameterError
        For a name that neither has, with who has it or the nearest one.
    """
    ours = [TRACKERS[tracker]] if tracker in TRACKERS else []
    owners = {
        one.name: part
        for part, kinds in (("tracker", ours), ("detector", kinds_of(detector, box_masks)))
        for kind in kinds
        for one in params.describe(kind)
    }
    if not isinstance(given, Mapping):
        raise ParameterError(f"parameters must be values by name, such as {{'patience': 2.0}}, not {given!r:.60}")
    divided = Split({}, {})
    for name, value in given.items():
        if name not in owners:
            raise ParameterError(_stranger(name, owners, tracker, detector))
        getattr(divided, owners[name])[name] = value
    return divided


def of_scenarios(
    given: Mapping[str, object], rules: Rules | None
) -> tuple[dict[str, object], Mapping[str, object]]:
    """Return the values of `Feedback` among those that were given, and the others.

    Raises
    ------
    ParameterError
        If there are such and no scenarios.
    """
    if not isinstance(given, Mapping):
        return {}, given
    known = {one.name for one in params.describe(Feedback)}
    own = {name: value for name, value in given.items() if name in known}
    if own and rules is None:
        raise ParameterError(f"{next(iter(own))!r} goes with --scenarios; name a file of them, or 'usual'")
    return own, {name: value for name, value in given.items() if name not in known}


def _stranger(name: str, owners: Mapping[str, str], tracker: str, detector: str) -> str:
    for what, kinds in (("tracker", TRACKERS), ("detector", DETECTORS)):
        for other, kind in kinds.items():
            if name in {one.name for one in params.describe(kind)}:
                return f"{name!r} belongs to the {what} {other!r}, which this run does not use"
    return params.unknown_name(f"parameter of the tracker {tracker!r} or the detector {detector!r}", name, owners)

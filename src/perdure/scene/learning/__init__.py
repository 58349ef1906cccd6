"""Zones proposed from the tracks of a run: where people come in and go out, what hides them, what only flickers.

A *path* is what one id was seen to do. It is a *walk* if it lasts for a second and leaves its place by half its own side;
it is a *flicker* if it lasts for less than a second and goes no farther than its own side, or for less than three and
stays where it is. Only walks tell of entries, exits and occluders, only flickers of noise.

=========  ==================================================================================================
entry,     begins and ends of walks at the picture's border, a rectangle along it for each cluster of both; and
exit       begins or ends inside (a door), if nobody was near with whom they parted or met, if they are not the
           two ends of one walk that broke, and if they are not at a zone of the kind along the border
occlusion  what the background model found to stand in front; and where walks were lost and found again while
           nobody was in front of them
noise      where flickers are, unless more walks begin there than flickers
=========  ==================================================================================================

Clusters are single linkage: two places belong together if they are nearer to one another than the mean size of their
things, and so does all that hangs together by such pairs. They depend on no order and on no random number. Who stood
there when the film began, or when it ended, tells neither an entry nor an exit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from perdure.scene.learning.flickers import flickers_of
from perdure.scene.learning.gates import gates_of
from perdure.scene.learning.occluders import Standing, broken_walks, lost_walks, occluders_of
from perdure.scene.learning.paths import paths_of
from perdure.scene.learning.proposals import LEAST, Proposal
from perdure.types import Tracks

__all__ = ["LEARNT", "Learnt", "Proposal", "Standing", "learn_zones"]

LEARNT = ("entry", "exit", "occlusion", "noise")  # kinds that can be proposed


@dataclass(frozen=True)
class Learnt:
    """What the tracks of a run tell of its place."""

    proposals: tuple[Proposal, ...]
    missing: Mapping[str, str]  # kinds of which no zone is proposed, and why
    walks: int  # paths that told anything


def learn_zones(
    rows: Tracks, size: tuple[int, int], span: tuple[float, float], standing: Sequence[Standing] = ()
) -> Learnt:
    """Propose zones from settled tracks.

    Parameters
    ----------
    rows : Tracks
        All of them, of all statuses; silhouettes are not needed.
    size : (int, int)
        Height and width of the picture.
    span : (float, float)
        Times of the first and last frame, in seconds.
    standing : sequence of Standing
        What the background model found to stand in front.

    Returns
    -------
    Learnt
        Entries first, then exits, occluders, noise; each kind from left to right.
    """
    paths = paths_of(rows, size)
    walks = paths.take(paths.walks)
    broken = broken_walks(walks, size)
    hidden, no_occluder = occluders_of(lost_walks(rows, walks, broken), standing, walks, size)
    ins, outs, no_gate = gates_of(walks, broken, span, hidden, size)
    noise, no_noise = flickers_of(paths, walks, size)
    found = (*ins, *outs, *hidden, *noise)
    few = f"tracks that went anywhere: {len(walks)}, needed are {LEAST}" if len(walks) < LEAST else ""
    why = {**no_gate, "occlusion": no_occluder, "noise": no_noise}
    kinds = {one.zone.kind for one in found}
    missing = {kind: (few if few and kind != "noise" else why[kind]) for kind in LEARNT if kind not in kinds}
    return Learnt(found, missing, len(walks))

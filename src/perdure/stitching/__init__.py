"""Tracks of the parts of a long film made one: who of one part is who of the next, and from which frame the next is told.

Neighbouring parts overlap. Who was seen in the same places of the overlap by both is one: the score is the multi-feature
tracker's global similarity of places and sizes (eq. 10, eq. 16), nearest the frame of the handover first, and the log
odds of looks. Who was hidden there is known again by looks alone, where they leave no doubt. Two identities whom one part
has seen in one frame at two places are never one, by whatever chain of parts.

The handover is where both parts agree best on who is where, about three quarters into the overlap: before it the later
part has not seen enough, behind it the earlier one has not seen what follows.
"""

from perdure.stitching.hidden import Recall
from perdure.stitching.joining import Stitched, names, stitch
from perdure.stitching.parts import Join, Life, Part

__all__ = ["Join", "Life", "Part", "Recall", "Stitched", "names", "stitch"]

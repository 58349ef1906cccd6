"""Learn how things are told apart in a kind of scene: films with a truth in, a context out (section 3, eq. 11-14).

A sample is a pair of seen things, an earlier one and a later one: +1 if they are one object, -1 if not. Of each pair
every feature of the pool tells how alike the two are, and boosting weighs the features by how well they tell the kinds
of pairs apart (`perdure.maths.boost`).

The paper takes all pairs of consecutive frames, and one threshold for all features (`PAPER`). Where we depart, each by
a parameter: pairs also farther apart, as a tracker has them after a gap; only pairs that are near enough to be linked,
or else what is trivially different would swamp the rest; the earlier thing carried on by its own motion; a threshold
that each round chooses; both kinds of pairs weighing the same; similarities counted between the levels that are
usual for different and for same pairs.
"""

from __future__ import annotations

from perdure.learn.contexts import Learnt, context_of, learn, link_similarity
from perdure.learn.learning import PAPER, Learning
from perdure.learn.samples import Film, Samples

__all__ = ["PAPER", "Film", "Learning", "Learnt", "Samples", "context_of", "learn", "link_similarity"]

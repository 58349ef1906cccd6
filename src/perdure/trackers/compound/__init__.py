"""Compound targets: identities that survive meetings, splits and occlusions.

F. Brémond and M. Thonnat, *Tracking multiple non-rigid objects in video sequences*. A target is a box of mean size
round five generic points with a polygonal trajectory; what cannot be decided yet is frozen in a compound target, which
is tracked as a whole until somebody moves away. docs/compound-targets.md says where each paragraph stands, what the
paper leaves open, and where we depart from it: inside a compound every member is believed in a place of its own,
fitted into the common silhouette, so that the rows of each person go on while the group is one region.
"""

from perdure.trackers.compound.tracker import Compound, CompoundState

__all__ = ["Compound", "CompoundState"]

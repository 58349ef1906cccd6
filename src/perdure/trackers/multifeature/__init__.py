"""The multi-feature tracker (Chau, Brémond, Thonnat): eight cues, weights learnt for each context."""

from perdure.trackers.multifeature.tracker import MultiFeature, MultiFeatureState

__all__ = ["MultiFeature", "MultiFeatureState"]

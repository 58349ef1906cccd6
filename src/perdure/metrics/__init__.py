"""Tracks against tracks: numbers."""

from perdure.metrics.scoring import Score, score

__all__ = ["Score", "score"]

"""The contour observer: a deforming shape followed through occlusion (Jackson, Yezzi & Soatto)."""

from perdure.trackers.contour.tracker import Contour, ContourState

__all__ = ["Contour", "ContourState"]

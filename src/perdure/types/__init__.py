"""The nouns: Frame, Mask, Outline, Regions, Tracks, Event, Report, Scene, Status.

*Seen* is `Regions`, *believed* is a tracker's own state, *said* is `Tracks`: three words, three types.
All are frozen, their arrays read-only. Boxes are (N, 4) float32 `x1 y1 x2 y2`, half-open, in pixels.
"""

from perdure.types.arrays import Bits, Boxes, Image
from perdure.types.frame import PER_PIXEL, Frame, Mask, Outline
from perdure.types.regions import Regions
from perdure.types.report import Dropped, Event, Explanation, Renamed, Report
from perdure.types.rows import Rows, Use
from perdure.types.scene import Scene
from perdure.types.tracks import TRACK_COLUMNS, Ground, Status, Tracks

__all__ = [
    "PER_PIXEL",
    "TRACK_COLUMNS",
    "Bits",
    "Boxes",
    "Dropped",
    "Event",
    "Explanation",
    "Frame",
    "Ground",
    "Image",
    "Mask",
    "Outline",
    "Regions",
    "Renamed",
    "Report",
    "Rows",
    "Scene",
    "Status",
    "Tracks",
    "Use",
]

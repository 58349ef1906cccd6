"""Frame and tracks to a picture; no file is touched here."""

from perdure.draw.colours import colour_of
from perdure.draw.marks import Mark
from perdure.draw.paint import paint
from perdure.draw.trails import Trails

__all__ = ["Mark", "Trails", "colour_of", "paint"]

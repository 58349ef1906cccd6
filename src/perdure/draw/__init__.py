"""Frame and tracks to a picture; no file is touched here."""

from perdure.draw.colours import colour_of
from perdure.draw.paint import paint
from perdure.draw.trails import Trails

__all__ = ["Trails", "colour_of", "paint"]

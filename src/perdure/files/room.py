"""How much room silhouettes may take: run lengths of a few bytes can say very many pixels."""

from __future__ import annotations

from collections.abc import Iterable

from perdure.types import Mask

_LEAST, _EACH = 1 << 28, 1 << 16  # px, of any file, and for each of its bytes


class Room:
    """The pixels that the silhouettes of a file may have, all together.

    Parameters
    ----------
    size : int
        Bytes of the file.
    """

    def __init__(self, size: int) -> None:
        self._left = max(_LEAST, _EACH * size)

    def keep(self, mask: Mask) -> Mask:
        """Return a silhouette for which there is room; ValueError if there is none."""
        self.take([mask.bits.size])
        return mask

    def take(self, areas: Iterable[int]) -> None:
        """Take the room of areas in pixels; ValueError if there is none."""
        self._left -= sum(areas)
        if self._left < 0:
            raise ValueError("its silhouettes unfold into more pixels than a file of this size may hold")

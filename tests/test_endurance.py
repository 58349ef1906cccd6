"""Long runs; `pytest -m slow` runs them, and so does CI."""

from __future__ import annotations

from pathlib import Path

import pytest
from memory import peak, repeat
from test_cli import write_film
from worlds import crossing


@pytest.mark.slow
def test_memory_does_not_grow_with_the_length_of_the_video(tmp_path: Path):
    """Twenty thousand frames take no more than a tenth more memory than two thousand."""
    film = write_film(tmp_path / "film.avi", [frame.image for frame in crossing().frames()])
    peaks = {}
    for length in (2_000, 20_000):
        long = tmp_path / f"{length}.avi"
        repeat(film, long, length)
        peaks[length], frames = peak(long, tmp_path / str(length), film=False)
        assert frames == length
    assert peaks[20_000] <= 1.1 * peaks[2_000], peaks

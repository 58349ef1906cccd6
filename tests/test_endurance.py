"""Long runs: of some thousand frames by `pytest -m slow`, the longest, which take an hour, by `pytest -n 0 -m endless`."""

from __future__ import annotations

from pathlib import Path

import endurance
import pytest
from memory import peak, repeat
from test_cli import write_film
from worlds import crossing

from perdure.trackers import TRACKERS

LENGTHS = {"overlap": 200_000, "compound": 200_000}  # frames; 5 000 of the others


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


@pytest.mark.endless
@pytest.mark.parametrize("tracker", TRACKERS)
def test_neither_memory_nor_the_work_for_a_frame_grows_along_a_video(tmp_path: Path, tracker: str):
    length = LENGTHS.get(tracker, 5_000)
    repeat(endurance.meeting(tmp_path / "film.avi"), tmp_path / "long.avi", length)
    endured = endurance.endure(tmp_path / "long.avi", tmp_path / "run", ["--tracker", tracker])
    assert endured.frames == length
    assert endured.memory_growth <= 0.05, endured.looks
    assert endured.time_growth <= 0.25, endured.looks


@pytest.mark.slow
def test_memory_does_not_grow_along_a_thousand_frames(tmp_path: Path):
    repeat(endurance.meeting(tmp_path / "film.avi"), tmp_path / "long.avi", 1_000)
    endured = endurance.endure(tmp_path / "long.avi", tmp_path / "run", ["--tracker", "overlap"])
    assert endured.frames == 1_000
    assert endured.memory_growth <= 0.05, endured.looks


def test_growth_is_told_between_the_second_and_the_last_fifth():
    looks = [endurance.Look(seconds=k * (1 + k / 100), frames=k, mib=100 + k) for k in range(101)]
    growing = endurance.Endured(tuple(looks), 100, 0.0)
    assert growing.memory_growth == pytest.approx(200 / 140 - 1)
    assert growing.time_growth == pytest.approx((1 + 1.8) / (1 + 0.6) - 1)
    level = endurance.Endured(tuple(endurance.Look(k / 9, k, 50.0) for k in range(101)), 100, 0.0)
    assert (level.memory_growth, level.time_growth) == (0.0, pytest.approx(0.0))

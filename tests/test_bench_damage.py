"""The bench that harms films: what it does to bytes, what it makes of a run, and a few places in each kind by `-m slow`."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from pathlib import Path

import damage
import pytest
from test_cli import perdure

BENCH = Path(damage.__file__)


def test_a_harm_is_a_cut_a_bit_or_a_stretch_and_the_same_for_a_seed():
    content = bytes(3000)
    for way in (0, 1, 2):
        one, same = (damage._harm(way, 0.4, len(content), random.Random(8)) for _ in range(2))
        assert one.words == same.words
        harmed = one.harmed(content)
        assert harmed == same.harmed(content) != content
        assert len(harmed) == (1200 if way == 0 else 3000)
        assert sum(byte.bit_count() for byte in harmed) == (way == 1) or way == 2


def test_a_run_that_is_shorter_and_says_nothing_is_found_out(tmp_path: Path):
    film = damage.yuv4mpeg(tmp_path / "film")
    film.write_bytes(film.read_bytes()[: 14_406 * 30])
    done = perdure("track", film.name, "-o", "run", "--no-video", "--tracker", "overlap", at=tmp_path)
    assert done.returncode == 0, done.stderr
    lines, rows = done.stderr.splitlines(), (tmp_path / "run" / "tracks.txt").read_bytes()
    assert damage._verdict(0, done.stderr, lines, tmp_path / "run", rows) == "told"
    assert damage._verdict(0, "", [], tmp_path / "run", rows) == "shorter"
    assert damage._verdict(3, "", ["perdure: film breaks off"], tmp_path / "run", rows) == "told"
    assert damage._verdict(2, "", ["perdure: no film"], tmp_path / "run", rows) == "unreadable"  # it left a folder
    assert damage._verdict(2, "", ["perdure: no film"], tmp_path / "none", rows) == "refused"
    assert damage._verdict(1, "Traceback", [], tmp_path / "run", rows) == "crash"
    assert damage._verdict(-11, "", [], tmp_path / "run", rows) == "crash"
    assert damage._verdict(None, "", [], tmp_path / "run", rows) == "hang"
    (tmp_path / "run" / "tracks.jsonl").write_text("no log\n")
    assert damage._verdict(0, "", [], tmp_path / "run", rows) == "unreadable"


@pytest.mark.slow
def test_no_damage_crashes_hangs_or_goes_untold():
    kinds = ("mp4-first", "mkv-h264", "webm-vp9", "avi-mjpeg", "ts-h264", "flv-h264", "y4m", "png", "jpg")
    words = [sys.executable, str(BENCH), *kinds, "--places", "4", "--seed", "3", "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    figures = json.loads(done.stdout.splitlines()[-1])
    assert set(figures) == set(kinds)
    assert all(one["places"] == 12 and one["told"] + one["refused"] > 0 for one in figures.values())

"""MOTChallenge text: frames and pixels count from 1 there, from 0 here."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from perdure.errors import FormatError
from perdure.files.mot import read_detections, read_tracks, write_rows
from perdure.types import Tracks


def test_the_first_pixel_of_the_first_frame_is_1_1_1():
    out = io.StringIO()
    write_rows(out, Tracks.of(frames=0, times=0.0, ids=[3], boxes=[[0, 0, 10, 20]], confidence=[0.5]))
    assert out.getvalue() == "1,3,1.00,1.00,10.00,20.00,0.5,-1,-1,-1\n"


def test_rows_read_back_as_they_were_written(tmp_path: Path):
    boxes = np.float32([[0, 0, 10, 20], [5.25, -3.5, 7, 8]])
    rows = Tracks.of(frames=[0, 7], times=[0.0, 0.7], ids=[1, 2], boxes=boxes, confidence=np.float32([1, 0.25]))
    out = io.StringIO()
    write_rows(out, rows)
    (tmp_path / "t.txt").write_text(out.getvalue())
    assert read_tracks(tmp_path / "t.txt", fps=10).equals(rows)


def test_detections_are_found_by_frame_from_0(tmp_path: Path):
    (tmp_path / "det.txt").write_text("2,-1,1,1,10,20,0.5\n1,-1,11,1,10,20,0.75\n2,-1,21,1,10,20,0.25\n")
    regions = read_detections(tmp_path / "det.txt")
    assert regions[0].boxes.tolist() == [[10, 0, 20, 20]]
    assert regions[1].scores.tolist() == [0.5, 0.25]


def test_scores_beyond_one_are_brought_into_range(tmp_path: Path):
    (tmp_path / "det.txt").write_text("1,-1,1,1,9,9,-10\n1,-1,1,1,9,9,30\n1,-1,1,1,9,9,10\n")
    assert read_detections(tmp_path / "det.txt")[0].scores.tolist() == [0.0, 1.0, 0.5]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("1,-1,a,1,9,9,1", "'a' is no number"),
        ("1,,1,1,9,9,1", "cell 2 is empty"),
        ("1,-1,1, ,9,9,1", "cell 4 is empty"),
        ("1,-1,1,1,9,9,,", "cell 7 is empty"),
        (",1,-1,1,1,9,9", "cell 1 is empty"),
        ("1,-1,1 1,9,9,1", "'1 1' is no number"),
        ("1e300,-1,1,1,9,9,1", "frame 1e\\+300"),
        ("1,-1,9e5,1,9e5,9,1", "cannot be"),
        ("1,-1,1,1,9,9,1e300", "cannot be"),
        ("1,-1,1,1,9", "is not frame, id"),
        ("0,-1,1,1,9,9,1", "frame 0"),
        ("1.5,-1,1,1,9,9,1", "frame 1.5"),
        ("1,-1,1,1,-9,9,1", "cannot be"),
        ("1,-1,nan,1,9,9,1", "is not frame"),
        ("1,-1,1e30,1,9,9,1", "cannot be"),
        ("1,-1,1,1,9,9,1,1", "8 columns"),
    ],
)
def test_a_line_that_is_no_box_is_named(tmp_path: Path, line: str, said: str):
    (tmp_path / "det.txt").write_text(f"1,-1,1,1,9,9,1\n{line}\n")
    with pytest.raises(FormatError, match=f"line 2.*{said}"):
        read_detections(tmp_path / "det.txt")


def test_an_empty_file_holds_no_detections(tmp_path: Path):
    (tmp_path / "det.txt").write_text("")
    assert read_detections(tmp_path / "det.txt") == {}


def test_one_comma_may_end_a_line(tmp_path: Path):
    (tmp_path / "det.txt").write_text("1,-1,1,1,10,20,0.5,\n1, -1, 11, 1, 10, 20, 0.5\n")
    assert read_detections(tmp_path / "det.txt")[0].boxes.tolist() == [[0, 0, 10, 20], [10, 0, 20, 20]]


def test_blanks_may_stand_for_commas(tmp_path: Path):
    (tmp_path / "det.txt").write_text("1 -1 1 1 10  20\n1\t-1 11 1 10 20\n")
    assert read_detections(tmp_path / "det.txt")[0].boxes.tolist() == [[0, 0, 10, 20], [10, 0, 20, 20]]

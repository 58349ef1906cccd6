"""MOTChallenge text: frames and pixels count from 1 there, from 0 here."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from perdure.errors import FormatError
from perdure.files import mot_table
from perdure.files.mot import protocol_of, read_detections, read_said, read_tracks, read_truth, write_rows
from perdure.files.mot_table import read_lines, read_table
from perdure.types import Tracks, Use


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


# Truths and results, for scores -----------------------------------------------------------------------------


def uses(path: Path, protocol: str = "auto") -> dict[int, Use]:
    rows = read_truth(path, protocol)
    return {int(identity): Use(use) for identity, use in zip(rows.ids, rows.use, strict=True)}


def test_rows_of_mot15_with_flag_0_are_not_asked_for(tmp_path: Path):
    (tmp_path / "gt.txt").write_text("1,1,1,1,9,9,1,-1,-1,-1\n1,2,1,1,9,9,0,-1,-1,-1\n1,3,1,1,9,9,-1,-1,-1,-1\n")
    assert uses(tmp_path / "gt.txt") == {1: Use.SCORED, 2: Use.IGNORED, 3: Use.SCORED}


def test_of_mot17_only_flagged_pedestrians_are_asked_for_and_distractors_excuse(tmp_path: Path):
    rows = [f"1,{kind},1,1,9,9,1,{kind},1" for kind in range(1, 14)] + ["1,14,1,1,9,9,0,1,1"]
    (tmp_path / "gt.txt").write_text("\n".join(rows))
    found = uses(tmp_path / "gt.txt")
    assert [kind for kind, use in found.items() if use == Use.SCORED] == [1]
    assert [kind for kind, use in found.items() if use == Use.DISTRACTOR] == [2, 7, 8, 12]
    assert found[14] == Use.IGNORED
    assert uses(tmp_path / "gt.txt", "mot20")[6] == Use.DISTRACTOR
    assert set(uses(tmp_path / "gt.txt", "mot15").values()) == {Use.SCORED, Use.IGNORED}


def test_nine_columns_whose_eighth_is_no_class_are_mot15(tmp_path: Path):
    (tmp_path / "gt.txt").write_text("1,1,1,1,9,9,1,-1,-1\n")
    assert protocol_of(read_table(tmp_path / "gt.txt")) == "mot15"


def test_a_protocol_of_classes_wants_a_class(tmp_path: Path):
    (tmp_path / "gt.txt").write_text("1,1,1,1,9,9,1\n")
    with pytest.raises(FormatError, match="no class in an 8th column"):
        read_truth(tmp_path / "gt.txt", "mot17")


def test_boxes_for_scores_keep_every_digit(tmp_path: Path):
    (tmp_path / "t.txt").write_text("3,1,100.123456789,7.25,10.5,20,1\n")
    rows = read_said(tmp_path / "t.txt")
    assert rows.boxes[0].tolist() == [100.123456789 - 1, 6.25, 100.123456789 - 1 + 10.5, 26.25]
    assert rows.frames.tolist() == [2]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1,-1,1,1,9,9,1\n", "line 1: id -1 is not a whole number ≥ 1; these are detections"),
        ("1,1,1,1,9,9,1\n\n2,1.5,1,1,9,9,1\n", "line 3: id 1.5"),
        ("1,0,1,1,9,9,1\n", "line 1: id 0 "),
        (
            "1,4,1,1,9,9,1\n2,4,1,1,9,9,1\n\n1,4,5,5,9,9,1\n",
            "line 4: id 4 stands twice in frame 1, first in line 1",
        ),
    ],
)
def test_a_row_that_cannot_be_scored_is_named_with_its_line(tmp_path: Path, text: str, said: str):
    (tmp_path / "t.txt").write_text(text)
    with pytest.raises(FormatError, match=re.escape(said)):
        read_said(tmp_path / "t.txt")


def test_blank_lines_do_not_shift_the_numbers_of_lines(tmp_path: Path):
    (tmp_path / "t.txt").write_text("\n1,1,1,1,9,9,1\n\n \n2,1,1,1,9,9,1\n")
    assert read_table(tmp_path / "t.txt").lines.tolist() == [2, 5]


@given(
    some.lists(
        some.tuples(
            some.sampled_from(["1", "2", "0", "1.5", "nan", "1e10", "x", ""]),
            some.sampled_from(["1", "-1", "2.5", "1e308", " 7 "]),
            some.sampled_from(["10", "-3.5", "inf", "1e9", "0x10", "1_0"]),
            some.sampled_from(["5", "0", "-1", "1e-320", "99999999"]),
        ),
        max_size=4,
    ),
    some.sampled_from([",", " ", ", "]),
)
def test_reading_at_once_and_line_by_line_agree(tmp_path_factory, rows, separator):
    path = tmp_path_factory.mktemp("mot") / "t.txt"
    path.write_text("\n".join(separator.join([*row, "5", "5", "1"]) for row in rows))
    lines = [(number, line) for number, line in enumerate(read_lines(path), 1) if line.strip()]
    try:
        careful = mot_table._carefully(path, lines)
    except FormatError as error:
        with pytest.raises(FormatError, match=re.escape(str(error))):
            read_table(path)
    else:
        assert np.array_equal(read_table(path).values, careful)

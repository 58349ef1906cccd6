"""What the user marks: what is drawn is what is marked, and what cannot be is refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from perdure.errors import FormatError, ParameterError, PerdureError
from perdure.files.marks import read_marks
from perdure.types import Scene

SCENE, FRAMES = Scene(6, 4), range(40)


def picture(*rows: str) -> np.ndarray:
    """'.' is 0, a digit itself, '#' 255."""
    return np.array([[{".": 0, "#": 255}.get(one) or int(one.replace(".", "0")) for one in row] for row in rows])


def write(path: Path, values: np.ndarray, kind: type = np.uint8) -> str:
    cv2.imwrite(str(path), values.astype(kind))
    return str(path)


def drawn(mask) -> list[str]:
    return ["".join(".#"[int(bit)] for bit in row) for row in mask.to_image(4, 6)]


TWO = picture("......", ".11...", ".11.7.", "....7.")


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_the_value_of_a_pixel_is_the_id_in_8_and_16_bits(tmp_path: Path, kind: type) -> None:
    one, other = read_marks(write(tmp_path / "m.png", TWO, kind) + "@12", SCENE, FRAMES)
    assert (one.id, one.frame, one.rough, one.box) == (1, 12, False, (1, 1, 3, 3))
    assert (other.id, other.frame, other.box) == (7, 12, (4, 2, 5, 4))
    assert drawn(one.mask) == ["......", ".##...", ".##...", "......"]


def test_the_index_of_a_palette_counts_and_not_its_colour(tmp_path: Path) -> None:
    import struct
    import zlib

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    rows = b"".join(b"\0" + bytes(row) for row in TWO.astype(np.uint8))
    palette = bytes([0, 0, 0] + [200, 0, 0] * 9)
    parts = [(b"IHDR", struct.pack(">IIBBBBB", 6, 4, 8, 3, 0, 0, 0)), (b"PLTE", palette)]
    parts += [(b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    (tmp_path / "p.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts))
    assert [mark.id for mark in read_marks(tmp_path / "p.png", SCENE, FRAMES)] == [1, 7]


def test_a_black_and_white_mask_is_one_thing_with_the_next_free_id(tmp_path: Path) -> None:
    white = write(tmp_path / "w.png", picture("......", "......", "......", "###..."))
    marks = read_marks([white, write(tmp_path / "m.png", TWO)], SCENE, FRAMES)
    assert [(mark.id, mark.box) for mark in marks] == [(2, (0, 3, 3, 4)), (1, (1, 1, 3, 3)), (7, (4, 2, 5, 4))]


def test_255_beside_ids_is_void(tmp_path: Path) -> None:
    marks = read_marks(write(tmp_path / "v.png", picture("......", ".11###", ".11###", "......")), SCENE, FRAMES)
    assert [mark.id for mark in marks] == [1]


def test_boxes_and_polygons_have_ids_in_their_order_and_are_cut_to_the_picture() -> None:
    box, polygon = read_marks(["4,-2,9,4@3", "0,0 2,0 2,2 1,1 0,2"], SCENE, FRAMES)
    assert (box.id, box.frame, box.box, box.rough, box.mask) == (1, 3, (4, 0, 6, 2), True, None)
    assert (polygon.id, polygon.frame, polygon.rough) == (2, 0, False)


def test_four_corners_are_drawn_around_a_thing_and_more_along_it() -> None:
    around, along = read_marks(["0,0 2,0 2,2 0,2", "3,0 5,0 5,2 4,2 3,2"], SCENE, FRAMES)
    assert (around.rough, along.rough) == (True, False)


def test_arrays_are_index_pictures_of_any_whole_number() -> None:
    assert [mark.frame for mark in read_marks((TWO.astype(np.int32), np.int64(3)), SCENE, FRAMES)] == [3, 3]
    marks = read_marks([(TWO.astype(np.int64), 5), TWO == 1], SCENE, FRAMES)
    assert [(mark.id, mark.frame) for mark in marks] == [(1, 5), (7, 5), (2, 0)]


def test_one_thing_may_be_marked_in_several_frames(tmp_path: Path) -> None:
    name = write(tmp_path / "m.png", TWO)
    assert [(mark.id, mark.frame) for mark in read_marks([name, f"{name}@9"], SCENE, FRAMES)] == [
        (1, 0),
        (7, 0),
        (1, 9),
        (7, 9),
    ]


def test_a_name_may_hold_an_at_sign(tmp_path: Path) -> None:
    name = write(tmp_path / "me@home.png", TWO)
    assert [mark.frame for mark in read_marks([name, f"{name}@9"], SCENE, FRAMES)] == [0, 0, 9, 9]


@pytest.mark.parametrize(
    ("name", "values", "reason"),
    [
        ("e.png", np.zeros((4, 6)), "mask is empty"),
        ("f.png", np.full((4, 6), 3), "covers 100.0 % of the picture"),
        ("w.png", np.full((4, 6), 255), "covers 100.0 % of the picture"),
        ("l.png", np.ones((8, 6)), "the mask is 6x8, the video 6x4"),
        ("c.png", np.eye(6)[:4, :, None] * np.array([1, 2, 3]), "in colour"),
        ("s.png", np.arange(24).reshape(4, 6), "soft edges"),
        ("j.jpg", np.ones((4, 6)), "is not a PNG"),
    ],
)
def test_a_mask_that_cannot_be_is_refused_by_name_and_reason(tmp_path: Path, name, values, reason) -> None:
    with pytest.raises(FormatError if "covers" not in reason else ParameterError, match=reason) as refused:
        read_marks(write(tmp_path / name, values), SCENE, FRAMES)
    assert str(refused.value).startswith("init = ")
    assert name in str(refused.value)


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ("gone.png", "no such file"),
        ("1,2,3", "no box and no polygon"),
        ("", "no file"),
        ("9,0,2,2", "no pixel inside the picture of 6x4"),
        ("1,1,0,2", "no pixel inside"),
        ("0,0 2,0 4,0", "no pixel inside"),
        ("9999999,1,1,1", "1000000"),
        ("0,0,6,4", "covers 100.0 %"),
        ("1,1,2,2@40", "frame 40 is not among those that are tracked, 0 to 39"),
        ("1,1,2,2@-1", "'-1' is no frame"),
        ("1,1,2,2@soon", "'soon' is no frame"),
        (("1,1,2,2", 1.5), "1.5 is no frame"),
        (5, "5 marks nothing"),
        (["1,1,2,2", None], "nothing marks nothing"),
        (np.full((4, 6), 0.5), "whole numbers"),
        (np.full((4, 6), -1), "not -1 to -1"),
        (np.full((4, 6), 70_000), "0 to 65535"),
        (np.ones((4, 6, 3), int), "must be"),
        (["1,1,2,2", "1,1,2,2"], "wholly under"),
        ([TWO.astype(int), TWO.astype(int)], "id 1 is marked twice in frame 0"),
        ((mark for mark in ["1,1,2,2"]), "marks nothing"),
    ],
)
def test_what_marks_nothing_is_refused_in_one_line(given, reason: str) -> None:
    with pytest.raises(PerdureError, match=reason) as refused:
        read_marks(given, SCENE, FRAMES)
    assert str(refused.value).startswith("init = ")
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 300


def test_only_frames_that_come_can_be_marked() -> None:
    assert read_marks("1,1,2,2@6", SCENE, range(4, 9, 2))[0].frame == 6
    with pytest.raises(ParameterError, match="0 is not among those that are tracked, 4 to 8 in steps of 2"):
        read_marks("1,1,2,2", SCENE, range(4, 9, 2))
    with pytest.raises(ParameterError, match="source is empty"):
        read_marks("1,1,2,2", SCENE, range(0))
    with pytest.raises(ParameterError, match="passes only once"):
        read_marks("1,1,2,2@1", SCENE, None)


def test_a_mark_outside_the_roi_is_refused() -> None:
    roi = np.zeros((4, 6), bool)
    roi[:, :3] = True
    assert len(read_marks("1,1,3,2", Scene(6, 4, roi=roi), FRAMES)) == 1
    with pytest.raises(ParameterError, match="outside the roi"):
        read_marks("4,1,2,2", Scene(6, 4, roi=roi), FRAMES)

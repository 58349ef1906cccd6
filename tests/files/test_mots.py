"""MOTS text: silhouettes as run lengths; frames count from 1 there, from 0 here."""

from __future__ import annotations

import contextlib
import io
import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycocotools import mask as coco

from perdure.errors import FormatError
from perdure.features.masks import of_picture_runs
from perdure.files.mots import read_masks, unpacked_runs, write_masks
from perdure.types import Mask, Rows, Tracks, Use

pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # of coco.decode
HEIGHT, WIDTH = 7, 9
LETTERS = [chr(code) for code in range(ord("0"), ord("o") + 1)]


@st.composite
def pictures(draw):
    height, width = draw(st.integers(1, 12)), draw(st.integers(1, 12))
    bits = draw(st.lists(st.booleans(), min_size=height * width, max_size=height * width))
    return np.array(bits).reshape(height, width)


def rle(picture: np.ndarray) -> str:
    return coco.encode(np.asfortranarray(picture, np.uint8))["counts"].decode()


def drawn(y: int, x: int, height: int, width: int) -> np.ndarray:
    return Mask(y, x, np.ones((height, width), bool)).to_image(HEIGHT, WIDTH)


def line(frame: int = 1, identity: int = 1, kind: int = 2, picture: np.ndarray | None = None) -> str:
    picture = drawn(2, 3, 4, 2) if picture is None else picture
    return f"{frame} {identity} {kind} {picture.shape[0]} {picture.shape[1]} {rle(picture)}\n"


def read(folder: Path, text: str) -> Rows:
    (folder / "masks.txt").write_text(text)
    return read_masks(folder / "masks.txt")


def written(rows: Tracks, height: int = HEIGHT, width: int = WIDTH) -> str:
    out = io.StringIO()
    write_masks(out, rows, height, width)
    return out.getvalue()


def said(frames: list[int], ids: list[int], masks: list[Mask]) -> Tracks:
    return Tracks.of(frames=frames, times=0.0, ids=ids, boxes=[mask.box for mask in masks], masks=masks)


def test_a_silhouette_is_a_tight_crop_with_its_box_in_the_frame_before_the_one_named(tmp_path: Path):
    rows = read(tmp_path, line(frame=3, identity=5))
    assert (rows.frames.tolist(), rows.ids.tolist(), rows.size) == ([2], [5], (HEIGHT, WIDTH))
    assert rows.masks == (Mask(2, 3, np.ones((4, 2), bool)),)
    assert rows.boxes.tolist() == [[3, 2, 5, 6]]


def test_frames_may_come_in_any_order(tmp_path: Path):
    assert read(tmp_path, line(frame=9) + "\n" + line(frame=2)).frames.tolist() == [1, 8]


def test_class_10_is_an_area_and_no_object_whatever_its_id(tmp_path: Path):
    rows = read(tmp_path, line() + line(identity=1, kind=10) + line(identity=-1, kind=10) * 2)
    assert rows.use.tolist() == [Use.SCORED, Use.REGION, Use.REGION, Use.REGION]


def test_objects_of_a_truth_may_overlap(tmp_path: Path):
    both = read(tmp_path, line(identity=1) + line(identity=2)).masks
    assert both[0] == both[1]


def test_an_empty_file_holds_no_rows(tmp_path: Path):
    rows = read(tmp_path, "\n")
    assert (len(rows), rows.size) == (0, None)


def test_a_silhouette_without_a_pixel_is_read_as_none_and_not_written(tmp_path: Path):
    assert read(tmp_path, line(picture=np.zeros((HEIGHT, WIDTH)))).masks == (Mask.empty(),)
    assert written(said([0], [1], [Mask.empty()])) == ""


@given(pictures())
def test_any_picture_reads_as_it_was_packed_and_is_packed_as_pycocotools_packs_it(picture: np.ndarray):
    height, width = picture.shape
    mask = Mask.of_image(picture)
    text = written(said([0], [1], [mask]), height, width)
    assert text == (f"1 1 2 {height} {width} {rle(picture)}\n" if mask.area else "")
    runs = unpacked_runs(rle(picture))
    assert np.array_equal(np.repeat(np.arange(len(runs)) % 2, runs), picture.ravel(order="F"))


@given(pictures())
def test_what_was_written_reads_back(tmp_path_factory: pytest.TempPathFactory, picture: np.ndarray):
    folder = tmp_path_factory.mktemp("mots")
    mask = Mask.of_image(picture)
    rows = read(folder, written(said([3, 7], [1, 2], [mask, mask]), *picture.shape))
    assert list(rows.masks) == ([mask] * 2 if mask.area else [])


def test_a_silhouette_that_leaves_the_picture_is_cut(tmp_path: Path):
    whole = Mask(-2, -3, np.ones((HEIGHT + 4, 5), bool))
    assert read(tmp_path, written(said([0], [1], [whole]))).masks == (Mask(0, 0, np.ones((HEIGHT, 2), bool)),)


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ("1 1 2 7 9", "5 words; wanted are frame, id, class, height, width, rle"),
        ("1 1 2 7 9 o 3", "7 words"),
        ("1 one 2 7 9 o", "the id 'one' is not a whole number"),
        ("1.5 1 2 7 9 o", "the frame '1.5' is not a whole number"),
        ("٣ 1 2 7 9 o", "the frame '٣' is not a whole number"),
        ("1 1 2 7 " + "9" * 5000 + " o", "the width '9999"),
        ("0 1 2 7 9 o1", "frame 0 is not"),
        ("1 0 2 7 9 o1", "id 0 is below 1"),
        ("1 1 2 0 9 o1", "a picture of 9x0 cannot be"),
        ("1 1 2 65537 1 o1", "a picture of 1x65537 cannot be"),
        ("1 1 2 20000 20000 o1", "a picture of 20000x20000 cannot be"),
        ("1 7 2 9 7 o1", "its picture is 7x9, the first line's 9x7"),
        ("1 4 2 7 9 o1", "frame 1 has id 4 in line 1 already"),
        ("1 1 2 7 9 n1", "the runs do not fill a picture of 9x7"),
        ("1 1 2 7 9 P2", "the runs do not fill"),
        ("1 1 2 7 9 5O5j1", "the runs do not fill"),
        ("1 1 2 7 9 o1é", "a letter that none may hold"),
        ("1 1 2 7 9 o1!", "a letter that none may hold"),
        ("1 1 2 7 9 o1p", "a letter that none may hold"),
        ("1 1 2 7 9 o", "ends in the midst of a number"),
        ("1 1 2 7 9 ooooooo1", "a number that is too large"),
        ("1 1 2 7 9 " + "oooooo?" * 9, "do not fill"),
    ],
)
def test_a_line_that_is_no_silhouette_is_named_with_the_reason(tmp_path: Path, wrong: str, why: str):
    with pytest.raises(FormatError, match="line 2") as refused:
        read(tmp_path, line(identity=4) + wrong + "\n")
    assert why in str(refused.value)


@pytest.mark.parametrize(("content", "why"), [(b"\xff\xfe\x00", "not text"), (None, "No such file")])
def test_a_file_that_cannot_be_read_is_named(tmp_path: Path, content: bytes | None, why: str):
    if content is not None:
        (tmp_path / "masks.txt").write_bytes(content)
    with pytest.raises(FormatError, match=rf"masks\.txt.*{why}"):
        read_masks(tmp_path / "masks.txt")


@given(st.text(st.sampled_from(LETTERS), min_size=1, max_size=12), st.integers(1, 40), st.integers(1, 40))
def test_letters_in_any_order_are_refused_or_read_as_pycocotools_reads_them(text: str, height: int, width: int):
    refused_or_read(text, height, width)


@given(pictures(), st.randoms(use_true_random=False))
def test_a_packed_picture_with_changed_letters_is_refused_or_read(picture: np.ndarray, chance: random.Random):
    letters = list(rle(picture))
    for _ in range(chance.randint(1, 3)):
        letters[chance.randrange(len(letters))] = chance.choice(LETTERS)
    refused_or_read("".join(letters), *picture.shape)


@given(st.text(max_size=60))
def test_any_text_is_refused_or_read(tmp_path_factory: pytest.TempPathFactory, text: str):
    path = tmp_path_factory.getbasetemp() / "any.txt"
    path.write_text(text, encoding="utf-8")
    with contextlib.suppress(FormatError):
        read_masks(path)


def refused_or_read(text: str, height: int, width: int) -> None:
    try:
        mask = of_picture_runs(unpacked_runs(text), height, width)
    except ValueError:
        return
    theirs = coco.decode({"size": [height, width], "counts": text.encode()}).astype(bool)
    assert np.array_equal(mask.to_image(height, width), theirs)
    assert mask == Mask.of_image(theirs)

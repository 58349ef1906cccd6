"""Folders of index PNGs: the value of a pixel is an id."""

from __future__ import annotations

import os
import random
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perdure.errors import FormatError, OutputError
from perdure.files.mask_pngs import pictures_in, read_masks, write_masks
from perdure.types import Mask, Tracks, Use

DATA = Path(os.environ.get("PERDURE_DATA", Path(__file__).parents[3] / "shared/data"))
GREY, PALETTE = 0, 3
PICTURE = np.array([[0, 0, 1, 1], [2, 0, 1, 0], [2, 2, 0, 0]], np.uint8)


def chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png(picture: np.ndarray, colours: int = GREY, bits: int = 8, packed: bytes | None = None) -> bytes:
    """Encode a picture of indices, by the book."""
    height, width = picture.shape
    lines = []
    for line in picture:
        if bits == 16:
            lines.append(line.astype(">u2").tobytes())
        else:
            spread = (line[:, None] >> np.arange(bits)[::-1]) & 1
            lines.append(np.packbits(spread.astype(np.uint8)).tobytes())
    palette = chunk(b"PLTE", bytes([9, 9, 9, 255, 0, 0, 255, 0, 0, 9, 9, 9])) + chunk(b"tRNS", b"\0")
    return b"".join(
        [
            b"\x89PNG\r\n\x1a\n",
            chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, colours, 0, 0, 0)),
            palette if colours == PALETTE else chunk(b"gAMA", struct.pack(">I", 45455)),
            chunk(b"IDAT", zlib.compress(b"".join(b"\0" + line for line in lines)) if packed is None else packed),
            chunk(b"IEND", b""),
        ]
    )


def put(folder: Path, **pictures: bytes) -> Path:
    for name, encoded in pictures.items():
        (folder / f"{name.strip('_')}.png").write_bytes(encoded)
    return folder


def said(frame: int, *ids_and_masks: tuple[int, Mask]) -> tuple[int, Tracks]:
    ids, masks = zip(*ids_and_masks, strict=True)
    return frame, Tracks.of(frames=frame, times=0.0, ids=ids, boxes=[mask.box for mask in masks], masks=masks)


def test_the_value_of_a_pixel_is_the_id_of_what_is_seen_there(tmp_path: Path):
    rows = read_masks(put(tmp_path, _00004=png(PICTURE), _00007=png(np.zeros_like(PICTURE))))
    assert (rows.frames.tolist(), rows.ids.tolist(), rows.size) == ([4, 4], [1, 2], (3, 4))
    assert rows.masks == (Mask.of_image(PICTURE == 1), Mask.of_image(PICTURE == 2))
    assert rows.boxes.tolist() == [[2, 0, 4, 2], [0, 1, 2, 3]]
    assert rows.use.tolist() == [Use.SCORED, Use.SCORED]


@pytest.mark.parametrize(
    ("colours", "bits"), [(PALETTE, 2), (PALETTE, 4), (PALETTE, 8), (GREY, 2), (GREY, 4), (GREY, 8), (GREY, 16)]
)
def test_the_index_counts_whatever_its_colour_and_its_bits(tmp_path: Path, colours: int, bits: int):
    """Two of the palette's colours are the same."""
    picture = np.minimum(PICTURE * 3, 3 if bits == 2 or colours == PALETTE else 13)
    rows = read_masks(put(tmp_path, _0=png(picture, colours, bits)))
    assert rows.ids.tolist() == sorted({*picture.ravel().tolist()} - {0})
    assert [mask.area for mask in rows.masks] == [np.count_nonzero(picture == one) for one in rows.ids]


def test_a_palette_of_two_colours_has_one_bit_a_pixel(tmp_path: Path):
    rows = read_masks(put(tmp_path, _0=png(PICTURE == 2, PALETTE, 1)))
    assert (rows.ids.tolist(), rows.masks) == ([1], (Mask.of_image(PICTURE == 2),))


def test_16_bits_hold_large_ids(tmp_path: Path):
    rows = read_masks(put(tmp_path, _0=png(PICTURE.astype(np.uint16) * 30_000, GREY, 16)), void=True)
    assert rows.ids.tolist() == [30_000, 60_000]


def test_255_is_an_id_or_void_as_is_asked(tmp_path: Path):
    put(tmp_path, _0=png(np.where(PICTURE == 2, 255, PICTURE)), _1=png(np.where(PICTURE == 2, 255, 0)))
    assert read_masks(tmp_path).use.tolist() == [Use.SCORED] * 3
    rows = read_masks(tmp_path, void=True)
    assert (rows.ids.tolist(), rows.use.tolist()) == ([1, 255, 255], [Use.SCORED, Use.REGION, Use.REGION])


@pytest.mark.parametrize("void", [False, True])
def test_pictures_in_black_and_white_only_show_object_1(tmp_path: Path, void: bool):
    put(
        tmp_path, _0=png(np.where(PICTURE == 2, 255, 0)), _1=png(np.zeros_like(PICTURE)), _2=png(PICTURE * 0 + 255)
    )
    rows = read_masks(tmp_path, void=void)
    assert (rows.frames.tolist(), rows.ids.tolist(), rows.use.tolist()) == ([0, 2], [1, 1], [Use.SCORED] * 2)


def test_a_name_that_is_a_number_is_the_frame_and_else_the_place_counts(tmp_path: Path):
    put(tmp_path, _00002=png(PICTURE), _10=png(PICTURE))
    (tmp_path / "notes.txt").write_text("not a picture")
    assert [frame for frame, _ in pictures_in(tmp_path)] == [2, 10]
    put(tmp_path, img3=png(PICTURE))
    assert [(frame, path.stem) for frame, path in pictures_in(tmp_path)] == [(0, "00002"), (1, "10"), (2, "img3")]


def test_two_pictures_of_one_frame_are_refused(tmp_path: Path):
    with pytest.raises(FormatError, match="both frame 2"):
        read_masks(put(tmp_path, _02=png(PICTURE), _2=png(PICTURE)))


def test_a_picture_in_colour_is_refused_with_a_remedy(tmp_path: Path):
    red = np.zeros((3, 4, 3), np.uint8)
    red[1, 2, 2] = 9
    half = np.full((3, 4, 4), 255, np.uint8)
    half[0, 0, 3] = 128
    for colourful in (red, half):
        with pytest.raises(FormatError, match=r"0\.png is in colour .*palette's index"):
            read_masks(put(tmp_path, _0=cv2.imencode(".png", colourful)[1].tobytes()))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [3, 4])
def test_greys_that_were_saved_as_colours_are_ids(tmp_path: Path, kind: type, channels: int):
    picture = np.zeros((3, 4, channels), kind)
    picture[1:, 2:, :3] = 7
    picture[..., 3:] = np.iinfo(kind).max
    rows = read_masks(put(tmp_path, _0=cv2.imencode(".png", picture)[1].tobytes()))
    assert (rows.ids.tolist(), rows.masks[0].box) == ([7], (2, 1, 4, 3))


def test_a_picture_of_another_size_is_refused(tmp_path: Path):
    with pytest.raises(FormatError, match=r"1\.png is 3x4, the first picture 4x3"):
        read_masks(put(tmp_path, _0=png(PICTURE), _1=png(PICTURE.T)))


@pytest.mark.parametrize(
    "damage",
    [
        b"",
        b"\xff\xd8 a JPEG",
        png(PICTURE)[:-3],
        png(PICTURE)[:40],
        png(PICTURE).replace(b"IDAT", b"IDAU"),
        png(PICTURE, packed=b"nothing"),
        png(PICTURE, packed=zlib.compress(b"\0" * 5)),
        png(PICTURE, packed=zlib.compress(b"\7" * 15)),
        png(PICTURE, bits=3),
        b"\x89PNG\r\n\x1a\n" + chunk(b"IEND", b""),
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", b"") + chunk(b"IEND", b""),
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 1 << 30, 1 << 30, 8, 0, 0, 0, 0)),
    ],
)
def test_a_damaged_picture_is_named(tmp_path: Path, damage: bytes):
    with pytest.raises(FormatError, match=r"0\.png"):
        read_masks(put(tmp_path, _0=damage))


@given(st.randoms(use_true_random=False))
def test_any_changed_byte_is_noticed(tmp_path_factory: pytest.TempPathFactory, chance: random.Random):
    folder = tmp_path_factory.getbasetemp() / "changed"
    folder.mkdir(exist_ok=True)
    encoded = bytearray(png(PICTURE, PALETTE))
    encoded[chance.randrange(len(encoded))] ^= chance.randint(1, 255)
    with pytest.raises(FormatError, match=r"0\.png"):
        read_masks(put(folder, _0=bytes(encoded)))


def test_a_folder_without_a_picture_is_refused(tmp_path: Path):
    with pytest.raises(FormatError, match="holds no PNG"):
        read_masks(tmp_path)
    with pytest.raises(FormatError, match="No such file"):
        read_masks(tmp_path / "gone")


@pytest.mark.parametrize(("largest", "depth"), [(254, np.uint8), (255, np.uint16), (65_535, np.uint16)])
def test_what_was_written_reads_back_in_8_bits_or_16(tmp_path: Path, largest: int, depth: type):
    one, other = Mask.of_image(PICTURE == 1), Mask.of_image(PICTURE == 2)
    films = [said(3, (largest, one), (2, other)), said(5, (2, one), (7, Mask.empty()))]
    assert write_masks(tmp_path / "out", films, [3, 4, 5], 3, 4, largest_id=largest) == 3
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["000003.png", "000004.png", "000005.png", "out"]
    assert cv2.imread(str(tmp_path / "out/000004.png"), cv2.IMREAD_UNCHANGED).dtype == depth
    rows = read_masks(tmp_path / "out", void=True)
    assert (rows.frames.tolist(), rows.ids.tolist()) == ([3, 3, 5], [2, largest, 2])
    assert rows.masks == (other, one, one)
    assert set(rows.use.tolist()) == {Use.SCORED}


def test_silhouettes_are_cut_to_the_picture_and_a_pixel_goes_to_the_first_that_claims_it(tmp_path: Path):
    wide, whole = Mask(-1, -1, np.ones((3, 3), bool)), Mask(-5, -5, np.ones((20, 20), bool))
    write_masks(tmp_path / "out", [said(0, (1, wide), (2, whole))], [0], 3, 4, largest_id=2)
    drawn = cv2.imread(str(tmp_path / "out/000000.png"), cv2.IMREAD_UNCHANGED)
    assert drawn.tolist() == [[1, 1, 2, 2], [1, 1, 2, 2], [2, 2, 2, 2]]


def test_an_id_that_no_picture_can_hold_is_refused(tmp_path: Path):
    with pytest.raises(OutputError, match="65536 is too large"):
        write_masks(tmp_path / "out", [], [0], 3, 4, largest_id=65_536)
    with pytest.raises(OutputError, match="id 256 came where 255 was to be the largest"):
        write_masks(tmp_path / "out", [said(0, (256, Mask.of_image(PICTURE == 1)))], [0], 3, 4, largest_id=255)
    assert list(tmp_path.iterdir()) == []


def test_the_folder_appears_whole_or_not_at_all(tmp_path: Path):
    def broken():
        yield said(0, (1, Mask.of_image(PICTURE == 1)))
        raise FormatError("the log is damaged")

    write_masks(tmp_path / "out", [], [8], 3, 4, largest_id=1)
    for place, there in (("new", []), ("out", ["000008.png"])):
        with pytest.raises(FormatError):
            write_masks(tmp_path / place, broken(), [0, 1], 3, 4, largest_id=1, overwrite=True)
        assert [path.name for path in (tmp_path / place).glob("*")] == there
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_pictures_are_replaced_only_if_that_is_asked_and_by_all_the_new_ones(tmp_path: Path):
    write_masks(tmp_path / "out", [], [0, 1, 2], 3, 4, largest_id=1)
    with pytest.raises(OutputError, match="--overwrite"):
        write_masks(tmp_path / "out", [], [7], 3, 4, largest_id=1)
    write_masks(tmp_path / "out", [], [7], 3, 4, largest_id=1, overwrite=True)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["000007.png"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("name", ["photo.png", "00000.png", "000001.jpg", "notes.txt"])
def test_a_folder_that_holds_anything_else_is_never_replaced(tmp_path: Path, name: str):
    (tmp_path / name).write_text("precious")
    with pytest.raises(OutputError, match=f"other files .{name}"):
        write_masks(tmp_path, [], [0], 3, 4, largest_id=1, overwrite=True)
    assert (tmp_path / name).read_text() == "precious"
    with pytest.raises(OutputError, match="is a file"):
        write_masks(tmp_path / name, [], [0], 3, 4, largest_id=1, overwrite=True)


@pytest.mark.skipif(not (DATA / "davis2016").is_dir(), reason="the sequences of DAVIS 2016 are not here")
def test_a_truth_of_davis_2016_is_one_object_seen_in_every_frame():
    folder = DATA / "davis2016/Annotations/car-shadow"
    rows = read_masks(folder, void=True)
    assert (rows.frames.tolist(), set(rows.ids.tolist())) == (list(range(40)), {1})
    white = cv2.imread(str(folder / "00011.png"), cv2.IMREAD_UNCHANGED) == 255
    assert np.array_equal(rows.masks[11].to_image(*rows.size), white)

